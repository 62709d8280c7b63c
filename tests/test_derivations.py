"""Each equation of Eskander 2002 derived once more here, by another route than drivelib.derivations takes.

Powers come from three phases with root-mean-square currents, voltages and torque from the complex stator
equation, the optimum from Lagrange's condition. An equation passes as printed, or once mended.
"""

import functools
import random

import numpy as np
import pytest
import sympy as sp
from numpy.testing import assert_allclose

from drivelib import derivations, pmsm, pmsm_angle, pmsm_optimum, symbolic
from drivelib.derivations import (
    D, P, R_c, R_s, T, V_d, V_q, i_d, i_od, i_oq, i_q, lam, lam_0, w,
)  # fmt: skip
from drivelib.derivations import B, J, L_d, L_q, L_s, T_L, dw_m, w_m
from drivelib.machines import IPMSM, PmsmParameters

MISPRINTED = {"eq05", "eq06", "eq10", "eq11", "eq15", "eq16"}  # (5), (6): the 3/2 of (3) is missing
INHOMOGENEOUS = {"eq10", "eq11", "eq15"}
NAMES = [f"eq{number:02d}" for number in range(3, 21)]


def is_homogeneous(expression, dimension):
    return symbolic.is_homogeneous(expression, dimension, derivations.rated_point(IPMSM), derivations.DIMENSIONS)


@functools.cache
def derived():
    """Derive what each right-hand side must be."""
    flux = lam + L_d * i_od + sp.I * L_q * i_oq
    emf, i_o = sp.I * w * flux, i_od + sp.I * i_oq
    at = sp.expand(R_s * i_o + emf)  # iron current neglected, as in section 6
    torque = P * sp.Rational(3, 2) * sp.im(sp.expand(sp.conjugate(flux) * i_o))
    rms = lambda peak_squared: peak_squared / 2  # noqa: E731
    iron = sp.expand(emf * sp.conjugate(emf)) / R_c
    loss = R_s * (i_od**2 + i_oq**2) + iron
    current = sp.solve(sp.Eq(torque, T), i_oq)[0]
    surface = {L_d: L_s, L_q: L_s}
    slope_surface = sp.diff(loss.subs(surface), i_od)
    return {
        "eq03": torque,
        "eq04": sp.solve(sp.Eq(J * dw_m, T - T_L - B * w_m), T)[0],
        "eq05": 3 * R_s * rms(i_d**2 + i_q**2),
        "eq06": 3 * rms((w * lam_0) ** 2) / R_c,
        "eq07": iron,
        "eq08": sp.diff(loss, i_od) + D * sp.diff(loss, i_oq),
        "eq09": current,
        "eq10": (-sp.diff(torque, i_od) / sp.diff(torque, i_oq)).subs(i_oq, current),
        "eq12": sp.sqrt(sp.expand((V_d + sp.I * V_q) * sp.conjugate(V_d + sp.I * V_q))),
        "eq13": iron.subs(surface),
        "eq14": torque.subs(surface),
        "eq15": slope_surface,
        "eq16": sp.solve(slope_surface, i_od)[0],
        "eq17": sp.im(at).subs(i_od, 0),
        "eq18": sp.re(at).subs(i_od, 0),
        "eq19": torque.subs(i_od, 0),
        "eq20": sp.atan((-sp.re(at) / sp.im(at)).subs(i_od, 0)),
    }


def vanishes(expression):
    """Tell whether an expression is identically zero; all symbols are real, so squares and moduli cancel."""
    return sp.simplify(expression) == 0


def right(name):
    eq = derivations.equation(name)
    return eq.printed if eq.mended is None else eq.mended


def test_the_equations_are_those_with_a_number_and_no_circuit_of_their_own():
    """(3) to (20), each once; those that need mending are (5), (6), (10), (11), (15), (16) and no other."""
    assert sorted(derivations.eskander()) == NAMES
    assert {name for name, eq in derivations.eskander().items() if eq.mended is not None} == MISPRINTED


@pytest.mark.parametrize("name", [name for name in NAMES if name != "eq11"])
def test_printed_or_mended_is_what_derives(name):
    """Right-hand side minus derivation is identically zero, for this derivation and for drivelib's."""
    assert vanishes(right(name) - derived()[name])
    printed_under = next(iter(derivations.equation(name).variants.values()))
    assert vanishes(right(name) - printed_under)


@pytest.mark.parametrize("name", sorted(MISPRINTED - {"eq11"}))
def test_the_misprint_is_not_what_derives(name):
    """As printed the difference is not zero: the mend is needed."""
    assert not vanishes(derivations.equation(name).printed - derived()[name])


def test_the_optimum_is_lagranges_condition():
    """∂P/∂i_od ∂T/∂i_oq = ∂P/∂i_oq ∂T/∂i_od is (11) mended, a common factor apart, and not (11) as printed."""
    torque, eq = derived()["eq03"], derivations.equation("eq11")
    loss = R_s * (i_od**2 + i_oq**2) + derived()["eq07"]
    condition = sp.diff(loss, i_od) * sp.diff(torque, i_oq) - sp.diff(loss, i_oq) * sp.diff(torque, i_od)
    factor = 2 * (R_s + w**2 * L_d**2 / R_c) * sp.diff(torque, i_oq)
    for expression, holds in ((eq.mended, True), (eq.variants["derived"], True), (eq.printed, False)):
        assert vanishes(condition - factor * (i_od - expression.subs(T, torque))) == holds


def test_readings_of_section_6_are_the_circuit_under_their_assumption():
    """i_od = 0 with the iron current counted, and i_d = 0 at the terminals: (17)-(19) then read differently."""
    flux = lam + L_d * i_od + sp.I * L_q * i_oq
    emf = sp.expand(sp.I * w * flux)
    terminal = sp.expand(i_od + sp.I * i_oq + emf / R_c)
    voltage = sp.expand(R_s * terminal + emf)
    readings = {
        "i_od = 0, iron current counted": {i_od: 0},
        "i_d = 0 at the terminals": {i_od: sp.solve(sp.re(terminal), i_od)[0]},
    }
    for label, assumption in readings.items():
        for name, quantity in (("eq17", sp.im(voltage)), ("eq18", sp.re(voltage)), ("eq19", derived()["eq03"])):
            assert vanishes(derivations.equation(name).variants[label] - quantity.subs(assumption))


def test_terminal_currents_in_the_copper_loss_change_the_derivative():
    """(8) holds for branch currents in (5); with terminal currents it gains terms, found here from |i|²."""
    emf = sp.I * w * (lam + L_d * i_od + sp.I * L_q * i_oq)
    terminal = sp.expand(i_od + sp.I * i_oq + emf / R_c)
    loss = R_s * (sp.re(terminal) ** 2 + sp.im(terminal) ** 2) + derived()["eq07"]
    full = sp.diff(loss, i_od) + D * sp.diff(loss, i_oq)
    assert vanishes(derivations.equation("eq08").variants["terminal currents in (5)"] - full)
    assert not vanishes(right("eq08") - full)


@pytest.mark.parametrize("name", NAMES)
def test_dimensions_tell_three_misprints(name):
    """(10), (11) and (15) add or yield unlike units as printed; mended, every right-hand side has the unit of its left."""
    units = dict.fromkeys(("eq05", "eq06", "eq07", "eq13"), (1, 1, 0)) | dict.fromkeys(("eq03", "eq04", "eq14", "eq19"), (1, 1, 1))
    units |= dict.fromkeys(("eq08", "eq12", "eq15", "eq17", "eq18"), (1, 0, 0)) | dict.fromkeys(("eq09", "eq11", "eq16"), (0, 1, 0))
    dimension = units.get(name, (0, 0, 0))
    eq = derivations.equation(name)
    assert eq.dimension == dimension
    assert is_homogeneous(eq.printed, dimension) == (name not in INHOMOGENEOUS)
    assert is_homogeneous(right(name), dimension)
    assert not is_homogeneous(right(name), tuple(n + 1 for n in dimension))


def test_the_size_of_each_misprint_is_arithmetic():
    """Two thirds instead of one is a third short, a lost sign is twice off, and what is right has error 0."""
    sizes = {"eq05": 1 / 3, "eq06": 1 / 3, "eq16": 2.0}
    for name in NAMES:
        evidence = derivations.evidence(name)
        assert evidence["ours"] == 0
        assert ("as_printed" in evidence) == (name in MISPRINTED)
        if name in sizes:
            assert_allclose(evidence["as_printed"], sizes[name], rtol=1e-12)
        if name in MISPRINTED:
            assert evidence["as_printed"] > 0.1
    wanted = 0.04 * 5.06 / (6 * 0.272**2)  # at i_od = −1 A, λ + ΔL i_od = 0.272 Wb
    printed = -((0.04 * 5.06 / (6 * 0.272)) ** 2)
    assert_allclose(derivations.evidence("eq10")["as_printed"], abs(printed / wanted - 1), rtol=1e-9)


def random_machine(draw, surface=False):
    L_d_value = draw.uniform(0.005, 0.05)
    values = dict(R_s=draw.uniform(0.5, 5), L_d=L_d_value, L_q=L_d_value if surface else draw.uniform(0.005, 0.08))
    return PmsmParameters(
        **values, psi_f=draw.uniform(0.1, 0.4), P=draw.randint(1, 6), V_dc=300, R_c=draw.uniform(100, 900),
        J=draw.uniform(1e-4, 1e-2), B=draw.uniform(0, 1e-2), omega_m_rated=100, T_rated=2,
    )  # fmt: skip


def numeric(name, m, **values):
    """Evaluate a mended right-hand side; i_od and the like come as keyword arguments by symbol name."""
    expression = right(name)
    known = {R_s: m.R_s, R_c: m.R_c, L_d: m.L_d, L_q: m.L_q, L_s: m.L_d, lam: m.psi_f, P: m.P, J: m.J, B: m.B}
    symbols = {str(s): s for s in expression.free_symbols | {i_od}}
    known |= {symbols[key]: value for key, value in values.items() if key in symbols}
    return sp.lambdify(list(known), expression, "numpy")(*known.values())


@pytest.mark.parametrize("seed", range(8))
def test_the_functions_compute_the_mended_equations(seed):
    """pmsm.py and the right-hand sides, evaluated at a random machine and point, are the same numbers."""
    draw = random.Random(seed)
    m = random_machine(draw)
    speed, d, q, load = draw.uniform(50, 900), draw.uniform(-2, 1), draw.uniform(-6, 6), draw.uniform(0.2, 6)
    point = dict(omega_s=speed, i_od=d, i_oq=q, i_d=d, i_q=q, T_e=load)
    same = functools.partial(assert_allclose, rtol=1e-11)
    same(pmsm.torque(m, d, q), numeric("eq03", m, **point))
    same(pmsm.acceleration(m, numeric("eq04", m, T_L=load, omega_r=speed, **{"domega_r/dt": 7.0}), load, speed), 7.0)
    same(pmsm.copper_loss(m, d, q), numeric("eq05", m, **point))
    flux = np.hypot(m.psi_f + m.L_d * d, m.L_q * q)
    same(pmsm.iron_loss(m, speed, d, q), numeric("eq06", m, lambda_0=flux, **point))
    same(pmsm.iron_loss(m, speed, d, q, convention="paper"), numeric("eq07", m, **point))
    slope = pmsm.di_oq_di_od(m, load, d)
    at = pmsm.i_oq_at_torque(m, load, d)
    same(at, numeric("eq09", m, **point))
    same(slope, numeric("eq10", m, **point))
    same(pmsm.loss_slope(m, speed, load, d), numeric("eq08", m, **{**point, "i_oq": at, "di_oq/di_od": slope}))
    V = pmsm.stator_voltages(m, speed, d, q)
    same(pmsm.stator_voltage(m, speed, d, q), numeric("eq12", m, V_d=V[0], V_q=V[1]))
    best = pmsm_optimum.optimal_i_od(m, speed, load, model="simplified")
    point |= {"i_od": best, "i_oq": pmsm.i_oq_at_torque(m, load, best)}
    assert_allclose(numeric("eq11", m, **point), best, rtol=1e-9)
    point = dict(omega_s=speed, i_oq=abs(q))
    same(pmsm.stator_voltages(m, speed, 0.0, abs(q), model="simplified"), [numeric(name, m, **point) for name in ("eq18", "eq17")])
    same(pmsm.torque(m, 0.0, abs(q)), numeric("eq19", m, **point))
    same(pmsm_angle.inverter_angle(m, speed, abs(q)), numeric("eq20", m, **point))
    m = random_machine(draw, surface=True)
    point = dict(omega_s=speed, i_od=d, i_oq=q)
    same(pmsm.iron_loss(m, speed, d, q, convention="paper"), numeric("eq13", m, **point))
    same(pmsm.torque(m, d, q), numeric("eq14", m, **point))
    same(pmsm.loss_slope(m, speed, load, d), numeric("eq15", m, **point))
    same(pmsm_optimum.optimal_i_od_surface(m, speed), numeric("eq16", m, **point))
