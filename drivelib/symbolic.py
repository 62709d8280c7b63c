"""An equation as printed, as mended and as derived, and what its errors say; each paper has its own `derivations`.

SymPy does the deriving. An equation passes when printed (or mended) minus derived is identically zero; the
number shown is its relative error at a rated point of a machine, because "wrong" has a size.
"""

from dataclasses import dataclass, field

import sympy as sp

from drivelib.validation import nearest

EXACT = 1e-12


@dataclass(frozen=True)
class Equation:
    """One numbered equation: right-hand sides as SymPy expressions, or tuples of them where one number has several parts.

    ``variants`` holds what derives under each reading of an assumption that the paper leaves open; the first
    is the reading under which it was printed. ``elsewhere`` holds what derives under a convention that the
    paper's other equations rule out, to say where a misprint would be right. ``at`` names the point.
    """

    printed: sp.Expr | tuple
    variants: dict[str, sp.Expr | tuple]
    mended: sp.Expr | tuple | None = None
    mend: str = ""
    at: str = ""
    dimension: tuple = (0, 0, 0)
    elsewhere: dict[str, sp.Expr | tuple] = field(default_factory=dict)


def evidence(eq, point, dimensions):
    """Return what `record.compare` takes for one equation: errors as printed, mended, and per variant."""
    right = eq.mended if eq.mended is not None else eq.printed
    errors = {label: relative_error(right, derived, point) for label, derived in eq.variants.items()}
    default, *others = errors
    result = {"ours": errors[default], "note": eq.mend}
    if eq.mended is not None:
        result["as_printed"] = relative_error(eq.printed, eq.variants[default], point)
        if not is_homogeneous(eq.printed, eq.dimension, point, dimensions):
            result["note"] += "; as printed its terms have different dimensions"
    for label, derived in eq.elsewhere.items():
        if relative_error(eq.printed, derived, point) <= EXACT:
            result["note"] += f"; as printed it would hold {label}"
    if others:
        result["alternatives"] = {label: errors[label] for label in others}
        result["note"] = f"assumed here: {default}" + (f"; {eq.mend}" if eq.mend else "")
    return result


def parts(expression):
    """Return the parts of an equation's right-hand side as a tuple."""
    return expression if isinstance(expression, tuple) else (expression,)


def part_errors(expression, derived, point):
    """Return |expression − derived| / |derived| of each part, 30 digits inside.

    Where a part derives as zero, the largest part stands in the denominator.
    """
    wanted = [sp.sympify(part).subs(point).evalf(30) for part in parts(derived)]
    largest = max(abs(value) for value in wanted)
    pairs = zip(parts(expression), parts(derived), wanted, strict=True)
    return [float(abs((a - b).subs(point).evalf(30, chop=True) / (value or largest))) for a, b, value in pairs]


def relative_error(expression, derived, point):
    """Return the largest of the parts' relative errors at a point (values for all symbols)."""
    return max(part_errors(expression, derived, point))


def is_homogeneous(expression, dimension, point, dimensions):
    """Return whether all terms have the given dimension: rescaling the units must rescale the value.

    ``dimension`` holds powers of volt, ampere and second, or one such tuple per part.
    """
    scales = (sp.Integer(2), sp.Integer(3), sp.Integer(5))
    units = {symbol: sp.prod(s**n for s, n in zip(scales, powers, strict=True)) for symbol, powers in dimensions.items()}
    rescaled_point = {symbol: value * units[symbol] for symbol, value in point.items()}
    each = dimension if isinstance(dimension[0], tuple) else (dimension,) * len(parts(expression))
    for part, powers in zip(parts(expression), each, strict=True):
        factor = sp.prod(s**n for s, n in zip(scales, powers, strict=True))
        plain = sp.sympify(part).subs(point).evalf(30)
        rescaled = sp.sympify(part).subs(rescaled_point).evalf(30)
        if plain and not abs(rescaled - plain * factor) < abs(plain * factor) * sp.Float("1e-20"):
            return False
    return True


def named(equations, name, paper):
    """Return one of a paper's derived equations, {name: `Equation`}.

    Raises
    ------
    ValueError
        If there is none of that name; the nearest is suggested.
    """
    if name not in equations:
        raise ValueError(f"{name!r} is no derived equation of {paper}{nearest(name, equations)}")
    return equations[name]
