"""The ledger with its results, rendered for people: terminal table and README block."""

import json
from string import Formatter

from drivelib import ledger, paths
from drivelib.record import table_cell, write_atomically

BEGIN, END = "<!-- verdicts: begin (rendered by `python -m drivelib reproduce`) -->", "<!-- verdicts: end -->"
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
    unit = f" {claim.unit}" if claim.unit else ""
    literally = f" (as printed {result['as_printed']:.3g})" if result["as_printed"] is not None else ""
    return f"{result['ours']:.4g}{unit}{literally}"


def findings(paper, folder=None):
    """Return a paper's findings with the numbers of its items filled in; those of items still to come are left out.

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
    for sentence in paper.findings:
        named = {field.split("[")[0] for _, field, *_ in Formatter().parse(sentence) if field}
        if named <= set(numbers):
            try:
                said.append(sentence.format(**numbers))
            except KeyError as error:
                raise ValueError(f"{paper.id}: a finding names {error}, which is no number of its item") from None
    return said


def readme(text, found, folder=None):
    """Return the README's text with its verdict block rendered anew.

    Raises
    ------
    ValueError
        If the markers are missing.
    """
    if BEGIN not in text or END not in text:
        raise ValueError(f"README.md: the markers of the verdict table are missing: {BEGIN} and {END}")
    head, rest = text.split(BEGIN, 1)
    return f"{head}{BEGIN}\n{_block(found, folder)}\n{END}{rest.split(END, 1)[1]}"


def update_readme(found):
    """Write README.md where its rendered block is stale; return whether it was."""
    path = paths.root() / "README.md"
    old = path.read_text(encoding="utf-8")
    new = readme(old, found)
    if new != old:
        write_atomically(path, new.encode())
    return new != old


def _block(found, folder):
    lines = []
    for paper in ledger.papers().values():
        place = {id_: number for number, id_ in enumerate(paper.items)}
        mine = sorted((row for row in rows(found) if row[0].id in paper.claims), key=lambda row: place[row[0].item])
        counts = {verdict: sum(v == verdict for *_, v in mine) for verdict in (*ledger.VERDICTS, OPEN)}
        lines.append(f"\n**{paper.citation}** " + ", ".join(f"{count} {name}" for name, count in counts.items() if count) + ".\n")
        lines += [f"- {sentence}" for sentence in findings(paper, folder)]
        judged = [row for row in mine if row[1] is not None]
        if judged:
            lines += [f"\n<details><summary>All {len(judged)} claims, with number and verdict</summary>\n"]
            lines += ["| item | claim | measured | paper | ours | verdict |", "|---|---|---|---|---:|---|"]
            lines += [_row(*row) for row in judged]
            lines += ["\n</details>"]
        if len(judged) < len(mine):
            ids = ", ".join(f"`{claim.id.split('/', 1)[1]}`" for claim, result, _ in mine if result is None)
            lines.append(f"\nOpen, because their notebooks are still to come: {ids}.")
    return "\n".join(lines)


def _row(claim, result, verdict):
    link = f"[{claim.item.split('/')[1].split('_')[0]}](notebooks/{claim.item}.ipynb)"
    said = [f"`{claim.id.split('/', 1)[1]}` {claim.text}", claim.measure, asked(claim), ours(claim, result), f"**{verdict}**"]
    return f"| {link} | " + " | ".join(table_cell(text) for text in said) + " |"


def asked(claim):
    """Return what the paper prints, or the bound that stands for its words."""
    if claim.printed:
        return claim.printed + (f" {claim.unit}" if claim.unit else "")
    if claim.relation is None:
        return ""
    bounds = claim.threshold if isinstance(claim.threshold, tuple) else (claim.threshold,)
    symbol = {"<=": "≤ ", ">=": "≥ ", "==": "= ", "between": ""}[claim.relation]
    return symbol + " to ".join(f"{bound:g}" for bound in bounds) + (f" {claim.unit}" if claim.unit else "")
