"""The exported network outside its range, compiled: no torque, braking, reverse, what is held and what is no number, judged by the physics."""

import itertools

import numpy as np
import pytest

from drivelib import fixed_point, loss_map, pmsm, pmsm_optimum
from drivelib.dfim_machines import DFIM_4KW
from exported_c import CURRENT, UNIT, compiled, made_torque, needs_gcc, outside_points, quantised, single_range, within_full_scale


def wanted_outside(motor, x, network=None):
    """Return the outputs outside the range, from the physics: nearest point inside, branch currents, torque in proportion to i_oq.

    Signed speed goes straight into `pmsm.terminal_currents`; a DFIM's references take sizes alone.
    """
    found, trained = motor
    network, (low, high) = network or trained.predict, single_range(trained)
    inside = np.clip(np.abs(x), low, high)
    y = network(inside)
    if found.machine is DFIM_4KW:
        return y
    m = found.machine
    i_od, i_oq = pmsm.branch_currents(m, m.P * inside[:, 0], *y.T)
    share = np.clip(x[:, 1] / low[1], -1, 1)
    return np.column_stack(pmsm.terminal_currents(m, m.P * np.clip(x[:, 0], -high[0], high[0]), i_od, share * i_oq))


def iron_shares(motor):
    """Return (α, β) = ω (L_q, L_d)/R_c at the highest speed: what a current adds to the other axis."""
    found, network = motor
    speed = found.machine.P * network.inputs.high[0] / found.machine.R_c
    return speed * found.machine.L_q, speed * found.machine.L_d


def carried(bound, alpha, beta):
    """Return what errors of i_d and i_q become outside the range, where i_oq, i_od and both currents follow from them in turn."""
    d, q = bound
    branch_q = q + beta * d
    branch_d = d + alpha * branch_q
    return np.array([branch_d + alpha * branch_q, branch_q + beta * branch_d])


@needs_gcc
@pytest.mark.parametrize("checked", [True, False], ids=["sanitizer", "plain"])
def test_outside_the_range_the_float_network_answers_by_symmetry_and_says_so(motor, tmp_path, checked):
    """Status from the range alone; the outputs from `wanted_outside`, to single precision."""
    network = motor[1]
    x = outside_points(network)
    out = compiled(tmp_path, motor, checked=checked).floats(x)
    held = np.any(np.abs(x) > single_range(network)[1], axis=1)
    assert np.array_equal(out["status"], np.where(held, 4, 3)) and 0.2 < np.mean(held) < 0.8
    wanted, bound = wanted_outside(motor, x), fixed_point.float32_bound(network)
    if motor[0].machine is not DFIM_4KW:
        alpha, beta = iron_shares(motor)
        bound = carried(bound, alpha, beta) + 32 * UNIT * (1 + alpha + beta) ** 2 * np.max(np.abs(wanted))
    assert np.all(np.abs(out["network"] - wanted) <= bound)


@needs_gcc
def test_outside_the_range_q15_answers_as_the_physics_does(motor, tmp_path):
    """At the inputs that the integers stand for. Steps of rounding: 6 in i_oq, 1.5 + 6 α in i_od, 7.5 in what is made of it, 2 more each in the ends."""
    _, network = motor
    q15 = quantised(motor)
    q = q15.to_q15(outside_points(network))
    got, status = compiled(tmp_path, motor).q15(q)
    outside = status > 0
    x = q15.from_q15(q)
    inside = np.where(np.abs(x) <= q15.from_q15(q15.x_low), network.inputs.low, np.abs(x))  # the ends of the range are rounded too
    share = np.clip(q[:, 1] / q15.x_low[1], -1, 1)
    x = np.column_stack([x[:, 0], np.where(np.abs(share) < 1, share * network.inputs.low[1], np.sign(x[:, 1]) * inside[:, 1])])
    wanted, steps = wanted_outside(motor, x, lambda x: within_full_scale(q15, network.predict(x))), np.zeros(2)
    bound = q15.bound
    if motor[0].machine is not DFIM_4KW:
        alpha, beta = iron_shares(motor)
        d, q_ = q15.y_scale
        bound = carried(bound, alpha, beta)
        a, b = alpha * q_ / d, beta * d / q_  # in steps
        steps = np.array([3.5 + 13.5 * a, 10 + b * (1.5 + 6 * a)]) * q15.y_scale / 2**15
    assert np.mean(outside) > 0.9
    error = np.abs(got * q15.y_scale / 2**15 - within_full_scale(q15, wanted))[outside]
    assert np.all(error <= bound + steps + 1e-6)


@needs_gcc
def test_no_torque_braking_and_reverse_make_the_torque_asked_for_inside_the_limits(pmsm_motor, tmp_path):
    """Of the compiled currents, float and Q15: torque and its sign as well as at the point inside; no more voltage or current than there."""
    found, network = pmsm_motor
    m, q15, (low, high) = found.machine, quantised(pmsm_motor), single_range(network)
    exported, x = compiled(tmp_path, pmsm_motor), outside_points(network)
    out = exported.floats(x)
    x, currents = x[out["status"] == 3], out["network"][out["status"] == 3]
    inside = np.clip(np.abs(x), low, high)
    error = made_torque(m, inside[:, 0], network.predict(inside)) - inside[:, 1]  # what the network errs by there
    allowed = np.abs(error) * np.abs(x[:, 1]) / inside[:, 1]
    torque = made_torque(m, x[:, 0], currents)
    rounding = 64 * UNIT * m.T_rated
    assert np.all(np.abs(torque - x[:, 1]) <= allowed + rounding)
    none = x[:, 1] == 0
    assert np.sum(none) >= 5 and np.all(np.abs(torque[none]) <= rounding)
    still = none & (x[:, 0] == 0)
    assert np.any(still) and np.all(currents[still, 1] == 0)
    there, here = strain(m, inside[:, 0], network.predict(inside)), strain(m, x[:, 0], currents)
    assert all(np.all(a <= b * (1 + 64 * UNIT)) for a, b in zip(here, there, strict=True))

    reached = inside[:, 1] <= loss_map.torque_limit(found, inside[:, 0], 0.95)  # beyond it the outputs may leave full scale
    x, allowed = x[reached], allowed[reached]
    got, status = exported.q15(q15.to_q15(x))
    coarse = made_torque(m, q15.from_q15(q15.to_q15(x))[:, 0], got * q15.y_scale / 2**15)
    step = 1.5 * m.P * (m.psi_f + np.abs(m.delta_L) * q15.y_scale[0]) * np.sum(carried(q15.bound, *iron_shares(pmsm_motor)) + 32 * q15.y_scale / 2**15)
    assert np.all(np.abs(coarse - x[:, 1])[status == 3] <= (allowed + step)[status == 3]) and np.mean(status == 3) > 0.9
    assert step < 0.1 * m.T_rated


def strain(machine, omega_m, currents):
    """Return (voltage, current) of terminal currents."""
    branch = pmsm.branch_currents(machine, machine.P * omega_m, *currents.T)
    return pmsm.stator_voltage(machine, machine.P * omega_m, *branch), np.hypot(*currents.T)


def test_a_mirrored_optimum_is_the_optimum_of_braking(pmsm_motor):
    """Brute force over i_od: where no limit acts no current brakes with less loss than the motoring optimum mirrored."""
    m = pmsm_motor[0].machine
    i_od = np.linspace(-2 * CURRENT[m], 0.5 * CURRENT[m], 20_001)
    for speed, torque in itertools.product((0.1, 0.6, 1.4), (0.1, 0.5, 1.0)):
        omega_e, T_e = speed * m.omega_e_rated, torque * m.T_rated
        motoring = pmsm_optimum.optimum(m, omega_e, T_e)
        mirrored = pmsm.total_loss(m, omega_e, motoring.i_od, -motoring.i_oq)
        every = pmsm.total_loss(m, omega_e, i_od, pmsm.i_oq_at_torque(m, -T_e, i_od))
        step = np.max(np.abs(np.diff(every)))
        assert np.min(every) - step <= mirrored <= np.min(every) * (1 + 1e-9)


@needs_gcc
def test_what_is_no_number_and_what_is_infinite_is_held(motor, tmp_path):
    out = compiled(tmp_path, motor).floats([[np.nan, 1.0], [1.0, np.nan], [np.inf, 1.0], [1.0, -np.inf]])
    assert np.all(out["status"] == 4)
    assert np.all(np.isnan(out["network"][:2])) and np.all(np.isfinite(out["network"][2:]))
