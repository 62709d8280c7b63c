"""Zidani's equations (1)-(20): printed or mended equals derived, each misprint does not, and the code computes the mended form."""

import numpy as np
import pytest
import sympy as sp

from drivelib import control, dfim, dfim_decoupling, symbolic
from drivelib import derivations_zidani as d
from drivelib.dfim_machines import DFIM_4KW, DFIM_SETS

EQUATIONS = d.zidani()
MISPRINTS = {"eq02", "eq04", "eq15", "eq16", "eq16/q", "eq17", "eq19"}
INHOMOGENEOUS = {"eq16"}
TRANSIENT, ORIENTED = d.rated_point(), d.rated_point(oriented=True)


def right(name):
    eq = EQUATIONS[name]
    return symbolic.parts(eq.printed if eq.mended is None else eq.mended)


def first(name):
    return symbolic.parts(next(iter(EQUATIONS[name].variants.values())))


def point(name, machine=DFIM_4KW):
    return d.rated_point(machine, oriented=EQUATIONS[name].at == "oriented")


def value(expression, values):
    """Evaluate an expression through lambdify, as NumPy would."""
    symbols = sorted(expression.free_symbols, key=str)
    return sp.lambdify(symbols, expression, "numpy")(*(complex(values[symbol]) if symbol is d.laplace else float(values[symbol]) for symbol in symbols))


@pytest.mark.parametrize("name", EQUATIONS)
def test_printed_or_mended_less_derived_is_zero(name):
    for ours, derived in zip(right(name), first(name), strict=True):
        assert sp.simplify(sp.expand(ours - derived)) == 0


@pytest.mark.parametrize("name", EQUATIONS)
def test_it_is_mended_if_and_only_if_it_is_a_misprint(name):
    """Where an equation is mended, what was printed is wrong by more than a tenth; where it is not, it is one of the sound ones."""
    eq = EQUATIONS[name]
    assert (eq.mended is not None) == (name in MISPRINTS)
    if eq.mended is not None:
        assert symbolic.relative_error(eq.printed, first(name), point(name)) > 0.1
        assert any(sp.simplify(a - b) != 0 for a, b in zip(symbolic.parts(eq.printed), first(name), strict=True))


@pytest.mark.parametrize("name", EQUATIONS)
def test_homogeneity(name):
    eq = EQUATIONS[name]
    assert symbolic.is_homogeneous(eq.printed, eq.dimension, point(name), d.DIMENSIONS) == (name not in INHOMOGENEOUS)
    assert symbolic.is_homogeneous(right(name), eq.dimension, point(name), d.DIMENSIONS)


@pytest.mark.parametrize("name", EQUATIONS)
def test_the_mended_form_holds_for_every_machine(name):
    """(19) divides by the friction, which two sets do not have."""
    for machine in DFIM_SETS.values():
        if name != "eq19" or machine.f:
            assert symbolic.relative_error(right(name), first(name), point(name, machine)) == 0


def test_homogeneity_finds_a_wrong_power():
    assert not symbolic.is_homogeneous(d.R_s * d.i_sd + d.L_s * d.i_sd, d.VOLT, TRANSIENT, d.DIMENSIONS)
    assert not symbolic.is_homogeneous(d.L_s * d.i_sd, d.VOLT, TRANSIENT, d.DIMENSIONS)


@pytest.mark.parametrize("name", ["eq02", "eq16/q", "eq17", "eq19"])
def test_a_misprint_is_right_under_the_convention_that_is_named(name):
    (derived,) = EQUATIONS[name].elsewhere.values()
    for printed, other in zip(symbolic.parts(EQUATIONS[name].printed), symbolic.parts(derived), strict=True):
        assert sp.simplify(sp.expand((printed - other).subs(d.c, d.f))) == 0


def test_equation_8_and_9_are_the_parts_of_2_with_plus_only():
    as_real = sp.expand(EQUATIONS["eq02"].mended).as_real_imag()
    assert [sp.expand(a - b) for a, b in zip(as_real, (EQUATIONS["eq08"].printed, EQUATIONS["eq09"].printed), strict=True)] == [0, 0]
    as_printed = sp.expand(EQUATIONS["eq02"].printed).as_real_imag()[0] - EQUATIONS["eq08"].printed
    assert sp.expand(as_printed - 2 * d.w_r * d.phi_rq) == 0


def test_equation_4_as_printed_leaves_no_torque():
    q = sp.expand(EQUATIONS["eq04"].printed).as_real_imag()[1]
    assert sp.solve(q, d.i_rq) == [0]
    assert right("eq17")[0].subs(d.i_rq, 0) == 0


def test_13_does_not_need_11():
    assert TRANSIENT[d.i_rd] != 0 and TRANSIENT[d.phi_rq] != 0
    assert symbolic.relative_error(right("eq13"), first("eq13"), TRANSIENT) == 0


def test_10_depends_on_the_frame_by_three_halves():
    invariant, other = EQUATIONS["eq10"].variants.values()
    assert sp.simplify(invariant / other) == sp.Rational(3, 2)


def test_the_motor_computes_5_to_10():
    """dφ/dt of `dfim_derivatives` under the voltages of (6)-(9) are the slopes that went in; dΩ/dt is (5)'s."""
    c = dfim.coefficients(DFIM_4KW)
    voltages = [value(right(f"eq{n:02d}")[0], TRANSIENT) for n in (6, 7, 8, 9)]
    fluxes = [float(TRANSIENT[symbol]) for symbol in (d.phi_sd, d.phi_sq, d.phi_rd, d.phi_rq)]
    slopes = [float(TRANSIENT[symbol]) for symbol in (d.dphi_sd, d.dphi_sq, d.dphi_rd, d.dphi_rq)]
    omega_m, omega_s, load = (float(TRANSIENT[symbol]) for symbol in (d.w_m, d.w_s, d.C_r))
    found = dfim.dfim_derivatives(*fluxes, omega_m, *voltages, omega_s, load, DFIM_4KW.R_r, c)
    assert found[:4] == pytest.approx(slopes, rel=1e-9)
    # (5) solved for the slope: C_em = J dΩ + f Ω + C_r
    torque = value(right("eq05")[0], {**TRANSIENT, d.dw_m: found[4]})
    assert torque == pytest.approx(value(right("eq10")[0], TRANSIENT), rel=1e-9)


def test_the_fluxes_are_3_and_4_mended():
    currents = [complex(float(TRANSIENT[a]), float(TRANSIENT[b])) for a, b in ((d.i_sd, d.i_sq), (d.i_rd, d.i_rq))]
    found = dfim.flux_linkages(*currents, DFIM_4KW)
    assert found == pytest.approx([value(right("eq03")[0], TRANSIENT), value(right("eq04")[0], TRANSIENT)], rel=1e-12)


def test_the_torque_is_10():
    arguments = [float(TRANSIENT[symbol]) for symbol in (d.phi_rd, d.phi_rq, d.i_sd, d.i_sq)]
    assert dfim.electromagnetic_torque(*arguments, DFIM_4KW) == pytest.approx(value(right("eq10")[0], TRANSIENT), rel=1e-12)


def test_combined_voltages_are_12_and_compensation_is_what_13_leaves():
    v_sd, v_sq, v_rd, v_rq = (value(right(f"eq{n:02d}")[0], TRANSIENT) for n in (6, 7, 8, 9))
    v_ts, v_tr = dfim_decoupling.combined_voltages(complex(v_sd, v_sq), complex(v_rd, v_rq), DFIM_4KW)
    combined = [v_ts.real, v_ts.imag, v_tr.real, v_tr.imag]
    assert combined == pytest.approx([value(part, TRANSIENT) for part in right("eq13")], rel=1e-9)
    i = [float(TRANSIENT[symbol]) for symbol in (d.i_sd, d.i_sq, d.i_rd, d.i_rq)]
    slopes = [float(TRANSIENT[symbol]) for symbol in (d.di_sd, d.di_sq, d.di_rd, d.di_rq)]
    m = DFIM_4KW
    terms = dfim_decoupling.compensation_terms(*i, float(TRANSIENT[d.w_s]), float(TRANSIENT[d.w_r]), m.R_s, m.R_r, m.L_s, m.L_r, m.M)
    L = np.repeat(dfim_decoupling.leakage_inductances(m), 2)
    assert np.array(combined) - terms == pytest.approx(np.repeat([m.R_s, m.R_r], 2) * i + L * slopes, rel=1e-9)


def test_the_references_are_16_mended_and_as_printed():
    arguments = float(ORIENTED[d.C_ref]), float(ORIENTED[d.phi_ref]), DFIM_4KW
    wanted = [value(part, ORIENTED) for part in (*right("eq16"), *right("eq16/q"))]
    i_sd, i_sq, i_rd, i_rq = dfim_decoupling.current_references(*arguments)
    assert [i_sd, i_rd, i_sq, i_rq] == pytest.approx(wanted, rel=1e-12)
    i_sd, i_sq, i_rd, i_rq = dfim_decoupling.printed_current_references(*arguments)
    printed = [value(part, ORIENTED) for name in ("eq16", "eq16/q") for part in symbolic.parts(EQUATIONS[name].printed)]
    assert [i_sd, i_rd, i_sq, i_rq] == pytest.approx(printed, rel=1e-12)


def test_the_torque_constant_is_17_mended():
    found = dfim_decoupling.torque_constant(float(ORIENTED[d.phi_rd]), DFIM_4KW) * float(ORIENTED[d.i_rq])
    assert found == pytest.approx(value(right("eq17")[0], ORIENTED), rel=1e-12)
    assert found == pytest.approx(DFIM_4KW.T_rated, rel=1e-12)


def test_gains_and_transfer_function_are_19_and_20():
    J, f, p = DFIM_4KW.J, DFIM_4KW.f, DFIM_4KW.p
    gains = control.speed_gains(J, f, 20.0, 0.7)
    assert gains == pytest.approx([value(part, TRANSIENT) for part in right("eq20")], rel=1e-9)
    printed = {**TRANSIENT, d.K_m: sp.Rational(p) / TRANSIENT[d.f]}
    assert control.printed_speed_gains(J, f, p, 20.0, 0.7) == pytest.approx([value(part, printed) for part in right("eq20")], rel=1e-9)
    numerator, denominator = control.speed_transfer_function(gains, J, f)
    assert np.polyval(numerator, 20j) / np.polyval(denominator, 20j) == pytest.approx(value(right("eq19")[0], TRANSIENT), rel=1e-9)


def test_evidence_says_what_was_mended():
    found = d.evidence("eq16")
    assert found["ours"] == 0 and found["as_printed"] == pytest.approx(1 - DFIM_4KW.L_r)
    assert "different dimensions" in found["note"]
    assert "alternatives" not in found
    assert d.evidence("eq10")["alternatives"] == {"power-invariant Park transformation": pytest.approx(0.5)}
    assert "it would hold with ω_R" in d.evidence("eq02")["note"]


def test_an_unknown_equation_gets_a_suggestion():
    with pytest.raises(ValueError, match="Did you mean eq1"):
        d.equation("eq 13")
