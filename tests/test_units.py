"""The units check agrees with rescaling the units, with SymPy's own unit system, and refuses what cannot be."""

import pytest
import sympy as sp
from sympy.physics import units as quantities
from sympy.physics.units.systems import SI

from drivelib import derivations, derivations_zidani, symbolic, units
from drivelib.machines import IPMSM
from drivelib.units import CANNOT_TELL, CONSISTENT, INCONSISTENT

R, L, i, w, lam, t, x = sp.symbols("R L i omega lambda t x", positive=True)
DIMENSIONS = {R: (1, -1, 0), L: (1, -1, 1), i: (0, 1, 0), w: (0, 0, -1), lam: (1, 0, 1), t: (0, 0, 1)}
VOLT = (1, 0, 0)
EQUATIONS = [(derivations, name, eq) for name, eq in derivations.eskander().items()] + [(derivations_zidani, name, eq) for name, eq in derivations_zidani.zidani().items()]


@pytest.mark.parametrize(("module", "name", "eq"), EQUATIONS, ids=lambda value: value if isinstance(value, str) else "")
def test_the_walk_agrees_with_rescaling(module, name, eq):
    """`symbolic.is_homogeneous` puts numbers in other units and looks whether the value follows: no tree, no SymPy dimension."""
    point = derivations.rated_point(IPMSM) if module is derivations else module.rated_point(oriented=eq.at == "oriented")
    for expression in (eq.printed, eq.mended):
        if expression is not None:
            rescaled = symbolic.is_homogeneous(expression, eq.dimension, point, module.DIMENSIONS)
            assert (units.check(expression, eq.dimension, module.DIMENSIONS).result == CONSISTENT) == rescaled


@pytest.mark.parametrize(
    ("expression", "said"),
    [
        (R * i + w * L * i, ""),
        (R * i + L * i, "adds"),
        (R * i + sp.S.Half, "adds"),
        (R * i**2, "gives W where V is due"),
        (R * i * sp.sin(w * t), ""),
        (R * i * sp.sin(w), "takes sin of 1/s"),
        (R * i * (w * t) ** t, "power"),
        (sp.sqrt((R * i) ** 2 + (w * lam) ** 2), ""),
        (sp.Abs(R * i), ""),
        (sp.Integral(R * i, (t, 0, t)), "gives Wb where V is due"),
        (sp.Integral(R * i / t, (t, 0, t)), ""),
        (sp.Integer(0), ""),
        (R * i + 0 * L, ""),
    ],
)
def test_what_cannot_be_is_refused_and_named(expression, said):
    found = units.check(expression, VOLT, DIMENSIONS)
    assert found.result == (INCONSISTENT if said else CONSISTENT)
    assert said in found.reason


def test_units_are_blind_to_signs_and_numbers():
    right = R * i + w * L * i
    for wrong in (R * i - w * L * i, 3 * R * i / 2 + w * L * i, -right):
        assert units.check(wrong, VOLT, DIMENSIONS).result == CONSISTENT


def test_a_symbol_without_a_unit_leaves_it_open():
    found = units.check(x * i, VOLT, DIMENSIONS)
    assert found == (CANNOT_TELL, "x has no printed unit")


def test_each_part_is_checked():
    assert units.check((R * i, R), (VOLT, (1, -1, 0)), DIMENSIONS).result == CONSISTENT
    assert units.check((R * i, R * i), (VOLT, (1, -1, 0)), DIMENSIONS).result == INCONSISTENT


def test_broken_copies_hold_one_symbol_too_many_in_one_term():
    copies = units.broken(R * i + w * lam, DIMENSIONS)
    assert len(copies) == 4 * 2  # four symbols with a unit, two terms
    assert len(set(copies)) == 8
    for (copy,) in copies:
        ratio = sp.simplify((copy - R * i) / (w * lam)), sp.simplify((copy - w * lam) / (R * i))
        assert any(value in DIMENSIONS for value in ratio)


@pytest.mark.parametrize(
    ("name", "quantity"),
    [
        ("V", quantities.volt), ("A", quantities.ampere), ("Wb", quantities.weber), ("Ω", quantities.ohm), ("H", quantities.henry), ("S", quantities.siemens),
        ("W", quantities.watt), ("N·m", quantities.newton * quantities.meter), ("kg·m²", quantities.kilogram * quantities.meter**2), ("s", quantities.second),
        ("1/s", 1 / quantities.second), ("Ω²", quantities.ohm**2), ("Wb²", quantities.weber**2), ("V·Ω²", quantities.volt * quantities.ohm**2),
        ("N·m·Wb", quantities.newton * quantities.meter * quantities.weber), ("N·m·s", quantities.newton * quantities.meter * quantities.second),
        ("V^-1·A^-1", 1 / (quantities.volt * quantities.ampere)),
    ],
)  # fmt: skip
def test_names_are_those_of_the_unit_system(name, quantity):
    """SymPy's own definitions of the units, broken down to the base, lead to our names."""
    system = SI.get_dimension_system()
    powers = system.get_dimensional_dependencies(SI.get_dimensional_expr(quantity))
    assert units.unit({str(getattr(base, "name", base)): power for base, power in powers.items()}) == name


@pytest.mark.parametrize("bad", [(1, 0), (1, 0, float("nan")), "volt"])
def test_a_dimension_must_be_three_powers(bad):
    with pytest.raises(ValueError, match="dimension of"):
        units.check(R * i, (bad,), DIMENSIONS)
