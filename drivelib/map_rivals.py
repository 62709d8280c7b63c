"""Four ways to hold the least-loss currents of a PMSM: network, look-up table, closed form, exact formula.

Each has a vectorised form, (speed, torque) → (i_d, i_q) for arrays, which `loss_map.network_error` judges, and an
algorithm of scalars, which `operations.counted` counts. The tests hold one against the other.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from drivelib import loss_map, operations, pmsm, pmsm_optimum
from drivelib.validation import number

SINGLE = 4  # bytes


@dataclass(frozen=True)
class Rival:
    """One way: ``currents`` of arrays, ``algorithm`` of scalars, ``memory`` of its constants (bytes)."""

    name: str
    currents: callable
    algorithm: callable
    memory: int


@dataclass(frozen=True)
class Cost:
    """What a rival costs on a map: loss above the least and torque error, worst and mean (%), voltage beyond the limit,
    worst (% of it), memory (bytes), and cycles, mean and worst over the map.
    """

    loss: float
    mean_loss: float
    torque: float
    voltage: float
    memory: int
    cycles: float
    worst_cycles: float


def network(trained):
    """Return a trained network (two inputs, two outputs, tanh) as a `Rival`, in single precision."""
    W1, B1, W2, B2 = trained.folded()
    rows = [tuple(map(float, row)) for row in np.column_stack([W1, B1, W2.T])]
    low, high = trained.inputs.low, trained.inputs.high

    def algorithm(omega_m, T_e):
        x, y = _clamped(omega_m, low[0], high[0]), _clamped(T_e, low[1], high[1])
        i_d, i_q = float(B2[0]), float(B2[1])
        for w, t, bias, to_d, to_q in rows:
            hidden = (bias + w * x + t * y).tanh()
            i_d, i_q = i_d + to_d * hidden, i_q + to_q * hidden
        return i_d, i_q

    def currents(x):
        return trained.predict(np.clip(x, low, high))

    return Rival(f"network, {B1.size} neurons", currents, algorithm, SINGLE * (W1.size + B1.size + W2.size + B2.size))


def table(found, data, points, headroom=0.95):
    """Return a bilinear look-up table, ``points`` × ``points`` over speed and torque, as a `Rival`.

    Its nodes are fitted to ``data`` (`loss_map.training_data`) by least squares, so that a table learns what a network
    learns. Where no point says otherwise a node keeps the optimum there, beyond the torque limit that at the limit.

    Raises
    ------
    ValueError
        If ``points`` is less than 2, or a speed of the table has no torque inside the limits.
    """
    points = number("points", points, "per axis", at_least=2, whole=True)
    speed = np.linspace(found.omega_m[0], found.omega_m[-1], points)
    torque = np.linspace(found.T_e[0], found.T_e[-1], points)
    limit = loss_map.torque_limit(found, speed, headroom)
    if np.isnan(limit).any():
        raise ValueError(f"{found.machine.name}: at {speed[np.isnan(limit)][0]:.4g} rad/s no torque is inside the limits: the table would have a hole")
    held = np.minimum(torque[None, :], limit[:, None])
    best = pmsm_optimum.optimum(found.machine, found.machine.P * speed[:, None], held, V_max=found.V_max, I_max=found.I_max)
    nodes = np.stack([best.i_d, best.i_q], axis=-1)
    hats = [np.maximum(1 - np.abs(x[:, None] - axis) / (axis[1] - axis[0]), 0) for x, axis in zip(data.x.T, (speed, torque), strict=True)]
    shares = np.einsum("ki,kj->kij", *hats).reshape(len(data.x), -1)
    off = data.t - shares @ nodes.reshape(-1, 2)
    nodes = nodes + np.linalg.lstsq(shares, off, rcond=1e-6)[0].reshape(nodes.shape)  # the least change where data is silent
    interpolate = RegularGridInterpolator((speed, torque), nodes)
    values = nodes.tolist()
    per_speed, per_torque = 1.0 / (speed[1] - speed[0]), 1.0 / (torque[1] - torque[0])

    def algorithm(omega_m, T_e):
        x = (_clamped(omega_m, speed[0], speed[-1]) - speed[0]) * per_speed
        y = (_clamped(T_e, torque[0], torque[-1]) - torque[0]) * per_torque
        row, column = x.whole(points - 2), y.whole(points - 2)
        u, v = x - float(row), y - float(column)
        found_ = []
        for k in (0, 1):
            corner = [[x.fetched(values[row + m][column + n][k]) for n in (0, 1)] for m in (0, 1)]
            near, far = (side[0] + v * (side[1] - side[0]) for side in corner)
            found_.append(near + u * (far - near))
        return tuple(found_)

    return Rival(f"table, {points} × {points}", interpolate, algorithm, SINGLE * nodes.size)


def table_for(found, data, memory, headroom=0.95):
    """Return the largest square table that fits into ``memory`` (bytes)."""
    return table(found, data, int((number("memory", memory, "bytes", at_least=2 * 4 * SINGLE) / (2 * SINGLE)) ** 0.5), headroom)


def closed_form(machine, passes=3):
    """Return the closed form without limits as a `Rival`: the quadratic of `pmsm_optimum.optimal_i_od_at_i_oq`, iterated.

    Each pass takes i_d of least loss at the present i_q, and i_q that makes the torque with that i_d.
    """
    passes = number("passes", passes, at_least=1, whole=True)
    m, R_s, G = machine, machine.R_s, 1.0 / machine.R_c
    scale, L_d2, L_q2, delta = G * (1.0 + R_s * G), machine.L_d**2, machine.L_q**2, machine.delta_L

    def algorithm(omega_m, T_e):
        w = m.P * omega_m
        g = w * w * scale
        under = 1.0 / (R_s + g * L_d2)
        b, k = g * (m.psi_f * m.L_d) * under, (R_s + g * L_q2) * under
        a, k = m.psi_f - b * delta, 4.0 * delta**2 * k
        q = T_e * (1.0 / (1.5 * m.P))
        i_oq = q * (1.0 / m.psi_f)
        for _ in range(passes):
            bend = k * i_oq * i_oq
            i_od = bend * (0.5 / delta) / (a + (a * a + bend).sqrt()) - b if delta else -b
            i_oq = q / (m.psi_f + delta * i_od)
        return i_od - w * (m.L_q * G) * i_oq, i_oq + w * G * (m.psi_f + m.L_d * i_od)

    def currents(x):
        omega_e, T_e = m.P * x[..., 0], x[..., 1]
        i_oq = T_e / (1.5 * m.P * m.psi_f)
        for _ in range(passes):
            i_od = pmsm_optimum.optimal_i_od_at_i_oq(m, omega_e, i_oq)
            i_oq = pmsm.i_oq_at_torque(m, T_e, i_od)
        return np.stack(pmsm.terminal_currents(m, omega_e, i_od, i_oq), axis=-1)

    return Rival("closed form, no limits", currents, algorithm, SINGLE * 12)


def exact(found):
    """Return the exact optimum inside the limits as a `Rival`: Newton's method, as `export_c_pmsm.FORMULA` has it."""
    machine = found.machine

    def currents(x):
        best = pmsm_optimum.optimum(machine, machine.P * x[..., 0], x[..., 1], V_max=found.V_max, I_max=found.I_max)
        return np.nan_to_num(np.stack([best.i_d, best.i_q], axis=-1))  # out of reach nothing is asked for

    return Rival("exact formula", currents, lambda omega_m, T_e: _optimum(machine, found.V_max, found.I_max, omega_m, T_e), SINGLE * 10)


def cost(found, rival, headroom=0.95, *, every=3, costs=operations.CORTEX_M4F):
    """Return the `Cost` of a rival on a map; cycles are counted at each ``every``-th speed and torque that is asked for.

    Raises
    ------
    ValueError
        If ``every`` leaves no point.
    """
    every = number("every", every, "points", at_least=1, whole=True)
    error = loss_map.network_error(found, rival.currents, headroom)
    asked = np.zeros(error.excess.shape, dtype=bool)
    asked[::every, ::every] = np.isfinite(error.excess[::every, ::every])
    if not asked.any():
        raise ValueError(f"every = {every} points: no point of the map is left to count at")
    rows = np.argwhere(asked)
    counts = [operations.cycles(operations.counted(rival.algorithm, found.omega_m[i], found.T_e[j])[1], costs) for i, j in rows]
    excess = 100 * error.excess / found.best.loss
    torque = 100 * np.nanmax(np.abs(error.torque)) / found.machine.T_rated
    return Cost(
        float(np.nanmax(excess)), float(np.nanmean(excess)), float(torque), float(100 * np.nanmax(error.voltage)),
        rival.memory, float(np.mean(counts)), float(np.max(counts)),
    )  # fmt: skip


def _clamped(value, low, high):
    if value < low:
        return value * 0.0 + low
    return value * 0.0 + high if value > high else value


def _optimum(m, V_max, I_max, omega_m, T_e):
    """The C function of `export_c_pmsm.FORMULA`, operation by operation."""
    w, q, G = m.P * omega_m, T_e * (1.0 / (1.5 * m.P)), 1.0 / m.R_c
    scaled, wG = w * (1.0 + m.R_s * G), w * G
    loss = (m.R_s, w * w * (G * (1.0 + m.R_s * G)), None)
    limits = (((m.R_s**2, scaled * scaled, scaled * (2.0 * m.R_s)), V_max**2), ((1.0, wG * wG, 2.0 * wG), I_max**2))
    free = i = _bottom(m, loss, q)
    for form, bound in limits:
        edge = _edge(m, form, bound, q, free)
        if abs(edge - free) > abs(i - free):
            i = edge
    for form, bound in limits:
        _ = _value(m, form, i, q) > bound * (1.0 + 1e-6)
    i_oq = q / (m.psi_f + m.delta_L * i)
    return i - w * (m.L_q * G) * i_oq, i_oq + wG * (m.psi_f + m.L_d * i)


def _value(m, form, i, q):
    p, g, c = form
    flux, ratio = m.psi_f + m.L_d * i, q / (m.psi_f + m.delta_L * i)
    return p * i * i + g * flux * flux + (p + g * m.L_q**2) * ratio * ratio + c * q


def _bottom(m, form, q):
    p, g, _ = form
    under = 1.0 / (p + g * m.L_d**2)
    b, k = g * (m.psi_f * m.L_d) * under, (p + g * m.L_q**2) * under
    a = m.psi_f - b * m.delta_L
    ratio = m.delta_L * q / (a * a)
    mu = k * ratio * ratio
    excess = mu.sqrt().sqrt()
    for _ in range(30):
        y = 1.0 + excess
        squared = y * y
        step = (squared * y * excess - mu) / (squared * (4.0 * excess + 1.0))
        excess = excess - step
        if not abs(step) > 1e-7 * excess:
            break
    x = a * (1.0 + excess)
    ratio = q / x
    return m.delta_L * k * ratio * ratio / x - b


def _edge(m, form, bound, q, i):
    p, g, _ = form
    bottom = _bottom(m, form, q)  # whether the limit can be met at all: every point asked for can
    _ = _value(m, form, bottom, q) > bound
    for _ in range(60):
        excess = _value(m, form, i, q) - bound
        if not excess > 1e-6 * bound:
            break
        ratio = q / (m.psi_f + m.delta_L * i)
        slope = 2.0 * (p * i + g * m.L_d * (m.psi_f + m.L_d * i) - (p + g * m.L_q**2) * m.delta_L * ratio * ratio / (m.psi_f + m.delta_L * i))
        i = i - excess / slope
    return i
