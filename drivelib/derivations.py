"""Every numbered equation of Eskander 2002, as printed, as mended, and as derived from the ones before it.

`symbolic` says how an equation passes; errors are those at the rated point of the appendix machine.
"""

from functools import cache

import sympy as sp

from drivelib import machines, symbolic
from drivelib.symbolic import Equation
from drivelib.validation import nearest

R_s, R_c, L_d, L_q, L_s, lam, P, w = sp.symbols("R_s R_c L_d L_q L_s lambda P omega_s", positive=True)
i_d, i_q, i_od, i_oq, D = sp.symbols("i_d i_q i_od i_oq di_oq/di_od", real=True)
T, T_L, B, J, w_m, dw_m = sp.symbols("T_e T_L B J omega_r domega_r/dt", real=True)
lam_0, V_d, V_q = sp.symbols("lambda_0 V_d V_q", real=True)
dL = L_d - L_q
HALF3 = sp.Rational(3, 2)

# Dimensions as powers of volt, ampere, second.
DIMENSIONS = {
    **dict.fromkeys((R_s, R_c), (1, -1, 0)),
    **dict.fromkeys((L_d, L_q, L_s), (1, -1, 1)),
    **dict.fromkeys((lam, lam_0), (1, 0, 1)),
    **dict.fromkeys((w, w_m), (0, 0, -1)),
    **dict.fromkeys((i_d, i_q, i_od, i_oq), (0, 1, 0)),
    **dict.fromkeys((T, T_L), (1, 1, 1)),
    **dict.fromkeys((V_d, V_q), (1, 0, 0)),
    P: (0, 0, 0),
    D: (0, 0, 0),
    B: (1, 1, 2),
    J: (1, 1, 3),
    dw_m: (0, 0, -2),
}


def equation(name):
    """Return the `Equation` called ``name``, such as "eq11".

    Raises
    ------
    ValueError
        If there is none; the nearest is suggested.
    """
    return symbolic.named(eskander(), name, "Eskander 2002")


def evidence(name):
    """Return what `record.compare` takes for one equation, at the rated point of the IPMSM (or SPMSM); see `symbolic.evidence`."""
    eq = equation(name)
    return symbolic.evidence(eq, rated_point(machines.SPMSM if eq.at == "surface" else machines.IPMSM), DIMENSIONS)


def rated_point(machine):
    """Return values for all symbols: the machine at rated torque and speed with i_od = −1 A; electrically consistent, load and acceleration free."""
    exact = {name: sp.Rational(str(getattr(machine, name))) for name in ("R_s", "R_c", "L_d", "L_q", "psi_f", "P", "J")}
    omega_m, torque, direct = sp.Rational(str(machine.omega_m_rated)), sp.Rational(str(round(machine.T_rated, 3))), sp.Integer(-1)
    omega = exact["P"] * omega_m
    quadrature = torque / (HALF3 * exact["P"] * (exact["psi_f"] + (exact["L_d"] - exact["L_q"]) * direct))
    e_d, e_q = -omega * exact["L_q"] * quadrature, omega * (exact["psi_f"] + exact["L_d"] * direct)
    at_d, at_q = direct + e_d / exact["R_c"], quadrature + e_q / exact["R_c"]
    return {
        R_s: exact["R_s"], R_c: exact["R_c"], L_d: exact["L_d"], L_q: exact["L_q"], L_s: exact["L_q"],
        lam: exact["psi_f"], P: exact["P"], w: omega, i_od: direct, i_oq: quadrature, i_d: at_d, i_q: at_q,
        D: -(exact["L_d"] - exact["L_q"]) * quadrature / (exact["psi_f"] + (exact["L_d"] - exact["L_q"]) * direct),
        T: torque, T_L: torque / 2, B: sp.Rational(1, 1000), J: exact["J"], w_m: omega_m, dw_m: sp.Integer(10),
        lam_0: sp.sqrt(e_d**2 + e_q**2) / omega, V_d: exact["R_s"] * at_d + e_d, V_q: exact["R_s"] * at_q + e_q,
    }  # fmt: skip


@cache
def eskander():
    """Return the equations (3)-(20) of Eskander 2002 with their derivations; (1), (2) come from the circuit of fig. 1."""
    e_d, e_q = -w * L_q * i_oq, w * (lam + L_d * i_od)
    iron_d, iron_q = i_od + e_d / R_c, i_oq + e_q / R_c
    air_gap = HALF3 * (e_d * i_od + e_q * i_oq)
    terminal = HALF3 * ((R_s * i_d + e_d) * i_d + (R_s * i_q + e_q) * i_q)
    torque = HALF3 * P * (lam * i_oq + dL * i_od * i_oq)
    copper, iron = R_s * (i_d**2 + i_q**2), w**2 * ((lam + L_d * i_od) ** 2 + (L_q * i_oq) ** 2) / R_c

    time = sp.Symbol("t")
    speed = sp.Function("omega_r")(time)
    stored = sp.diff(J * speed**2 / 2, time)
    power = sp.expand((T_L * speed + B * speed**2 + stored) / speed)
    motion = power.subs(sp.Derivative(speed, time), dw_m).subs(speed, w_m)

    branch_q = sp.Function("i_oq")(i_od)

    def along_torque(loss):
        slope = sp.diff(loss.subs(i_oq, branch_q), i_od)
        return slope.subs(sp.Derivative(branch_q, i_od), D).subs(branch_q, i_oq)

    q_of_torque = _linear_root(torque - T, i_oq)
    slope = sp.diff(q_of_torque, i_od)
    printed_8 = 2 * (
        i_od * (R_s + w**2 * L_d**2 / R_c) + i_oq * D * (R_s + w**2 * L_q**2 / R_c) + w**2 * lam * L_d / R_c
    )
    # (10) with (9) put back in, so that the optimum appears as (11) prints it, over i_oq and T_e
    slope_over_torque = -HALF3 * P * dL * i_oq**2 / T
    optimum = _linear_root(printed_8.subs(D, slope_over_torque), i_od)
    k = (R_s * R_c + w**2 * L_q**2) / (R_s * R_c + w**2 * L_d**2)
    printed_11 = HALF3 * P * (dL / T) * k * i_oq**3

    angle = sp.Symbol("theta")
    phase = V_d * sp.cos(angle) - V_q * sp.sin(angle)
    amplitude = sp.sqrt(phase.subs(angle, 0) ** 2 + phase.subs(angle, -sp.pi / 2) ** 2)

    surface = {L_d: L_s, L_q: L_s}
    iron_surface, torque_surface = iron.subs(surface), torque.subs(surface)
    slope_surface = sp.diff(R_s * (i_od**2 + i_oq**2) + iron_surface, i_od)  # (14) fixes i_oq
    mended_15 = 2 * (R_s * i_od + L_s * w**2 * lam / R_c + w**2 * L_s**2 * i_od / R_c)

    neglected, branch_zero, terminal_zero = (
        "i_od = 0, iron current neglected",
        "i_od = 0, iron current counted",
        "i_d = 0 at the terminals",
    )
    at_zero = {i_od: w * L_q * i_oq / R_c}  # the branch current when i_d = 0
    both_q = {branch_zero: R_s * iron_q.subs(i_od, 0) + w * lam, terminal_zero: (R_s * iron_q + e_q).subs(at_zero)}
    both_d = {branch_zero: R_s * iron_d.subs(i_od, 0) + e_d, terminal_zero: e_d}
    missing = "the 3/2 of (3) is missing"
    watt, volt, ampere, newton_metre = (1, 1, 0), (1, 0, 0), (0, 1, 0), (1, 1, 1)
    same = "derived"
    return {
        "eq03": Equation(torque, {same: sp.expand(air_gap / (w / P))}, dimension=newton_metre),
        "eq04": Equation(T_L + B * w_m + J * dw_m, {same: motion}, dimension=newton_metre),
        "eq05": Equation(copper, {same: sp.expand(terminal - HALF3 * (e_d * i_d + e_q * i_q))}, HALF3 * copper, missing, dimension=watt),
        "eq06": Equation(w**2 * lam_0**2 / R_c, {same: HALF3 * (w * lam_0) ** 2 / R_c}, HALF3 * w**2 * lam_0**2 / R_c, missing, dimension=watt),
        "eq07": Equation(iron, {same: w**2 * ((e_q / w) ** 2 + (e_d / w) ** 2) / R_c}, dimension=watt),
        "eq08": Equation(
            printed_8,
            {
                "branch currents in (5)": along_torque(R_s * (i_od**2 + i_oq**2) + iron),
                "terminal currents in (5)": along_torque(R_s * (iron_d**2 + iron_q**2) + iron),
            },
            dimension=(1, 0, 0),
        ),
        "eq09": Equation(T / (HALF3 * P * (lam + dL * i_od)), {same: q_of_torque}, dimension=ampere),
        "eq10": Equation(
            -((dL * T / (HALF3 * P * (lam + dL * i_od))) ** 2), {same: slope}, -dL * T / (HALF3 * P * (lam + dL * i_od) ** 2),
            "the square belongs to the bracket alone",
        ),
        "eq11": Equation(
            printed_11 - lam * w**2 * L_d**2 / (R_s * R_c + w**2 * L_d**2), {same: optimum},
            printed_11 - lam * w**2 * L_d / (R_s * R_c + w**2 * L_d**2),
            "L_d², in the last numerator, must be L_d", dimension=ampere,
        ),
        "eq12": Equation(sp.sqrt(V_d**2 + V_q**2), {same: amplitude}, dimension=volt),
        "eq13": Equation(w**2 * ((lam + L_s * i_od) ** 2 + (L_s * i_oq) ** 2) / R_c, {same: iron_surface}, at="surface", dimension=watt),
        "eq14": Equation(HALF3 * P * lam * i_oq, {same: torque_surface}, at="surface", dimension=newton_metre),
        "eq15": Equation(
            2 * (R_s * i_od + L_s * w**2 * lam / R_c + w**2 * L_s**2 * i_od * R_c), {same: slope_surface}, mended_15,
            "R_c must divide the last term", at="surface", dimension=volt,
        ),
        "eq16": Equation(
            L_s * w**2 * lam / (R_s * R_c + w**2 * L_s**2), {same: _linear_root(mended_15, i_od)},
            -L_s * w**2 * lam / (R_s * R_c + w**2 * L_s**2), "the minus is missing", at="surface", dimension=ampere,
        ),
        "eq17": Equation(R_s * i_oq + w * lam, {neglected: R_s * i_oq + e_q.subs(i_od, 0), **both_q}, dimension=volt),
        "eq18": Equation(-w * L_q * i_oq, {neglected: e_d, **both_d}, dimension=volt),
        "eq19": Equation(
            HALF3 * P * lam * i_oq, {neglected: torque.subs(i_od, 0), branch_zero: torque.subs(i_od, 0), terminal_zero: torque.subs(at_zero)},
            dimension=newton_metre,
        ),
        "eq20": Equation(
            sp.atan(w * L_q * i_oq / (R_s * i_oq + w * lam)),
            {same: sp.atan(-(-w * L_q * i_oq) / (R_s * i_oq + w * lam))},
        ),
    }  # fmt: skip


def _linear_root(expression, symbol):
    return -expression.subs(symbol, 0) / sp.expand(sp.diff(expression, symbol))
