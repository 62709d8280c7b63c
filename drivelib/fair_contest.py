"""The contest under equal conditions: one encoder, one torque limit, one sample time, one budget, one objective.

Controllers are tuned on one cycle and one motor, and scored on other cycles, other noise and motors that differ from
what they were tuned for. Four measures, smaller is better: `OBJECTIVES`, the first four fields of `Measures`.
"""

import math
from typing import NamedTuple

import numpy as np

from drivelib import ann_data, contest, control, fuzzy_facts, tuning
from drivelib.dfim_drive import SimulationDiverged, simulate
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.encoder import Encoder
from drivelib.speed_law import FuzzySpeed, NetworkSpeed, PiSpeed, WeightedPiSpeed
from drivelib.tuning import Range
from drivelib.validation import number

BAND = 0.5  # rad/s, inside which the speed has settled
TAIL = 0.2  # share of the time between two events, at its end, that counts as rest

TUNING = DEFAULT_SCENARIO.changed(
    name="tuning", duration=2.4, encoder=Encoder(seed=1),
    speed_reference=((0.0, 60.0), (1.6, -20.0)), load_torque=((0.0, 0.0), (0.7, 20.0), (1.2, 0.0)),
)  # fmt: skip
CYCLES = {
    "figure 10": DEFAULT_SCENARIO.changed(name="figure 10", encoder=Encoder(seed=2)),
    "slow": TUNING.changed(
        name="slow", encoder=Encoder(seed=3),
        speed_reference=((0.0, 10.0), (0.8, 0.0), (1.6, -5.0)), load_torque=((0.0, 0.0), (0.4, 12.5), (1.2, -12.5), (2.0, 0.0)),
    ),
    "driving load": TUNING.changed(
        name="driving load", encoder=Encoder(seed=4),
        speed_reference=((0.0, 100.0),), load_torque=((0.0, 0.0), (0.8, -25.0), (1.3, 25.0), (1.9, 0.0)),
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
    rest. ``variation`` (N m/s): total variation of the command per second. ``IAE`` (rad). ``unsettled``: changes after
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
    events, T = run.events(band=BAND, tail=TAIL), run["T_ref"]
    ends = [*(event.time for event in events[1:]), scenario.duration]
    rest, recovery = [], []
    for event, end in zip(events, ends, strict=True):
        window = T[np.searchsorted(run.t, end - TAIL * (end - event.time)) : np.searchsorted(run.t, end)]
        rest.append(_rms_about_line(window))
        recovery.append(min(event.recovery_time, end - event.time))
    loaded = {time for time, _ in scenario.load_torque[1:]}
    return Measures(
        dip=max(abs(event.peak) for event in events if event.time in loaded),
        settling=float(np.mean(recovery)),
        effort=float(np.sqrt(np.mean(T**2))),
        ripple=max(rest),
        steady=max(abs(event.steady_error) for event in events),
        variation=float(np.sum(np.abs(np.diff(T))) / scenario.duration),
        IAE=run.indices.IAE,
        unsettled=float(sum(not math.isfinite(event.recovery_time) for event in events)),
    )


def _rms_about_line(values):
    x = np.arange(values.size) - 0.5 * (values.size - 1)
    about = values - values.mean()
    return float(np.sqrt(np.mean((about - x * (x @ about) / (x @ x)) ** 2)))


def score(found, reference):
    """Return the objective: mean over the four of measure over the reference controller's measure; infinite if diverged."""
    return float(np.mean([ours / theirs for ours, theirs in zip(found[:4], reference[:4], strict=True)]))


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


def tune(contender, *, scenario=TUNING, budget, seed):
    """Return the `tuning.Found` of one contender, (ranges, function) as `contenders` gives it, in one scenario."""
    if not (isinstance(contender, tuple) and len(contender) == 2 and callable(contender[1])):
        raise ValueError(f"contender = {contender!r}: must be (ranges, function that makes a controller), see contenders()")
    ranges, make = contender
    unit = measure(scenario, reference_law(scenario))
    return tuning.search(lambda **values: measure(scenario, make(**values)), lambda found: score(found, unit), ranges, budget=budget, seed=seed)


def scored(laws, scenarios):
    """Return {name: {condition: Measures}} and {name: {condition: score against the untuned PI}}.

    Raises
    ------
    ValueError
        If a controller is missing (None) or there is no condition.
    """
    missing = [name for name, law in laws.items() if law is None]
    if missing or not laws or not scenarios:
        raise ValueError(f"no controller {missing[0]!r}" if missing else "laws or scenarios is empty: there is nothing to score")
    units = {key: measure(scenario, reference_law()) for key, scenario in scenarios.items()}
    measures = {name: {key: measure(scenario, law) for key, scenario in scenarios.items()} for name, law in laws.items()}
    return measures, {name: {key: score(found, units[key]) for key, found in own.items()} for name, own in measures.items()}


def scaled(network, g_e, g_i, g_u):
    """Return a `NetworkSpeed` with factors on its inputs e and ∫e and on its output."""
    factors = np.array([g_e, 1.0, g_i])[: network.W1.shape[1]]
    return NetworkSpeed(network.W1 * factors, network.B1, network.W2 * g_u, network.B2 * g_u, network.activation, network.form)


def stiffness(law, period=TUNING.period):
    """Return the slope of a position-form fuzzy controller at rest, near no error (N m s/rad)."""
    return fuzzy_facts.equivalent_gains(law, period)[0]


def teacher(law, scenario=TUNING):
    """Return the scenario with exact speed whose own PI has the gains of ``law`` (`PiSpeed`): what a network learns from."""
    machine = scenario.known_machine
    omega_n = math.sqrt(law.K_i / machine.J)
    return scenario.changed(encoder=None, omega_n=omega_n, xi=(law.K_p + machine.f) / (2.0 * omega_n * machine.J))


def error_network(law, *, scenario=TUNING, speed_factors=(2.5, 1.0, 0.4), **training):
    """Return the paper's network, torque from the present error alone, trained on runs of the PI ``law``.

    ``training`` goes to `ann_data.trained_network`. The fastest runs reach 150 rad/s, so that the steps of figure 10 lie
    hardly outside what it has seen.
    """
    result = ann_data.trained_network(teacher(law, scenario), speed_factors=speed_factors, **training)
    return ann_data.network_speed(result.best(unfinished=True))


def fair_network(law, *, scenario=TUNING, e_max=300.0, samples=2048, n_hidden=15, starts=4, seed=2020):
    """Return a network with the PI's inputs, e and ∫e, that has learned the limited command of the PI ``law``.

    It learns the PI's own answer on Sobol points of the plane, dense near zero, instead of on runs: where a run goes
    would only thin them out. Errors up to ``e_max`` (rad/s), integrals that hold up to the torque limit.
    """
    from scipy.stats import qmc

    from drivelib.levenberg import TOOLBOX
    from drivelib.training import train

    samples = number("samples", samples, at_least=64, whole=True)
    number("K_i of the teacher", law.K_i, "N m/rad", above=0)
    unit = 2.0 * qmc.Sobol(2, rng=np.random.default_rng(seed)).random_base2(math.ceil(math.log2(samples)))[:samples] - 1.0
    inputs = unit**3 * [number("e_max", e_max, "rad/s", above=0), scenario.T_limit / law.K_i]
    command = np.clip(inputs @ [law.K_p, law.K_i], -scenario.T_limit, scenario.T_limit)
    result = train(inputs, command, n_hidden, starts=starts, seed=seed, schedule=TOOLBOX, split=ann_data.SPLIT)
    W1, B1, W2, B2 = result.best(unfinished=True).folded()
    return NetworkSpeed(np.insert(W1, 1, 0.0, axis=1), B1, W2[0], float(B2[0]))
