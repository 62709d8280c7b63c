"""Units check of an equation: SymPy's dimension system walks the formula and says what cannot be.

It sees a wrong power or a symbol too many. It cannot see a sign, a pure number, or an index: terms that are wrong
in these ways have the right unit. Where a symbol's unit is printed nowhere it can be chosen to fit, and the check
cannot tell.
"""

from functools import cache
from typing import NamedTuple

import sympy as sp
from sympy.physics.units import current, time, voltage
from sympy.physics.units.systems.si import dimsys_SI

from drivelib.symbolic import parts
from drivelib.validation import array

CONSISTENT, INCONSISTENT, CANNOT_TELL = "consistent", "inconsistent", "cannot tell"
NAMES = {
    (0, 0, 0): "a pure number", (1, 0, 0): "V", (0, 1, 0): "A", (1, 0, 1): "Wb", (1, -1, 0): "Ω", (1, -1, 1): "H", (-1, 1, 0): "S",
    (1, 1, 0): "W", (1, 1, 1): "N·m", (1, 1, 2): "N·m·s", (1, 1, 3): "kg·m²", (0, 0, 1): "s", (0, 0, -1): "1/s", (0, 0, -2): "1/s²",
    (2, -2, 0): "Ω²", (2, 0, 2): "Wb²", (3, -2, 0): "V·Ω²", (2, 1, 2): "N·m·Wb",
}  # fmt: skip
_FREE = object()  # zero fits every unit


class UnitsCheck(NamedTuple):
    """Whether the units of an equation fit: one of `CONSISTENT`, `INCONSISTENT`, `CANNOT_TELL`, and why."""

    result: str
    reason: str = ""


class _Clash(Exception):
    pass


class _Unknown(Exception):
    pass


def check(expression, dimension, dimensions):
    """Return the `UnitsCheck` of one right-hand side.

    Parameters
    ----------
    expression : SymPy expression, or tuple of them
    dimension : tuple of int
        Of the left-hand side: powers of volt, ampere, second; or one such tuple per part.
    dimensions : mapping of symbol to tuple of int
        The same for every symbol; symbols that are not in it have no printed unit.

    Raises
    ------
    ValueError
        If a dimension does not hold three finite powers.
    """
    each = dimension if isinstance(dimension[0], tuple) else (dimension,) * len(parts(expression))
    for name, powers in [*dimensions.items(), *(("left side", powers) for powers in each)]:
        if array(f"dimension of {name}", powers).shape != (3,):
            raise ValueError(f"dimension of {name} = {powers}: must be three powers, of volt, ampere and second")
    known = {symbol: _dependencies(tuple(powers)) for symbol, powers in dimensions.items()}
    try:
        for part, powers in zip(parts(expression), each, strict=True):
            found, wanted = _dimension(sp.sympify(part), known), _dependencies(tuple(powers))
            if found is not _FREE and found != wanted:
                return UnitsCheck(INCONSISTENT, f"gives {unit(found)} where {unit(wanted)} is due")
    except _Clash as clash:
        return UnitsCheck(INCONSISTENT, str(clash))
    except _Unknown as unknown:
        return UnitsCheck(CANNOT_TELL, f"{unknown} has no printed unit")
    return UnitsCheck(CONSISTENT)


def broken(expression, dimensions):
    """Return copies of a right-hand side, each with one term multiplied by one of its symbols that has a unit.

    Nothing but units is wrong with them, so `check` must refuse each.
    """
    copies = []
    for number, part in enumerate(parts(expression)):
        part = sp.expand(part)
        for symbol in sorted((s for s in part.free_symbols if any(dimensions.get(s, ()))), key=str):
            for term in sp.Add.make_args(part):
                if term:
                    copies.append(tuple(part - term + term * symbol if k == number else other for k, other in enumerate(parts(expression))))
    return copies


def unit(powers):
    """Return the name of a unit, given as SymPy's dictionary of base dimensions."""
    amperes_of_a_volt, ampere = -powers.get("mass", 0), powers.get("current", 0)
    volt = powers.get("mass", 0)  # only the volt holds the kilogram
    key = (volt, ampere - amperes_of_a_volt, powers.get("time", 0) + 3 * volt)
    if key in NAMES:
        return NAMES[key]
    return "·".join(name if n == 1 else f"{name}^{n}" for name, n in zip(("V", "A", "s"), key, strict=True) if n)


@cache
def _dependencies(powers):
    volt, ampere, second = (sp.nsimplify(power) for power in powers)
    return _clean(dimsys_SI.get_dimensional_dependencies(voltage**volt * current**ampere * time**second))


def _clean(powers):
    return {str(getattr(name, "name", name)): power for name, power in powers.items() if power != 0}


def _times(*each):
    total = {}
    for powers in each:
        if powers is _FREE:
            return _FREE
        for name, power in powers.items():
            total[name] = total.get(name, 0) + power
    return _clean(total)


def _dimension(expression, known):
    if expression.is_zero:
        return _FREE
    if expression.is_number:
        return {}
    if expression in known:
        return known[expression]
    if expression.is_Symbol:
        raise _Unknown(expression)
    of = [_dimension(part, known) for part in expression.args if not isinstance(part, sp.Tuple)]
    if expression.is_Add:
        first, *others = [powers for powers in of if powers is not _FREE]
        for other in others:
            if other != first:
                raise _Clash(f"adds {unit(first)} and {unit(other)}")
        return first
    if expression.is_Mul:
        return _times(*of)
    if expression.is_Pow:
        if of[1] or not expression.exp.is_number:
            raise _Clash("has a power that is no pure number")
        return {name: power * expression.exp for name, power in of[0].items()}
    if isinstance(expression, sp.Integral):
        return _times(of[0], *(_dimension(limits[0], known) for limits in expression.limits))
    if isinstance(expression, sp.Abs):
        return of[0]
    for powers in of:  # atan, exp, …
        if powers:
            raise _Clash(f"takes {expression.func.__name__} of {unit(powers)}")
    return {}
