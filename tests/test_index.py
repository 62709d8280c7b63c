"""The index, where a reader starts: an item of no paper that needs all others and may record nothing."""

import json

import pytest

from drivelib import notebook

SHOW = """
import json, os
from pathlib import Path

found = [json.loads(path.read_text()) for path in sorted(Path(os.environ["DRIVELIB_READ"]).rglob("fig*.json"))]
print([claim["verdict"] for item in found for claim in item["claims"]])
"""
RECORD = """
from drivelib import plotting, record
item = record.begin("index")
fig, axis = plotting.figure("All verdicts")
axis.plot([0, 1], [0, 1])
item.show(fig, alt="A line.", columns=[record.Column("y", "m", "height", [0.0, 1.0])])
item.finish()
"""


@pytest.fixture
def indexed(reproduced):
    """A fresh miniature pack to which an index was added."""
    write(reproduced, SHOW)
    return reproduced


def write(pack, text):
    pack.write_cells("../index", [text])
    path = pack.root / "notebooks" / "index.ipynb"
    content = json.loads(path.read_text())
    content["cells"][0]["metadata"] = {}  # no parameters
    path.write_bytes(notebook.dumps(content))


def shown(pack):
    content = json.loads((pack.root / "notebooks" / "index.ipynb").read_text())
    return content["cells"][0]["outputs"][0]["text"]


def test_it_runs_alone_when_all_else_is_fresh_and_needs_no_parameters_claims_or_figures(indexed):
    done = indexed.run("reproduce")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 of 3 notebooks run" in done.stdout
    assert shown(indexed) == ["['reproduced', 'reproduced']\n"]
    assert not list((indexed.root / "figures").glob("index.*"))
    assert "0 of 3 notebooks run" in indexed.run("reproduce").stdout
    assert indexed.run("clean-notebooks").stdout == ""


def test_it_follows_in_the_same_run_when_the_numbers_of_another_item_change(indexed):
    indexed.run("reproduce")
    ledger = indexed.root / "drivelib" / "papers" / "mini.toml"
    ledger.write_text(ledger.read_text().replace("threshold = 0.5", "threshold = 5.0"))
    done = indexed.run("reproduce")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 of 3 notebooks run" in done.stdout
    assert shown(indexed) == ["['reproduced', 'contradicted']\n"]
    assert indexed.run("status").stdout.count("fresh") == 3


def test_the_check_runs_it_last_and_sees_when_its_committed_text_is_old(indexed):
    indexed.run("reproduce")
    assert indexed.run("reproduce", "--check").returncode == 0
    path = indexed.root / "notebooks" / "index.ipynb"
    path.write_text(path.read_text().replace("'reproduced', 'reproduced'", "'reproduced', 'shown'"))
    done = indexed.run("reproduce", "--check")
    assert done.returncode == 1
    assert "differs: notebooks/index.ipynb" in done.stdout


def test_a_changed_finding_makes_it_stale_and_nothing_else(indexed):
    indexed.run("reproduce")
    path = indexed.root / "drivelib" / "papers" / "mini.toml"
    path.write_text('findings = ["It rises."]\n' + path.read_text())
    out = indexed.run("status").stdout
    assert "index: stale: findings changed" in out and out.count("fresh") == 2


def test_it_does_not_run_when_an_item_failed(indexed):
    indexed.write_cells("fig01_line", ["slope = 2.0", "raise RuntimeError('broken')"])
    done = indexed.run("reproduce")
    assert "index: not run, because mini/fig01_line failed" in done.stdout


@pytest.mark.parametrize("text, message", [("1 / 0", "ZeroDivisionError"), ("import sys; sys.exit(0)", "SystemExit"), ("import os; os.kill(os.getpid(), 9)", "Kernel died")])
def test_its_failures_are_named(indexed, text, message):
    write(indexed, text)
    done = indexed.run("reproduce")
    assert done.returncode == 1
    assert "failed: index: " in done.stdout and message in done.stdout


def test_what_it_records_is_published_and_kept_whole(indexed):
    write(indexed, RECORD)
    assert indexed.run("reproduce").returncode == 0
    figures = {path.name for path in (indexed.root / "figures").glob("index.*")}
    assert figures == {"index.png", "index.svg", "index.csv", "index.json"}
    (indexed.root / "figures" / "index.png").unlink()
    assert "index: stale: figures/index.png is missing" in indexed.run("status").stdout
    write(indexed, RECORD.replace("item.finish()", ""))
    assert "failed: index: finish() was not reached" in indexed.run("reproduce").stdout
