"""The committed notebooks as pages: links, pictures with their descriptions, and the data behind them."""

import base64
import csv
import hashlib
import io
import re
from collections import Counter

import numpy as np
from PIL import Image

from drivelib import ledger, notebook, paths
from drivelib.pack import report
from drivelib.pack.site_text import page, relinked

ROWS = 10  # of a table behind a figure; the rest is in the file to download
THUMBNAIL = 560  # pixels wide: a card of the gallery on a fine screen
LONG = 6  # lines of code that stay open; the story is in text and figures


def found():
    """Return ``{id: path}`` of every notebook of the pack, those without an item (index) too."""
    folder = paths.root() / "notebooks"
    return {path.relative_to(folder).with_suffix("").as_posix(): path for path in sorted(folder.rglob("*.ipynb")) if ".ipynb_checkpoints" not in path.parts}


def pictures(content, id_):
    """Return ``{stem of the published files: description}`` of the pictures that a notebook shows, in its order."""
    return {stem: alt for _, stem, alt in _shown(content, id_)}


def as_page(id_, content, claims, verdicts):
    """Return a notebook's bytes as a source of the site.

    Pictures become the published SVG files with their description, links lead to pages of the site, long code is folded,
    verdicts stand below the title, and a last cell holds claims, files and the data behind each figure.

    Parameters
    ----------
    id_ : str
    content : dict
        The notebook as committed; it is changed.
    claims : dict
        Every claim of the pack by id.
    verdicts : dict
        Their verdicts.
    """
    depth = id_.count("/") + 1
    up, folder = "../" * depth, id_[: id_.rfind("/") + 1]
    stems = list(pictures(content, id_))
    for output, stem, alt in _shown(content, id_):
        output["data"], output["metadata"] = {"text/markdown": page("picture.md", file=f"/files/figures/{folder}{stem}.svg", alt=alt)}, {}
    for output in _outputs(content):
        text = output["data"].get("text/markdown")
        if text:
            output["data"]["text/markdown"] = _claim_links(relinked("".join(text), depth), claims, up)
    for cell in content["cells"]:
        if cell["cell_type"] == "markdown":
            cell["source"] = relinked(_assumptions(notebook.source(cell), id_), depth)
        elif len(notebook.source(cell).splitlines()) > LONG:
            cell["metadata"]["tags"] = [*cell["metadata"].get("tags", ()), "hide-input"]
    mine = {claim_id: verdicts[claim_id] for claim_id, claim in claims.items() if claim.item == id_}
    if mine or stems:
        first, tables = content["cells"][0], [table(paths.root() / "figures" / f"{folder}{stem}.csv") for stem in stems]
        title, _, rest = first["source"].partition("\n")
        first["source"] = page("notebook_head.md", title=title, counts=_counted(mine.values()), rest=rest)
        last = page("notebook_end.md", id=id_, folder=f"/files/figures/{folder}", up=up, claims=mine, tables=tables)
        content["cells"].append({"cell_type": "markdown", "id": "site-end", "metadata": {}, "source": last})
    return notebook.dumps(content)


def table(path):
    """Return what a reader without sight needs of a CSV file: columns with unit, meaning and range, and the first rows.

    Returns
    -------
    dict
        ``name``, ``columns`` (name, unit, meaning, least, largest), ``header``, ``rows`` and ``count`` (of all rows).
    """
    lines = path.read_text(encoding="utf-8").splitlines()
    about = [re.fullmatch(r"# (.+?) \[(.*?)\]: (.*)", line) for line in lines if line.startswith("#")]
    about = {match[1]: (match[2], match[3]) for match in about if match}
    header, *rows = list(csv.reader(io.StringIO("\n".join(line for line in lines if not line.startswith("#")))))
    columns = []
    for number, name in enumerate(header):
        unit, meaning = about.get(name, ("", ""))
        columns.append((name, unit, meaning, *_range([row[number] for row in rows])))
    return {"name": path.name, "columns": columns, "header": header, "rows": rows[:ROWS], "count": len(rows)}


def thumbnail(path):
    """Return a picture made small, as PNG bytes."""
    image = Image.open(path).convert("RGB")
    image.thumbnail((THUMBNAIL, 2 * THUMBNAIL))
    stream = io.BytesIO()
    image.quantize(64).save(stream, "PNG", optimize=True)
    return stream.getvalue()


def _counted(verdicts):
    counts = Counter(verdicts)
    return {verdict: counts[verdict] for verdict in (*ledger.VERDICTS, report.OPEN) if counts[verdict]}


def _outputs(content):
    return [output for cell in content["cells"] for output in cell.get("outputs", ()) if "data" in output]


def _shown(content, id_):
    """Yield (output, stem, description) of each output that is a published picture; the bytes say which one."""
    folder = (paths.root() / "figures" / id_).parent
    published = {hashlib.sha256(path.read_bytes()).digest(): path.stem for path in folder.glob("*.png")}
    for output in _outputs(content):
        image = base64.b64decode("".join(output["data"].get("image/png", "")))
        stem = published.get(hashlib.sha256(image).digest())
        if stem:
            yield output, stem, output.get("metadata", {}).get("image/png", {}).get("alt", "")


def _range(values):
    try:
        numbers = np.array([float(value) for value in values if value])
    except ValueError:  # names, not numbers
        return "", ""
    return (f"{numbers.min():.6g}", f"{numbers.max():.6g}") if numbers.size else ("", "")


def _claim_links(text, claims, up):
    def link(found):
        return f"[{found[0]}]({up}claims/{found[1]}.md)" if found[1] in claims else found[0]

    return re.sub(r"`([\w/-]+)`", link, text)


def _assumptions(text, id_):
    known = ledger.papers().get(id_.split("/")[0])

    def link(found):
        name = found[1]
        return f"[{found[0]}](#assumption-{known.id}-{name})" if known and name in known.assumptions else found[0]

    return re.sub(r"(?<!\[)`([A-Za-z_-]+)`(?!\])", link, text)
