"""Each file of the pack changed in turn: exactly the items that depend on it become stale, and the reason is named."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from drivelib import ledger, notebook, paths
from drivelib.pack import freshness, runner

ITEMS = runner.items()
CLAIMS = {id_: claim for paper in ledger.papers().values() for id_, claim in paper.claims.items()}

# Runs the import statements of every notebook, one after the other, and lists the drivelib modules that are then there.
IMPORTS = """
import ast, json, sys
sources = json.load(sys.stdin)
found = {}
for item, text in sources.items():
    for name in [name for name in sys.modules if name.split(".")[0] == "drivelib"]:
        del sys.modules[name]
    for node in ast.parse(text).body:
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            exec(compile(ast.Module([node], []), item, "exec"), {})
    files = [module.__file__ for name, module in sys.modules.items() if name.split(".")[0] == "drivelib"]
    found[item] = sorted(set(files))
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    """Every item recorded as fresh, once."""
    folder = tmp_path_factory.mktemp("records")
    with pytest.MonkeyPatch.context() as patch:
        _patch(patch, folder)
        for item in ITEMS.values():
            freshness.write_record(item, freshness.parts(item))
    return folder


@pytest.fixture
def recorded(records, monkeypatch):
    """Every item is fresh; figures are those of the repository."""
    _patch(monkeypatch, records)


def _patch(patch, folder):
    patch.setattr(freshness, "_record_path", lambda id_: folder / f"{id_.replace('/', '-')}.json")


def test_nothing_is_stale_to_begin_with(recorded):
    assert stale() == {}


def stale():
    """Return {item: reasons} of the items that are not fresh."""
    reasons = {id_: freshness.why_stale(item) for id_, item in ITEMS.items()}
    return {id_: said for id_, said in reasons.items() if said}


def test_the_closure_holds_every_module_that_python_really_imports():
    """The closure is read off the sources; Python's own import is the judge. Imports inside functions come on top."""
    sources = {id_: "\n".join(notebook.code(notebook.read(paths.notebook(id_)))) for id_ in ITEMS}
    done = subprocess.run([sys.executable, "-c", IMPORTS], input=json.dumps(sources), capture_output=True, text=True, check=True)
    for id_, files in json.loads(done.stdout).items():
        imported = {name.removeprefix(f"{freshness.PACKAGE}/") for name in files}
        assert len(imported) > 3 or id_ == ledger.INDEX
        assert imported <= set(freshness.closure([sources[id_]])), id_


@pytest.mark.parametrize("module", sorted(path.relative_to(freshness.PACKAGE).as_posix() for path in freshness.PACKAGE.rglob("*.py")))
def test_each_source_file(recorded, monkeypatch, module):
    """Against the notebooks that name the file in their own records, and never the whole pack for a file of the runner."""
    digest = freshness.file_digest
    monkeypatch.setattr(freshness, "file_digest", lambda path: "changed" if path == freshness.PACKAGE / module else digest(path))
    wanted = {id_ for id_ in ITEMS if f"drivelib/{module}" in freshness.record(id_)["parts"]}
    assert stale() == {id_: [f"drivelib/{module} changed"] for id_ in wanted}
    if module.startswith("pack/"):
        assert wanted <= {ledger.INDEX}  # it shows the findings as the README does
    if module in ("record.py", "ledger.py", "__init__.py"):
        assert wanted >= set(ITEMS) - {ledger.INDEX}


def test_a_change_of_the_machine_sets_reaches_the_drives_and_spares_what_has_no_machine(recorded, monkeypatch):
    digest = freshness.file_digest
    monkeypatch.setattr(freshness, "file_digest", lambda path: "changed" if path.name == "machines.py" else digest(path))
    text = {id_: "\n".join(notebook.code(notebook.read(paths.notebook(id_)))) for id_ in ITEMS}
    users = {id_ for id_ in ITEMS if "drivelib.machines import" in text[id_]}
    assert users and users <= set(stale())


@pytest.mark.parametrize("claim", [id_ for id_, claim in CLAIMS.items() if claim.item in ITEMS])
def test_each_claim(recorded, monkeypatch, claim):
    real = ledger.claims_of

    def changed(item):
        found = dict(real(item))
        if claim in found:
            found[claim] = type(found[claim])(**(vars(found[claim]) | {"measure": "changed"}))
        return found

    monkeypatch.setattr(ledger, "claims_of", changed)
    assert stale() == {CLAIMS[claim].item: ["claims changed"]}


@pytest.mark.parametrize("item", ITEMS)
def test_each_parameter_cell_and_each_text(recorded, monkeypatch, item):
    real = notebook.read

    def changed(path):
        content = real(path)
        if path == paths.notebook(item):
            code = [cell for cell in content["cells"] if cell["cell_type"] == "code"]
            cell = next((cell for cell in code if "parameters" in cell["metadata"].get("tags", ())), code[0])
            cell["source"] = notebook.source(cell) + "\nanother = 1"
        return content

    monkeypatch.setattr(notebook, "read", changed)
    assert stale() == {item: ["cells and parameters changed"]}


def test_the_lock_reaches_everything(recorded, monkeypatch):
    digest = freshness.file_digest
    monkeypatch.setattr(freshness, "file_digest", lambda path: "changed" if path == paths.root() / "environment.lock" else digest(path))
    assert stale() == {id_: ["environment.lock changed"] for id_ in ITEMS}


@pytest.mark.parametrize("item", ITEMS)
def test_each_published_file(recorded, monkeypatch, item):
    """A changed figure makes its own item stale; changed numbers also whoever reads them."""
    readers = {id_ for id_, other in ITEMS.items() if item in other.needs}
    digest = freshness.file_digest
    for path in filter(Path.exists, freshness.artefacts(item)):
        monkeypatch.setattr(freshness, "file_digest", lambda one, path=path: "changed" if one == path else digest(one))
        found = stale()
        assert set(found) == ({item} | readers if path.suffix == ".json" else {item})
        assert path.name in found[item][0]
