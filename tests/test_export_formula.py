"""A PMSM's exported formula, and the torque limit of every motor, compiled: held against the optimum in double precision."""

import numpy as np

from drivelib import export, loss_map, pmsm, pmsm_optimum
from exported_c import UNIT, compiled, made_torque, needs_gcc, outside_points, points, single_range


def optima(found, x, margin):
    """Return the optimum inside a map's limits, inside tighter ones and inside wider ones, ``margin`` (relative) apart."""
    m, scales = found.machine, (1, 1 - margin, 1 + margin)
    return [pmsm_optimum.optimum(m, m.P * x[:, 0], x[:, 1], V_max=found.V_max * scale, I_max=found.I_max * scale) for scale in scales]


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
    best, tighter, wider = optima(found, x, 1e-4)
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
    free = pmsm_optimum.optimum(machine, omega_e, T_e)
    away = np.abs(free.V_s / found.V_max - 1)[clear] > 1e-4
    away &= np.abs(np.hypot(free.i_d, free.i_q) / found.I_max - 1)[clear] > 1e-4
    assert np.array_equal(moved[away], best.limited[clear][away])


@needs_gcc
def test_compiled_formula_holds_for_either_sign_and_beyond_the_range(pmsm_motor, tmp_path):
    """Torque as asked, least loss of braking and reverse inside the limits, against the optimum in double precision; no torque too."""
    found, network = pmsm_motor
    m, allowed, x = found.machine, 64 * UNIT, outside_points(network)
    out = compiled(tmp_path, pmsm_motor).floats(x)
    best, tighter, wider = optima(found, x, 1e-3)
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
def test_beyond_the_range_the_torque_limit_is_none_and_reverse_is_forwards(motor, tmp_path):
    network = motor[1]
    x = outside_points(network)
    exported = compiled(tmp_path, motor)
    out, forwards = exported.floats(x)["limit"], exported.floats(np.abs(x))["limit"]
    assert np.array_equal(out, forwards)
    assert np.all(out[np.abs(x[:, 0]) > single_range(network)[1][0]] == 0) and np.any(out > 0)
