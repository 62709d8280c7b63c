"""The map of claims: one square per claim, by item, coloured and lettered by verdict."""

import json
import math

from matplotlib.patches import Rectangle

from drivelib import ledger, paths, plotting

# Letter and colour: light for what holds, dark for what fails, so that the map reads in grey too.
LOOKS = {
    ledger.REPRODUCED: ("R", "#CFE8DF"),
    ledger.CORRECTED: ("C", "#A6D8C6"),
    ledger.ASSUMED: ("A", "#F3DDA6"),
    ledger.FITTED: ("F", "#B9D7EA"),
    ledger.NOT_REPRODUCED: ("N", "#A8430C"),
    ledger.CONTRADICTED: ("X", "#1F1F1F"),
    ledger.SHOWN: ("S", "#F4F4F4"),
    ledger.NOT_CHECKABLE: ("–", "#D9D9D9"),
}
WIDEST = 17  # squares in a line; longer items take several
DARK = (ledger.NOT_REPRODUCED, ledger.CONTRADICTED)


def verdicts(paper):
    """Return {item id: {claim id: verdict}} of a paper's items, as their notebooks recorded them.

    Raises
    ------
    ValueError
        If an item has no record; `python -m drivelib reproduce` makes it.
    """
    found = {}
    for item in paper.items:
        path = paths.results() / f"{item}.json"
        if not path.exists():
            raise ValueError(f"{path}: not there; `python -m drivelib reproduce {item}` makes it")
        found[item] = {claim["id"]: claim["verdict"] for claim in json.loads(path.read_text(encoding="utf-8"))["claims"]}
    return found


def draw(title, columns):
    """Return a figure with a row per item and a square per claim.

    Parameters
    ----------
    title : str
    columns : sequence of dict
        One column each: {heading: `verdicts`}, the papers in it one below the other.

    Raises
    ------
    ValueError
        If there is nothing to draw.
    """
    if not columns or not all(columns) or not all(items for column in columns for items in column.values()):
        raise ValueError("columns is empty, or a paper in it has no item")
    figure, axis = plotting.figure(title)
    left = deepest = 0.0
    for column in columns:
        left += max(len(_name(item)) for items in column.values() for item in items) * 0.36 + 0.6
        y = 0.0
        for heading, items in column.items():
            axis.text(left, y + 0.45, heading, va="center", fontweight="bold")
            y += 1.0
            for item, claims in items.items():
                axis.text(left - 0.3, y + 0.5, _name(item), ha="right", va="center", fontsize=9)
                for number, verdict in enumerate(claims.values()):
                    _square(axis, left + number % WIDEST, y + number // WIDEST, verdict)
                y += max(1, math.ceil(len(claims) / WIDEST))
            y += 0.6
        deepest = max(deepest, y)
        left += min(WIDEST, max(len(claims) for items in column.values() for claims in items.values()))
    figure.set_figheight(1.4 + deepest * figure.get_figwidth() / (left + 0.1))
    axis.set(xlim=(0, left + 0.1), ylim=(deepest, 0), aspect="equal", anchor="NW")
    axis.axis("off")
    _key(figure)
    return figure


def _name(item):
    paper, stem = item.split("/")
    return stem.replace("_", " ") if paper == "beyond" else stem.split("_")[0]


def _square(axis, x, y, verdict):
    letter, colour = LOOKS[verdict]
    axis.add_patch(Rectangle((x + 0.04, y + 0.04), 0.92, 0.92, facecolor=colour, edgecolor=plotting.GREY, linewidth=0.6))
    axis.text(x + 0.5, y + 0.52, letter, ha="center", va="center", fontsize=9.5, color="white" if verdict in DARK else "black")


def _key(figure):
    handles = [Rectangle((0, 0), 1, 1, facecolor=colour, edgecolor=plotting.GREY, linewidth=0.6) for _, colour in LOOKS.values()]
    labels = [f"{letter}  {verdict}" for verdict, (letter, _) in LOOKS.items()]
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=9)
