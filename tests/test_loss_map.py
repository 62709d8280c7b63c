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
