"""The README's rendered block: headlines, a row per figure and table, what failed and why, every claim."""

from html import escape

from drivelib import ledger, paths
from drivelib.pack import report
from drivelib.record import write_atomically
from drivelib.verdict_table import table_cell

BEGIN, END = "<!-- verdicts: begin (rendered by `python -m drivelib reproduce`) -->", "<!-- verdicts: end -->"
FAILED = (ledger.NOT_REPRODUCED, ledger.CONTRADICTED, ledger.NOT_CHECKABLE)
EXACT = 1e-9  # a claim whose largest allowed deviation is no more asks for an identity
VERDICTS = (*ledger.VERDICTS, report.OPEN)


def rendered(text, found, folder=None):
    """Return the README's text with its block rendered anew from results (`report.results`) below a folder.

    Raises
    ------
    ValueError
        If the markers are missing.
    """
    if BEGIN not in text or END not in text:
        raise ValueError(f"README.md: the markers of the verdict table are missing: {BEGIN} and {END}")
    head, rest = text.split(BEGIN, 1)
    return f"{head}{BEGIN}\n{_block(found, folder)}\n{END}{rest.split(END, 1)[1]}"


def update(found):
    """Write README.md where its block is stale; return whether it was."""
    path = paths.root() / "README.md"
    old = path.read_text(encoding="utf-8")
    new = rendered(old, found)
    if new != old:
        write_atomically(path, new.encode())
    return new != old


def _block(found, folder):
    papers = ledger.papers().values()
    of = {paper.id: [row for row in report.rows(found) if row[0].id in paper.claims] for paper in papers}
    lines = ["", *(f"- {said}" for paper in papers for said in report.findings(paper, folder, headlines=True)), "", *_counts(papers, of)]
    for paper in papers:
        lines += ["", f"### {paper.citation}", "", *_items(paper, of[paper.id])]
        failed = [row for row in of[paper.id] if row[2] in FAILED]
        if failed:
            lines += _folded(f"What fails, and why: {len(failed)} claims", [_why(paper, *row) for row in failed])
        further = report.findings(paper, folder)
        if further:
            lines += _folded("Further findings", [f"- {said}" for said in further])
        judged = sorted((row for row in of[paper.id] if row[1] is not None), key=lambda row: list(paper.items).index(row[0].item))
        if judged:
            head = ["| item | claim | measured | paper | ours | verdict |", "|---|---|---|---|---:|---|"]
            lines += _folded(f"All {len(judged)} claims, with number and verdict", head + [_claim(*row) for row in judged])
        still = ", ".join(f"`{_short(claim.id)}`" for claim, result, _ in of[paper.id] if result is None)
        if still:
            lines += ["", f"Open, because their notebooks are still to come: {still}."]
    return "\n".join(lines)


def _counts(papers, of):
    papers = [paper for paper in papers if of[paper.id]]
    yield "| verdict | " + " | ".join(paper.name for paper in papers) + " |"
    yield "|---|" + "---:|" * len(papers)
    for verdict in VERDICTS:
        counts = [sum(row[2] == verdict for row in of[paper.id]) for paper in papers]
        if any(counts):
            yield f"| {verdict} | " + " | ".join(map(str, counts)) + " |"
        if verdict == ledger.ASSUMED and any(counts):
            elsewhere = [sum(row[2] == verdict and not row[0].holds(row[1]["ours"]) for row in of[paper.id]) for paper in papers]
            yield "| – of these not with our default assumptions | " + " | ".join(map(str, elsewhere)) + " |"


def _items(paper, rows):
    yield "| | what | verdicts | nearest to its limit or farthest beyond | equations |"
    yield "|---|---|---|---|---|"
    for item in paper.items.values():
        mine = [row for row in rows if row[0].item == item.id]
        counts = {verdict: sum(row[2] == verdict for row in mine) for verdict in VERDICTS}
        verdicts = "<br>".join(f"{count} {'**' * (name in FAILED)}{name}{'**' * (name in FAILED)}" for name, count in counts.items() if count)
        link = f"notebooks/{item.id}.ipynb"
        picture = f'<a href="{link}"><img src="figures/{item.id}.png" width="160" alt="{escape(item.title)}"></a>'
        yield f"| {picture} | [{table_cell(item.title)}]({link}) | {verdicts} | {_worst(mine)} | {item.equations} |"


def _worst(rows):
    used = [(usage, row) for row in rows if (usage := report.usage(*row[:2])) is not None]
    if not used:
        return ""
    _, (claim, result, verdict) = max(used, key=lambda entry: entry[0])
    if claim.holds(result["ours"]) and claim.allowed[1] <= EXACT:
        return "exact"
    cases = report.in_words(claim, result, verdict).removeprefix(verdict).replace(": ", "; ", 1)
    return table_cell(f"`{_short(claim.id)}`: {report.ours(claim, result)}, asked {report.asked(claim)}{cases}")


def _why(paper, claim, result, verdict):
    number, asked = report.ours(claim, result), report.asked(claim)
    measured = f"Measured: {claim.measure}, {number}{f'; asked {asked}' if asked else ''}. " if number else ""
    omitted = f"Omitted: {', '.join(claim.omitted)}. " if claim.omitted else ""
    return f"- **{verdict}**, `{_short(claim.id)}`: *{claim.text}* {measured}{omitted}{paper.expected.get(claim.id, ('', ''))[1]}"


def _claim(claim, result, verdict):
    link = f"[{claim.item.split('/')[1].split('_')[0]}](notebooks/{claim.item}.ipynb)"
    last = f"**{verdict}**{report.in_words(claim, result, verdict).removeprefix(verdict)}"
    said = [f"`{_short(claim.id)}` {claim.text}", claim.measure, report.asked(claim), report.ours(claim, result), last]
    return f"| {link} | " + " | ".join(table_cell(text) for text in said) + " |"


def _short(id_):
    return id_.split("/", 1)[1]


def _folded(summary, lines):
    return ["", f"<details><summary>{summary}</summary>", "", *lines, "", "</details>"]
