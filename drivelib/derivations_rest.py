"""Equations that `derivations` and `derivations_zidani` leave out: Eskander's (1), (2) and network, Zidani's (21)-(25).

(1) and (2) come from R i + dψ/dt seen from the rotor; the network's shapes from SymPy's matrix algebra; (21)-(24) are
definitions, whose units show what their gains must carry; (25) is held against its own name, time-weighted.
"""

from functools import cache

import sympy as sp
from sympy.matrices.exceptions import ShapeError

from drivelib import derivations as pm
from drivelib import derivations_zidani as df
from drivelib.symbolic import Equation
from drivelib.validation import number

e, e_before, de, u, K_e, K_de, K_u, reference = sp.symbols("e e_before Delta_e u K_e K_Delta_e K_u Omega_ref", real=True)
E_0, tau, horizon, t = sp.symbols("E_0 tau T t", positive=True)

# Powers of volt, ampere, second. The fuzzy gains are missing on purpose: their units are printed nowhere.
DIMENSIONS = {**dict.fromkeys((e, e_before, de, E_0, reference), (0, 0, -1)), **dict.fromkeys((tau, horizon, t), (0, 0, 1)), u: (0, 0, 0), df.w_m: (0, 0, -1)}


@cache
def eskander():
    """Return (1) and (2) with their derivation, for an interior machine at steady state."""
    flux = pm.lam + pm.L_d * pm.i_od + sp.I * pm.L_q * pm.i_oq
    V_d, V_q = sp.expand(df.seen_from_a_turning_frame(pm.R_s, pm.i_d + sp.I * pm.i_q, flux, 0, pm.w)).as_real_imag()
    return {
        "eq01": Equation(pm.R_s * pm.i_q + pm.w * pm.L_d * pm.i_od + pm.w * pm.lam, {"derived": V_q}, dimension=(1, 0, 0)),
        "eq02": Equation(pm.R_s * pm.i_d - pm.w * pm.L_q * pm.i_oq, {"derived": V_d}, dimension=(1, 0, 0)),
    }


@cache
def zidani():
    """Return (25) with its derivation and the definitions (21)-(24), which have none.

    (25) is tried on the error E_0 exp(−t/τ) over the horizon T; any error that is not zero would do.
    """
    error = E_0 * sp.exp(-t / tau)  # positive, so it is its own size

    def over(weighed):
        return sp.Integral(weighed, (t, 0, horizon))

    squared, absolute, weighted = over(error**2), over(error), over(t * error)
    by_hand = (
        E_0**2 * tau * (1 - sp.exp(-2 * horizon / tau)) / 2,
        E_0 * tau * (1 - sp.exp(-horizon / tau)),
        E_0 * tau * (tau - (tau + horizon) * sp.exp(-horizon / tau)),
    )
    return {
        "eq21": Equation(K_e * e + K_de * de, {}, dimension=(0, 0, 0)),
        "eq22": Equation(K_u * u, {}, dimension=(1, 1, 1)),
        "eq23": Equation(reference - df.w_m, {}, dimension=(0, 0, -1)),
        "eq24": Equation(e - e_before, {}, dimension=(0, 0, -1)),
        "eq25": Equation(
            (squared, absolute, absolute), {"time-weighted": by_hand}, (squared, absolute, weighted),
            "ITAE lacks its t", dimension=((0, 0, -1), (0, 0, 0), (0, 0, 1)),
        ),
    }  # fmt: skip


def error_point():
    """Return values for (25): an error of 2 rad/s that dies with 0.1 s, over 2 s."""
    return {E_0: sp.Integer(2), tau: sp.Rational(1, 10), horizon: sp.Integer(2)}


def network_shape(hidden, outputs, *, one_matrix=False, bias=None):
    """Return the shape of W2 tanh(W1 X + B1) + B2 for two inputs, or None where the products do not fit.

    Parameters
    ----------
    hidden, outputs : int
        Neurons of the hidden and the output layer.
    one_matrix : bool
        Whether both matrices are W2, as Eskander's text calls them.
    bias : int, optional
        Rows of B2; by default one per output. The text says 1.
    """
    hidden, outputs = number("hidden", hidden, at_least=1, whole=True), number("outputs", outputs, at_least=1, whole=True)
    W2 = sp.MatrixSymbol("W2", outputs, hidden)
    W1 = W2 if one_matrix else sp.MatrixSymbol("W1", hidden, 2)
    X, B1 = sp.MatrixSymbol("X", 2, 1), sp.MatrixSymbol("B1", hidden, 1)
    B2 = sp.MatrixSymbol("B2", outputs if bias is None else number("bias", bias, at_least=1, whole=True), 1)
    try:
        return tuple(int(n) for n in (W2 * (W1 * X + B1).applyfunc(sp.tanh) + B2).shape)
    except ShapeError:
        return None
