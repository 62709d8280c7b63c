"""The contest under equal conditions: one encoder, one torque limit, one sample time, one budget, one objective.

Controllers are tuned on one cycle and one motor, and scored on other cycles, other noise and motors that differ from
what they were tuned for. Four measures, smaller is better: `OBJECTIVES`, the first four fields of `Measures`.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from drivelib import contest, control, fuzzy_facts, tuning
from drivelib.dfim_drive import SimulationDiverged, simulate
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.encoder import Encoder
from drivelib.fair_networks import scaled
from drivelib.speed_law import FuzzySpeed, PiSpeed, WeightedPiSpeed
from drivelib.tuning import Range

BAND = 0.5  # rad/s, inside which the speed has settled
UNTUNED = "untuned PI"
TAIL = 0.2  # share of the time between two events, at its end, that counts as rest

TUNING = DEFAULT_SCENARIO.changed(
    name="tuning", duration=2.4, encoder=Encoder(seed=1),
    speed_reference=((0.0, 60.0), (1.6, -20.0)), load_torque=((0.0, 0.0), (0.7, 20.0), (1.2, 0.0)),
)  # fmt: skip
CYCLES = {
    "figure 10": contest.stretched(DEFAULT_SCENARIO, 1.5).changed(name="figure 10", encoder=Encoder(seed=2)),
    "slow": TUNING.changed(
        name="slow", encoder=Encoder(seed=3),
        speed_reference=((0.0, 10.0), (0.8, 0.0), (1.6, -5.0)), load_torque=((0.0, 0.0), (0.4, 12.5), (1.2, -12.5), (2.0, 0.0)),
    ),
    "driving load": TUNING.changed(
        name="driving load", encoder=Encoder(seed=4), duration=3.0,
        speed_reference=((0.0, 100.0),), load_torque=((0.0, 0.0), (1.2, -25.0), (1.8, 25.0), (2.4, 0.0)),
    ),
}  # fmt: skip
MOTORS = {"as known": (1.0, 1.0), "R_r + 50 %": (1.5, 1.0), "J − 50 %": (1.0, 0.5), "J + 50 %": (1.0, 1.5)}


def conditions(cycles=None, motors=None):
    """Return {(cycle, motor): Scenario}: every cycle with every motor; the controller knows the nominal one."""
    found = {}
    for cycle, scenario in (cycles or CYCLES).items():
        for motor, (R_r, J) in (motors or MOTORS).items():
            actual = scenario.machine.changed(J=J * scenario.machine.J)
            found[cycle, motor] = scenario.changed(
                machine=actual, controller_machine=scenario.known_machine, rotor_resistance=((0.0, R_r),)
            )
    return found


class Measures(NamedTuple):
    """What a controller does in one run; infinities where the drive diverged. True speed, commanded torque.

    ``dip`` (rad/s): largest error after a change of load. ``settling`` (s): time into ±0.5 rad/s for good, mean over all
    changes; one that does not end counts as all the time there is. ``effort`` (N m): RMS torque command. ``ripple``
    (N m): RMS of the command about a straight line at rest, worst event. ``steady`` (rad/s): largest mean error at
    rest. ``variation`` (N m/s): total variation of the command per second. ``IAE`` (rad): after changes of load, as in table II. ``unsettled``: changes after
    which the speed never stayed in the band.
    """

    dip: float
    settling: float
    effort: float
    ripple: float
    steady: float
    variation: float
    IAE: float
    unsettled: float

    @property
    def diverged(self):
        """Whether the run ended because the drive's state left all bounds."""
        return not math.isfinite(self.dip)


OBJECTIVES = Measures._fields[:4]


def measure(scenario, law):
    """Return the `Measures` of a speed controller in one scenario."""
    try:
        run = simulate(scenario, law)
    except SimulationDiverged:
        return Measures(*[math.inf] * len(Measures._fields))
    error, T = run["omega_ref"] - run["omega_m"], np.ascontiguousarray(run["T_ref"])
    loaded = {time for time, _ in scenario.load_torque[1:]}
    instants = [*scenario.events, scenario.duration]
    dips, recovery, rest, steady, iae, unsettled = [], [], [], [], 0.0, 0
    for start, end in zip(instants[:-1], instants[1:], strict=True):
        window = slice(*np.searchsorted(run.t, (start - 0.5 * scenario.period, end - 0.5 * scenario.period)))
        size = np.abs(error[window])
        outside = np.flatnonzero(size > BAND)
        after = outside[-1] + 1 if outside.size else 0
        recovery.append(after * scenario.period)
        unsettled += after == size.size
        tail = slice(window.start + math.ceil((1.0 - TAIL) * size.size), window.stop)
        rest.append(_rms_about_line(T[tail]))
        steady.append(abs(float(np.mean(error[tail]))))
        if start in loaded:
            dips.append(float(size.max()))
            iae += scenario.period * float(size.sum())
    return Measures(
        dip=max(dips),
        settling=float(np.mean(recovery)),
        effort=float(np.sqrt(np.mean(T**2))),
        ripple=max(rest),
        steady=max(steady),
        variation=float(np.sum(np.abs(np.diff(T))) / scenario.duration),
        IAE=iae,
        unsettled=float(unsettled),
    )


def _rms_about_line(values):
    x = np.arange(values.size) - 0.5 * (values.size - 1)
    about = values - values.mean()
    return float(np.sqrt(np.mean((about - x * (np.sum(x * about) / np.sum(x * x))) ** 2)))


def score(found, reference, weights=(1.0, 1.0, 1.0, 1.0)):
    """Return the objective: weighted mean over the four of measure over the reference controller's measure.

    Infinite where the drive diverged. A weight of 0 leaves a measure out, such as the ripple where nothing is noisy.
    """
    parts = [weight * ours / theirs for ours, theirs, weight in zip(found[:4], reference[:4], weights, strict=True) if weight > 0]
    return float(np.sum(parts) / np.sum(weights))


def stiffness(law, period=TUNING.period):
    """Return the slope of a position-form fuzzy controller at rest, near no error (N m s/rad)."""
    return fuzzy_facts.equivalent_gains(law, period)[0]


def reference_law(scenario=TUNING):
    """Return the untuned PI of the scenario's ω_n and ξ, whose measures are the unit of every score."""
    return PiSpeed(*scenario.speed_gains)


GAIN = Range("K_p", 1.0, 100.0, "N m s/rad")
RESET = Range("T_i", 0.01, 10.0, "s")
FACTORS = {name: Range(name, 0.1, 10.0) for name in ("g_e", "g_i", "g_u")}


def contenders(scenario=TUNING, *, error_network=None, fair_network=None):
    """Return {name: (ranges, function of their values that makes the controller)}.

    The networks (`NetworkSpeed`) join where they are given; what is tuned of them are factors on inputs and output.
    Ranges of like quantities are alike.
    """
    h, J = scenario.period, scenario.known_machine.J

    def observer(K_p, T_i, weight, omega_o):
        return WeightedPiSpeed(K_p, K_p / T_i, weight, math.exp(-omega_o * h), J)

    def fuzzy(K_p, T_i, e_max):
        return contest.fuzzy_like_pi(scenario, e_max, gains=control.PiGains(K_p, K_p / T_i))

    def fuzzy_position(K_p, T_d, K_u):
        slope = fuzzy_facts.ORIGIN_SLOPE * K_u
        return FuzzySpeed(K_p / slope, K_p * T_d / (slope * h), K_u, "position")

    found = {
        "PI": ((GAIN, RESET), lambda K_p, T_i: PiSpeed(K_p, K_p / T_i)),
        "IP": ((GAIN, RESET), lambda K_p, T_i: WeightedPiSpeed(K_p, K_p / T_i, 0.0)),
        "PI + observer": ((GAIN, RESET, Range("weight", 0.0, 1.0, linear=True), Range("omega_o", 10.0, 1000.0, "rad/s")), observer),
        "FLC": ((GAIN, RESET, Range("e_max", 1.0, 1000.0, "rad/s")), fuzzy),
        "FLC position": ((GAIN, Range("T_d", 1e-5, 0.1, "s"), Range("K_u", 20.0, 2000.0, "N m")), fuzzy_position),
    }
    if error_network is not None:
        found["ANN"] = ((FACTORS["g_e"], FACTORS["g_u"]), lambda g_e, g_u: scaled(error_network, g_e, 1.0, g_u))
    if fair_network is not None:
        found["ANN, e and ∫e"] = (tuple(FACTORS.values()), lambda g_e, g_i, g_u: scaled(fair_network, g_e, g_i, g_u))
    return found


def tune(contender, *, scenario=TUNING, budget, seed, weights=(1.0, 1.0, 1.0, 1.0)):
    """Return the `tuning.Found` of one contender, (ranges, function) as `contenders` gives it, in one scenario.

    Raises
    ------
    ValueError
        If the contender is no such pair, or the budget is not one of `tuning.search`.
    """
    if not (isinstance(contender, tuple) and len(contender) == 2 and callable(contender[1])):
        raise ValueError(f"contender = {contender!r}: must be (ranges, function that makes a controller), see contenders()")
    ranges, make = contender
    unit = measure(scenario, reference_law(scenario))
    return tuning.search(
        lambda **values: measure(scenario, make(**values)), lambda found: score(found, unit, weights), ranges, budget=budget, seed=seed
    )


@dataclass(frozen=True)
class Round:
    """One contest: what each search found, the controllers it chose, and what they do in every condition.

    ``measures`` and ``scores``: by name and condition; ``weights`` of the four measures.
    """

    found: dict
    laws: dict
    measures: dict
    scores: dict
    weights: tuple

    def score(self, name):
        """Return a controller's score, mean over the conditions."""
        return float(np.mean(list(self.scores[name].values())))

    def mean(self, name):
        """Return a controller's `Measures`, each the mean over the conditions."""
        return Measures(*np.mean(list(self.measures[name].values()), axis=0).tolist())

    def worst(self, name):
        """Return a controller's `Measures`, each the largest over the conditions."""
        return Measures(*np.max(list(self.measures[name].values()), axis=0).tolist())

    def front(self, name):
        """Return the Pareto front of every candidate that a search tried, shape (n, 4), in its own cycle."""
        results = self.found[name].results[:, :4]
        return results[tuning.pareto_front(results)]

    def sensitivity(self, name):
        """Return the score of the worst motor, in units of what the same controller does with the motor that it knows, less 1."""
        own, known = self.measures[name], next(iter(MOTORS))
        cycles = dict.fromkeys(cycle for cycle, _ in own)
        wrong = [motor for motor in MOTORS if motor != known]
        return max(float(np.mean([score(own[cycle, motor], own[cycle, known], self.weights) for cycle in cycles])) for motor in wrong) - 1.0


def play(contenders, *, scenario=TUNING, cycles=None, budget, seed, weights=(1.0, 1.0, 1.0, 1.0), known=None):
    """Return the `Round`: every contender tuned in ``scenario``, then scored in all `conditions` of ``cycles``.

    ``known``: {name: `tuning.Found`} of those that were tuned before, in the same way. Beside them, untuned, stand the scenario's own PI and, where there is a fuzzy position form, the P of its stiffness.
    """
    if not contenders:
        raise ValueError("contenders is empty: there is nobody to play")
    options = {"scenario": scenario, "budget": budget, "seed": seed, "weights": weights}
    found = {name: (known or {}).get(name) or tune(contender, **options) for name, contender in contenders.items()}
    return chosen(found, contenders, cycles=cycles, weights=weights)


def chosen(found, contenders, *, scenario=None, cycles=None, weights=(1.0, 1.0, 1.0, 1.0)):
    """Return the `Round` of the best of what was ``found``; with ``scenario`` the best by other ``weights`` there."""
    laws = {UNTUNED: reference_law()}
    for name, own in found.items():
        pick = own.best
        if scenario is not None:
            unit = measure(scenario, reference_law(scenario))
            k = int(np.argmin([score(results, unit, weights) for results in own.results]))
            pick = dict(zip(pick, own.values[k].tolist(), strict=True))
        laws[name] = contenders[name][1](**pick)
    if "FLC position" in laws:
        laws["P"] = PiSpeed(stiffness(laws["FLC position"]), 0.0)
    return Round(found, laws, *scored(laws, conditions(cycles), weights), weights)


def scored(laws, scenarios, weights=(1.0, 1.0, 1.0, 1.0)):
    """Return {name: {condition: Measures}} and {name: {condition: score against the untuned PI}}.

    Raises
    ------
    ValueError
        If a controller is missing (None), or there is no controller or no condition.
    """
    missing = [name for name, law in laws.items() if law is None]
    if missing or not laws or not scenarios:
        raise ValueError(f"no controller {missing[0]!r} was given" if missing else "laws or scenarios is empty: there is nothing to score")
    measures = {name: {key: measure(scenario, law) for key, scenario in scenarios.items()} for name, law in laws.items()}
    units = measures.get(UNTUNED) or {key: measure(scenario, reference_law()) for key, scenario in scenarios.items()}
    return measures, {name: {key: score(found, units[key], weights) for key, found in own.items()} for name, own in measures.items()}
