"""The few calls that every notebook makes refuse misuse, and write the same bytes for the same numbers."""

import json

import numpy as np
import pytest
from matplotlib.layout_engine import ConstrainedLayoutEngine

from drivelib import plotting, record, verdict_table


@pytest.fixture
def item(reproduced, monkeypatch, tmp_path):
    monkeypatch.setenv("DRIVELIB_ROOT", str(reproduced.root))
    monkeypatch.setenv("DRIVELIB_OUT", str(tmp_path / "out"))
    return record.Record("mini/fig01_line", {"slope": 2.0})


def show(item, **changes):
    figure, axis = plotting.figure("Fig. 1: a line")
    axis.plot([0, 1], [0, 2])
    item.show(figure, **{"alt": "A line.", "columns": [record.Column("y", "m", "height", [0.0, 2.0])], **changes})


def test_finish_wants_every_claim_and_every_artefact(item):
    with pytest.raises(RuntimeError, match="not evaluated: mini/slope"):
        item.finish()
    item.compare("mini/slope", 2.0)
    with pytest.raises(RuntimeError, match="no png, svg, csv was saved"):
        item.finish()
    show(item)
    item.finish()
    assert json.loads((item.folder / "fig01_line.json").read_text())["published"] is False


class Unsteady(ConstrainedLayoutEngine):
    """Constrained layout whose last bits differ from run to run, as its solver's do; here enough to see."""

    def __init__(self, error):
        super().__init__()
        self.error = error

    def execute(self, fig):
        super().execute(fig)
        for axis in fig.axes:
            x, y, width, height = axis.get_position().bounds
            axis._set_position((x + self.error, y, width, height + self.error))


@pytest.mark.parametrize("settled", [True, False])
def test_last_bits_of_the_layout_reach_no_file(item, monkeypatch, settled):
    """Without the rounding they do: the fault that is asked about is there."""
    if not settled:
        monkeypatch.setattr(record, "_settle", lambda figure: None)
    written = []
    for error in (0.0, 1e-8):
        figure, axes = plotting.figure("Fig. 1: panels", 2, 2)
        for axis in axes.flat:
            axis.plot([0, 1], [0, 2])
        figure.set_layout_engine(Unsteady(error))
        item.show(figure, "Lines.", [record.Column("y", "m", "height", [0.0, 2.0])])
        written.append([(item.folder / f"fig01_line.{suffix}").read_bytes() for suffix in ("svg", "png")])
    assert (written[0] == written[1]) is settled


def shown(monkeypatch):
    said = []
    monkeypatch.setattr(record, "_say", said.append)
    return said


def test_with_other_numbers_the_texts_say_that_they_were_written_for_the_published(item, monkeypatch):
    said = shown(monkeypatch)
    for published in (False, True):
        item.published = published
        show(item)
        item.reading("Every line rises.")
    assert said == [
        "*In words, for the published numbers:* A line.",
        "*Written for the published numbers; with others the table above speaks, not these sentences.*\n\nEvery line rises.",
        "*In words:* A line.",
        "Every line rises.",
    ]


def test_begin_shows_the_assumptions_that_the_text_cites(reproduced, monkeypatch):
    path = reproduced.root / "drivelib" / "papers" / "mini.toml"
    path.write_text('[assumptions]\nslope-unit = "The unit is not printed."\nother = "x"\nlinked = "y"\n' + path.read_text())
    content = json.loads(reproduced.notebook("fig01_line").read_text())
    content["cells"][2] |= {"cell_type": "markdown", "source": ["Code: [`linked`](x.py). The unit (assumption `slope-unit`), and `unknown`."]}
    reproduced.notebook("fig01_line").write_text(json.dumps(content))
    monkeypatch.setenv("DRIVELIB_ROOT", str(reproduced.root))
    record.ledger.load.cache_clear()
    said = shown(monkeypatch)
    record.Record("mini/fig01_line", {"slope": 2.0})
    record.ledger.load.cache_clear()
    assert said[0] == "**Assumed here**\n\n- `slope-unit`: The unit is not printed."


def judged(relation, ours, **changes):
    values = {"printed": "2.0", "tolerance": 0.05, "reason": "r"} if relation == "matches" else {"threshold": 1.0, "reason": "r"}
    one = record.ledger.Claim(id="p/a", item="p/fig", where="w", text="t", relation=relation, unit="m", measure="height", **values)
    return record.ledger.judge(one, ours, **changes)


def test_a_column_without_an_entry_is_left_out_of_the_table():
    words, number = judged("<=", 0.5), judged("matches", 2.0)
    head = [verdict_table.verdict_table(rows, ["v"] * len(rows)).splitlines()[0] for rows in ([words], [words, number])]
    assert head == ["| claim | measured | ours | allowed | verdict |", "| claim | measured | paper | ours | deviation | allowed | verdict |"]
    for line in verdict_table.verdict_table([words, number], ["v", "v"]).splitlines()[:4]:
        assert line.count("|") == 8


def test_cases_and_note_stand_one_under_the_other():
    text = verdict_table.verdict_table([judged("<=", 0.5, alternatives={"b, at 2 m": 2.0, "c": 0.1}, note="a note")], ["v"])
    assert "- `p/a`:\n  - holds in 2 of 3 cases: as assumed here; c; not in: b, at 2 m\n  - a note\n" in text


def test_a_claim_is_judged_once_and_by_its_own_notebook(item):
    with pytest.raises(ValueError, match="'mini/rise' is no claim of mini/fig01_line"):
        item.compare("mini/rise", 1.0)
    item.compare("mini/slope", 2.0)
    with pytest.raises(ValueError, match="mini/slope was judged before"):
        item.compare("mini/slope", 2.0)


def test_a_figure_needs_its_description_and_its_arrays(item):
    with pytest.raises(ValueError, match="needs its description"):
        show(item, alt=" ")
    with pytest.raises(ValueError, match="needs its description .* and the plotted arrays"):
        show(item, columns=[])
    with pytest.raises(ValueError, match="two columns share a name"):
        show(item, columns=[record.Column("y", "m", "a", [1.0]), record.Column("y", "m", "b", [1.0])])


def test_pictures_have_no_date_and_the_same_bytes_each_time(item):
    show(item)
    first = {suffix: (item.folder / f"fig01_line.{suffix}").read_bytes() for suffix in record.SUFFIXES}
    show(item)
    assert first == {suffix: (item.folder / f"fig01_line.{suffix}").read_bytes() for suffix in record.SUFFIXES}
    assert b"<dc:date>" not in first["svg"]


def test_a_missing_glyph_is_an_error(item):
    with pytest.raises(UserWarning, match="Glyph"):
        figure, _ = plotting.figure("Fig. 1: \N{CJK UNIFIED IDEOGRAPH-9A71}")
        item.show(figure, alt="x", columns=[record.Column("y", "m", "height", [0.0])])


def test_numbers_are_rounded_and_nan_is_refused():
    assert record.rounded(1 / 3) == 0.333333333
    assert record.rounded(-0.0) == 0 and str(record.rounded(-0.0)) == "0.0"
    assert record.rounded(None) is None
    with pytest.raises(ValueError, match="nan is no number"):
        record.rounded(float("nan"))


def test_columns_of_different_length_are_padded_with_nothing():
    text = record._csv([record.Column("a", "m", "one", [1.0]), record.Column("b", "", "two", np.array([1.5, np.nan, -0.0]))])
    assert text == "# a [m]: one\n# b [1]: two\na,b\n1,1.5\n,\n,0\n"


def test_begin_refuses_a_mistyped_parameter_that_papermill_would_only_warn_of(reproduced, monkeypatch):
    monkeypatch.setenv("DRIVELIB_ROOT", str(reproduced.root))
    with pytest.raises(ValueError, match="has no parameter 'slop', it has slope. Did you mean slope"):
        record.Record("mini/fig01_line", {"slope": 2.0, "In": ["", "# Parameters\nslop = 3\n"]})
    with pytest.raises(ValueError, match="'slope' is not set"):
        record.Record("mini/fig01_line", {})


def test_a_write_that_fails_leaves_the_old_file_and_no_scrap(tmp_path, monkeypatch):
    path = tmp_path / "a.json"
    record.write_atomically(path, b"old")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(record.os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        record.write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.json"]


def test_a_name_with_a_comma_is_one_column_of_the_csv_file():
    import csv

    text = record._csv([record.Column("torque, PI", "N m", "torque", [1.0, 2.0]), record.Column("t", "s", "time", [0.5])])
    rows = list(csv.reader(line for line in text.splitlines() if not line.startswith("#")))
    assert rows == [["torque, PI", "t"], ["1", "0.5"], ["2", ""]]
