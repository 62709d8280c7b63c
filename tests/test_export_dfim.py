"""What a DFIM's header has of its own, compiled: formula of the references, currents and stator frequency."""

import numpy as np
import pytest

from drivelib import dfim_optimum, loss_map
from drivelib.dfim_machines import DFIM_4KW
from exported_c import DFIM_MAIN, UNIT, compiled, made, needs_gcc, outside_points, points, single_range


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


def references(found, torque):
    """Return what the formula gives before any inverter limit."""
    phi_r = np.minimum(dfim_optimum.free_flux(found.machine, torque), found.limits.phi_r)
    return phi_r, dfim_optimum.free_i_rd(found.machine, phi_r)


def usage(point, limits):
    return point.V_s / limits.V_s, point.V_r / limits.V_r, np.hypot(point.i_sd, point.i_sq) / limits.I_s, np.hypot(point.i_rd, point.i_rq) / limits.I_r


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
def test_the_dfims_closed_form_is_the_same_forwards_and_in_reverse(tmp_path):
    """Turning both signs changes neither references nor status, and turns the stator frequency."""
    _, network = motor = made(DFIM_4KW)
    x = outside_points(network)
    exported = compiled(tmp_path, motor)
    there, back = exported.floats(x), exported.floats(-x)
    assert np.array_equal(there["flag"], back["flag"]) and np.array_equal(there["optimum"], back["optimum"])
    drive = compiled(tmp_path, motor, main=DFIM_MAIN)
    turning = np.column_stack([x[:, 1], x[:, 0] / 100, np.ones(len(x))])
    assert np.array_equal(drive.references(turning)[:, 3], -drive.references(turning * [-1, -1, 1])[:, 3])


@needs_gcc
def test_compiled_dfim_currents_make_torque_and_flux(tmp_path):
    """From the flux equations and the torque of two vectors, with braking torque too; and the stator frequency at 100 times the flux as speed."""
    found, _ = motor = made(DFIM_4KW)
    m, rng = found.machine, np.random.default_rng(5)
    x = np.column_stack([rng.uniform(-25, 25, 2000), rng.uniform(0.1, 1, 2000), rng.uniform(-3, 8, 2000)]).astype(np.float32).astype(float)
    out = compiled(tmp_path, motor, main=DFIM_MAIN).references(x)
    i_s, i_r = out[:, 0] + 1j * out[:, 1], x[:, 2] + 1j * out[:, 2]
    phi_r = m.L_r * i_r + m.M * i_s
    omega_s = dfim_optimum.stator_frequency(m, 100 * x[:, 1], x[:, 0], found.limits)
    assert np.all(abs(out[:, 3] / omega_s - 1) <= 64 * UNIT)
    size = m.L_r * abs(i_r) + m.M * abs(i_s)
    assert np.all(abs(phi_r - x[:, 1]) <= 64 * UNIT * size)
    torque = 1.5 * m.p * m.M * (np.conj(i_r) * i_s).imag
    assert np.all(abs(torque - x[:, 0]) <= 64 * UNIT * 1.5 * m.p * m.M * abs(i_r) * abs(i_s))


@needs_gcc
def test_the_dfims_references_hold_flux_and_limits_outside_the_range(tmp_path):
    """Flux never below that of the lowest torque; braking and reverse, with currents and frequency of the header, strain no limit more than motoring."""
    found, network = motor = made(DFIM_4KW)
    m, exported, x = found.machine, compiled(tmp_path, motor), outside_points(network)
    out = exported.floats(x)
    x, (phi_r, i_rd) = x[out["status"] == 3], out["network"][out["status"] == 3].T
    low, high = single_range(network)
    inside = np.clip(np.abs(x), low, high)
    drive = compiled(tmp_path, motor, main=DFIM_MAIN)

    def excess(x):
        currents = drive.references(np.column_stack([x[:, 1], phi_r, i_rd]))[:, :3]
        frequency = drive.references(np.column_stack([x[:, 1], x[:, 0] / 100, i_rd]))[:, 3]
        state = dfim_optimum.point(m, *x.T, phi_r, i_rd, frequency)
        assert np.allclose(currents, np.column_stack([state.i_sd, state.i_sq, state.i_rq]), atol=1e-4)
        return dfim_optimum.excess(state, found.limits)

    assert np.all(phi_r >= 0.9 * min(dfim_optimum.free_flux(m, low[1]), found.limits.phi_r))
    reached = inside[:, 1] <= loss_map.torque_limit(found, inside[:, 0], 0.95)
    assert np.sum(reached) > 200
    assert np.all((excess(x) <= excess(inside) + 1e-3)[reached])
