"""The exported files: compiled, run, and held against the Python they come from; every bound follows from the number format."""

import csv
import functools
import itertools
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from conftest import REPOSITORY
from drivelib import dfim_map, dfim_optimum, export, fixed_point, loss_map, notebook, paths, pmsm, pmsm_optimum
from drivelib.dfim_machines import DFIM_4KW
from drivelib.machines import IPMSM, IPMSM_2200W, SPMSM
from drivelib.neural import Network, Range
from exported_c import DFIM_MAIN, Exported, needs_gcc

UNIT = 2.0**-24  # relative rounding error of single precision
CURRENT = {IPMSM: 6.0, SPMSM: 8.0, IPMSM_2200W: 9.12}


TIGHT = dfim_optimum.DfimLimits(phi_r=0.85, V_s=170.0, V_r=150.0, I_s=14.0, I_r=14.0)


@functools.cache
def made(machine):
    """Return a map and its trained network."""
    speed, torque = np.linspace(0.1, 1.5, 15) * machine.omega_m_rated, np.linspace(0.1, 1, 10) * machine.T_rated
    if machine is DFIM_4KW:
        found = dfim_map.dfim_map(machine, speed, torque, TIGHT)
        return found, loss_map.trained(loss_map.training_data(found), hidden=12, rms_percent=1.5)
    found = loss_map.loss_map(machine, speed, torque, V_max=pmsm.voltage_limit(machine), I_max=CURRENT[machine])
    return found, loss_map.trained(loss_map.training_data(found), hidden=16, rms_percent=0.3)


@pytest.fixture(params=[*CURRENT, DFIM_4KW], ids=lambda machine: machine.name)
def motor(request):
    """A map and its trained network, of every kind of motor."""
    return made(request.param)


@pytest.fixture(params=list(CURRENT), ids=lambda machine: machine.name)
def pmsm_motor(request):
    return made(request.param)


def compiled(tmp_path, motor, **options):
    found, network = motor
    return Exported(tmp_path, export.c_name(found.machine.name), export.c_header(found, network), **options)


def points(network, n):
    """Return operating points all over the training range, its corners among them."""
    low, high = single_range(network)
    x = np.random.default_rng(1).uniform(low, high, (n, 2)).astype(np.float32).astype(float)
    x[:4] = [[low[0], low[1]], [low[0], high[1]], [high[0], low[1]], high]
    return np.clip(x, low, high)


def single_range(network):
    """Return the training range as the header holds it."""
    return fixed_point.single(network.inputs.low), fixed_point.single(network.inputs.high)


def outside_points(network, n=4_000):
    """Return operating points of either sign up to 130 % of the range, none of them in it; standstill and no torque among them."""
    low, high = single_range(network)
    x = np.random.default_rng(3).uniform(-1.3 * high, 1.3 * high, (n, 2))
    x[: n // 4, 1] = np.linspace(-low[1], low[1], n // 4)
    edges = np.array(list(itertools.product(*([-1.3 * b, -b, -a, 0.0, a / 2, a, b, 1.3 * b] for a, b in zip(low, high, strict=True)))))
    x = np.concatenate([x, edges]).astype(np.float32).astype(float)
    return x[np.any((x < low) | (x > high), axis=1)]


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


def quantised(motor):
    found, network = motor
    return fixed_point.quantised(network, None if found.machine is DFIM_4KW else found.machine)


def q15_points(n=20_000):
    """Return int16 pairs: every pair of extremes, and many between."""
    edges = [-32768, -32767, -1, 0, 1, 32766, 32767]
    inner = np.random.default_rng(2).integers(-32768, 32768, (n, 2))
    return np.concatenate([np.array(list(itertools.product(edges, edges))), inner])


def within_full_scale(q15, values):
    return np.clip(values, -q15.y_scale, q15.y_scale * (1 - 2.0**-15))


@needs_gcc
@pytest.mark.parametrize("checked", [True, False], ids=["sanitizer", "plain"])
def test_compiled_q15_is_the_python_integers_bit_for_bit(motor, tmp_path, checked):
    """Over the whole int16 plane, extremes included, with and without the sanitizer of undefined behaviour."""
    q = q15_points()
    got, status = compiled(tmp_path, motor, checked=checked).q15(q)
    q15 = quantised(motor)
    assert np.array_equal(got, q15.evaluate(q)) and np.array_equal(status, q15.status(q))
    assert {*np.unique(status)} == {0, 3, 4}


@needs_gcc
def test_compiled_q15_errs_within_its_stated_bound(motor, tmp_path):
    """Against the float64 network at the inputs that the integers stand for: half a step per rounding, carried to the output."""
    _, network = motor
    q15 = quantised(motor)
    q = q15.to_q15(points(network, 10_000))
    x = np.clip(q15.from_q15(q), network.inputs.low, network.inputs.high)
    got, status = compiled(tmp_path, motor).q15(q)
    assert np.all(status == 0)
    error = np.abs(got * q15.y_scale / 2**15 - within_full_scale(q15, network.predict(x)))
    assert np.all(error <= q15.bound)
    assert np.all(q15.bound <= 0.02 * q15.y_scale)  # a bound of 2 % of full scale or more would say nothing


@needs_gcc
@pytest.mark.parametrize("checked", [True, False], ids=["sanitizer", "plain"])
def test_compiled_float_network_errs_within_the_bound_of_single_precision(motor, tmp_path, checked):
    """γ_n on every sum, two units for tanhf."""
    _, network = motor
    x = points(network, 10_000)
    wanted = network.predict(x)
    out = compiled(tmp_path, motor, checked=checked).floats(x)
    assert np.all(out["status"] == 0)
    error, bound = np.abs(out["network"] - wanted), fixed_point.float32_bound(network)
    assert np.all(error <= bound)
    assert np.all(bound <= 1e-3 * np.max(np.abs(wanted), axis=0))


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


def made_torque(machine, omega_m, currents):
    return pmsm.torque(machine, *pmsm.branch_currents(machine, machine.P * omega_m, *currents.T))


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
def test_the_dfims_references_hold_flux_and_limits_outside_the_range(tmp_path):
    """Flux never below that of the lowest torque; braking and reverse, with currents and frequency of the header, strain no limit more than motoring."""
    found, network = motor = made(DFIM_4KW)
    m, exported, x = found.machine, compiled(tmp_path, motor), outside_points(network)
    out = exported.floats(x)
    x, (phi_r, i_rd) = x[out["status"] == 3], out["network"][out["status"] == 3].T
    low, high = single_range(network)
    inside = np.clip(np.abs(x), low, high)
    drive = Exported(tmp_path, export.c_name(m.name), export.c_header(*motor), main=DFIM_MAIN)

    def excess(x):
        currents = drive.references(np.column_stack([x[:, 1], phi_r, i_rd]))[:, :3]
        frequency = drive.references(np.column_stack([x[:, 1], x[:, 0] / 100, i_rd]))[:, 3]
        made = dfim_optimum.point(m, *x.T, phi_r, i_rd, frequency)
        assert np.allclose(currents, np.column_stack([made.i_sd, made.i_sq, made.i_rq]), atol=1e-4)
        return dfim_optimum.excess(made, found.limits)

    assert np.all(phi_r >= 0.9 * min(dfim_optimum.free_flux(m, low[1]), found.limits.phi_r))
    reached = inside[:, 1] <= loss_map.torque_limit(found, inside[:, 0], 0.95)
    assert np.sum(reached) > 200
    assert np.all((excess(x) <= excess(inside) + 1e-3)[reached])


@needs_gcc
def test_the_dfims_formula_keeps_a_flux_at_no_torque(tmp_path):
    """Between none and the lowest torque, of either sign: the flux of the lowest torque, and a status that says so."""
    found, network = motor = made(DFIM_4KW)
    low, _ = single_range(network)
    torque = np.concatenate([np.linspace(-0.999, 0.999, 101) * low[1], [0.0]])
    out = compiled(tmp_path, motor).floats(np.column_stack([np.full(torque.shape, 30.0), torque]))
    floor = dfim_optimum.free_flux(found.machine, low[1])
    assert np.all(out["flag"] == 1)
    assert np.allclose(out["optimum"], [floor, dfim_optimum.free_i_rd(found.machine, floor)], rtol=64 * UNIT)


@needs_gcc
def test_what_is_no_number_and_what_is_infinite_is_held(motor, tmp_path):
    out = compiled(tmp_path, motor).floats([[np.nan, 1.0], [1.0, np.nan], [np.inf, 1.0], [1.0, -np.inf]])
    assert np.all(out["status"] == 4)
    assert np.all(np.isnan(out["network"][:2])) and np.all(np.isfinite(out["network"][2:]))


@needs_gcc
def test_beyond_the_range_the_torque_limit_is_none_and_reverse_is_forwards(motor, tmp_path):
    network = motor[1]
    x = outside_points(network)
    exported = compiled(tmp_path, motor)
    out, forwards = exported.floats(x)["limit"], exported.floats(np.abs(x))["limit"]
    assert np.array_equal(out, forwards)
    assert np.all(out[np.abs(x[:, 0]) > single_range(network)[1][0]] == 0) and np.any(out > 0)


@needs_gcc
def test_compiled_formula_makes_the_torque_at_the_least_loss_inside_the_limits(pmsm_motor, tmp_path):
    """Judged by the physics, not by the currents alone, which near a flat optimum may differ by sqrt(eps).

    64 roundings of single precision are allowed; points within 1e-4 of a limit of reach may fall on either side.
    """
    found, network = pmsm_motor
    machine, allowed = found.machine, 64 * UNIT
    x = points(network, 4_000)
    out = compiled(tmp_path, pmsm_motor).floats(x)
    omega_e, T_e = machine.P * x[:, 0], x[:, 1]
    best, tighter, wider = (
        pmsm_optimum.optimum(machine, omega_e, T_e, V_max=found.V_max * scale, I_max=found.I_max * scale) for scale in (1, 1 - 1e-4, 1 + 1e-4)
    )
    answered = out["flag"] < 2
    assert np.all(answered[tighter.feasible]) and not np.any(answered[~wider.feasible])
    assert np.all(out["optimum"][~answered] == -1)  # left alone
    clear = answered & best.feasible
    i_d, i_q = out["optimum"][clear].T
    i_od, i_oq = pmsm.branch_currents(machine, omega_e[clear], i_d, i_q)
    assert np.all(np.abs(pmsm.torque(machine, i_od, i_oq) / T_e[clear] - 1) <= allowed)
    assert np.all(pmsm.stator_voltage(machine, omega_e[clear], i_od, i_oq) <= found.V_max * (1 + allowed))
    assert np.all(np.hypot(i_d, i_q) <= found.I_max * (1 + allowed))
    loss = pmsm.total_loss(machine, omega_e[clear], i_od, i_oq)
    slack = best.loss[clear] * allowed + np.maximum(best.loss - wider.loss, 0)[clear] * 1e4 * allowed
    deep = tighter.feasible[clear]  # at the very border the loss itself is infinitely steep in the limit
    assert np.all(np.abs(loss - best.loss[clear])[deep] <= 2 * slack[deep])
    moved = out["flag"][clear] == 1
    away = np.abs(pmsm_optimum.optimum(machine, omega_e, T_e).V_s / found.V_max - 1)[clear] > 1e-4
    away &= np.abs(np.hypot(*(getattr(pmsm_optimum.optimum(machine, omega_e, T_e), n) for n in ("i_d", "i_q"))) / found.I_max - 1)[clear] > 1e-4
    assert np.array_equal(moved[away], best.limited[clear][away])


@needs_gcc
def test_compiled_formula_holds_for_either_sign_and_beyond_the_range(pmsm_motor, tmp_path):
    """Torque as asked, least loss of braking and reverse inside the limits, against the optimum in double precision; no torque too."""
    found, network = pmsm_motor
    m, allowed, x = found.machine, 64 * UNIT, outside_points(network)
    out = compiled(tmp_path, pmsm_motor).floats(x)
    best, tighter, wider = (
        pmsm_optimum.optimum(m, m.P * x[:, 0], x[:, 1], V_max=found.V_max * scale, I_max=found.I_max * scale) for scale in (1, 1 - 1e-3, 1 + 1e-3)
    )
    answered = out["flag"] < 2
    assert np.all(answered[tighter.feasible]) and not np.any(answered[~wider.feasible])
    clear = answered & tighter.feasible
    assert np.sum(clear & (x[:, 1] < 0)) > 300 and np.sum(clear & (x[:, 0] < 0)) > 300 and np.sum(clear & (x[:, 1] == 0)) > 3
    assert np.all(np.abs(made_torque(m, x[:, 0], out["optimum"]) - x[:, 1])[clear] <= allowed * m.T_rated)
    branch = pmsm.branch_currents(m, m.P * x[:, 0], *out["optimum"].T)
    loss = pmsm.total_loss(m, m.P * x[:, 0], *branch)
    slack = allowed * (best.loss + 1e3 * np.maximum(tighter.loss - wider.loss, 0) + 1.5 * m.R_s * found.I_max**2)
    assert np.all(np.abs(loss - best.loss)[clear] <= slack[clear])


@needs_gcc
def test_the_dfims_closed_form_is_the_same_forwards_and_in_reverse(tmp_path):
    """Turning both signs changes neither references nor status, and turns the stator frequency."""
    found, network = motor = made(DFIM_4KW)
    x = outside_points(network)
    exported = compiled(tmp_path, motor)
    there, back = exported.floats(x), exported.floats(-x)
    assert np.array_equal(there["flag"], back["flag"]) and np.array_equal(there["optimum"], back["optimum"])
    drive = Exported(tmp_path, export.c_name(found.machine.name), export.c_header(*motor), main=DFIM_MAIN)
    turning = np.column_stack([x[:, 1], x[:, 0] / 100, np.ones(len(x))])
    assert np.array_equal(drive.references(turning)[:, 3], -drive.references(turning * [-1, -1, 1])[:, 3])


@needs_gcc
def test_compiled_torque_limit_is_reachable_and_close(motor, tmp_path):
    """At every table node the limit is the map's own; between them no more than a step's chord away."""
    found, network = motor
    nodes = np.linspace(network.inputs.low[0], network.inputs.high[0], export.LIMIT_STEPS)
    limit = compiled(tmp_path, motor).floats(np.column_stack([nodes, np.ones_like(nodes)]))["limit"]
    wanted = np.nan_to_num(loss_map.torque_limit(found, nodes, 0.95))
    steepest = np.max(np.abs(np.diff(wanted))) / (nodes[1] - nodes[0])
    place = 4 * UNIT * nodes[-1] * steepest  # the speed in single precision
    assert np.allclose(limit, wanted, rtol=8 * UNIT, atol=64 * place + 1e-6)
    assert np.all(found.optimum(nodes, limit).feasible | (limit == 0))


@needs_gcc
@pytest.mark.parametrize("checked", [True, False], ids=["sanitizer", "plain"])
def test_compiled_dfim_formula_is_the_optimum_where_no_inverter_limit_acts(tmp_path, checked):
    """Flags as the Python optimum has them, but within 1e-4 of a limit; references to 64 roundings; both torque and flux kept."""
    found, network = motor = made(DFIM_4KW)
    x = points(network, 4_000)
    exported = compiled(tmp_path, motor, checked=checked)
    out = exported.floats(x)
    best = found.optimum(*x.T)
    beyond = best.limited | ~best.feasible
    free = dfim_optimum.point(found.machine, *x.T, *references(found, x[:, 1]), dfim_optimum.stator_frequency(found.machine, *x.T, found.limits))
    flux_alone = dfim_optimum.free_flux(found.machine, x[:, 1])
    clear = np.min([abs(used - 1) for used in usage(free, found.limits)] + [abs(flux_alone / found.limits.phi_r - 1)], axis=0) > 1e-4
    assert 0.05 < np.mean(beyond) < 0.95 and np.mean(clear) > 0.95
    assert np.array_equal((out["flag"] == 2)[clear], beyond[clear])
    clear &= x[:, 1] > single_range(network)[0][1]  # there the floor of the flux begins
    assert np.array_equal((out["flag"] == 1)[clear], (best.capped & ~beyond)[clear])
    assert np.all(out["optimum"][out["flag"] == 2] == -1)
    kept = clear & ~beyond
    wanted = np.column_stack([best.phi_r, best.i_rd])[kept]
    assert np.all(np.abs(out["optimum"][kept] / wanted - 1) <= 64 * UNIT)


@needs_gcc
def test_compiled_dfim_currents_make_torque_and_flux(tmp_path):
    """From the flux equations and the torque of two vectors, with braking torque too; and the stator frequency at 100 times the flux as speed."""
    found, network = made(DFIM_4KW)
    m, rng = found.machine, np.random.default_rng(5)
    x = np.column_stack([rng.uniform(-25, 25, 2000), rng.uniform(0.1, 1, 2000), rng.uniform(-3, 8, 2000)]).astype(np.float32).astype(float)
    out = Exported(tmp_path, export.c_name(m.name), export.c_header(found, network), main=DFIM_MAIN).references(x)
    i_s, i_r = out[:, 0] + 1j * out[:, 1], x[:, 2] + 1j * out[:, 2]
    phi_r = m.L_r * i_r + m.M * i_s
    omega_s = dfim_optimum.stator_frequency(m, 100 * x[:, 1], x[:, 0], found.limits)
    assert np.all(abs(out[:, 3] / omega_s - 1) <= 64 * UNIT)
    size = m.L_r * abs(i_r) + m.M * abs(i_s)
    assert np.all(abs(phi_r - x[:, 1]) <= 64 * UNIT * size)
    torque = 1.5 * m.p * m.M * (np.conj(i_r) * i_s).imag
    assert np.all(abs(torque - x[:, 0]) <= 64 * UNIT * 1.5 * m.p * m.M * abs(i_r) * abs(i_s))


def references(found, torque):
    """Return what the formula gives before any inverter limit."""
    phi_r = np.minimum(dfim_optimum.free_flux(found.machine, torque), found.limits.phi_r)
    return phi_r, dfim_optimum.free_i_rd(found.machine, phi_r)


def usage(point, limits):
    return point.V_s / limits.V_s, point.V_r / limits.V_r, np.hypot(point.i_sd, point.i_sq) / limits.I_s, np.hypot(point.i_rd, point.i_rq) / limits.I_r


def harsh(seed):
    """Return a network whose neurons saturate, cancel and differ in size by orders of magnitude."""
    rng = np.random.default_rng(seed)
    hidden = int(rng.integers(1, 12))
    scale = 10.0 ** rng.uniform(-2, 1.3, hidden)
    W1, B1 = rng.normal(size=(hidden, 2)) * scale[:, None], rng.normal(size=hidden) * scale
    W2, B2 = rng.normal(size=(2, hidden)) * 10.0 ** rng.uniform(-2, 0.7), rng.normal(size=2)
    return Network(W1, B1, W2, B2, Range([10.0, 0.5], [200.0, 9.0]), Range([-8.0, 0.2], [0.0, 7.0]))


@pytest.fixture(scope="module")
def some_map():
    speed, torque = np.linspace(16, 160, 5), np.linspace(1, 14, 4)
    return loss_map.loss_map(IPMSM_2200W, speed, torque, V_max=300.0, I_max=9.0)


@needs_gcc
@pytest.mark.parametrize("seed", range(6))
def test_a_harsh_network_stays_exact_and_defined_too(some_map, tmp_path, seed):
    """Nothing overflows whatever the weights, and the stated bound still holds."""
    network = harsh(seed)
    q15, exported, q = quantised((some_map, network)), compiled(tmp_path, (some_map, network)), q15_points(5_000)
    got, status = exported.q15(q)
    assert np.array_equal(got, q15.evaluate(q))
    x, inside = np.clip(q15.from_q15(q), network.inputs.low, network.inputs.high), status == 0
    assert np.mean(inside) > 0.1
    assert np.all((np.abs(got * q15.y_scale / 2**15 - within_full_scale(q15, network.predict(x))) <= q15.bound)[inside])
    x = points(network, 5_000)
    assert np.all(np.abs(exported.floats(x)["network"] - network.predict(x)) <= fixed_point.float32_bound(network))


@pytest.mark.parametrize("seed", range(20))
def test_no_sum_of_the_q15_network_can_leave_32_bits(seed):
    q15 = fixed_point.quantised(harsh(seed))
    for W, B in ((q15.W1, q15.B1), (q15.W2, q15.B2)):
        assert np.all(np.abs(W) < 2**15)
        assert np.all(np.abs(W).sum(axis=1) * 2**15 + np.abs(B) + 2**14 < 2**31)


def test_the_tanh_table_interpolates_within_its_bound():
    """Largest |tanh''| is 4/(3√3); h²/8 of it, half a step for the entry (one where it saturates), half for the result."""
    bits = np.array([15 - 2])  # 28 fractional bits: 8 units of the argument fit
    z = np.random.default_rng(0).integers(-(9 << 27), 9 << 27, 100_000)
    z[:3] = 0, (8 << 28) - 1, -(8 << 28)
    error = np.abs(fixed_point._tanh(z, bits) / 2**15 - np.tanh(z / 2.0**28))
    assert np.max(error) <= 4 / (3 * np.sqrt(3)) / 64**2 / 8 + 2.0**-15 + 2.0**-16 + 2.0**-21
    assert np.all(fixed_point._tanh(-z, bits) == -fixed_point._tanh(z, bits))


def test_the_float_emulation_errs_within_the_bound(motor):
    """tanh correctly rounded here, so half a unit for it."""
    _, network = motor
    x = points(network, 5_000)
    assert np.all(np.abs(fixed_point.float32_predict(network, x) - network.predict(x)) <= fixed_point.float32_bound(network, tanh_ulps=0.5))


def test_the_table_holds_the_map_with_flags(motor):
    found, _ = motor
    m = found.machine
    lines = [line for line in export.table_csv(found).splitlines() if not line.startswith("#")]
    table = list(csv.DictReader(lines))
    assert len(table) == found.omega_m.size * found.T_e.size
    flags = np.array([int(row["flag"]) for row in table]).reshape(found.best.feasible.shape)
    assert np.array_equal(flags == 2, ~found.best.feasible) and np.array_equal(flags == 1, found.best.limited)
    for row in table:
        if row["flag"] == "2":
            assert {row[name] for name in row if name not in ("omega_m", "T_e", "flag")} == {""}
            continue
        if m is DFIM_4KW:
            torque = 1.5 * m.p * m.M * (float(row["i_sq"]) * float(row["i_rd"]) - float(row["i_sd"]) * float(row["i_rq"]))
        else:
            torque = pmsm.torque(m, *pmsm.branch_currents(m, m.P * float(row["omega_m"]), float(row["i_d"]), float(row["i_q"])))
        assert abs(torque / float(row["T_e"]) - 1) < 1e-5  # seven digits are written


def test_onnx_gives_the_same_currents(motor):
    """By the reference evaluator of the package onnx, in single precision."""
    from onnx.reference import ReferenceEvaluator

    _, network = motor
    x = points(network, 2_000)
    (got,) = ReferenceEvaluator(export.onnx_model(network, "motor")).run(None, {"x": x.astype(np.float32)})
    assert np.all(np.abs(got - network.predict(x)) <= fixed_point.float32_bound(network))


def test_onnx_names_its_range_and_warns_of_the_rest(motor):
    import onnx

    _, network = motor
    model = onnx.load_from_string(export.onnx_model(network, "motor"))
    told = {prop.key: float(prop.value) for prop in model.metadata_props}
    for end, pair in (("low", network.inputs.low), ("high", network.inputs.high)):
        assert np.allclose([told[f"omega_m_{end}"], told[f"torque_{end}"]], pair, rtol=1e-8)
    assert "extrapolates" in model.doc_string


def test_files_are_written_whole_and_named_after_the_machine(some_map, tmp_path):
    made = export.files(some_map, harsh(0))
    assert set(made) == {"ipmsm_2_2_kw.h", "ipmsm_2_2_kw.csv", "ipmsm_2_2_kw.onnx"}
    assert {path.name: path.read_bytes() for path in export.write(tmp_path / "new", made)} == made


def example(**changes):
    """Return a reader's record of your_motor: the published parameters, some of them changed."""
    published = json.loads((REPOSITORY / "figures/beyond/your_motor.json").read_text())["parameters"]
    return SimpleNamespace(item="beyond/your_motor", published=False, parameters={**published, **changes})


def test_other_numbers_never_go_under_the_examples_name():
    assert export.own_name(example()) == "IPMSM 2.2 kW"
    for changes in ({"R_s": 2.0}, {"I_max": 12.0}, {"torque_range": [0.2, 1.0]}):
        assert export.own_name(example(**changes)) == "IPMSM 2.2 kW, changed"
    assert export.own_name(example(name="mine", R_s=2.0), ["IPMSM 900 W"]) == "mine"
    with pytest.raises(ValueError, match="a name of its own"):
        export.own_name(example(name="ipmsm 900 W"), ["IPMSM 900 W"])


def test_a_readers_files_lie_beside_his_run_and_published_ones_in_build(tmp_path, monkeypatch):
    monkeypatch.setenv("DRIVELIB_ROOT", str(tmp_path / "pack"))
    for published, folder in ((False, tmp_path / "run" / "exports"), (True, tmp_path / "pack" / "build" / "exports")):
        export.keep(SimpleNamespace(published=published, folder=tmp_path / "run"), {"motor.h": b"x"})
        assert (folder / "motor.h").read_bytes() == b"x"


@pytest.mark.parametrize("stem", ["your_motor", "your_dfim"])
def test_a_notebook_exports_after_everything_else(stem):
    """So that a run that fails leaves no firmware behind: nothing is written before finish, and nothing follows."""
    cells = ["".join(cell["source"]) for cell in notebook.read(paths.notebook(f"beyond/{stem}"))["cells"] if cell["cell_type"] == "code"]
    assert [line for line in cells[-1].splitlines()] == ["item.finish()", "export.keep(item, made);"]
    assert not any(re.search(r"export\.(keep|write)\(|write_(bytes|text)\(", cell) for cell in cells[:-1])


@pytest.mark.parametrize(("name", "wanted"), [("IPMSM 2.2 kW", "ipmsm_2_2_kw"), ("900 W", "motor_900_w"), ("Größe */", "gr_e")])
def test_a_machines_name_becomes_an_identifier(name, wanted):
    assert export.c_name(name) == wanted


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f, n: (f, Network(n.W1, n.B1, n.W2, n.B2, n.inputs, n.targets, "logistic")), "only 'tanh'"),
        (lambda f, n: (f, Network(n.W1 * 1e4, n.B1, n.W2, n.B2, n.inputs, n.targets)), "too large for Q15"),
        (lambda f, n: (f, Network(n.W1, n.B1, n.W2[:1], n.B2[:1], n.inputs, Range([0.0], [1.0]))), "must be 2 and 2"),
        (lambda f, n: (loss_map.loss_map(f.machine.changed(R_s=0.0), f.omega_m, f.T_e, V_max=300, I_max=9), n), "R_s = 0 ohm"),
    ],
)
def test_what_cannot_be_exported_is_refused(some_map, change, message):
    with pytest.raises(ValueError, match=message):
        export.c_header(*change(some_map, harsh(3)))


def test_a_name_without_letters_is_refused():
    with pytest.raises(ValueError, match="must hold a letter"):
        export.c_name("±∞")
