"""Read, check and normalise notebooks as plain JSON: parameters, source digest, committed form."""

import ast
import hashlib
import json
import math
import re

from drivelib import ledger
from drivelib.validation import nearest

ADDRESS = re.compile(r"<.+ at 0x[0-9a-f]+>")  # how Python shows an object that says nothing better of itself
PARAMETERS_TAG = "parameters"
INJECTED_TAG = "injected-parameters"  # papermill's own cell, which no committed notebook has
METADATA = {
    "kernelspec": {"display_name": "Python 3 (ipykernel)", "language": "python", "name": "python3"},
    "language_info": {"file_extension": ".py", "mimetype": "text/x-python", "name": "python", "pygments_lexer": "ipython3"},
}


def read(path):
    """Return a notebook as a dictionary.

    Raises
    ------
    ValueError
        If the file is no JSON notebook of format 4.5 or later, or a cell of it is not whole.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: no readable notebook ({error})") from error
    minor = content.get("nbformat_minor") if isinstance(content, dict) and content.get("nbformat") == 4 else None
    if not isinstance(minor, int) or minor < 5:
        raise ValueError(f"{path}: must be a notebook of format 4.5 (open and save it in JupyterLab)")
    if not isinstance(content.get("cells"), list):
        raise ValueError(f"{path}: has no list of cells")
    kinds = {"cell_type": str, "source": (str, list), "metadata": dict}
    for number, cell in enumerate(content["cells"], start=1):
        if not isinstance(cell, dict) or not all(isinstance(cell.get(key), kind) for key, kind in kinds.items()):
            raise ValueError(f"{path}: cell {number} must have {', '.join(kinds)}")
    return content


def source(cell):
    """Return a cell's source as one string with LF line ends."""
    return "".join(cell["source"]).replace("\r\n", "\n")


def code(content):
    """Return the sources of all code cells."""
    return [source(cell) for cell in content["cells"] if cell["cell_type"] == "code"]


def assumptions(content, item_id):
    """Return ``{name: text}`` of the assumptions of the item's ledger that the notebook's text cites, in the order of the text."""
    paper = ledger.papers().get(item_id.split("/")[0])
    text = "\n".join(source(cell) for cell in content["cells"] if cell["cell_type"] == "markdown")
    names = re.findall(r"(?<!\[)`([\w-]+)`(?!\])", text)  # a link is one to code
    return {name: paper.assumptions[name] for name in names if name in paper.assumptions} if paper else {}


def parameters(content, name="notebook"):
    """Return ``{parameter: default}`` from the cell tagged "parameters"; literals only.

    Raises
    ------
    ValueError
        If there is more than one such cell, or something else than literal assignments in it.
    """
    tagged = [source(cell) for cell in content["cells"] if PARAMETERS_TAG in cell["metadata"].get("tags", ())]
    if len(tagged) > 1:
        raise ValueError(f"{name}: {len(tagged)} cells are tagged {PARAMETERS_TAG!r}, one is allowed")
    return assignments(tagged[0], name) if tagged else {}


def assignments(text, name):
    """Return ``{name: value}`` of a cell that holds literal assignments only.

    Raises
    ------
    ValueError
        Naming the first line that is something else.
    """
    found = {}
    try:
        statements = ast.parse(text).body
    except SyntaxError as error:
        raise ValueError(f"{name}: the parameters cell is no Python: {error}") from None
    for statement in statements:
        try:
            (target,) = statement.targets
            found[target.id] = ast.literal_eval(statement.value)
        except (AttributeError, ValueError):
            raise ValueError(f"{name}: line {statement.lineno} of the parameters cell is no literal assignment") from None
    return found


def check_overrides(given, defaults, name):
    """Raise ValueError unless every given parameter exists, has the kind of its default and is finite."""
    for parameter, value in given.items():
        if parameter not in defaults:
            raise ValueError(
                f"{name} has no parameter {parameter!r}, it has {', '.join(defaults) or 'none'}{nearest(parameter, defaults)}"
            )
        default = defaults[parameter]
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{name}: {parameter} = {value!r}: must be finite")
        if _kind(value) != _kind(default):
            raise ValueError(f"{name}: {parameter} = {value!r}: must be {_kind(default)}, such as {default!r}")


def _kind(value):
    kinds = {bool: "True or False", int: "a number", float: "a number", str: "a text", list: "a list"}
    return kinds.get(type(value), f"a {type(value).__name__}")


def digest(content):
    """Return the digest of what decides a run: cell kinds, sources and parameter tags, not outputs."""
    cells = [
        (cell["cell_type"], source(cell), PARAMETERS_TAG in cell["metadata"].get("tags", ())) for cell in content["cells"]
    ]
    return hashlib.sha256(json.dumps(cells).encode()).hexdigest()


def normalised(content):
    """Return the committed form: no times, paths, widgets or execution metadata; stable cell ids and counts."""
    cells, count = [], 0
    for number, cell in enumerate(content["cells"], start=1):
        kept = {
            "cell_type": cell["cell_type"],
            "id": f"cell-{number:02d}",
            "metadata": {key: value for key, value in cell["metadata"].items() if key in ("tags", "jupyter") and value},
            "source": source(cell).splitlines(keepends=True),
        }
        if cell["cell_type"] == "code":
            ran = bool(cell.get("outputs")) or cell.get("execution_count") is not None
            count += ran
            kept["execution_count"] = count if ran else None
            kept["outputs"] = [_output(output, count) for output in _joined(cell.get("outputs", [])) if not _is_widget(output)]
        cells.append(kept)
    return {"cells": cells, "metadata": METADATA, "nbformat": 4, "nbformat_minor": 5}


def dumps(content):
    """Return a notebook's bytes: sorted keys, one-space indent, LF, as Jupyter writes them."""
    return (json.dumps(content, indent=1, sort_keys=True, ensure_ascii=False) + "\n").encode("utf-8")


def unpublishable(content):
    """Return why a notebook must not be published, or an empty list; cells are counted as their [n] in the committed one."""
    reasons = []
    cells = [cell for cell in content["cells"] if cell["cell_type"] == "code" and INJECTED_TAG not in cell["metadata"].get("tags", ())]
    for number, cell in enumerate(cells, start=1):
        for output in cell.get("outputs", ()):
            if output["output_type"] == "error":
                reasons.append(f"cell {number} raised {output.get('ename')}: {output.get('evalue')}")
            if output.get("name") == "stderr":
                reasons.append(f"cell {number} wrote to stderr: {''.join(output['text']).strip()[:300]}")
            if address := ADDRESS.search("".join(output.get("data", {}).get("text/plain", output.get("text", "")))):
                reasons.append(f"cell {number} shows an address in memory, another in each run: {address.group()}")
            if _is_widget(output):
                reasons.append(f"cell {number} shows a widget, which nobody sees without a kernel")
    return reasons


def _is_widget(output):
    return any(kind.startswith("application/vnd.jupyter.widget") for kind in output.get("data", ()))


def _joined(outputs):
    """Join neighbouring pieces of one stream: where they split depends on timing."""
    joined = []
    for output in outputs:
        previous = joined[-1] if joined else {}
        if output["output_type"] == "stream" and previous.get("output_type") == "stream" and previous["name"] == output["name"]:
            previous["text"] = "".join(previous["text"]) + "".join(output["text"])
        else:
            joined.append(dict(output))
    return joined


def _output(output, count):
    output = dict(output)
    if output["output_type"] == "stream":
        output["text"] = "".join(output["text"]).splitlines(keepends=True)
        return output
    if "execution_count" in output:
        output["execution_count"] = count
    output["data"] = {kind: _lines(value) for kind, value in output.get("data", {}).items()}
    return output


def _lines(value):
    text = "".join(value) if isinstance(value, list) else value
    return text.splitlines(keepends=True) if isinstance(text, str) else text
