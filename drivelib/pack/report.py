"""The ledger with its results, in words that a table or a page can use."""

import json
import math
from string import Formatter

from drivelib import ledger, paths

OPEN = "open"


def results(folder=None, broken="raise"):
    """Return ``{claim id: result}`` from the JSON of every item, published or below ``folder``.

    Raises
    ------
    ValueError
        If a JSON is not readable, unless ``broken`` is "skip".
    """
    base = folder or paths.root() / "figures"
    found = {}
    for paper in ledger.papers().values():
        for id_ in paper.items:
            path = base / f"{id_}.json"
            if path.exists():
                try:
                    found |= {claim["id"]: claim for claim in json.loads(path.read_text(encoding="utf-8"))["claims"]}
                except (ValueError, LookupError, TypeError):
                    if broken == "skip":
                        continue
                    raise ValueError(f"{path}: no whole record of a run; `python -m drivelib reproduce {id_}` mends it") from None
    return found


def rows(found):
    """Yield (claim, result or None, verdict) for every claim of the ledgers; a claim without a result is open."""
    for paper in ledger.papers().values():
        for claim in paper.claims.values():
            result = found.get(claim.id)
            yield claim, result, result["verdict"] if result else OPEN


def ours(claim, result):
    """Return our number with its unit as text, and what a misprint taken literally gives."""
    if result is None or result["ours"] is None:
        return ""
    unit = _unit(claim)
    literally = f" (as printed {result['as_printed']:.3g})" if result["as_printed"] is not None else ""
    return f"{result['ours']:.4g}{unit}{literally}"


def usage(claim, result):
    """Return how much of what it is allowed a claim uses, under its default assumptions; above 1 it fails.

    The deviation over the tolerance where a value is to be matched, else our number over its bound or the other way
    round. None where nothing is measured.
    """
    if result is None or result["ours"] is None or claim.relation is None:
        return None
    ours, (low, high) = result["ours"], claim.allowed
    if not math.isfinite(ours):
        return math.inf
    if math.isfinite(low) and math.isfinite(high) and low < high:
        return abs(ours - (low + high) / 2) / ((high - low) / 2)
    less, more = (low, ours) if math.isfinite(low) else (ours, high)
    if claim.relation == "==" or less <= 0 or more <= 0:  # no ratio says anything
        return 0.0 if claim.holds(ours) else math.inf
    return less / more


def findings(paper, folder=None, *, headlines=False):
    """Return a paper's findings, or its headlines, with the numbers of its items filled in.

    Those of items still to come are left out.

    Raises
    ------
    ValueError
        If a finding names a number that its item does not have.
    """
    base = folder or paths.root() / "figures"
    numbers = {}
    for id_ in paper.items:
        path = base / f"{id_}.json"
        if path.exists():
            values = json.loads(path.read_text(encoding="utf-8"))["numbers"]
            numbers[id_.split("/")[1]] = {name: entry["value"] for name, entry in values.items()}
    said = []
    for sentence in paper.headlines if headlines else paper.findings:
        named = {field.split("[")[0] for _, field, *_ in Formatter().parse(sentence) if field}
        if named <= set(numbers):
            try:
                said.append(sentence.format(**numbers))
            except KeyError as error:
                raise ValueError(f"{paper.id}: a finding names {error}, which is no number of its item") from None
    return said


def asked(claim):
    """Return what the paper prints, or the bound that stands for its words."""
    if claim.printed:
        return claim.printed + _unit(claim)
    if claim.relation is None:
        return ""
    bounds = claim.threshold if isinstance(claim.threshold, tuple) else (claim.threshold,)
    symbol = {"<=": "≤ ", ">=": "≥ ", "==": "= ", "between": ""}[claim.relation]
    return symbol + " to ".join(f"{bound:g}" for bound in bounds) + _unit(claim)


def _unit(claim):
    return f" {claim.unit}" if claim.unit not in ("", "1") else ""
