"""The errata print what they judge, judge every equation, and do not misprint."""

import re

import latex2mathml.converter
import latex_reader
import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad

from drivelib import derivations as pm
from drivelib import derivations_rest as rest
from drivelib import derivations_zidani as df
from drivelib import dfim_decoupling, errata, paths, symbolic, units
from drivelib.errata_rows import ESKANDER, ZIDANI

FOUND = {paper: errata.judged(paper) for paper in errata.PAPERS}
ROWS = [("eskander", row) for row in ESKANDER] + [("zidani", row) for row in ZIDANI]
STRINGS = [pytest.param(paper, row, which, id=f"{paper}-{row.key}-{which}") for paper, row in ROWS for which in ("printed", "mended") if getattr(row, which)]

_BY_EXPRESSION = {
    "R_{s}": pm.R_s, "R_{c}": pm.R_c, "L_{d}": pm.L_d, "L_{q}": pm.L_q, "L_{s}": pm.L_s, "L": pm.L_q, "P": pm.P, "J": pm.J, "B": pm.B,
    r"\lambda": pm.lam, r"\lambda_{o}": pm.lam_0, r"\omega_{s}": pm.w, r"\omega_{r}": pm.w_m, r"d:\omega_{r}": pm.dw_m,
    "i_{d}": pm.i_d, "i_{q}": pm.i_q, "i_{od}": pm.i_od, "i_{oq}": pm.i_oq, "d:i_{oq}": pm.D, "T_{e}": pm.T, "T_{L}": pm.T_L, "V_{d}": pm.V_d, "V_{q}": pm.V_q,
}  # fmt: skip
_AXES = {"S": (df.i_sd, df.i_sq, df.di_sd, df.di_sq, df.phi_sd, df.phi_sq, df.dphi_sd, df.dphi_sq), "R": (df.i_rd, df.i_rq, df.di_rd, df.di_rq, df.phi_rd, df.phi_rq, df.dphi_rd, df.dphi_rq)}
_ZIDANI = {
    "R_{S}": df.R_s, "R_{R}": df.R_r, "L_{S}": df.L_s, "L_{R}": df.L_r, "M": df.M, "M_{SR}": df.M, "p": df.p, "P": df.p, "J": df.J, "f": df.f, "c": df.c, "j": sp.I,
    r"\omega_{S}": df.w_s, r"\omega_{R}": df.w_r, r"\Omega": df.w_m, r"d:\Omega": df.dw_m, r"\Omega^*": rest.reference, "C_{em}": sp.Symbol("C_em", real=True), "C_{r}": df.C_r,
    r"\phi_{Rd}^*": df.phi_ref, "C_{em}^*": df.C_ref, "K_{m}": df.K_m, "T_{m}": df.T_m, "K_{p}": df.K_p, "K_{i}": df.K_i, r"\xi": df.xi, r"\omega_{n}": df.w_n,
    r"\sigma": 1 - df.M**2 / (df.L_s * df.L_r), "s": df.laplace, "K_{u}": rest.K_u, "u": rest.u, "K_{em}": -sp.Rational(3, 2) * df.p * df.phi_rd, "t": rest.t,
    r"e_{\Omega}": rest.E_0 * sp.exp(-rest.t / rest.tau), "K_{e}": rest.K_e, "e": rest.e,
}  # fmt: skip
for _w, (_id, _iq, _did, _diq, _pd, _pq, _dpd, _dpq) in _AXES.items():
    _ZIDANI |= {f"I_{{{_w}}}": _id + sp.I * _iq, f"I_{{{_w}d}}": _id, f"I_{{{_w}q}}": _iq, f"d:I_{{{_w}d}}": _did, f"d:I_{{{_w}q}}": _diq}
    _ZIDANI |= {rf"\phi_{{{_w}}}": _pd + sp.I * _pq, rf"\phi_{{{_w}d}}": _pd, rf"\phi_{{{_w}q}}": _pq, rf"d:\phi_{{{_w}}}": _dpd + sp.I * _dpq, rf"d:\phi_{{{_w}d}}": _dpd, rf"d:\phi_{{{_w}q}}": _dpq}
_ZIDANI |= {f"V_{{{name}}}": df.equation(f"eq{number:02d}").printed for number, name in enumerate(("Sd", "Sq", "Rd", "Rq"), 6)}
_CURRENTS = (df.i_sd, df.i_sq, df.i_rd, df.i_rq)
_TERMS = dfim_decoupling.compensation_terms(*_CURRENTS, df.w_s, df.w_r, df.R_s, df.R_r, df.L_s, df.L_r, df.M)
_WHOLE = [part.subs(df.FLUXES) for part in df.equation("eq13").printed]
for _name, _term, _all in zip(("Sd", "Sq", "Rd", "Rq"), _TERMS, _WHOLE, strict=True):
    _ZIDANI |= {f"V_{{t{_name}c1}}": _term, f"V_{{t{_name}}}": _all, f"V_{{t{_name}c}}": _all - _term}


def what_the_latex_says(paper, row, latex):
    """Return the right-hand sides of an equation's strings, in the order of the judged parts."""
    if paper == "eskander":
        return [latex_reader.read(latex_reader.sides(text)[-1], _BY_EXPRESSION) for text in latex]
    if row.key == "eq05":
        left, right = (latex_reader.read(side, _ZIDANI) for side in latex_reader.sides(latex[0]))
        return [left - right + _ZIDANI["C_{em}"]]
    if row.key == "eq15":  # currents over voltages, q before d
        return [latex_reader.read(latex_reader.sides(text)[k], _ZIDANI) for text in latex for k in (1, 0)]
    if row.key == "eq19":
        K_m, T_m = (latex_reader.read(latex_reader.sides(text)[1], _ZIDANI) for text in latex[1:])
        return [latex_reader.read(latex_reader.sides(latex[0])[1], _ZIDANI | {"K_{m}": K_m, "T_{m}": T_m})]
    if row.key == "eq21":
        return [latex_reader.read("K_{e}e+" + "K_{u}u", _ZIDANI | {"K_{u}": rest.K_de, "u": rest.de})] if latex[0] == r"u=K_{e}e+K_{\Delta e}\Delta e" else []
    if row.key == "eq24":
        return [rest.e - rest.e_before] if latex[0] == r"\Delta e=e(k)-e(k-1)" else []
    if row.key == "eq25":
        inside = [re.fullmatch(r"\w+=\\int_\{0\}\^\{T\}(.*)dt", text)[1] for text in latex]
        bare = [text.replace(r"\lvert", "").replace(r"\rvert", "") for text in inside]  # the error tried is positive
        return [sp.Integral(latex_reader.read(text, _ZIDANI), (rest.t, 0, rest.horizon)) for text in bare]
    return [latex_reader.read(latex_reader.sides(text)[1], _ZIDANI) for text in latex]


@pytest.mark.parametrize(("paper", "row", "which"), STRINGS)
def test_the_latex_is_the_expression_that_is_judged(paper, row, which):
    """A misprint in the errata themselves would be found here: LaTeX, read back, less the expression is zero."""
    if (row.key, which) == ("eq21", "mended"):
        return  # the surface of a rule table has no formula
    wanted = symbolic.parts(getattr(FOUND[paper][row.key].equation, which))
    said = what_the_latex_says(paper, row, getattr(row, which))
    assert len(said) == len(wanted)
    for ours, judged in zip(said, wanted, strict=True):
        assert sp.simplify(sp.expand((sp.nsimplify(ours) - judged).subs({df.c: df.f} if which == "mended" else {}))) == 0


def test_the_reader_tells_a_misprint():
    """What compares LaTeX and expression is itself able to fail: a square moved by one bracket is another expression."""
    row = next(row for row in ESKANDER if row.key == "eq10")
    (printed,), (mended,) = (what_the_latex_says("eskander", row, text) for text in (row.printed, row.mended))
    assert sp.simplify(printed - mended) != 0


@pytest.mark.parametrize(("paper", "last"), [("eskander", 20), ("zidani", 25)])
def test_every_number_is_there_once(paper, last):
    numbers = [one.number for one in FOUND[paper].values()]
    assert list(dict.fromkeys(numbers)) == [str(n) for n in range(1, last + 1)]
    assert len(numbers) - len(set(numbers)) == (1 if paper == "zidani" else 0)  # (16) is split, d and q


def test_mended_is_what_needs_mending():
    """Known from tests/test_derivations.py and its neighbour, which derive by another route; (25) by its name, (21) by table I."""
    assert errata.not_following(FOUND["eskander"], mended=False) == ["5", "6", "10", "11", "15", "16"]
    assert errata.not_following(FOUND["zidani"], mended=False) == ["2", "4", "15", "16", "17", "19", "25"]
    for paper in errata.PAPERS:
        assert errata.not_following(FOUND[paper], mended=True) == []
        for key, one in FOUND[paper].items():
            assert one.misprinted == (one.equation.mended is not None or key == "eq21")


def test_units_see_five_misprints_and_no_more():
    """Wrong powers and a lost time are seen; signs, 3/2, an index, a wrong current and an undefined constant are not."""
    seen = {(paper, key) for paper, found in FOUND.items() for key, one in found.items() if one.units.result == units.INCONSISTENT}
    assert seen == {("eskander", "eq10"), ("eskander", "eq11"), ("eskander", "eq15"), ("zidani", "eq16"), ("zidani", "eq25")}
    assert all(one.units_right.result != units.INCONSISTENT for found in FOUND.values() for one in found.values())


def test_no_broken_equation_passes():
    for paper, found in FOUND.items():
        let_through, tried = errata.breakages(paper, found)
        assert let_through == 0 and tried > 200


@pytest.mark.parametrize("paper", errata.PAPERS)
def test_the_table_is_a_table(paper):
    """One line per equation, as many cells as the head has, links that lead somewhere, effects where they belong."""
    key = next(iter(FOUND[paper]))
    head, rule, *lines = errata.table(paper, FOUND[paper], {key: "seen here"}).splitlines()
    assert len(lines) == len(FOUND[paper])
    assert {line.count("|") for line in (head, rule, *lines)} == {8}
    assert [key for key, line in zip(FOUND[paper], lines, strict=True) if "seen here" in line] == [key]
    for line in lines:
        (link,) = re.findall(r"\]\(\.\./(\w+/\w+)\.ipynb\)", line)
        assert paths.notebook(link).exists()
    with pytest.raises(ValueError, match="effects = 'eq99'"):
        errata.table(paper, FOUND[paper], {"eq99": ""})


@pytest.mark.parametrize("text", [text for _, row in ROWS for text in (*row.printed, *row.mended)])
def test_the_latex_becomes_mathml(text):
    """No command is left over as text."""
    assert "\\" not in re.sub(r"<annotation.*?</annotation>", "", latex2mathml.converter.convert(text))


def test_an_unknown_paper_is_refused():
    with pytest.raises(ValueError, match="Did you mean eskander"):
        errata.judged("eskandar")


@pytest.mark.parametrize(("options", "hidden", "outputs"), [({}, 2, 1), ({"one_matrix": True}, 2, 1), ({"one_matrix": True}, 2, 2), ({}, 2, 2), ({"bias": 1}, 2, 2), ({"one_matrix": True}, 3, 1), ({}, 5, 3)])
def test_network_shapes_are_those_of_arrays(options, hidden, outputs):
    """NumPy multiplies or refuses as SymPy says; its broadcasting of the bias is no matrix sum and counts as a refusal."""
    W2 = np.ones((outputs, hidden))
    W1 = W2 if options.get("one_matrix") else np.ones((hidden, 2))
    bias = np.ones((options.get("bias", outputs), 1))
    try:
        inner = W1 @ np.ones((2, 1))
        fits = inner.shape == (hidden, 1) and bias.shape == (outputs, 1)
        shape = (W2 @ inner).shape if fits else None
    except ValueError:
        shape = None
    assert rest.network_shape(hidden, outputs, **options) == shape
    with pytest.raises(ValueError, match="hidden = 0"):
        rest.network_shape(0, 1)


def test_the_integrals_of_25_are_those_of_quadrature():
    values = rest.error_point()
    E, tau, T = (float(values[symbol]) for symbol in (rest.E_0, rest.tau, rest.horizon))
    wanted = [quad(weight, 0, T, epsabs=1e-13)[0] for weight in (lambda t: E**2 * np.exp(-2 * t / tau), lambda t: E * np.exp(-t / tau), lambda t: t * E * np.exp(-t / tau))]
    assert [float(part.subs(values)) for part in rest.zidani()["eq25"].variants["time-weighted"]] == pytest.approx(wanted, rel=1e-9)
