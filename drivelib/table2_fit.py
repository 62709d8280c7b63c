"""Identify the rows of Zidani's table II in the simulated drive: PI loop and load, fuzzy gains, static maps.

Everything is found by running the drive; the closed forms of ``table2`` only start the search. The drive stands
at 0 rad/s before the load comes, so that nothing but the load makes an error.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, least_squares

from drivelib import metrics, table2
from drivelib.contest import fuzzy_like_pi
from drivelib.control import PiGains
from drivelib.dfim_drive import SimulationDiverged, simulate
from drivelib.speed_law import FuzzySpeed, NetworkSpeed, PiSpeed
from drivelib.validation import number

ON = 0.01  # s, when the load comes
SEARCH = np.log(8.0)  # how far a fit may go from the closed form, as a factor either way
PRECISION = {"xtol": 1e-12, "ftol": 1e-14, "gtol": 1e-12}


class Load(NamedTuple):
    """Load steps T_load (N m) on and off in turn, each ``hold`` (s) after the last; the indices end at ``horizon`` (s)."""

    T_load: float
    steps: int = 1
    hold: float = 1.0
    horizon: float = 2.0


class Found(NamedTuple):
    """What a fit found: ``values`` by name, residual as largest relative error of the indices, and the run behind it."""

    values: dict
    residual: float
    run: object


def load_test(scenario, load, *, speed=0.0):
    """Return the scenario that holds a set point (rad/s) and meets a load; its error indices belong from ``ON`` on."""
    T_load = number("T_load", load.T_load, "N m")
    profile = [(0.0, 0.0), *((ON + k * load.hold, T_load * ((k + 1) % 2)) for k in range(load.steps))]
    return scenario.changed(speed_reference=((0.0, speed),), load_torque=tuple(profile), duration=ON + load.horizon)


def under_load(scenario, load, law, *, every=0):
    """Return the run of a load test, its indices from the load's coming to the horizon."""
    test = load_test(scenario, load)
    return simulate(test, law, every=every, window=(ON, test.duration))


def settled(values):
    """Return the values to seven digits: beyond these a search's end depends on the processor."""
    return np.array([float(f"{value:.7g}") for value in np.atleast_1d(values)])


def _fit(names, start, run_at, row):
    def errors(logs):
        try:
            found = run_at(*np.exp(logs)).indices
        except SimulationDiverged:
            return np.array([10.0, 10.0])  # far from any row, so that the search turns back
        return np.log([found.IAE / row.IAE[0], found.ISE / row.ISE[0]])

    first = np.log(start)
    best = least_squares(errors, first, bounds=(first - SEARCH, first + SEARCH), diff_step=1e-6, max_nfev=60, **PRECISION)
    values = settled(np.exp(best.x))
    found = run_at(*values)
    residual = max(abs(found.indices.IAE / row.IAE[0] - 1.0), abs(found.indices.ISE / row.ISE[0] - 1.0))
    return Found(dict(zip(names, values.tolist(), strict=True)), residual, found)


def fit_pi(scenario, row, xi, load):
    """Find ω_n (rad/s) and T_load (N m) with which the PI loop meets a row's IAE and ISE; two free, two matched.

    Parameters
    ----------
    scenario : Scenario
        Machine, limits, current loops, inverter.
    row : table2.Printed
    xi : float
        Damping, chosen: the row cannot tell.
    load : Load
        Number of steps, hold and horizon, chosen; its T_load is not used.

    Returns
    -------
    Found
        ``residual`` stays large where the torque limit forbids the row.
    """
    first = table2.member(row.IAE[0], row.ISE[0], xi, load.steps)

    def run_at(omega_n, T_load):
        tuned = scenario.changed(omega_n=float(omega_n), xi=xi)
        return under_load(tuned, load._replace(T_load=float(T_load)), None)

    return _fit(("omega_n", "T_load"), (first.omega_n, first.a * scenario.machine.J), run_at, row)


def fit_gains(scenario, row, load, law):
    """Find the gains K_p (N m s/rad) and K_i (N m/rad) with which an integrating controller meets a row under a given load.

    Two free, two matched. ``law`` makes the speed controller from control.PiGains. The search starts at the
    overdamped PI loop, and where that loop would oscillate it refuses (``table2.overdamped``).
    """
    J = scenario.machine.J
    start = table2.overdamped(row.IAE[0] / load.steps, row.ISE[0] / load.steps, load.T_load / J)

    def run_at(K_p, K_i):
        return under_load(scenario, load, law(PiGains(float(K_p), float(K_i))))

    return _fit(("K_p", "K_i"), (J * start[0], J * start[1]), run_at, row)


def fit_fuzzy(scenario, row, load, e_max):
    """Find the small-signal gains with which the incremental FLC meets a row: `fit_gains` with `contest.fuzzy_like_pi`."""
    return fit_gains(scenario, row, load, lambda gains: fuzzy_like_pi(scenario, e_max, gains=gains))


def static_map(stiffness, T_limit):
    """Return T* = T_limit tanh(k e/T_limit) as a one-neuron network: the steepest map a torque limit allows, k in N m s/rad."""
    k, T_limit = number("stiffness", stiffness, "N m s/rad", above=0), number("T_limit", T_limit, "N m", above=0)
    return NetworkSpeed(np.array([[k / T_limit]]), np.zeros(1), np.array([T_limit]))


def fit_static(scenario, row, load, *, form=static_map):
    """Find the stiffness (N m s/rad) and the hold (s) with which a static map meets a row under one load; two free, two matched.

    ``form`` makes the speed controller from stiffness and torque limit; horizon and hold end together.

    Raises
    ------
    ValueError
        If no stiffness between a quarter and four times the closed form's meets the row.
    """
    first = scenario.T_limit * np.arctanh(min(load.T_load / scenario.T_limit, 0.99)) / row.mean_error()
    span = 2.0 * row.duration()[2]

    def hold_and_gap(k):
        run = under_load(scenario, load._replace(horizon=span), form(float(k), scenario.T_limit), every=1)
        later = run.t >= ON - 1e-9
        t, e = run.t[later] - ON, (run["omega_ref"] - run["omega_m"])[later]
        parts = metrics.interval_indices(t[:-1], np.diff(t), e[:-1], e[1:])
        iae, ise = (np.concatenate([[0.0], np.cumsum(part)]) for part in parts[:2])
        if iae[-1] < row.IAE[0]:
            return span, np.log(0.5)
        return float(np.interp(row.IAE[0], iae, t)), float(np.log(np.interp(row.IAE[0], iae, ise) / row.ISE[0]))

    k = brentq(lambda k: hold_and_gap(k)[1], 0.25 * first, 4.0 * first, xtol=1e-9, rtol=1e-12)
    (k,) = settled(k)
    (hold,) = settled(hold_and_gap(k)[0])
    run = under_load(scenario, load._replace(horizon=hold), form(k, scenario.T_limit))
    residual = max(abs(run.indices.IAE / row.IAE[0] - 1.0), abs(run.indices.ISE / row.ISE[0] - 1.0))
    return Found({"stiffness": float(k), "hold": float(hold)}, residual, run)


def fit_one_load(scenario, pi, flc, ann, *, xi, e_max, horizon=2.0, rounds=8):
    """Find one load pulse, a PI, a fuzzy controller and a static map that meet all three rows; six free, six matched.

    Free: ω_n and T_load (PI row), K_p and K_i (FLC row), stiffness and hold (ANN row). A static map errs only
    while the load is on, so the ANN row sets the hold; the FLC row's IAE²/ISE is longer than that, so its error
    must outlast the load, and load on and load off both count.

    Returns
    -------
    dict of str to Found
        "PI", "FLC", "ANN"; the load is in the PI's and the ANN's ``values``.
    """
    hold, k = ann.duration()[1], None
    for _ in range(rounds):
        load = Load(0.0, 2, hold, horizon)
        loop = fit_pi(scenario, pi, xi, load)
        load = load._replace(T_load=loop.values["T_load"])
        k = k or load.T_load / ann.mean_error()
        for _ in range(4):  # the map is nearly linear, so this settles at once
            run = under_load(scenario, load, static_map(k, scenario.T_limit))
            (k,) = settled(k * run.indices.ISE / run.indices.IAE / ann.mean_error())
        got = run.indices.IAE**2 / run.indices.ISE
        if abs(got / ann.duration()[1] - 1.0) < 1e-4:
            break
        (hold,) = settled(hold + ann.duration()[1] - got)
    fuzzy = fit_fuzzy(scenario, flc, load, e_max)
    residual = max(abs(run.indices.IAE / ann.IAE[0] - 1), abs(run.indices.ISE / ann.ISE[0] - 1))
    return {"PI": loop, "FLC": fuzzy, "ANN": Found({"stiffness": float(k), "hold": hold}, float(residual), run)}


OMITTED = ("omega_n", "xi", "J", "T_load", "steps", "T_PI", "T_FLC", "T_ANN", "K_e", "K_de", "K_u", "stiffness", "on_time")
"""What table II depends on: arguments of `all_rows`."""


def all_rows(scenario, omega_n, xi, J, T_load, steps, T_PI, T_FLC, T_ANN, K_e, K_de, K_u, stiffness, on_time):
    """Return table II's nine indices, by row IAE, ISE, ITAE = horizon · IAE: PI loop, incremental FLC, static map.

    PI in closed form, FLC in the simulated drive with ``scenario``'s remaining values, static map as a constant error.

    Parameters
    ----------
    omega_n, xi : float
        Of the PI loop (rad/s, 1).
    J, T_load, steps : float
        Inertia (kg m²), load step (N m), number of steps far apart.
    T_PI, T_FLC, T_ANN : float
        Horizons (s).
    K_e, K_de, K_u : float
        Scaling gains of the FLC (s/rad, s/rad, N m).
    stiffness, on_time : float
        Of the static map (N m s/rad), and for how long in all the load is on in its row (s).
    """
    pi = table2.load_step(omega_n, xi, T_load / J)
    drive = scenario.changed(machine=scenario.machine.changed(J=J))
    flc = under_load(drive, Load(T_load), FuzzySpeed(K_e, K_de, K_u, "incremental")).indices
    error = T_load / stiffness
    rows = ((steps * pi.IAE, steps * pi.ISE, T_PI), (steps * flc.IAE, steps * flc.ISE, T_FLC), (error * on_time, error**2 * on_time, T_ANN))
    return np.array([index for iae, ise, horizon in rows for index in (iae, ise, horizon * iae)])


def rings(scenario, stiffness):
    """Return whether a proportional speed controller of this stiffness (N m s/rad) keeps oscillating after a load step.

    A tenth of the torque limit as load, half a second.
    """
    run = under_load(scenario, Load(0.1 * scenario.T_limit, horizon=0.5), PiSpeed(stiffness, 0.0), every=1)
    return swings(run["omega_ref"] - run["omega_m"])


def swings(error):
    """Return whether a record of the error (rad/s) swings by more than 1 % of its mean over the last fifth."""
    last = error[int(0.8 * error.size) :]
    return bool(np.ptp(last) > 0.01 * abs(last.mean()))


def largest_stable_stiffness(scenario, *, low=None, high=None):
    """Return the largest stiffness (N m s/rad) that does not ring, to 0.1 %, by bisection.

    The search runs from 100 J per second to 10⁶ J per second unless told otherwise.

    Raises
    ------
    ValueError
        If the lower end rings or the upper does not.
    """
    J = scenario.machine.J
    low, high = 100.0 * J if low is None else low, 1e6 * J if high is None else high
    if rings(scenario, low) or not rings(scenario, high):
        raise ValueError(f"low = {low:g}, high = {high:g} N m s/rad: the lower must be calm and the upper ring")
    while high > 1.001 * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if rings(scenario, middle) else (middle, high)
    return low
