"""The pages that are written from the ledgers and results: start, gallery, claims, papers, API, differences."""

import csv
import io
import re
from pathlib import Path

from drivelib import ledger, notebook, paths
from drivelib.pack import architecture, report, site_notebooks
from drivelib.pack.site_text import api_page, page, relinked
from drivelib.record import describe

SHOWN = ("eskander/fig08_minimum_loss", "zidani/fig10_speed", "beyond/your_motor")  # on the start page: one of each
PACKAGE = Path(architecture.__file__).parent.parent


def all_pages(problem, differences):
    """Return ``{path: bytes}`` of the site's sources, without the files that are copied as they are.

    Parameters
    ----------
    problem : str
        Why there is no difference page, or nothing.
    differences : sequence of layers.Difference
        What that page shows.
    """
    results = report.results(broken="skip")
    papers = ledger.papers()
    rows = {claim.id: (claim, result, verdict) for claim, result, verdict in report.rows(results)}
    claims = {id_: claim for id_, (claim, *_) in rows.items()}
    verdicts = {id_: verdict for id_, (*_, verdict) in rows.items()}
    order = [item for paper in papers.values() for item in paper.items]
    contents = {id_: notebook.read(path) for id_, path in site_notebooks.found().items()}
    contents = dict(sorted(contents.items(), key=lambda entry: order.index(entry[0]) if entry[0] in order else -1))
    titles = {id_: _title(content, id_) for id_, content in contents.items()}
    cards, found = [], {}
    for id_, content in contents.items():
        for stem, alt in site_notebooks.pictures(content, id_).items():
            folder = id_.rpartition("/")[0]
            picture = f"thumbnails/{folder}/{stem}.png"
            found[picture] = site_notebooks.thumbnail(paths.root() / "figures" / folder / f"{stem}.png")
            cards.append(_card(id_, picture, alt, papers, titles, claims, verdicts))
        found[f"notebooks/{id_}.ipynb"] = site_notebooks.as_page(id_, content, claims, verdicts)
    text = {}
    shared = {"papers": papers, "names": {id_: _name(paper) for id_, paper in papers.items()}, "rows": rows, "titles": titles}
    counts = {id_: _counts(paper, verdicts) for id_, paper in papers.items()}
    findings = {id_: report.findings(paper) for id_, paper in papers.items()}
    others = [id_ for id_ in contents if "/" not in id_]
    text["index.md"] = page("start.md", **shared, counts=counts, findings=findings, verdicts=_met(verdicts), how=_how_to_read(), others=others, cards=cards, shown=SHOWN)
    text["gallery.md"] = page("gallery.md", cards=cards)
    text["claims/index.md"] = page("claims.md", **shared, report=report)
    text["differences.md"] = page("differences.md", problem=problem, differences=differences)
    for id_, paper in papers.items():
        items = [item for item in paper.items if item in contents]
        values = {**shared, "paper": paper, "counts": counts[id_], "findings": findings[id_]}
        text[f"papers/{id_}.md"] = page("paper.md", **values, items=items)
        text[f"claims/{id_}/index.md"] = page("paper_claims.md", **values)
        robustness = _robustness()
        for claim in paper.claims.values():
            _, result, verdict = rows[claim.id]
            text[f"claims/{claim.id}.md"] = page(
                "claim.md", **shared, paper=paper, claim=claim, result=result, verdict=verdict, asked=report.asked(claim), allowed=describe(claim)[1],
                ours=report.ours(claim, result), why=paper.expected.get(claim.id, ("", ""))[1], robustness=robustness.get(claim.id, []),
                up="../" * (claim.id.count("/") + 1), functions=_functions(claim), has_page=claim.item in contents,
                window=result["window"] if result and not claim.omitted else "",
            )  # fmt: skip
    layers = {layer.name.lower(): (layer, _modules(layer)) for layer in architecture.LAYERS}
    text["api/index.md"] = page("api.md", layers=layers)
    for name, (layer, modules) in layers.items():
        text[f"api/{name}.md"] = page("layer.md", layer=layer, modules=modules)
        for module in modules:
            text[f"{api_page(module)}.md"] = page("module.md", module=architecture.module(module))
    return found | {name: content.encode() for name, content in text.items()}


def _title(content, id_):
    """Return a notebook's first heading."""
    for cell in content["cells"]:
        heading = re.search(r"^# (.+)$", notebook.source(cell), re.MULTILINE) if cell["cell_type"] == "markdown" else None
        if heading:
            return heading[1].strip()
    return id_


def _name(paper):
    """Return a paper's short name: what stands before the first comma of authors, or its id."""
    return paper.id.capitalize()


def _card(id_, picture, alt, papers, titles, claims, verdicts):
    paper = papers.get(id_.split("/")[0])
    item = paper.items.get(id_) if paper else None
    mine = {verdicts[claim_id] for claim_id, claim in claims.items() if claim.item == id_}
    order = [verdict for verdict in (*ledger.VERDICTS, report.OPEN) if verdict in mine]
    return {
        "picture": picture, "alt": alt, "title": titles[id_], "page": f"notebooks/{id_}.ipynb", "paper": _name(paper) if paper else "",
        "topic": item.topic if item else ledger.Item.topic, "verdicts": order, "id": id_,
    }  # fmt: skip


def _counts(paper, verdicts):
    mine = [verdicts[id_] for id_ in paper.claims]
    return {verdict: mine.count(verdict) for verdict in (*ledger.VERDICTS, report.OPEN)}


def _met(verdicts):
    """Return the verdicts that occur, in their order."""
    return [verdict for verdict in (*ledger.VERDICTS, report.OPEN) if verdict in verdicts.values()]


def _how_to_read():
    """Return the README's section on verdicts; it is written there once.

    Raises
    ------
    ValueError
        If the README has no such section.
    """
    text = (paths.root() / "README.md").read_text(encoding="utf-8")
    section = re.search(r"^## How to read a verdict\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL)
    if section is None:
        raise ValueError("README.md: the section '## How to read a verdict' is missing, which the site's start page shows")
    return relinked(section[1].strip(), 0)


def _functions(claim):
    """Return (dotted name, page of its module) of the functions that a claim names."""
    found = []
    for function in claim.functions:
        module = function.rsplit(".", 1)[0].replace(".", "/")
        found.append((f"drivelib.{function}", api_page(module)))
    return found


def _modules(layer):
    """Return a layer's files that hold something."""
    return [name for name in layer.files if (PACKAGE / f"{name}.py").read_text(encoding="utf-8").strip()]


def _robustness():
    """Return ``{claim id: [(what, value), …]}`` from what the robustness notebook published, if it did."""
    found = {}
    for path in sorted((paths.root() / "figures" / "beyond").glob("claim_robustness*.csv")):
        text = path.read_text(encoding="utf-8").splitlines()
        about = {match[1]: match.groups()[1:] for match in (re.fullmatch(r"# (\S+) \[(.*?)\]: (.*)", line) for line in text) if match}
        for row in csv.DictReader(io.StringIO("\n".join(line for line in text if not line.startswith("#")))):
            shown = found.setdefault(row.pop("claim", None), [])
            for name, value in row.items():
                unit, meaning = about.get(name, ("1", name))
                if value:
                    shown.append((meaning, value + (f" {unit}" if unit not in ("", "1") else "")))
    return found
