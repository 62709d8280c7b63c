"""What a notebook calls: begin, show, compare, table, reading, finish.

Only the runner publishes: it names an output folder in ``DRIVELIB_PUBLISH``. Run in any other way, the same
notebook writes below ``build/runs`` and its verdicts say that these are not the published conditions.
"""

import csv
import hashlib
import inspect
import io
import json
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from drivelib import environment, ledger, notebook, paths
from drivelib.validation import nearest
from drivelib.verdict_table import verdict_table

SCHEMA = 1
DIGITS = 9  # what survives a change of processor and compiler with margin; more would be noise
PUBLISH = "DRIVELIB_PUBLISH"
OUT = "DRIVELIB_OUT"
LIES = "DRIVELIB_LIES"  # where what is written to OUT will lie once the run has passed
SUFFIXES = ("png", "svg", "csv")
EXPORTS = "exports"  # folder of a run's firmware files
UNPUBLISHED = "not the published conditions"
OTHER_NUMBERS = "*Written for the published numbers; with others the table above speaks, not these sentences.*\n\n"


@dataclass(frozen=True)
class Column:
    """One plotted array with its name, unit and meaning; all columns of an item go to one CSV file."""

    name: str
    unit: str
    meaning: str
    values: np.ndarray


def begin(item_id):
    """Start an item's record; call it once, after the parameters cell.

    Raises
    ------
    ValueError
        If the item is unknown, or a parameter was injected that its notebook does not have.

    Examples
    --------
    >>> begin("eskander/fig08_minimum_los")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ValueError: 'eskander/fig08_minimum_los' is no item of any paper's ledger. Did you mean eskander/fig08_minimum_loss...
    """
    namespace = inspect.currentframe().f_back.f_globals
    return Record(item_id, namespace)


class Record:
    """The record of one run of one item; see the module's text for the order of calls."""

    def __init__(self, item_id, namespace):
        self.item = item_id
        self.claims = ledger.claims_of(item_id)
        self.parameters = _parameters(item_id, namespace)
        publish = os.environ.get(PUBLISH)
        self.published = publish is not None
        self.folder = Path(publish or os.environ.get(OUT) or paths.build("runs", item_id))
        self.stem = item_id.rsplit("/", 1)[-1]
        self.judgements = {}
        self.numbers = {}
        self.machines = []
        self.alt = None
        self.artefacts = {}
        self._say_assumptions()
        pins = environment.missing_pins()
        if pins:
            say = "Not pinned, so the last digits may differ from the published ones: " + ", ".join(pins)
            _say(f"> {say}. `make lab` sets them.")

    def machine(self, machine, without=()):
        """Note a machine set and show its values with unit and origin, but those named in ``without``."""
        self.machines.append(machine.name)
        rows = ["| | value | unit | origin | note |", "|---|---:|---|---|---|"]
        rows += [f"| {name} | {value:.6g} | {unit} | {kind} | {note} |" for name, value, unit, kind, note in machine.rows() if name not in without]
        _say(f"**{machine.name}**\n\n" + "\n".join(rows))

    def number(self, name, value, unit, meaning):
        """Note a number that the reading or the README speaks of."""
        self.numbers[name] = {"value": rounded(value), "unit": unit, "meaning": meaning}

    def show(self, figure, alt, columns):
        """Save the figure (PNG, SVG) and its arrays (CSV), and display it with its description.

        Parameters
        ----------
        figure : matplotlib Figure
        alt : str
            What a reader who cannot see it needs to know.
        columns : sequence of Column
            Every plotted array; lengths may differ.
        """
        import matplotlib.pyplot as plt
        from IPython.display import Image, display

        if not columns or not alt.strip():
            raise ValueError(f"{self.item}: a figure needs its description (alt) and the plotted arrays (columns)")
        self.alt = " ".join(alt.split())
        _settle(figure)
        png, svg = io.BytesIO(), io.BytesIO()
        figure.savefig(png, format="png", metadata={"Software": None})
        figure.savefig(svg, format="svg", metadata={"Date": None, "Creator": None})
        plt.close(figure)
        self._write("png", png.getvalue())
        self._write("svg", svg.getvalue())
        self._write("csv", _csv(columns).encode())
        display(Image(data=png.getvalue(), format="png", alt=self.alt))
        _say(f"*In words{'' if self.published else ', for the published numbers'}:* {self.alt}")

    def compare(self, claim_id, ours=None, **evidence):
        """Judge one claim; see `drivelib.ledger.judge` for the evidence it takes.

        Raises
        ------
        ValueError
            If the claim belongs to another item (the nearest is suggested) or was judged before.
        """
        if claim_id not in self.claims:
            raise ValueError(f"{claim_id!r} is no claim of {self.item}{nearest(claim_id, self.claims)}")
        if claim_id in self.judgements:
            raise ValueError(f"{claim_id} was judged before in this notebook")
        numbers = {key: _plain(value) for key, value in evidence.items()}
        ours = ours if ours is None or isinstance(ours, str) else float(ours)
        self.judgements[claim_id] = ledger.judge(self.claims[claim_id], ours, **numbers)

    def table(self):
        """Show every claim: printed or asked, ours, deviation, tolerance, verdict."""
        judged = self.judgements.values()
        _say(verdict_table(judged, [self._verdict(judgement) for judgement in judged]))

    def reading(self, text):
        """Show the reading: what agrees, what does not, and why. Numbers come in as an f-string."""
        _say(("" if self.published else OTHER_NUMBERS) + inspect.cleandoc(text))

    def finish(self):
        """Write the JSON, last and atomically.

        Raises
        ------
        RuntimeError
            If a claim of this item was not judged or an artefact is missing.
        """
        open_claims = [claim for claim in self.claims if claim not in self.judgements]
        if open_claims:
            raise RuntimeError(f"{self.item}: not evaluated: {', '.join(open_claims)}")
        missing = [suffix for suffix in SUFFIXES if suffix not in self.artefacts]
        if missing:
            raise RuntimeError(f"{self.item}: no {', '.join(missing)} was saved; call show() before finish()")
        content = {
            "schema": SCHEMA,
            "item": self.item,
            "published": self.published,
            "parameters": self.parameters,
            "machines": sorted(set(self.machines)),
            "alt": self.alt,
            "numbers": self.numbers,
            "claims": [self._claim(judgement) for judgement in self.judgements.values()],
            "artefacts": self.artefacts,
        }
        text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        path = write_atomically(self.folder / f"{self.stem}.json", text.encode())
        if not self.published:
            folder = Path(os.environ.get(LIES) or path.parent)
            shown = folder.relative_to(paths.root()) if folder.is_relative_to(paths.root()) else folder
            _say(f"Written to `{shown.as_posix()}` ({UNPUBLISHED}).")

    def _write(self, suffix, content):
        write_atomically(self.folder / f"{self.stem}.{suffix}", content)
        self.artefacts[suffix] = hashlib.sha256(content).hexdigest()

    def _verdict(self, judgement):
        return judgement.verdict if self.published else UNPUBLISHED

    def _say_assumptions(self):
        """Show the text of every assumption that the notebook cites, for a reader who has no ledger at hand."""
        cited = notebook.assumptions(notebook.read(paths.notebook(self.item)), self.item)
        if cited:
            _say("**Assumed here**\n\n" + "\n".join(f"- `{name}`: {text}" for name, text in cited.items()))

    def _claim(self, judgement):
        return {
            "id": judgement.claim.id,
            "ours": rounded(judgement.ours),
            "as_printed": rounded(judgement.as_printed),
            "deviation": rounded(judgement.deviation),
            "unit": judgement.claim.unit,
            "verdict": self._verdict(judgement),
            "window": judgement.window,
            "note": judgement.note,
        }


def _say(text):
    """Show Markdown. Imported here, as matplotlib is above: the command line, which shows nothing, starts faster."""
    from IPython.display import Markdown, display

    display(Markdown(text))


def _settle(figure):
    """Lay a figure out for good, places rounded to a millionth of its size.

    The solver behind constrained layout orders its unknowns by where they lie in memory. In a figure of many panels
    the last bits of the places then differ from run to run, and with them the names of the clip paths in the SVG.
    """
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axis in figure.axes:
        axis.set_position([round(value, 6) for value in axis.get_position().bounds])


def rounded(value):
    """Return a float with the digits that are meaningful, or None."""
    if value is None:
        return None
    value = float(f"{float(value):.{DIGITS}g}")
    if not np.isfinite(value):
        raise ValueError(f"{value} is no number that can be recorded")
    return value + 0.0  # no negative zero


def write_atomically(path, content):
    """Write bytes so that no reader, and no kill, ever sees half of them."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return path


def _parameters(item_id, namespace):
    defaults = notebook.parameters(notebook.read(paths.notebook(item_id)), item_id)
    for cell in namespace.get("In", ()):
        if cell.startswith("# Parameters\n"):  # papermill's injected cell; papermill itself would only warn
            notebook.check_overrides(notebook.assignments(cell, item_id), defaults, item_id)
    missing = [name for name in defaults if name not in namespace]
    if missing:
        raise ValueError(f"{item_id}: run the parameters cell before begin(); {missing[0]!r} is not set")
    return {name: namespace[name] for name in defaults}


def _plain(value):
    if isinstance(value, dict):
        return {str(key): float(item) for key, item in value.items()}
    return value if isinstance(value, (str, tuple)) else float(value)


def _csv(columns):
    names = [column.name for column in columns]
    if len(set(names)) != len(names):
        raise ValueError(f"two columns share a name: {', '.join(names)}")
    stream = io.StringIO()
    stream.writelines(f"# {column.name} [{column.unit or '1'}]: {column.meaning}\n" for column in columns)
    writer = csv.writer(stream, lineterminator="\n")  # quotes what holds a comma, and nothing else
    writer.writerow(names)
    arrays = [np.atleast_1d(column.values) for column in columns]
    for row in range(max(len(values) for values in arrays)):
        writer.writerow([_cell(values[row]) if row < len(values) else "" for values in arrays])
    return stream.getvalue()


def _cell(value):
    if isinstance(value, str):
        return value
    return "" if np.isnan(value) else f"{float(value) + 0.0:.{DIGITS}g}"
