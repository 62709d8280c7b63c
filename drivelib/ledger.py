"""The claims ledger: what each paper says, how it is judged, and the one rule that turns numbers into verdicts.

The files ``papers/<paper>.toml`` hold assumptions, items (one notebook each) and claims. A notebook hands its
numbers to `judge`; it never sees the expected verdict, which only the tests read.
"""

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from drivelib import paths
from drivelib.claims import Claim, claim_from, known_only
from drivelib.validation import choice, nearest, number

DEFAULT = "default"  # the case that a notebook assumes, among its alternatives
INDEX = "index"  # the one item of no paper: where a reader starts; it needs all others and judges nothing
TOLERANCE = 1e-6  # relative; below it an array or a number counts as unchanged, where byte identity is not asked for

REPRODUCED = "reproduced"
CORRECTED = "reproduced, corrected"
ASSUMED = "reproduced, assumed"
FITTED = "matched by a fit"
NOT_REPRODUCED = "not reproduced"
CONTRADICTED = "contradicted"
SHOWN = "shown"
NOT_CHECKABLE = "not checkable"
VERDICTS = (REPRODUCED, CORRECTED, ASSUMED, FITTED, NOT_REPRODUCED, CONTRADICTED, SHOWN, NOT_CHECKABLE)


@dataclass(frozen=True)
class Item:
    """One notebook: figure or table of a paper, and the items whose numbers it reads.

    ``equations`` are the paper's numbers of those it rests on; ``tolerance`` is the relative difference of its
    arrays and numbers that still counts as unchanged; ``topic`` is what the gallery filters by.
    """

    id: str
    title: str
    equations: str = ""
    needs: tuple[str, ...] = ()
    tolerance: float = TOLERANCE
    topic: str = "other"


@dataclass(frozen=True)
class Paper:
    """One paper's ledger. ``headlines`` and ``findings`` hold ``{stem[number]:format}`` in place of every number."""

    id: str
    name: str
    citation: str
    items: dict[str, Item]
    claims: dict[str, Claim]
    assumptions: dict[str, str]
    expected: dict[str, tuple[str, str]]
    headlines: tuple[str, ...] = ()
    findings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Judgement:
    """A verdict with the numbers behind it."""

    claim: Claim
    verdict: str
    ours: float | None
    as_printed: float | None = None
    window: str = ""
    note: str = ""

    @property
    def deviation(self):
        """Ours minus printed where a value is to be matched, else None."""
        return self.ours - float(self.claim.printed) if self.claim.relation == "matches" else None


def judge(claim, ours=None, *, as_printed=None, alternatives=None, fit=None, note=""):
    """Return the `Judgement` of one claim.

    Parameters
    ----------
    claim : Claim
    ours : float or str
        The measured number under the default assumptions, or the label of the alternative that is the default.
    as_printed : float, optional
        The same measure with a misprinted formula used literally.
    alternatives : mapping of str to float, optional
        The measure under every other admissible value of what the paper leaves open. A claim that holds
        for all of them is reproduced, for some reproduced under an assumption, for none not reproduced
        (or contradicted, where the paper's own equation refutes it).
    fit : tuple of int, optional
        (free parameters, printed numbers matched), where ``ours`` was fitted.

    Raises
    ------
    ValueError
        If a number is missing for a claim that needs one.

    Examples
    --------
    A printed 118.9 W is met by what rounds to it, and a fit to it is called a fit:

    >>> claim = Claim("p/loss", "p/fig", "fig. 8", "The least loss.", "matches", "W", printed="118.9", tolerance=0.05)
    >>> judge(claim, 118.93).verdict, judge(claim, 118.96).verdict
    ('reproduced', 'contradicted')
    >>> judge(claim, 118.90, fit=(1, 1)).verdict
    'matched by a fit'
    """
    if claim.omitted:
        return Judgement(claim, NOT_CHECKABLE, ours, window="omitted: " + "; ".join(claim.omitted), note=note)
    if ours is None:
        raise ValueError(f"{claim.id}: no measured value given, the claim needs one in {claim.unit or 'pure numbers'}")
    default, cases = DEFAULT, dict(alternatives or {})
    if isinstance(ours, str):
        default, ours = ours, cases[choice(f"{claim.id}: ours", ours, tuple(cases))]
    cases = {default: ours} | cases
    holding = [label for label, value in cases.items() if claim.holds(value)]
    window = _window(holding, cases, default) if alternatives else ""
    if fit is not None:
        verdict = FITTED if claim.holds(ours) else NOT_REPRODUCED
        window = f"{fit[0]} free, {fit[1]} matched"
    elif not holding:
        verdict = NOT_REPRODUCED if alternatives and claim.refuted_by is None else CONTRADICTED
    elif len(holding) < len(cases):
        verdict = ASSUMED
    elif claim.structure:
        verdict = SHOWN
    elif as_printed is not None and not claim.holds(as_printed):
        verdict = CORRECTED
    else:
        verdict = REPRODUCED
    return Judgement(claim, verdict, ours, as_printed, window, note)


def _window(holding, cases, default):
    if len(holding) in (0, len(cases)):
        return f"holds in {'all' if holding else 'none'} of the {len(cases)} cases tried"
    shown = {label: label for label in cases}
    shown[default] = "as assumed here" if default == DEFAULT else f"{default} (as assumed here)"
    inside, outside = ("; ".join(shown[label] for label in cases if (label in holding) == wanted) for wanted in (True, False))
    return f"holds in {len(holding)} of {len(cases)} cases: {inside}; not in: {outside}"


def papers():
    """Return every ledger by id, the papers before what goes beyond them."""
    return {path.stem: load(path) for path in sorted(paths.ledgers().glob("*.toml"), key=lambda path: (path.stem == "beyond", path.stem))}


@cache
def load(path):
    """Return the `Paper` of one TOML file.

    Raises
    ------
    ValueError
        Naming file, entry and what is wrong with it.
    """
    path = Path(path)
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path.name}: no valid TOML: {error}") from error
    paper = path.stem
    items, claims, expected = {}, {}, {}
    for stem, entry in raw.get("items", {}).items():
        known_only(entry, ("title", "equations", "needs", "tolerance", "topic"), f"{path.name}, item {stem}")
        if not entry.get("title"):
            raise ValueError(f"{path.name}, item {stem}: 'title' is missing")
        tolerance = number(f"{path.name}, item {stem}: tolerance", entry.get("tolerance", TOLERANCE), at_least=0, at_most=0.01)
        items[f"{paper}/{stem}"] = Item(
            f"{paper}/{stem}", entry["title"], entry.get("equations", ""), tuple(entry.get("needs", ())), tolerance, entry.get("topic", Item.topic)
        )  # fmt: skip
    for entry in raw.get("claims", []):
        claim = claim_from(entry, f"{path.name}, claim {entry.get('id', '(no id)')}", paper, items)
        if claim.id in claims:
            raise ValueError(f"{path.name}: claim {claim.id} is listed twice")
        claims[claim.id] = claim
        if "expected_verdict" in entry:
            verdict = choice(f"{path.name}, claim {claim.id}: expected_verdict", entry["expected_verdict"], VERDICTS)
            expected[claim.id] = (verdict, entry.get("expected_reason", ""))
    said = (tuple(raw.get(kind, ())) for kind in ("headlines", "findings"))
    return Paper(paper, raw.get("name", paper), raw.get("citation", ""), items, claims, raw.get("assumptions", {}), expected, *said)


def claims_of(item_id):
    """Return the claims that one notebook has to evaluate.

    Raises
    ------
    ValueError
        If no ledger knows the item; the nearest is suggested.
    """
    if item_id == INDEX:
        return {}
    items = {id_: paper for paper in papers().values() for id_ in paper.items}
    if item_id not in items:
        raise ValueError(f"{item_id!r} is no item of any paper's ledger{nearest(item_id, items)}")
    return {claim.id: claim for claim in items[item_id].claims.values() if claim.item == item_id}
