"""Many drives at once give each the numbers that it has alone."""

import numpy as np
import pytest

from drivelib import dfim_many
from drivelib.dfim_drive import SimulationDiverged, simulate
from drivelib.dfim_loop import LIMITS
from drivelib.dfim_machines import DFIM_4KW
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.encoder import Encoder
from drivelib.speed_law import FuzzySpeed, NetworkSpeed, PiSpeed, WeightedPiSpeed

SHORT = DEFAULT_SCENARIO.changed(duration=0.25, speed_reference=((0.0, 60.0),), load_torque=((0.0, 0.0), (0.1, 20.0)))


def different(n):
    """Drives that differ in machine, gains, limits, laws and in when and how their loads step."""
    rng = np.random.default_rng(1)
    for k in range(n):
        machine = DFIM_4KW.changed(R_s=DFIM_4KW.R_s * rng.uniform(0.7, 1.3), J=rng.uniform(0.05, 0.4))
        yield SHORT.changed(
            machine=machine, controller_machine=DFIM_4KW, omega_n=rng.uniform(10, 40), T_limit=rng.uniform(20, 60),
            V_dc_s=rng.uniform(100, 600), V_dc_r=rng.uniform(60, 600),
            i_s_limit=rng.uniform(5, 30), i_r_limit=rng.uniform(5, 30),
            frequency_law=("equal split", "constant rotor frequency")[k % 2],
            load_torque=((0.0, 0.0), (rng.uniform(0.01, 0.24), rng.uniform(-25, 25))), rotor_resistance=((0.0, 1.0), (0.12, rng.uniform(0.6, 1.5))),
        )  # fmt: skip


def alone(scenario, speed=None, window=None):
    """The row of one drive, from ``simulate``."""
    run = simulate(scenario, speed, window=window)
    error = np.abs(run["omega_ref"] - run["omega_m"])
    first, last = (0, scenario.steps) if window is None else (round(t / scenario.period) for t in window)
    hits = [run.first_hits.get(name, np.nan) for name in LIMITS]
    return [run.indices.IAE, run.indices.ISE, run.indices.ITAE, error[first:last].max(), run["omega_m"][-1], *hits, np.nan]


def numbers(table):
    return table.view(float).reshape(len(table), -1)


def test_each_of_many_has_the_bits_it_has_alone():
    """70 drives abreast and in a rest of 6, limits hit and not: no bit differs from ``simulate``."""
    scenarios = list(different(70))
    table = numbers(dfim_many.simulate_many(scenarios, window=(0.05, 0.2)))
    expected = np.array([alone(s, window=(0.05, 0.2)) for s in scenarios])
    assert np.array_equal(table, expected, equal_nan=True)
    reached = np.isfinite(expected[:, 5:10])
    assert np.all(reached.any(axis=0)) and not reached.all(), "the drives must hit every limit, and not all of them"


def test_neither_order_nor_workers_nor_neighbours_matter():
    scenarios = list(different(150))
    whole = dfim_many.simulate_many(scenarios, workers=1)
    assert dfim_many.simulate_many(scenarios[::-1], workers=3)[::-1].tobytes() == whole.tobytes()
    assert dfim_many.simulate_many(scenarios[20:47]).tobytes() == whole[20:47].tobytes()


def test_every_kind_has_the_bits_it_has_alone(monkeypatch):
    """Families of controllers, flux estimates and lengths mixed in one block, limits hit or not, and four drives that must go alone."""
    speeds = (None, FuzzySpeed(0.1, 2.0, 30.0), FuzzySpeed(0.1, 2.0, 0.5, "incremental"), NetworkSpeed(np.array([[0.05]]), np.zeros(1), np.array([40.0])))
    drives = []
    for k, scenario in enumerate(different(60)):
        estimator = ("current model", "rotor voltage model")[k // 4 % 2]
        drives.append((scenario.changed(flux_estimator=estimator, duration=(0.25, 0.3, 0.27)[k % 3]), speeds[k % 4]))
    drives += [(SHORT.changed(inverter="switching"), None), (SHORT.changed(substeps=2), None), (SHORT.changed(encoder=Encoder()), None)]
    drives += [(SHORT, WeightedPiSpeed(3.0, 20.0, 0.5, 0.9, 0.2))]
    counted, original = [], dfim_many._alone
    monkeypatch.setattr(dfim_many, "_alone", lambda *arguments: [counted.append(arguments), original(*arguments)])
    table = numbers(dfim_many.simulate_many(*zip(*drives, strict=True), window=(0.05, 0.2), workers=1))
    expected = [alone(scenario, speed, (0.05, 0.2)) for scenario, speed in drives]
    assert np.array_equal(table, expected, equal_nan=True)
    assert len(counted) == 4, "all but four must have gone abreast"


def test_a_drive_that_diverges_is_flagged_and_harms_no_other():
    """A load of 1e9 N m: time as ``simulate`` says, the rest of its row NaN, its neighbours untouched."""
    bad = SHORT.changed(load_torque=((0.0, 0.0), (0.1, 1e9)))
    scenarios = list(different(40))
    whole = dfim_many.simulate_many(scenarios)
    with pytest.raises(SimulationDiverged) as caught:
        simulate(bad)
    for others in (scenarios, scenarios[:2]):
        table = dfim_many.simulate_many([*others[:1], bad, *others[1:]])
        assert table["diverged"][1] == caught.value.time and np.isnan(table["IAE"][1]) and np.isnan(table["omega_m"][1])
        assert np.delete(table, 1).tobytes() == whole[: len(others)].tobytes()


def test_a_frame_too_fast_for_the_polynomials_is_computed_again():
    """High voltage and a light rotor reach speeds at which a frame turns more than 1/8 rad in half a period."""
    machine = DFIM_4KW.changed(J=0.01)
    fast = SHORT.changed(machine=machine, period=4e-4, speed_reference=((0.0, 700.0),), load_torque=((0.0, 0.0),), V_dc_s=6e3, V_dc_r=6e3)
    assert 0.5 * fast.period * 0.5 * machine.p * simulate(fast)["omega_m"].max() > 0.125
    table = numbers(dfim_many.simulate_many([fast] * 30))
    assert np.array_equal(table, [alone(fast)] * 30, equal_nan=True)


def test_a_generator_of_drives_is_taken_as_needed():
    """No more blocks are taken ahead than two per worker and one."""
    taken, most = [0], []

    def source():
        for scenario in [SHORT.changed(duration=0.01, load_torque=((0.0, 0.0),))] * 64 * 20:
            taken[0] += 1
            yield scenario

    original = dfim_many.block

    def counting(drives, window):
        most.append(taken[0])
        return original(drives, window)

    dfim_many.block = counting
    try:
        assert len(dfim_many.simulate_many(source(), workers=1)) == 64 * 20
    finally:
        dfim_many.block = original
    ahead = np.array(most) - 64 * np.arange(len(most))
    assert ahead.max() <= 64 * 5


def test_bad_calls_are_refused():
    with pytest.raises(ValueError, match="scenarios is empty"):
        dfim_many.simulate_many([])
    with pytest.raises(ValueError, match="speeds ended"):
        dfim_many.simulate_many([SHORT] * 3, [None] * 2)
    with pytest.raises(ValueError, match="scenarios ended"):
        dfim_many.simulate_many([SHORT] * 2, [None] * 3)
    with pytest.raises(ValueError, match="window's end = 9 s"):
        dfim_many.simulate_many([SHORT] * 20, window=(0, 9))
