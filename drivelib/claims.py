"""One claim of a ledger: what it says, when it holds, and how its entry in the TOML is read and checked."""

import math
from dataclasses import dataclass
from decimal import Decimal

from drivelib.validation import choice, nearest, number

RELATIONS = {
    "matches": "within the tolerance of the printed value",
    "<=": "at most the threshold",
    ">=": "at least the threshold",
    "==": "exactly the threshold",
    "between": "inside the two thresholds",
}


@dataclass(frozen=True)
class Claim:
    """One claim of a paper. ``relation`` and its numbers say when it holds; ``reason`` says why those numbers.

    ``printed`` stays a string, because its last digit sets the tolerance. ``refuted_by`` names the paper's
    own equation that contradicts the claim, should it fail. ``omitted`` lists what the paper would have had to
    print; such a claim is not checkable.
    """

    id: str
    item: str
    where: str
    text: str
    relation: str | None = None
    unit: str = ""
    measure: str = ""
    printed: str | None = None
    threshold: float | tuple[float, float] | None = None
    tolerance: float | None = None
    reason: str = ""
    structure: bool = False
    refuted_by: str | None = None
    omitted: tuple[str, ...] = ()
    functions: tuple[str, ...] = ()

    @property
    def allowed(self):
        """The (low, high) interval inside which the claim holds."""
        if self.relation == "matches":
            value = float(self.printed)
            return value - self.tolerance, value + self.tolerance
        if self.relation == "between":
            return self.threshold
        low = -math.inf if self.relation == "<=" else self.threshold
        high = math.inf if self.relation == ">=" else self.threshold
        return low, high

    def holds(self, value):
        """Return whether a measured value meets the claim; NaN never does."""
        low, high = self.allowed
        return bool(low <= value <= high)


def claim_from(entry, where, paper, items):
    """Return the `Claim` of one TOML entry.

    Raises
    ------
    ValueError
        Naming ``where`` and what is wrong.
    """
    known = ("id", "item", "where", "text", "relation", "unit", "measure", "printed", "threshold", "tolerance", "reason")
    known_only(entry, (*known, "structure", "refuted_by", "omitted", "functions", "expected_verdict", "expected_reason"), where)
    for required in ("id", "item", "where", "text"):
        if not entry.get(required):
            raise ValueError(f"{where}: {required!r} is missing")
    values = {key: value for key, value in entry.items() if not key.startswith("expected_")}
    values["id"], values["item"] = f"{paper}/{entry['id']}", f"{paper}/{entry['item']}"
    if values["item"] not in items:
        raise ValueError(f"{where}: item {entry['item']!r} is not listed{nearest(values['item'], items)}")
    for key in ("omitted", "functions"):
        values[key] = tuple(entry.get(key, ()))
    if isinstance(entry.get("threshold"), list):
        values["threshold"] = tuple(entry["threshold"])
    relation = entry.get("relation")
    if relation is None:
        return Claim(**values)
    choice(f"{where}: relation", relation, tuple(RELATIONS))
    if relation != "matches" and "printed" in entry:
        raise ValueError(f"{where}: 'printed' goes with relation 'matches', not with {relation!r}")
    if relation == "matches":
        if not isinstance(entry.get("printed"), str):
            raise ValueError(f"{where}: relation 'matches' needs the printed value, as a string")
        if "tolerance" not in entry:
            values["tolerance"] = half_last_digit(entry["printed"])
            values["reason"] = values.get("reason") or "half a unit of the last printed digit"
    elif "threshold" not in entry or (relation == "between") != isinstance(values["threshold"], tuple):
        raise ValueError(f"{where}: relation {relation!r} needs {'two thresholds' if relation == 'between' else 'one threshold'}")
    for key in {"threshold", "tolerance"} & values.keys():
        for value in values[key] if isinstance(values[key], tuple) else (values[key],):
            number(f"{where}: {key}", value)
    if not values.get("reason"):
        raise ValueError(f"{where}: a threshold or a tolerance of its own needs a reason")
    return Claim(**values)


def half_last_digit(printed):
    """Return half a unit of the last digit of a printed number: 0.05 for "118.9".

    Examples
    --------
    >>> half_last_digit("118.9"), half_last_digit("0.5265"), half_last_digit("12")
    (0.05, 5e-05, 0.5)
    """
    return float(Decimal(5).scaleb(Decimal(printed).as_tuple().exponent - 1))


def known_only(entry, known, where):
    """Raise ValueError where an entry has a field that is not known; the nearest is suggested."""
    for key in entry:
        if key not in known:
            raise ValueError(f"{where}: unknown field {key!r}{nearest(key, known)}")
