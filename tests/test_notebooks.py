"""Every notebook has the eight sections, its outputs are in the committed form, and nothing is too large."""

import re
import subprocess

import pytest

from drivelib import ledger, notebook, paths
from drivelib.pack import attempt, runner

ITEMS = sorted(set(runner.items()) - {ledger.INDEX})  # the index is checked for what it shows, not for its sections
PAPER_ITEMS = [item for item in ITEMS if not item.startswith("beyond/")]


def cells(item):
    return notebook.read(paths.notebook(item))["cells"]


def first(item, pattern):
    """Return the number of the first code cell that matches, failing when there is none."""
    for number, cell in enumerate(cells(item)):
        if cell["cell_type"] == "code" and re.search(pattern, notebook.source(cell)):
            return number
    pytest.fail(f"{item}: no cell with {pattern}")


@pytest.mark.parametrize("item", PAPER_ITEMS)
def test_the_eight_sections_stand_in_order(item):
    content = cells(item)
    assert content[0]["cell_type"] == "markdown"
    head = notebook.source(content[0])
    assert re.match(r"# (Fig\.|Table) ", head)
    assert "**What the paper shows.**" in head
    assert "**What is omitted, and what we assume.**" in head
    parameters = next(number for number, cell in enumerate(content) if "parameters" in cell["metadata"].get("tags", ()))
    order = [parameters] + [first(item, rf"\b{call}\(") for call in ("begin", "show", "compare", "table", "reading", "finish")]
    assert order == sorted(order)
    assert order[-1] == len(content) - 1
    assert 8 <= len(content) <= 14


@pytest.mark.parametrize("item", [item for item in ITEMS if item.startswith("beyond/")])
def test_beyond_the_papers_a_notebook_has_parameters_begins_and_finishes(item):
    content = cells(item)
    parameters = next(number for number, cell in enumerate(content) if "parameters" in cell["metadata"].get("tags", ()))
    order = [parameters, first(item, r"\bbegin\("), first(item, r"\bfinish\(")]
    assert order == sorted(order)
    assert order[-1] == len(content) - 1


@pytest.mark.parametrize("item", ITEMS)
def test_parameters_are_literals_each_with_a_comment(item):
    content = notebook.read(paths.notebook(item))
    assert notebook.parameters(content, item)
    (tagged,) = [notebook.source(cell) for cell in content["cells"] if "parameters" in cell["metadata"].get("tags", ())]
    assert all("  # " in line for line in tagged.splitlines())


@pytest.mark.parametrize("item", ITEMS)
def test_a_notebook_holds_no_long_code(item):
    for text in notebook.code(notebook.read(paths.notebook(item))):
        assert len(text.splitlines()) <= 40


@pytest.mark.parametrize("item", ITEMS)
def test_committed_outputs_are_complete_and_normalised(item):
    content = notebook.read(paths.notebook(item))
    assert notebook.dumps(notebook.normalised(content)) == paths.notebook(item).read_bytes()
    assert notebook.unpublishable(content) == []
    assert all(cell["execution_count"] for cell in content["cells"] if cell["cell_type"] == "code")
    text = notebook.dumps(content).decode()
    assert "image/png" in text
    assert not re.search(r"/home/|/root/|/tmp/|papermill| at 0x[0-9a-f]+>", text)


@pytest.mark.parametrize("item", ITEMS)
def test_nothing_is_shown_that_only_happens_to_end_a_cell(item):
    """Such as what a call on an axis gives back; what is meant for readers has a form of its own beside the plain text."""
    for cell in notebook.read(paths.notebook(item))["cells"]:
        for output in cell.get("outputs", ()):
            assert output["output_type"] != "execute_result" or set(output["data"]) != {"text/plain"}, notebook.source(cell)[-80:]


@pytest.mark.parametrize("item", ITEMS)
def test_sizes_stay_small(item):
    for suffix, limit in attempt.SIZE_LIMITS.items():
        path = paths.notebook(item) if suffix == ".ipynb" else paths.figure(item, suffix.removeprefix("."))
        assert path.stat().st_size <= limit


@pytest.mark.parametrize("item", ITEMS)
def test_every_csv_column_carries_unit_and_meaning(item):
    lines = paths.figure(item, "csv").read_text().splitlines()
    header = next(line for line in lines if not line.startswith("#"))
    described = re.findall(r"^# (\S+) \[[^\]]+\]: \S+", "\n".join(lines), re.MULTILINE)
    assert described == header.split(",")


def test_the_repository_stays_small(repository):
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=repository, capture_output=True, text=True, check=True).stdout.split("\0")
    assert sum((repository / name).stat().st_size for name in listed if name and (repository / name).exists()) < 40e6
