"""The map of a reader's motor, its limits, what a network costs on it, and what happens to a motor that cannot."""

import numpy as np
import pytest

from drivelib import loss_map, pmsm, pmsm_optimum
from drivelib.machines import IPMSM, IPMSM_2200W, SPMSM
from drivelib.training import NotConverged
from pmsm_by_hand import at_torque, motor_branch

SPEED, TORQUE = np.linspace(20, 300, 9), np.linspace(0.5, 6, 8)


@pytest.fixture(scope="module")
def found():
    return loss_map.loss_map(IPMSM, SPEED, TORQUE, V_max=144.0, I_max=5.0)


def test_unreachable_points_are_flagged_and_really_unreachable(found):
    """Brute force over the branch of currents that make the torque; some points are in reach, some are not."""
    assert 0 < found.reachable < 1
    for row, omega_m in enumerate(SPEED):
        for column, T_e in enumerate(TORQUE):
            points = at_torque(IPMSM, IPMSM.P * omega_m, T_e, motor_branch(IPMSM, T_e, 4001), "full")
            inside = np.any((abs(points.u) <= 144.0) & (abs(points.i) <= 5.0))
            assert inside <= found.best.feasible[row, column]  # a grid may miss a sliver, never find what is not there
    assert np.all(np.isnan(found.best.i_d) == ~found.best.feasible)


def test_the_largest_torque_is_where_reach_ends(found):
    limits = {"V_max": found.V_max, "I_max": found.I_max}
    for factor, wanted in ((1 - 1e-9, True), (1 + 1e-6, False)):
        ends = found.T_max < TORQUE[-1]
        at = pmsm_optimum.optimum(IPMSM, IPMSM.P * SPEED[ends], found.T_max[ends] * factor, **limits)
        assert np.all(at.feasible == wanted)
    assert np.array_equal(found.best.feasible, TORQUE[None, :] <= found.T_max[:, None])


def test_a_speed_out_of_reach_is_nan_and_left_out_of_training():
    """A surface machine whose emf alone exceeds the voltage, and too little current to weaken it."""
    speed, torque = np.linspace(100, 500, 9), np.linspace(0.1, 0.5, 5)
    found = loss_map.loss_map(SPMSM, speed, torque, V_max=57.7, I_max=2.0)
    assert np.isnan(found.T_max[-1]) and np.isfinite(found.T_max[0])
    data = loss_map.training_data(found, 20)
    assert np.isfinite(data.t).all() and data.x[:, 0].max() < speed[-1]
    limit = loss_map.torque_limit(found, data.x[:, 0], 0.95)
    assert np.all(data.x[:, 1] <= limit * (1 + 1e-9)) and np.isclose(np.max(data.x[:, 1] / limit), 1)


@pytest.mark.parametrize(("machine", "I_max"), [(IPMSM, 5.0), (SPMSM, 8.0), (IPMSM_2200W, 9.12)], ids=lambda value: getattr(value, "name", ""))
def test_the_torque_at_rated_speed_is_the_largest_of_all_allowed_currents(machine, I_max):
    """Brute force over the disk of terminal currents; its steps leave half a per cent."""
    V_max = pmsm.voltage_limit(machine)
    speed, torque = np.linspace(0.1, 1.2, 5) * machine.omega_m_rated, np.linspace(0.1, 1, 4) * machine.T_rated
    found = loss_map.loss_map(machine, speed, torque, V_max=V_max, I_max=I_max)
    size, angle = np.meshgrid(np.linspace(0, I_max, 200), np.linspace(0, 2 * np.pi, 3000))
    omega_e = machine.omega_e_rated
    branch = pmsm.branch_currents(machine, omega_e, size * np.cos(angle), size * np.sin(angle))
    allowed = pmsm.stator_voltage(machine, omega_e, *branch) <= V_max
    largest = np.max(pmsm.torque(machine, *branch)[allowed])
    assert 0.995 * loss_map.rated_torque(found) <= largest <= loss_map.rated_torque(found) * (1 + 1e-9)


def test_the_share_above_least_leaves_out_what_loses_nothing():
    assert np.array_equal(loss_map.percent_above([1.0, 0.0, 0.0], [4.0, 4.0, 0.0]), [25.0, 0.0, np.nan], equal_nan=True)
    with_none = loss_map.loss_map(IPMSM, [0.0, 100.0], [0.0, 2.0], V_max=144.0, I_max=5.0)
    assert with_none.best.loss[0, 0] == 0
    shares = loss_map.percent_above(loss_map.network_error(with_none, lambda x: 0.1 + 0 * x).excess, with_none.best.loss)
    assert np.isnan(shares[0, 0]) and not np.any(np.isinf(shares))


def test_what_mirroring_gives_away_is_found_by_brute_force(found):
    """Loss over the whole branch of currents that brake inside the limits, against the motoring point mirrored."""
    excess = loss_map.mirrored_excess(found)
    assert np.nanmax(excess) > 0.5 and np.array_equal(np.isnan(excess), ~found.best.feasible)
    assert np.nanmax(np.abs(excess[~found.best.limited])) < 1e-6
    for row, column in np.argwhere(found.best.feasible):
        omega_e, T_e = IPMSM.P * SPEED[row], TORQUE[column]
        points = at_torque(IPMSM, omega_e, -T_e, motor_branch(IPMSM, T_e, 20_001), "full")
        least = np.min(points.loss[(abs(points.u) <= 144.0) & (abs(points.i) <= 5.0)])
        mirrored = at_torque(IPMSM, omega_e, -T_e, found.best.i_od[row, column], "full")
        assert abs(mirrored.u) <= 144.0 * (1 + 1e-9) and abs(mirrored.i) <= 5.0 * (1 + 1e-9)
        assert abs(100 * (mirrored.loss / least - 1) - excess[row, column]) < 0.05  # the grid misses the least a little


def test_headroom_keeps_off_the_border_but_not_off_the_rated_torque(found):
    limit = loss_map.torque_limit(found, SPEED, 0.9)
    full = loss_map.largest_torque(IPMSM, SPEED, TORQUE[0], 100.0, V_max=144.0, I_max=5.0)
    assert np.allclose(limit, np.minimum(0.9 * full, TORQUE[-1]))


def test_the_optimum_itself_has_no_error(found):
    """The map's own currents cost nothing and stay inside; those without i_d cost something wherever they are allowed."""

    def exact(x):
        best = pmsm_optimum.optimum(IPMSM, IPMSM.P * x[..., 0], x[..., 1], V_max=144.0, I_max=5.0)
        return np.nan_to_num(np.stack([best.i_d, best.i_q], axis=-1))

    def without(x):
        return np.stack(pmsm.terminal_currents(IPMSM, IPMSM.P * x[..., 0], 0.0, x[..., 1] / (1.5 * IPMSM.P * IPMSM.psi_f)), axis=-1)

    error = loss_map.network_error(found, exact, 1.0)
    for values in (error.torque, error.excess, error.voltage, error.current):
        assert np.nanmax(np.abs(values)) < 1e-9
        assert np.array_equal(np.isnan(values), ~found.best.feasible)
    error = loss_map.network_error(found, without, 1.0)
    allowed = (error.voltage == 0) & (error.current == 0)
    assert np.nanmax(np.abs(error.torque)) < 1e-9 and np.all(error.excess[allowed] > 0) and np.any(error.voltage > 0)


def test_a_network_that_does_not_get_there_is_not_handed_out(found):
    with pytest.raises(NotConverged, match="goal or minimum not reached"):
        loss_map.trained(loss_map.training_data(found), hidden=1, starts=2, rms_percent=0.01)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: loss_map.loss_map(SPMSM, [400, 500], [0.5, 1.0], V_max=20.0, I_max=2.0), "no point of 400 to 500 rad/s"),
        (lambda: loss_map.loss_map(IPMSM, [-10, 10], [1, 2], V_max=100, I_max=5), "omega_m = -10"),
        (lambda: loss_map.loss_map(IPMSM, [10, 5], [1, 2], V_max=100, I_max=5), "omega_m"),
        (lambda: loss_map.loss_map(IPMSM, [5, 10], [1, np.nan], V_max=100, I_max=5), "T_e = nan"),
        (lambda: loss_map.loss_map(IPMSM, [5, 10], [1, 2], V_max=0, I_max=5), "V_max = 0"),
        (lambda: loss_map.loss_map(IPMSM, [5, 10], [1, 2], V_max=100, I_max=-5), "I_max = -5"),
        (lambda: loss_map.rated_torque(loss_map.loss_map(IPMSM_2200W, [10, 20], [1, 2], V_max=34.6, I_max=9.12)), r"rated speed \(157.1 rad/s\) no current .* check V_dc"),
        (lambda: loss_map.rated_torque(loss_map.loss_map(IPMSM_2200W, [10, 20], [1, 2], V_max=312, I_max=5), needed=20.0), "at most, not the 20 N m"),
        (lambda: IPMSM_2200W.changed(R_s=-1.0), "R_s = -1.0 ohm"),
        (lambda: IPMSM_2200W.changed(L_q=0.0), "L_q = 0.0 H"),
        (lambda: IPMSM_2200W.changed(P=2.5), "P = 2.5"),
    ],
)
def test_bad_input_names_parameter_value_and_unit(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_too_few_points_in_reach_are_refused(found):
    with pytest.raises(ValueError, match="must be at least 50"):
        loss_map.training_data(found, 5)
    with pytest.raises(ValueError, match="headroom = 1.2"):
        loss_map.torque_limit(found, SPEED, 1.2)


def test_the_third_machines_numbers_are_its_sources():
    """motulator's example: 3.6 ohm, 36 and 51 mH, 0.545 Wb, 3 pole pairs, 540 V, 0.015 kg m², 75 Hz, 14 N m, 2.2 kW."""
    m = IPMSM_2200W
    assert (m.R_s, m.L_d, m.L_q, m.psi_f, m.P, m.V_dc, m.J, m.T_rated) == (3.6, 0.036, 0.051, 0.545, 3, 540, 0.015, 14)
    assert abs(m.omega_e_rated - 2 * np.pi * 75) < 0.02 and abs(m.omega_m_rated * m.T_rated - 2200) < 2
    assert {row[3] for row in m.rows()} == {"found", "assumed", "inferred"}
    assert all(row[4] for row in m.rows())
    assert abs(1.5 * (m.omega_e_rated * m.psi_f) ** 2 / m.R_c - 99) < 0.5
