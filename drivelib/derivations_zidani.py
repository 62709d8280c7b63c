"""Equations (1)-(20) of Zidani, Brakta and Bendjeghaba, as printed, as mended, and as derived from the ones before them.

`symbolic` says how an equation passes. Errors are those of the default machine at rated speed, torque and flux:
in a transient with i_rd = 1 A, where no term vanishes, or oriented as (11) says. (21)-(24) are the fuzzy
controller's and are tested on it.
"""

from functools import cache

import sympy as sp

from drivelib import dfim_decoupling, symbolic
from drivelib.dfim_machines import DFIM_4KW
from drivelib.symbolic import Equation
from drivelib.validation import nearest

R_s, R_r, L_s, L_r, M, p, J, f, c = sp.symbols("R_s R_r L_s L_r M p J f c", positive=True)
i_sd, i_sq, i_rd, i_rq, di_sd, di_sq, di_rd, di_rq = sp.symbols("i_sd i_sq i_rd i_rq di_sd di_sq di_rd di_rq", real=True)
phi_sd, phi_sq, phi_rd, phi_rq = sp.symbols("phi_sd phi_sq phi_rd phi_rq", real=True)
dphi_sd, dphi_sq, dphi_rd, dphi_rq = sp.symbols("dphi_sd dphi_sq dphi_rd dphi_rq", real=True)
w_s, w_r, w_m, dw_m, C_em, C_r, phi_ref, C_ref = sp.symbols("omega_s omega_r Omega dOmega C_em C_r phi_ref C_ref", real=True)
K_p, K_i, K_m, T_m, w_n, xi = sp.symbols("K_p K_i K_m T_m omega_n xi", positive=True)
laplace = sp.Symbol("s")
j, HALF3 = sp.I, sp.Rational(3, 2)

# Dimensions as powers of volt, ampere, second.
DIMENSIONS = {
    **dict.fromkeys((R_s, R_r), (1, -1, 0)),
    **dict.fromkeys((L_s, L_r, M), (1, -1, 1)),
    **dict.fromkeys((i_sd, i_sq, i_rd, i_rq), (0, 1, 0)),
    **dict.fromkeys((di_sd, di_sq, di_rd, di_rq), (0, 1, -1)),
    **dict.fromkeys((phi_sd, phi_sq, phi_rd, phi_rq, phi_ref), (1, 0, 1)),
    **dict.fromkeys((dphi_sd, dphi_sq, dphi_rd, dphi_rq), (1, 0, 0)),
    **dict.fromkeys((w_s, w_r, w_m, w_n, laplace), (0, 0, -1)),
    **dict.fromkeys((C_em, C_r, C_ref, K_i), (1, 1, 1)),
    **dict.fromkeys((f, c, K_p), (1, 1, 2)),
    **dict.fromkeys((p, xi), (0, 0, 0)),
    dw_m: (0, 0, -2),
    J: (1, 1, 3),
    K_m: (-1, -1, -2),
    T_m: (0, 0, 1),
}
VOLT, AMPERE, WEBER, NEWTON_METRE, NONE = (1, 0, 0), (0, 1, 0), (1, 0, 1), (1, 1, 1), (0, 0, 0)
FLUXES = {phi_sd: L_s * i_sd + M * i_rd, phi_sq: L_s * i_sq + M * i_rq, phi_rd: L_r * i_rd + M * i_sd, phi_rq: L_r * i_rq + M * i_sq}
FLUX_SLOPES = {
    dphi_sd: L_s * di_sd + M * di_rd, dphi_sq: L_s * di_sq + M * di_rq,
    dphi_rd: L_r * di_rd + M * di_sd, dphi_rq: L_r * di_rq + M * di_sq,
}  # fmt: skip


def equation(name):
    """Return the `Equation` called ``name``, such as "eq13".

    Raises
    ------
    ValueError
        If there is none; the nearest is suggested.
    """
    return symbolic.named(zidani(), name, "Zidani")


def evidence(name, machine=DFIM_4KW):
    """Return what `record.compare` takes for one equation; see `symbolic.evidence`."""
    eq = equation(name)
    return symbolic.evidence(eq, rated_point(machine, oriented=eq.at == "oriented"), DIMENSIONS)


def rated_point(machine=DFIM_4KW, *, oriented=False, phi_r=0.85, omega_n=20.0, damping=0.7):
    """Return values for all symbols at rated speed and torque, consistent among themselves.

    The frame takes half the electrical speed. ``oriented``: steady, i_rd = 0 and φ_rq = 0, as (11) says; else
    i_rd = 1 A, i_rq 1 A off, and currents and speed in change, so that no term of (1)-(15) vanishes.
    """
    names = {R_s: "R_s", R_r: "R_r", L_s: "L_s", L_r: "L_r", M: "M", p: "p", J: "J", f: "f", w_m: "omega_m_rated", C_ref: "T_rated"}
    values = {symbol: sp.Rational(str(getattr(machine, name))) for symbol, name in names.items()}
    flux, off = sp.Rational(str(phi_r)), 0 if oriented else 1
    quadrature = 2 * L_r * C_ref / (3 * p * M * flux)
    found = {i_sd: flux / M, i_sq: quadrature, i_rd: sp.Integer(off), i_rq: -M / L_r * quadrature + off}
    values |= {symbol: value.subs(values) for symbol, value in found.items()}
    values |= {slope: sp.Integer(off * number) for slope, number in zip((di_sd, di_sq, di_rd, di_rq), (100, -150, 50, 200), strict=True)}
    values |= {w_s: values[p] * values[w_m] / 2, w_r: -values[p] * values[w_m] / 2}
    values |= {symbol: value.subs(values) for symbol, value in (FLUXES | FLUX_SLOPES).items()}
    values |= {C_em: (HALF3 * p * M / L_r * (phi_rd * i_sq - phi_rq * i_sd)).subs(values), C_r: values[C_ref] / 2, dw_m: sp.Integer(10)}
    values |= {phi_ref: flux, c: values[f]}
    natural, xi_value = sp.Rational(str(omega_n)), sp.Rational(str(damping))
    values |= {w_n: natural, xi: xi_value, laplace: j * natural}
    return values | {
        K_p: 2 * xi_value * natural * values[J] - values[f], K_i: values[J] * natural**2,
        K_m: 1 / (values[f] or sp.Rational(1, 1000)), T_m: values[J] / (values[f] or sp.Rational(1, 1000)),
    }  # fmt: skip


def seen_from_a_turning_frame(resistance, current, flux, slope, speed):
    """Return the winding's voltage in a frame that turns at ``speed`` against it, from v = R i + dφ/dt in the winding's own frame."""
    time = sp.Symbol("t", real=True)
    angle, turning = sp.Function("theta")(time), sp.Function("phi")(time)
    own = resistance * current * sp.exp(j * angle) + sp.diff(turning * sp.exp(j * angle), time)
    seen = sp.expand(own * sp.exp(-j * angle))
    return seen.subs(sp.Derivative(turning, time), slope).subs(sp.Derivative(angle, time), speed).subs(turning, flux)


def linked_by_windings(self_inductance, own, other):
    """Return the flux of three windings in the frame, from the frame's currents ``own`` in them and ``other`` in the other three.

    Two windings on one axis have the mutual inductance 2M/3. The frame's angle, seen from the windings and from the
    others, enters as the unit vectors u and w, and must drop out.
    """
    u, w = sp.symbols("u w")
    third = sp.Rational(-1, 2) + j * sp.sqrt(3) / 2

    def winding(vector, unit):
        return (vector * unit + sp.conjugate(vector) / unit) / 2  # d cos − q sin of the unit vector's angle

    flux = 0
    for k in range(3):
        linked = self_inductance * winding(own, u * third**-k)
        for n in range(3):
            between = u / w * third ** (n - k)
            linked += sp.Rational(2, 3) * M * (between + 1 / between) / 2 * winding(other, w * third**-n)
        flux += sp.Rational(2, 3) * linked * third**k / u
    return sp.simplify(sp.expand(sp.radsimp(sp.expand(flux))))


def _parts(vector):
    return vector.as_real_imag()


def _torque_from_power(factor):
    """Return the mechanical power over speed that (6)-(9) leave beside copper loss and field energy, in φ_r and i_s."""
    i_s, phi_r = i_sd + j * i_sq, phi_rd + j * phi_rq
    i_r = (phi_r - M * i_s) / L_r  # (4) mended
    phi_s = L_s * i_s + M * i_r
    rotational = _parts(sp.expand(sp.conjugate(i_s) * j * w_s * phi_s + sp.conjugate(i_r) * j * w_r * phi_r))[0]
    return sp.expand(sp.cancel(factor * rotational.subs(w_s, w_r + p * w_m) / w_m))


@cache
def zidani():
    """Return the equations (1)-(20) with their derivations."""
    vectors = (i_sd + j * i_sq, phi_sd + j * phi_sq, dphi_sd + j * dphi_sq), (i_rd + j * i_rq, phi_rd + j * phi_rq, dphi_rd + j * dphi_rq)
    (i_s, phi_s, dphi_s), (i_r, phi_r, dphi_r) = vectors
    stator, rotor = R_s * i_s + dphi_s + j * w_s * phi_s, R_r * i_r + dphi_r + j * w_r * phi_r
    from_rotor = seen_from_a_turning_frame(R_r, i_r, phi_r, dphi_r, w_r)

    speed = sp.Function("Omega")(sp.Symbol("t"))
    power = f * speed**2 + C_r * speed + sp.diff(J * speed**2 / 2, sp.Symbol("t"))
    motion = sp.expand(power / speed).subs(sp.Derivative(speed, sp.Symbol("t")), dw_m).subs(speed, w_m)

    (v_sd, v_sq), (v_rd, v_rq) = _parts(sp.expand(stator)), _parts(sp.expand(rotor))
    k = sp.Symbol("k")
    k_r, k_s = sp.solve(M - k * L_r, k)[0], sp.solve(M - k * L_s, k)[0]  # no slope of the other winding's current is left
    combined = v_sd - k_r * v_rd, v_sq - k_r * v_rq, v_rd - k_s * v_sd, v_rq - k_s * v_sq
    in_currents = tuple(sp.expand(part.subs(FLUX_SLOPES)) for part in combined)
    sigma = 1 - M**2 / (L_s * L_r)
    regulated = (
        R_s * i_sd + sigma * L_s * di_sd, R_s * i_sq + sigma * L_s * di_sq,
        R_r * i_rd + sigma * L_r * di_rd, R_r * i_rq + sigma * L_r * di_rq,
    )  # fmt: skip
    coupling = (
        -R_r * M / L_r * i_rd - phi_sq * w_s + M / L_r * phi_rq * w_r, -R_r * M / L_r * i_rq + phi_sd * w_s - M / L_r * phi_rd * w_r,
        -R_s * M / L_s * i_sd - w_r * phi_rq + M / L_s * phi_sq * w_s, -R_s * M / L_s * i_sq + w_r * phi_rd - M / L_s * phi_sd * w_s,
    )  # fmt: skip
    compensation = dfim_decoupling.compensation_terms(i_sd, i_sq, i_rd, i_rq, w_s, w_r, R_s, R_r, L_s, L_r, M)
    whole = tuple(part.subs(FLUXES) for part in in_currents)
    alone = tuple(sp.expand(a - b) for a, b in zip(whole, compensation, strict=True))
    currents, slopes = (i_sd, i_sq, i_rd, i_rq), (di_sd, di_sq, di_rd, di_rq)
    lags = tuple(1 / (R + sigma * L * slope / i) for R, L, i, slope in zip((R_s, R_s, R_r, R_r), (L_s, L_s, L_r, L_r), currents, slopes, strict=True))
    index_dropped = i_sd / whole[0], i_sq / alone[1], i_rd / whole[2], i_rq / alone[3]

    torque = HALF3 * p * M / L_r * (phi_rd * i_sq - phi_rq * i_sd)
    from_power = _torque_from_power(HALF3)
    oriented = {phi_rq: 0, i_rd: 0}
    i_rq_oriented = sp.solve(FLUXES[phi_rq], i_rq)[0]
    flux_current = sp.solve(FLUXES[phi_rd].subs(oriented) - phi_ref, i_sd)[0]
    torque_current = sp.solve(torque.subs(oriented) - C_ref, i_sq)[0].subs(phi_rd, phi_ref)
    printed_q = L_r / (p * M * phi_ref) * C_ref, -C_ref / (p * phi_ref)
    stator_by_rotor = {i_sd: (phi_rd - L_r * i_rd) / M, i_sq: (phi_rq - L_r * i_rq) / M}  # (4) mended
    by_rotor = sp.expand(torque.subs(stator_by_rotor, simultaneous=True)).subs(i_rd, 0)
    K_em = -HALF3 * p * phi_rd

    def closed(plant_gain, plant_time):
        return (plant_gain * (K_p * laplace + K_i) / plant_time) / (
            laplace**2 + laplace * (1 + plant_gain * K_p) / plant_time + plant_gain * K_i / plant_time
        )

    def with_plant(plant):
        loop = (K_p + K_i / laplace) * plant
        return sp.cancel(loop / (1 + loop))

    gains = sp.solve([(1 + K_m * K_p) / T_m - 2 * xi * w_n, K_m * K_i / T_m - w_n**2], [K_p, K_i], dict=True)[0]
    same, missing = "derived", "the 3/2 of (10) is missing"
    frequency = "with ω_R = pΩ − ω_S, which (8), (9) and (13) do not have"
    invariant = "in a power-invariant frame, in which (10) would carry no 3/2"
    return {
        "eq01": Equation(stator, {same: seen_from_a_turning_frame(R_s, i_s, phi_s, dphi_s, w_s)}, dimension=VOLT),
        "eq02": Equation(
            R_r * i_r + dphi_r - j * w_r * phi_r, {same: from_rotor}, rotor, "the sign of jω_R φ_R must be plus", dimension=VOLT,
            elsewhere={frequency: from_rotor.subs(w_r, -w_r)},
        ),
        "eq03": Equation(L_s * i_s + M * i_r, {same: linked_by_windings(L_s, i_s, i_r)}, dimension=WEBER),
        "eq04": Equation(
            L_r * i_r + M * i_r, {same: linked_by_windings(L_r, i_r, i_s)},
            L_r * i_r + M * i_s, "the second current must be I_S", dimension=WEBER,
        ),
        "eq05": Equation(J * dw_m + f * w_m + C_r, {same: motion}, dimension=NEWTON_METRE),
        "eq06": Equation(R_s * i_sd + dphi_sd - w_s * phi_sq, {same: v_sd}, dimension=VOLT),
        "eq07": Equation(R_s * i_sq + dphi_sq + w_s * phi_sd, {same: v_sq}, dimension=VOLT),
        "eq08": Equation(R_r * i_rd + dphi_rd - w_r * phi_rq, {same: v_rd}, dimension=VOLT),
        "eq09": Equation(R_r * i_rq + dphi_rq + w_r * phi_rd, {same: v_rq}, dimension=VOLT),
        "eq10": Equation(
            3 * p * M / (2 * L_r) * (phi_rd * i_sq - phi_rq * i_sd),
            {"amplitude-invariant Park transformation": from_power, "power-invariant Park transformation": _torque_from_power(1)},
            dimension=NEWTON_METRE,
        ),
        "eq11": Equation(-M / L_r * i_sq, {same: i_rq_oriented}, at="oriented", dimension=AMPERE),
        "eq12": Equation((v_sd - M / L_r * v_rd, v_sq - M / L_r * v_rq, v_rd - M / L_s * v_sd, v_rq - M / L_s * v_sq), {same: combined}, dimension=VOLT),
        "eq13": Equation(tuple(a + b for a, b in zip(regulated, coupling, strict=True)), {same: in_currents}, dimension=VOLT),
        "eq14": Equation(tuple(a + b for a, b in zip(regulated, compensation, strict=True)), {same: whole}, dimension=VOLT),
        "eq15": Equation(
            index_dropped, {same: lags}, tuple(i / v for i, v in zip(currents, alone, strict=True)),
            "V_tSd and V_tRd must be V_tSdc and V_tRdc", dimension=(-1, 1, 0),
        ),
        "eq16": Equation((L_r / M * phi_ref, sp.Integer(0)), {same: (flux_current, sp.Integer(0))}, (phi_ref / M, sp.Integer(0)), "i_sd* must be φ*/M", at="oriented", dimension=AMPERE),
        "eq16/q": Equation(
            printed_q, {same: (torque_current, i_rq_oriented.subs(i_sq, torque_current))}, tuple(sp.Rational(2, 3) * part for part in printed_q),
            missing, at="oriented", dimension=AMPERE,
            elsewhere={invariant: (HALF3 * torque_current, HALF3 * i_rq_oriented.subs(i_sq, torque_current))},
        ),
        "eq17": Equation(
            -p * phi_rd * i_rq, {same: by_rotor}, K_em * i_rq, missing, at="oriented", dimension=NEWTON_METRE,
            elsewhere={invariant: by_rotor / HALF3},
        ),
        "eq18": Equation(K_em * i_rq - f * w_m - C_r, {same: sp.solve(motion - by_rotor, dw_m)[0] * J}, at="oriented", dimension=NEWTON_METRE),
        "eq19": Equation(
            closed(p / c, J / c), {same: with_plant(1 / (J * laplace + f))}, closed(1 / f, J / f), "K_m must be 1/f, and c is f",
            elsewhere={"if P times the controller's output were the torque": with_plant(p / (J * laplace + f))}, dimension=NONE,
        ),
        "eq20": Equation(((2 * xi * w_n * T_m - 1) / K_m, T_m * w_n**2 / K_m), {same: (gains[K_p], gains[K_i])}, dimension=(DIMENSIONS[K_p], DIMENSIONS[K_i])),
    }  # fmt: skip
