"""The chain from claim to figure has no gap and no loose end, and no verdict has drifted."""

import hashlib
import importlib
import json
import math
import re

import jsonschema
import pytest

from drivelib import claims, ledger, notebook, paths
from drivelib.pack import check, readme, report, runner

SECTION_A = (
    [f"eq{number:02d}" for number in range(1, 21)]
    + [f"fig{number:02d}" for number in range(1, 20)]
    + ["eq05/08", "net", "fig02-03/x", "eq20/x", "end-1", "end-2", "end-3"]
)
ITEMS = sorted(set(runner.items()) - {ledger.INDEX})
CLAIMS = {id_: claim for paper in ledger.papers().values() for id_, claim in paper.claims.items()}
EXPECTED = {id_: verdict for paper in ledger.papers().values() for id_, verdict in paper.expected.items()}
RESULTS = report.results()
SCHEMA = json.loads((paths.ledgers() / "record.schema.json").read_text())


@pytest.mark.parametrize("row", SECTION_A)
def test_every_row_of_eskanders_list_is_in_the_ledger(row):
    """A row may be split into several claims, such as torque and efficiency."""
    assert [id_ for id_ in CLAIMS if id_ == f"eskander/{row}" or id_.startswith(f"eskander/{row}/")]


@pytest.mark.parametrize("claim_id", [id_ for id_, claim in CLAIMS.items() if claim.item in ITEMS])
def test_the_computed_verdict_is_the_expected_one(claim_id):
    """In either direction: a sign error would turn a verdict, and so would a mended result."""
    verdict, reason = EXPECTED[claim_id]
    assert RESULTS[claim_id]["verdict"] == verdict
    assert reason


@pytest.mark.parametrize("claim_id", sorted(RESULTS))
def test_a_verdict_follows_from_the_number_beside_it(claim_id):
    """Whoever edits a JSON by hand must edit number and verdict consistently."""
    result, claim = RESULTS[claim_id], CLAIMS[claim_id]
    if claim.omitted:
        assert result["verdict"] == ledger.NOT_CHECKABLE
        return
    positive = {ledger.REPRODUCED, ledger.CORRECTED, ledger.SHOWN, ledger.FITTED}
    if result["verdict"] in positive:
        assert claim.holds(result["ours"])
    if result["verdict"] in {ledger.CONTRADICTED, ledger.NOT_REPRODUCED}:
        assert not claim.holds(result["ours"])
    if result["verdict"] == ledger.CORRECTED:
        assert not claim.holds(result["as_printed"])


@pytest.mark.parametrize("item", ITEMS)
def test_each_item_judges_its_claims_and_signs_its_artefacts(item):
    content = json.loads(paths.figure(item, "json").read_text())
    jsonschema.validate(content, SCHEMA)
    assert content["item"] == item
    assert content["published"] is True
    assert [claim["id"] for claim in content["claims"]] and {claim["id"] for claim in content["claims"]} == set(ledger.claims_of(item))
    for suffix, digest in content["artefacts"].items():
        assert hashlib.sha256(paths.figure(item, suffix).read_bytes()).hexdigest() == digest


@pytest.mark.parametrize("claim_id", [id_ for id_, claim in CLAIMS.items() if claim.item in ITEMS])
def test_each_claim_names_functions_that_exist_and_that_its_notebook_uses(claim_id):
    claim = CLAIMS[claim_id]
    text = "\n".join(notebook.code(notebook.read(paths.notebook(claim.item))))
    assert claim.functions
    for name in claim.functions:
        module, function = name.split(".")
        assert callable(getattr(importlib.import_module(f"drivelib.{module}"), function))
    used = [name for name in claim.functions if re.search(rf"\b{re.escape(name.split('.')[1])}\b", text)]
    assert used, f"{claim.item} uses none of {claim.functions}"


def test_no_figure_and_no_notebook_is_left_without_an_owner():
    assert check.orphans(runner.items()) == []


def test_each_item_has_claims_and_each_paper_item_links_its_code():
    for item in ITEMS:
        assert ledger.claims_of(item)
        prose = "\n".join(notebook.source(cell) for cell in notebook.read(paths.notebook(item))["cells"] if cell["cell_type"] == "markdown")
        links = re.findall(r"\]\(\.\./\.\./(drivelib/\w+\.py)\)", prose)
        assert links or item.startswith("beyond/")
        assert all((paths.root() / link).exists() for link in links)


def test_the_readmes_table_is_what_the_results_say():
    text = (paths.root() / "README.md").read_text()
    assert readme.rendered(text, RESULTS) == text


def test_open_claims_are_said_to_be_open():
    text = (paths.root() / "README.md").read_text()
    said = "".join(line for line in text.splitlines() if line.startswith("Open, because"))
    for claim, result, _ in report.rows(RESULTS):
        assert (result is None) == (claim.item not in ITEMS)
        assert result is not None or f"`{claim.id.split('/', 1)[1]}`" in said


def test_each_assumption_that_a_notebook_names_is_in_the_ledger():
    for item in ITEMS:
        known = ledger.papers()[item.split("/")[0]].assumptions
        prose = notebook.source(notebook.read(paths.notebook(item))["cells"][0])
        _, lead, omitted = prose.partition("**What is omitted")
        assert lead or item.startswith("beyond/")
        for name in re.findall(r"`([A-Za-z_-]+)`", omitted):
            assert name in known, (item, name)


def test_every_number_in_a_finding_comes_from_a_result():
    """A finding holds digits of its own only where the paper prints them or names a figure or equation."""
    for paper in ledger.papers().values():
        for headlines, written in ((False, paper.findings), (True, paper.headlines)):
            said = report.findings(paper, headlines=headlines)
            assert len(said) == len(written) or any(id_ not in ITEMS for id_ in paper.items)
            for sentence in said:
                assert "{" not in sentence


def test_the_readme_begins_with_five_headlines():
    assert sum(len(paper.headlines) for paper in ledger.papers().values()) == 5


def test_an_item_names_the_equations_of_its_claims():
    for claim in CLAIMS.values():
        if claim.item.startswith("beyond/"):
            continue  # of no paper
        named = ledger.papers()[claim.item.split("/")[0]].items[claim.item].equations
        spans = [part.split("–") for part in named.split(", ") if part]
        known = {number for span in spans for number in range(int(span[0]), int(span[-1]) + 1)}
        for number in re.findall(r"(?<!claim )\((\d+)\)", claim.where):
            assert int(number) in known, claim.id


@pytest.mark.parametrize(
    ("relation", "bound", "ours", "used"),
    [
        ("matches", ("118.9", 0.05), 118.91, 0.2),
        ("<=", 5.0, 4.0, 0.8),
        (">=", 2.0, 4.0, 0.5),
        (">=", 2.0, -1.0, math.inf),
        ("<=", 0.0, -3.0, 0.0),
        ("<=", 1.0, math.nan, math.inf),
        ("==", 0.0, 0.0, 0.0),
        ("==", 3.0, 2.0, math.inf),
        ("between", (1.0, 3.0), 4.0, 2.0),
    ],
)
def test_usage_of_what_a_claim_is_allowed(relation, bound, ours, used):
    """By hand: 0.01 of 0.05, 4 of 5, 2 of 4, and so on; a claim uses at most all of it exactly where it holds."""
    printed, tolerance = bound if relation == "matches" else (None, None)
    claim = claims.Claim("p/c", "p/i", "", "", relation, printed=printed, tolerance=tolerance, threshold=None if printed else bound)
    got = report.usage(claim, {"ours": ours})
    assert got == pytest.approx(used)
    assert (got <= 1) == claim.holds(ours)


def test_no_public_function_of_the_physics_is_left_unused():
    """Each is named by a claim, called in a notebook or another file of drivelib, or is what a test measures with."""
    named = {name for claim in CLAIMS.values() for name in claim.functions}
    texts = ["\n".join(notebook.code(notebook.read(paths.notebook(item)))) for item in ITEMS]
    package = paths.root() / "drivelib"
    sources = {path.stem: path.read_text() for folder in (package, paths.root() / "tests") for path in folder.rglob("*.py")}
    for module in ("pmsm", "pmsm_optimum", "pmsm_angle", "circuits", "identification", "curves", "networks", "dfim", "dfim_decoupling", "dfim_optimum", "metrics"):
        public = [name for name, value in vars(importlib.import_module(f"drivelib.{module}")).items() if getattr(value, "__module__", "") == f"drivelib.{module}"]
        for name in public:
            if name.startswith("_") or f"{module}.{name}" in named:
                continue
            elsewhere = "\n".join([*texts, *(text for stem, text in sources.items() if stem != module)])
            inside = len(re.findall(rf"\b{name}\b", sources[module])) > 1
            assert inside or re.search(rf"\b{name}\b", elsewhere), f"{module}.{name}"
