"""What Eskander's networks learn, and what they are held against."""

import numpy as np
import pytest

from drivelib import networks, pmsm, pmsm_optimum
from drivelib.machines import IPMSM, SPMSM
from drivelib.neural import Network, Range

SPEEDS, TORQUES, CURRENTS = np.linspace(20, 170, 5), np.linspace(0.2, 1.2, 4), np.linspace(0.3, 3.5, 6)


def test_nn_i_learns_the_current_at_which_the_loss_is_flat_along_its_torque():
    """Each target makes eq. (8) vanish at the torque that (3) gives for it."""
    data = networks.nn_i_data(IPMSM, CURRENTS, SPEEDS)
    assert data.x.shape == (30, 2) and data.t.shape == (30, 1)
    i_q, omega_m = data.x.T
    torque = pmsm.torque(IPMSM, data.t[:, 0], i_q)
    slope = pmsm.loss_slope(IPMSM, IPMSM.P * omega_m, torque, data.t[:, 0])
    scale = 2 * IPMSM.R_s * np.abs(data.t[:, 0])
    assert np.all(np.abs(slope) < 1e-9 * np.maximum(scale, 1))


def test_nn_s_learns_a_torque_current_and_a_speed_current():
    """i_q* depends on the load alone and makes the torque; i_d depends on the speed alone and lowers the loss."""
    data = networks.nn_s_data(SPMSM, SPEEDS, TORQUES)
    omega_m, torque = data.x.T
    i_q, i_d = data.t.T
    assert np.allclose(pmsm.torque(SPMSM, 0.0, i_q), torque)
    nudged = [pmsm.total_loss(SPMSM, SPMSM.P * omega_m, i_d + d, i_q, model="simplified") for d in (-1e-3, 0, 1e-3)]
    assert np.all(nudged[1] < nudged[0]) and np.all(nudged[1] < nudged[2])


def test_nn_a_learns_the_angle_that_leaves_no_direct_current():
    data = networks.nn_a_data(SPMSM, SPEEDS, TORQUES)
    omega_e, torque = SPMSM.P * data.x[:, 0], data.x[:, 1]
    i_q = torque / (1.5 * SPMSM.P * SPMSM.psi_f)
    V_s = pmsm.stator_voltage(SPMSM, omega_e, 0.0, i_q, model="simplified")
    i_od, i_oq = pmsm.branch_currents_at_voltage(SPMSM, omega_e, V_s, data.t[:, 0], model="simplified")
    assert np.allclose(i_od, 0, atol=1e-9) and np.allclose(i_oq, i_q)


def test_the_goal_is_the_rms_error_as_a_share_of_the_range():
    """An error of 1 % of the range at every sample, mapped to [-1, 1], sums to the goal of 1 %."""
    data = networks.nn_s_data(SPMSM, SPEEDS, TORQUES)
    mapped_error = np.full(data.t.shape, 2 * 0.01)
    assert np.isclose(networks.sse_goal(data, 1.0), np.sum(mapped_error**2))
    with pytest.raises(ValueError, match="rms_percent = 0"):
        networks.sse_goal(data, 0.0)


def test_epochs_to_a_goal_count_the_first_epoch_that_meets_it():
    class Result:
        history = {"sse": np.array([[5.0, 3.0, 1.0, 1.0], [5.0, 4.0, np.nan, np.nan], [0.5, np.nan, np.nan, np.nan]])}

    assert networks.epochs_to(Result, 2.0).tolist() == [2, np.inf, 0]


def test_a_network_as_a_law_gives_the_same_currents_and_knows_its_range():
    net = Network([[0.3, -0.2], [0.1, 0.4]], [0.1, -0.3], [[1.0, -0.5]], [0.2], Range([0.2, 20], [4.0, 170]), Range([-4.0], [0.0]))
    law = networks.as_law(net)
    x = np.array([[1.0, 50.0], [3.0, 150.0]])
    assert np.allclose(law(x), net.predict(x), rtol=1e-12)
    assert law.low.tolist() == [0.2, 20] and law.high.tolist() == [4.0, 170]


def test_the_counted_operations_are_those_of_a_plain_evaluation():
    """Count them by evaluating with numbers that count."""

    class Counted(float):
        products = 0

        def __mul__(self, other):
            Counted.products += 1
            return Counted(float(self) * float(other))

    n_in, n_hidden, n_out = 2, 3, 2
    one = Counted(1.0)
    hidden = [sum((one * one for _ in range(n_in)), start=0) for _ in range(n_hidden)]
    assert len(hidden) == networks.operations(n_in, n_hidden, n_out)["tanh"]
    for _ in range(n_out):
        sum((one * Counted(h) for h in hidden), start=0)
    assert Counted.products == networks.operations(n_in, n_hidden, n_out)["multiply-add"]


def test_a_table_of_a_bilinear_function_needs_its_corners_only_and_a_bent_one_the_size_theory_gives():
    assert networks.table_size_for(lambda x, y: x * y, [0, 0], [1, 1], 1e-9) == 2
    # linear interpolation of x² over a cell h errs by h²/4
    assert networks.table_size_for(lambda x, y: x**2, [0, 0], [1, 1], 1.001 / (4 * 10**2), check=401) == 11
    assert networks.table_size_for(lambda x, y: x**2, [0, 0], [1, 1], 1e-9, largest=5) == np.inf


def test_grids_are_checked():
    with pytest.raises(ValueError, match="i_q"):
        networks.nn_i_data(IPMSM, [1.0], SPEEDS)
    with pytest.raises(ValueError, match="omega_m"):
        networks.nn_s_data(SPMSM, [3.0, 1.0], TORQUES)
    with pytest.raises(ValueError, match="surface machine"):
        networks.nn_s_data(IPMSM, SPEEDS, TORQUES)


def test_the_formula_that_the_network_replaces_is_the_optimum():
    """The operations counted for the formula are those of this expression, which gives the optimum exactly."""
    m, omega, i_q = IPMSM, 4 * 120.0, 2.0
    w2 = omega * omega
    scale = 1 / (m.R_s * m.R_c + w2 * m.L_d**2)
    b, k = w2 * m.psi_f * m.L_d * scale, (m.R_s * m.R_c + w2 * m.L_q**2) * scale
    a = m.psi_f - b * m.delta_L
    s = m.delta_L**2 * k * i_q * i_q
    x = (a + np.sqrt(a * a + 4 * s)) / 2
    assert np.isclose((x - m.psi_f) / m.delta_L, pmsm_optimum.optimal_i_od_at_i_oq(m, omega, i_q, model="simplified"), rtol=1e-12)
