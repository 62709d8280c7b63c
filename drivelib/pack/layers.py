"""Figures held against figures, in layers: claims and numbers, then arrays, then pictures, then the rest.

The numbers decide. Pictures inform: an amplitude off by one per cent can leave most pixels as they are, and a changed
font changes them all.
"""

import csv
import io
import itertools
import json
import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drivelib import ledger, notebook
from drivelib.pack import check, freshness

LAYERS = ("claims", "arrays", "pictures", "notebook")
COUNTS = ("epochs", "iterations", "steps", "curves", "cases")  # a count differs or it does not
WHOLE = float("inf")  # the size of a difference that has no number


@dataclass(frozen=True)
class Difference:
    """One difference of one item: ``size`` orders those of one layer, the worst first."""

    item: str
    layer: str
    what: str
    size: float


def files(root, item):
    """Return ``{suffix: path}`` of an item's files in the tree ``root``."""
    found = {suffix: Path(root, "figures", f"{item}.{suffix}") for suffix in freshness.ARTEFACTS}
    return found | {"ipynb": Path(root, "notebooks", f"{item}.ipynb")}


def compare(old_root, new_root, chosen):
    """Return every difference of the items between two trees, by layer and then worst first.

    An item that the old tree does not have is new and has nothing to be held against.
    """
    found = []
    for item in chosen:
        old, new = files(old_root, item), files(new_root, item)
        if any(path.exists() for suffix, path in old.items() if suffix != "ipynb" or item == ledger.INDEX):
            for layer in (claims, arrays, pictures, rest):
                found += layer(old, new, item)
    return sorted(found, key=lambda one: (LAYERS.index(one.layer), -one.size, one.item, one.what))


def claims(old, new, item):
    """Return changed verdicts, numbers, parameters and machines, old and new side by side."""
    if not old["json"].exists() or not new["json"].exists():
        return _missing(old, new, item, "claims", "json")
    try:
        before, after = (_facts(json.loads(path.read_text(encoding="utf-8"))) for path in (old["json"], new["json"]))
    except (ValueError, LookupError, TypeError) as error:
        return [Difference(item, "claims", f"{item}.json is not readable: {error!r}", WHOLE)]
    tolerance, found = _tolerance(item), []
    for name in {**before, **after}:
        a, b = before.get(name), after.get(name)
        size = _distance(a, b, exact=name.endswith(COUNTS))
        if size > tolerance:
            found.append(Difference(item, "claims", f"{name}: {a} → {b}", size))
    return found


def _facts(content):
    facts = {}
    for claim in content["claims"]:
        for key in ("verdict", "ours", "as_printed", "window"):
            unit = f" in {claim['unit']}" if claim["unit"] and key in ("ours", "as_printed") else ""
            facts[f"{claim['id']}, {key}{unit}"] = claim[key]
    facts |= {f"{name} in {entry['unit']}": entry["value"] for name, entry in content["numbers"].items()}
    facts |= {f"parameter {name}": value for name, value in content["parameters"].items()}
    return facts | {key: content[key] for key in ("machines", "alt", "schema")}


def arrays(old, new, item):
    """Return the plotted columns that differ by more than the item's tolerance, as share of their largest value."""
    if not old["csv"].exists() or not new["csv"].exists():
        return _missing(old, new, item, "arrays", "csv")
    try:
        before, after = (_columns(path.read_text(encoding="utf-8")) for path in (old["csv"], new["csv"]))
    except ValueError as error:
        return [Difference(item, "arrays", f"{item}.csv is not readable: {error}", WHOLE)]
    found, tolerance = [], _tolerance(item)
    for name in {**before, **after}:
        if name not in before or name not in after:
            found.append(Difference(item, "arrays", f"{name}: only in the {'new' if name in after else 'old'} file", WHOLE))
            continue
        a, b = before[name], after[name]
        if len(a) != len(b):
            found.append(Difference(item, "arrays", f"{name}: {len(a)} → {len(b)} values", WHOLE))
            continue
        apart = [_distance(x, y) for x, y in zip(a, b, strict=True)]
        if all(isinstance(x, float) for x in (*a, *b)):
            scale = max(map(abs, a), default=0.0) or 1.0
            apart = [abs(x - y) / scale for x, y in zip(a, b, strict=True)]
        worst = int(np.argmax(apart)) if apart else 0
        if apart and apart[worst] > tolerance:
            share = f", {100 * apart[worst]:.3g} % of the largest" if np.isfinite(apart[worst]) else ""
            found.append(Difference(item, "arrays", f"{name}, value {worst + 1}: {a[worst]} → {b[worst]}{share}", apart[worst]))
    return found


def _columns(text):
    comments = [line for line in text.splitlines() if line.startswith("#")]
    rows = list(csv.reader(io.StringIO("\n".join(line for line in text.splitlines() if not line.startswith("#")))))
    columns = {name: [_number(row[number]) for row in rows[1:]] for number, name in enumerate(rows[0])} if rows else {}
    return columns | {"units and meanings": comments}


def _number(text):
    try:
        return float(text)
    except ValueError:
        return text


def pictures(old, new, item):
    """Return how far the PNG and the SVG are apart: RMS of the pixels in units of 0 to 255."""
    found = []
    for suffix in ("png", "svg"):
        if not old[suffix].exists() or not new[suffix].exists():
            found += _missing(old, new, item, "pictures", suffix)
        elif old[suffix].read_bytes() != new[suffix].read_bytes():
            rms = _rms(old[suffix], new[suffix]) if suffix == "png" else 0.0
            what = f"the picture, RMS {rms:.3g} of 255" if suffix == "png" else "the SVG file"
            found.append(Difference(item, "pictures", what, rms))
    return found


def picture_difference(old, new, folder):
    """Return matplotlib's comparison of two PNG files (``rms``, ``diff``), or None where they cannot be compared.

    Works on copies in ``folder``; equal pixels give an RMS of 0 and no difference picture.
    """
    from matplotlib.testing.compare import compare_images  # slow to import, and seldom needed
    from PIL import Image

    try:
        sizes = [Image.open(io.BytesIO(path.read_bytes())).convert("RGB").size for path in (old, new)]
    except OSError:  # no whole picture
        return None
    if sizes[0] != sizes[1]:
        return None
    one, two = shutil.copy(old, Path(folder, "old.png")), shutil.copy(new, Path(folder, "new.png"))
    return compare_images(one, two, tol=0, in_decorator=True) or {"rms": 0.0}


def _rms(old, new):
    with tempfile.TemporaryDirectory() as folder:
        result = picture_difference(old, new, folder)
    return float(result["rms"]) if result else WHOLE


def rest(old, new, item):
    """Return the first line that differs in each cell of the notebooks, or else the first difference of the outputs shown."""
    if not old["ipynb"].exists() or not new["ipynb"].exists() or old["ipynb"].read_bytes() == new["ipynb"].read_bytes():
        return []
    try:
        changed = _changed_lines(*(notebook.read(tree["ipynb"])["cells"] for tree in (old, new)))
    except (ValueError, LookupError, TypeError):
        changed = []  # no readable notebook; what follows says so
    return [Difference(item, "notebook", what, 0.0) for what in changed or [check.first_difference(old["ipynb"], new["ipynb"], 0.0)]]


def _changed_lines(old, new):
    """Return what the first line that differs is in each cell of two notebooks, as text."""
    found, nothing = [], {"id": "", "source": []}
    for before, after in itertools.zip_longest(old, new, fillvalue=nothing):
        lines = itertools.zip_longest(*(notebook.source(cell).splitlines() for cell in (before, after)), fillvalue="")
        different = ((number, *pair) for number, pair in enumerate(lines, start=1) if pair[0] != pair[1])
        for number, a, b in itertools.islice(different, 1):
            found.append(f"{before['id'] or after['id']}, line {number}: {a.strip()} → {b.strip()}")
    return found


def _missing(old, new, item, layer, suffix):
    there = [name for name, tree in (("old", old), ("new", new)) if tree[suffix].exists()]
    return [Difference(item, layer, f"{item}.{suffix}: only in the {there[0]} tree", WHOLE)] if there else []


def _distance(a, b, exact=False):
    """Return how far two values are apart: relative for numbers, infinite for anything else that differs."""
    if a == b:
        return 0.0
    numbers = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in (a, b))
    if exact or not numbers:
        return WHOLE
    return abs(a - b) / max(abs(a), abs(b))


def _tolerance(item):
    """Return an item's relative tolerance from its ledger."""
    for paper in ledger.papers().values():
        if item in paper.items:
            return paper.items[item].tolerance
    return ledger.TOLERANCE
