"""The contest of figures 10 to 12: three speed controllers of Zidani's drive through one scenario.

Gains of the fuzzy controller are printed nowhere. Two documented rules stand in for them, one for each
reading of its output: `fuzzy_like_pi` (variation of the command) and `fuzzy_position` (the command).
"""

from typing import NamedTuple

import numpy as np

from drivelib import fuzzy_facts, metrics
from drivelib.dfim_drive import simulate
from drivelib.speed_law import FuzzySpeed, PiSpeed
from drivelib.validation import number

E_MAX = 150.0
CONTROLLERS = ("PI", "FLC", "ANN")


def fuzzy_like_pi(scenario, e_max=E_MAX, *, gains=None):
    """Return the incremental fuzzy controller with the small-signal gains of a PI, by default the scenario's own.

    Parameters
    ----------
    scenario : Scenario
    e_max : float
        Error at the edge of the input's range (rad/s): the one number that stays free. By default the
        largest set point of figure 10.
    gains : control.PiGains, optional
    """
    like = fuzzy_facts.gains_like_pi(*(gains or scenario.speed_gains), scenario.period, e_max)
    return FuzzySpeed(like.K_e, like.K_de, like.K_u, "incremental")


def fuzzy_position(scenario, stiffness=None):
    """Return the fuzzy controller in the form of (21)–(22), T* = K_u u.

    K_u: what table I holds at rest at most, u = 2/3, is the torque limit. K_e: its slope in e at the origin
    is ``stiffness`` (N m s/rad), by default the PI's K_p. K_de: full acceleration at the torque limit
    drives Δe to a tenth of its range.
    """
    stiffness = number("stiffness", scenario.speed_gains.K_p if stiffness is None else stiffness, "N m s/rad", above=0)
    K_u = scenario.T_limit / fuzzy_facts.HOLDING_LIMIT
    full = scenario.T_limit / scenario.machine.J * scenario.period
    return FuzzySpeed(stiffness / (fuzzy_facts.ORIGIN_SLOPE * K_u), 0.1 / full, K_u, "position")


def controllers(scenario, *, e_max=E_MAX, **training):
    """Return {"PI", "FLC", "ANN"}: the scenario's PI, the fuzzy controller like it, the network trained on its runs.

    ``training`` is passed to `ann_data.trained_network`. The network is trained for this scenario's drive
    with averaged inverters and its nominal rotor resistance.
    """
    from drivelib import ann_data

    clean = scenario.changed(inverter="averaged", rotor_resistance=((0.0, 1.0),))
    network = ann_data.trained_network(clean, **training).best(unfinished=True)
    return {
        "PI": PiSpeed(*scenario.speed_gains),
        "FLC": fuzzy_like_pi(scenario, e_max),
        "ANN": ann_data.network_speed(network),
    }


def contest(scenario, laws, *, every=1):
    """Return {name: DriveRun} of the controllers ``laws``, {name: speed controller}, in one scenario."""
    return {name: simulate(scenario, law, every=every) for name, law in laws.items()}


def stretched(scenario, factor):
    """Return the scenario with every instant ``factor`` times as late, so that each load is held that much longer."""
    factor = number("factor", factor, above=0)

    def profile(pairs):
        return tuple((factor * time, value) for time, value in pairs)

    return scenario.changed(
        duration=factor * scenario.duration,
        speed_reference=profile(scenario.speed_reference),
        load_torque=profile(scenario.load_torque),
        rotor_resistance=profile(scenario.rotor_resistance),
    )


def with_machine(scenario, machine):
    """Return the scenario with another motor: torque limit and loads scaled by the rated torques."""
    scale = machine.T_rated / scenario.machine.T_rated
    loads = tuple((time, scale * load) for time, load in scenario.load_torque)
    return scenario.changed(machine=machine, T_limit=scale * scenario.T_limit, load_torque=loads)


class Response(NamedTuple):
    """Worst of several events, in % of the set point's size at that time; recovery in s, into ±0.5 % of it. Six decimals."""

    dip: float
    overshoot: float
    steady: float
    ripple: float
    recovery: float


def _worst(run, events, recovery_percent=0.5):
    ends = [*run.scenario.events[1:], run.t[-1] + (run.t[-1] - run.t[-2])]
    following = dict(zip(run.scenario.events, ends, strict=True))
    rows = []
    for event in events:
        reference = abs([value for time, value in run.scenario.speed_reference if time <= event][-1])
        share = 100.0 / number(f"set point at {event:g} s", reference, "rad/s", above=0)
        band = recovery_percent / share
        found = metrics.step_metrics(run.t, run["omega_ref"], run["omega_m"], event, following[event], band=band)
        recovery = min(found.recovery_time, following[event] - event)
        rows.append((share * abs(found.peak), share * found.overshoot, share * abs(found.steady_error), share * found.ripple, recovery))
    return Response(*np.round(np.max(rows, axis=0), 6).tolist())


def load_response(run):
    """Return the worst `Response` over every change of load.

    ``dip`` is the largest error after the change; ``steady`` and ``ripple`` are taken over the last fifth of
    the time until the next event; a recovery that does not end counts as the whole of that time.
    """
    return _worst(run, [time for time, _ in run.scenario.load_torque[1:]])


def reference_response(run):
    """Return the worst `Response` over every set point, start included; its dip, the step itself, says nothing."""
    return _worst(run, [time for time, _ in run.scenario.speed_reference])


def flux_deviation(run, start=0.0):
    """Return the largest deviation of the true rotor flux from its reference (% of it), (d, q), from ``start`` (s) on.

    φ_rd is held against φ*, φ_rq against 0, as (11) asks.
    """
    later = run.t >= number("start", start, "s", at_least=0)
    reference = run.scenario.phi_r_ref
    d = 100.0 * np.max(np.abs(run["phi_rd"][later] - reference)) / reference
    return float(d), float(100.0 * np.max(np.abs(run["phi_rq"][later])) / reference)


def largest_change(run, other):
    """Return the largest difference of speed between two runs (rad/s), and in % of the set point at that time."""
    difference = np.abs(run["omega_m"] - other["omega_m"])
    return float(difference.max()), float(np.max(100.0 * difference / np.abs(run["omega_ref"])))


class Standing(NamedTuple):
    """One controller in one scenario: responses to load and set point, and to loads held four times as long."""

    load: Response
    reference: Response
    held: Response


HELD = 4.0


def study(scenario, laws):
    """Return {name: Standing} of the controllers ``laws``; ``held`` is where a steady state is one."""
    runs = contest(scenario, laws)
    held = contest(stretched(scenario, HELD), laws, every=2)
    return {name: Standing(load_response(run), reference_response(run), load_response(held[name])) for name, run in runs.items()}
