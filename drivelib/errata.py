"""The errata: every numbered equation judged by derivation and by units, and its table.

What judges is SymPy: `symbolic.part_errors` against what derives from the equations before, `units.check` for the units.
"""

from typing import NamedTuple

import sympy as sp

from drivelib import derivations, derivations_rest, derivations_zidani, ledger, symbolic, units
from drivelib.dfim_machines import DFIM_4KW
from drivelib.errata_rows import ESKANDER, ZIDANI, Row
from drivelib.machines import IPMSM, SPMSM
from drivelib.units import UnitsCheck
from drivelib.validation import choice

PAPERS = ("eskander", "zidani")
HEAD = "| no. | as printed | mended | must follow from | follows as printed | units as printed | effect, measured |\n|---|---|---|---|---|---|---|"


class Judged(NamedTuple):
    """One equation judged: relative errors as printed and as it should be (None for a definition), and the units of both.

    ``readings``: relative error of the right form under the other readings of what the paper leaves open; ``holds``: under
    which convention, ruled out elsewhere in the paper, the print would be right.
    """

    row: Row
    equation: symbolic.Equation
    as_printed: float | None
    right: float | None
    units: UnitsCheck
    units_right: UnitsCheck
    readings: dict
    holds: str

    @property
    def number(self):
        """The number that the paper gives it, such as "16"."""
        return self.row.key[2:4].lstrip("0")

    @property
    def misprinted(self):
        """Whether it needs mending; (21) does because the rule table says so, not a derivation."""
        return bool(self.row.mended)


def judged(paper):
    """Return {key: Judged} for every numbered equation of a paper, in its order.

    Raises
    ------
    ValueError
        If the paper is not one of `PAPERS`.
    """
    choice("paper", paper, PAPERS)
    first, rest = (derivations, derivations_rest.eskander()) if paper == "eskander" else (derivations_zidani, derivations_rest.zidani())
    equations = {**(derivations.eskander() if paper == "eskander" else derivations_zidani.zidani()), **rest}
    dimensions = {**derivations_rest.DIMENSIONS, **first.DIMENSIONS}
    found = {}
    for row in ESKANDER if paper == "eskander" else ZIDANI:
        eq = equations[row.key]
        right = eq.printed if eq.mended is None else eq.mended
        at = _point(paper, row.key, eq)
        errors = {label: symbolic.relative_error(_worked_out(right), derived, at) for label, derived in eq.variants.items()}
        default = next(iter(eq.variants), None)
        holds = [label for label, derived in eq.elsewhere.items() if symbolic.relative_error(eq.printed, derived, at) <= symbolic.EXACT]
        found[row.key] = Judged(
            row,
            eq,
            None if default is None else symbolic.relative_error(_worked_out(eq.printed), eq.variants[default], at),
            errors.pop(default, None),
            units.check(eq.printed, eq.dimension, dimensions),
            units.check(right, eq.dimension, dimensions),
            errors,
            "; ".join(holds),
        )
    return found


def breakages(paper, found):
    """Return (let through, tried): deliberately broken copies of the right equations that `units.check` accepts, and all.

    ``found`` is what `judged` returned for the paper.

    Equations whose units it cannot tell are left out.
    """
    dimensions = {**derivations_rest.DIMENSIONS, **(derivations if choice("paper", paper, PAPERS) == "eskander" else derivations_zidani).DIMENSIONS}
    results = []
    for one in found.values():
        if one.units_right.result == units.CONSISTENT:
            right = one.equation.printed if one.equation.mended is None else one.equation.mended
            copies = units.broken(right, dimensions)
            results += [units.check(copy, one.equation.dimension, dimensions).result for copy in copies]
    return sum(result != units.INCONSISTENT for result in results), len(results)


def not_following(found, *, mended):
    """Return the numbers of the equations that do not follow, as printed or once mended."""
    errors = {one.number: 0.0 for one in found.values()}
    for one in found.values():
        error = one.right if mended else one.as_printed
        errors[one.number] = max(errors[one.number], 0.0 if error is None else error)
    return [number for number, error in errors.items() if error > symbolic.EXACT]


def table(paper, found, effects):
    """Return the Markdown table of a paper's equations; ``effects`` maps keys to what was measured, others stay empty.

    Raises
    ------
    ValueError
        If an effect is given for an equation that the table does not hold.
    """
    for key in effects:
        choice("effects", key, tuple(found))
    claims = ledger.papers()[choice("paper", paper, PAPERS)].claims
    lines = [HEAD]
    for key, one in found.items():
        stem = claims[f"{paper}/{key}"].item.split("/")[1]
        label = key[2:].lstrip("0").replace("/", " ")
        mended = "<br>".join(filter(None, (f"{one.equation.mend}: " if one.equation.mend else "", *(f"${part}$" for part in one.row.mended)))) or "as printed"
        cells = (
            f"[{label}](../{paper}/{stem}.ipynb)", "<br>".join(f"${part}$" for part in one.row.printed), mended.replace(": <br>", ": "), one.row.before,
            _follows(one), _units(one), "; ".join(filter(None, (effects.get(key, ""), one.row.remark))),
        )  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _point(paper, key, eq):
    if key == "eq25":
        return derivations_rest.error_point()
    if paper == "zidani":
        return derivations_zidani.rated_point(DFIM_4KW, oriented=eq.at == "oriented")
    return derivations.rated_point(SPMSM if eq.at == "surface" else IPMSM)


def _worked_out(expression):
    """Return it with its integrals done, which is much faster than thirty digits by quadrature."""
    return tuple(part.doit() if isinstance(part, sp.Integral) else part for part in symbolic.parts(expression))


def _follows(one):
    if one.as_printed is None:
        return "a definition"
    if one.as_printed > symbolic.EXACT:
        return f"**no**, off by {100 * one.as_printed:.3g} %" + (f"; it would {one.holds}" if one.holds else "")
    off = "; ".join(f"with {label}: off by {100 * error:.2g} %" for label, error in one.readings.items() if error > symbolic.EXACT)
    return "yes" + (f" ({off})" if off else "")


def _units(one):
    if one.units.result == units.INCONSISTENT:
        return f"**{one.units.result}**: {one.units.reason}"
    if one.units.result == units.CANNOT_TELL:
        return f"{one.units.result}: {one.units.reason}"
    return f"{one.units.result}, blind to this error" if one.misprinted else one.units.result
