"""The pages that are written from the ledgers and results: start, gallery, claims, papers, API, differences."""

import csv
import re
from dataclasses import dataclass
from pathlib import Path

from drivelib import ledger, notebook, paths
from drivelib.pack import architecture, report, site_notebooks
from drivelib.pack.site_text import api_page, page, relinked
from drivelib.verdict_table import describe

VERDICTS = (*ledger.VERDICTS, report.OPEN)
SHOWN = ("eskander/fig08_minimum_loss", "zidani/fig10_speed", "beyond/your_motor")  # on the start page: one of each
PACKAGE = Path(architecture.__file__).parent.parent


@dataclass(frozen=True)
class Known:
    """What all pages draw from: ledgers, results and notebooks, read once."""

    papers: dict
    rows: dict  # claim id: (claim, result or None, verdict)
    contents: dict  # notebook id: content, in the order of the ledgers
    titles: dict

    @property
    def claims(self):
        """Every claim by id."""
        return {id_: claim for id_, (claim, *_) in self.rows.items()}

    @property
    def verdicts(self):
        """Every claim's verdict by id."""
        return {id_: verdict for id_, (*_, verdict) in self.rows.items()}

    @property
    def names(self):
        """Every ledger's name by id, as a heading."""
        return {id_: paper.name[:1].upper() + paper.name[1:] for id_, paper in self.papers.items()}

    def shared(self):
        """Return what most templates use."""
        return {"papers": self.papers, "names": self.names, "rows": self.rows, "titles": self.titles}


def all_pages(problem, differences):
    """Return ``{path: bytes}`` of the site's sources, without the files that are copied as they are.

    Parameters
    ----------
    problem : str
        Why there is no difference page, or nothing.
    differences : sequence of layers.Difference
        What that page shows.
    """
    known = _read()
    cards, binary = _cards(known), {}
    for card in cards:
        binary[card["picture"]] = site_notebooks.thumbnail(paths.root() / "figures" / f"{card['figure']}.png")
    for id_, content in known.contents.items():
        binary[f"notebooks/{id_}.ipynb"] = site_notebooks.as_page(id_, content, known.claims, known.verdicts)
    text = {
        "gallery.md": page("gallery.md", cards=cards),
        "claims/index.md": page("claims.md", **known.shared(), report=report),
        "differences.md": page("differences.md", problem=problem, differences=differences),
    }
    text |= _paper_pages(known) | _claim_pages(known) | _api_pages()
    text["index.md"] = page(
        "start.md", **known.shared(), counts={id_: _counts(paper, known.verdicts) for id_, paper in known.papers.items()},
        headlines=[said for paper in known.papers.values() for said in report.findings(paper, headlines=True)], how=_how_to_read(), cards=cards, shown=SHOWN,
        verdicts=[verdict for verdict in VERDICTS if verdict in known.verdicts.values()], others=[id_ for id_ in known.contents if "/" not in id_],
    )  # fmt: skip
    return binary | {name: content.encode() for name, content in text.items()}


def _read():
    papers = ledger.papers()
    order = [item for paper in papers.values() for item in paper.items]
    contents = {id_: notebook.read(path) for id_, path in site_notebooks.found().items()}
    contents = dict(sorted(contents.items(), key=lambda entry: order.index(entry[0]) if entry[0] in order else -1))
    rows = {claim.id: (claim, result, verdict) for claim, result, verdict in report.rows(report.results(broken="skip"))}
    return Known(papers, rows, contents, {id_: _title(content, id_) for id_, content in contents.items()})


def _paper_pages(known):
    text = {}
    for id_, paper in known.papers.items():
        values = {**known.shared(), "paper": paper, "counts": _counts(paper, known.verdicts), "findings": _findings(paper)}
        text[f"papers/{id_}.md"] = page("paper.md", **values, items=[item for item in paper.items if item in known.contents])
        text[f"claims/{id_}/index.md"] = page("paper_claims.md", **values)
    return text


def _claim_pages(known):
    text, robustness = {}, _robustness()
    for before, (claim, result, verdict), after in _with_neighbours(known.rows.values()):
        paper = known.papers[claim.id.split("/")[0]]
        text[f"claims/{claim.id}.md"] = page(
            "claim.md", **known.shared(), paper=paper, claim=claim, result=result, verdict=verdict,
            asked=report.asked(claim), allowed=describe(claim)[1], ours=report.ours(claim, result),
            why=paper.expected.get(claim.id, ("", ""))[1], functions=_functions(claim), has_page=claim.item in known.contents,
            window=result["window"] if result and not claim.omitted else "", robustness=robustness.get(claim.id),
            before=before[0] if before else None, after=after[0] if after else None,
        )  # fmt: skip
    return text


def _with_neighbours(values):
    """Yield (the one before or None, each, the one after or None)."""
    values = list(values)
    return zip([None, *values], values, [*values[1:], None], strict=False)


def _api_pages():
    layers = {layer.name.lower(): (layer, _modules(layer)) for layer in architecture.LAYERS}
    text = {"api/index.md": page("api.md", layers=layers)}
    for name, (layer, modules) in layers.items():
        text[f"api/{name}.md"] = page("layer.md", layer=layer, modules=modules)
        text |= {f"{api_page(module)}.md": page("module.md", module=architecture.module(module)) for module in modules}
    return text


def _title(content, id_):
    """Return a notebook's first heading."""
    for cell in content["cells"]:
        heading = re.search(r"^# (.+)$", notebook.source(cell), re.MULTILINE) if cell["cell_type"] == "markdown" else None
        if heading:
            return heading[1].strip()
    return id_


def _cards(known):
    """Return what the gallery shows of each picture."""
    cards = []
    for id_, content in known.contents.items():
        paper, _, _ = id_.rpartition("/")
        items = known.papers[paper].items if paper in known.papers else {}
        mine = {known.verdicts[claim_id] for claim_id, claim in known.claims.items() if claim.item == id_}
        shared = {
            "id": id_, "title": known.titles[id_], "page": f"notebooks/{id_}.ipynb", "paper": known.names.get(paper, "The pack"),
            "topic": items[id_].topic if id_ in items else ledger.Item.topic, "verdicts": [verdict for verdict in VERDICTS if verdict in mine],
        }  # fmt: skip
        for stem, alt in site_notebooks.pictures(content, id_).items():
            figure = id_[: id_.rfind("/") + 1] + stem
            cards.append(shared | {"alt": alt, "figure": figure, "picture": f"thumbnails/{figure}.png"})
    return cards


def _findings(paper):
    return report.findings(paper, headlines=True) + report.findings(paper)


def _counts(paper, verdicts):
    mine = [verdicts[id_] for id_ in paper.claims]
    return {verdict: mine.count(verdict) for verdict in VERDICTS}


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
    """Return ``{claim id: row}`` of what the robustness notebook published, with numbers as numbers, if it did."""
    found = {}
    for path in sorted((paths.root() / "figures" / "beyond").glob("claim_robustness*.csv")):
        lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
        for row in csv.DictReader(lines):
            if row.get("claim") and row.get("share"):
                numbers = {name: float(row[name]) for name in ("draws", "flagged", "share", "low", "high")}
                found[row["claim"]] = row | numbers
    return found
