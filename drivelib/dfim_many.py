"""Many of Zidani's drives at once: parameters, gains, loads differ, and only what was asked of each run is kept.

    table = simulate_many(DEFAULT_SCENARIO.changed(machine=m) for m in machines)
    table["IAE"], table["peak"], table["diverged"]

Drives that ``dfim_pieces.suits`` go 64 abreast through ``dfim_lanes``, those with controllers of one family together; the
others, and the odd few, one by one through ``dfim_loop``. Each drive's numbers are those of ``dfim_drive.simulate``, to the last bit.
"""

import os
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from itertools import islice

import numpy as np

from drivelib.dfim_drive import SimulationDiverged, initial_state, schedule, simulate
from drivelib.dfim_lanes import FAMILIES, LANES
from drivelib.dfim_loop import LIMITS, STATES
from drivelib.dfim_pieces import FEW, Drive, Piece, run_block, suits
from drivelib.dfim_plant import SMALL_ANGLE
from drivelib.speed_law import PiSpeed
from drivelib.validation import number

HITS = tuple(f"first {limit}" for limit in LIMITS)
COLUMNS = ("IAE", "ISE", "ITAE", "peak", "omega_m", *HITS, "diverged")
"""Indices over the window and its largest |error| (rad/s); final speed (rad/s); time (s) at which each limit was
first hit and at which the drive diverged, NaN for never. A drive that diverged has NaN in the first five."""


def simulate_many(scenarios, speeds=None, *, window=None, workers=None):
    """Simulate drives without keeping their trajectories.

    Parameters
    ----------
    scenarios : iterable of Scenario
        Any number; taken as they are needed, so a generator costs no memory. For speed, neighbours should have the
        same kind of controller and nearly the same number of steps.
    speeds : iterable of speed controllers, optional
        One for each scenario, None standing for the PI of its ω_n and ξ; by default that for all.
    window : (float, float), optional
        Start and end (s) of indices and peak; by default each whole run.
    workers : int, optional
        Threads; by default one per core. The results do not depend on it.

    Returns
    -------
    structured array
        One row per drive in the order given, fields ``COLUMNS``.

    Raises
    ------
    ValueError
        If there is no scenario, numbers of scenarios and speeds differ, or the window does not lie in every run.
    """
    workers = os.cpu_count() if workers is None else number("workers", workers, at_least=1, whole=True)
    tables, waiting = [], deque()
    with ThreadPoolExecutor(workers) as pool:
        for drives in _blocks(scenarios, speeds):
            waiting.append(pool.submit(block, drives, window))
            if len(waiting) > 2 * workers:
                tables.append(waiting.popleft().result())
        tables += [future.result() for future in waiting]
    if not tables:
        raise ValueError("scenarios is empty: there is nothing to simulate")
    return np.concatenate(tables)


def study(drives, window=None):
    """Return rows (drives, columns) of a list of scenarios: a batched function for ``ensemble.evaluate`` with ``COLUMNS``."""
    pairs = [(scenario, None) for scenario in drives]
    tables = [block(pairs[k : k + LANES], window) for k in range(0, len(pairs), LANES)]
    return np.concatenate([table.view(float).reshape(-1, len(COLUMNS)) for table in tables])


def block(drives, window=None):
    """Return the table of up to 64 pairs (scenario, speed controller or None)."""
    table = np.full(len(drives), np.nan, dtype=[(name, float) for name in COLUMNS])
    groups, alone = {}, []
    for k, (scenario, speed) in enumerate(drives):
        law = (PiSpeed(*scenario.speed_gains) if speed is None else speed).law()
        if suits(scenario) and law.kind in FAMILIES:
            groups.setdefault(FAMILIES[law.kind], []).append((k, scenario, law))
        else:
            alone.append(k)
    for members in groups.values():
        alone += _abreast(members, window, table) if len(members) > FEW else [k for k, _, _ in members]
    for k in alone:
        _alone(*drives[k], window, table, k)
    return table


def _blocks(scenarios, speeds):
    scenarios, speeds = iter(scenarios), None if speeds is None else iter(speeds)
    while scenario := list(islice(scenarios, LANES)):
        speed = [None] * len(scenario) if speeds is None else list(islice(speeds, len(scenario)))
        if len(speed) != len(scenario):
            raise ValueError("speeds ended before scenarios: there must be one for each, or none at all")
        yield list(zip(scenario, speed, strict=True))
    if speeds is not None and next(speeds, scenario) is not scenario:
        raise ValueError("scenarios ended before speeds: there must be one speed controller for each")


def _alone(scenario, speed, window, table, row):
    try:
        run = simulate(scenario, speed, every=0, window=window)
    except SimulationDiverged as error:
        table["diverged"][row] = error.time
        return
    values = (run.indices.IAE, run.indices.ISE, run.indices.ITAE, run.peak, run.state["omega_m"])
    for name, value in zip(COLUMNS, values, strict=False):
        table[name][row] = value
    for limit, name in zip(LIMITS, HITS, strict=True):
        table[name][row] = run.first_hits.get(limit, np.nan)


def _abreast(members, window, table):
    """Fill the rows of (row, scenario, law); return those that the fast loop is not valid for."""
    pieces = [Piece(Drive.of(scenario), law, initial_state(scenario), (*schedule(scenario), scenario.steps)) for _, scenario, law in members]
    result, _, final = run_block(pieces, windows=[_samples(scenario, window) for _, scenario, _ in members])
    left = []
    for j, (row, scenario, _) in enumerate(members):
        h = scenario.period
        if not result["turned"][j] <= SMALL_ANGLE:
            left.append(row)
            continue
        if result["failed"][j] >= 0:
            table["diverged"][row] = result["failed"][j] * h
            continue
        values = (*(result[name][j] for name in ("iae", "ise", "itae", "peak")), final[j, STATES.index("omega_m")])
        for name, value in zip(COLUMNS, values, strict=False):
            table[name][row] = value
        for name, lane in zip(HITS, ("hit_T", "hit_v_s", "hit_v_r", "hit_i_s", "hit_i_r"), strict=True):
            table[name][row] = result[lane][j] * h if result[lane][j] >= 0 else np.nan
    return left


def _samples(scenario, window):
    # As dfim_drive.simulate rounds and checks them.
    if window is None:
        return 0, scenario.steps
    start = number("window's start", window[0], "s", at_least=0)
    end = number("window's end", window[1], "s", above=start, at_most=scenario.duration)
    return round(start / scenario.period), min(round(end / scenario.period), scenario.steps)
