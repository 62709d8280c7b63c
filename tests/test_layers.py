"""Lower layers never import higher ones, and importing drivelib is cheap."""

import ast
import re
import subprocess
import sys

import pytest

from drivelib.pack import freshness
from drivelib.pack.architecture import LAYERS, layer_of

FILES = sorted(path.relative_to(freshness.PACKAGE).with_suffix("").as_posix() for path in freshness.PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("name", FILES)
def test_a_file_imports_its_own_layer_and_lower_ones_only(name):
    text = (freshness.PACKAGE / f"{name}.py").read_text()
    for imported in freshness._imported(text):
        assert layer_of(imported.removesuffix(".py")) <= layer_of(name), f"{name} imports {imported}"


def test_no_layer_lists_a_file_that_is_not_there_or_that_another_one_lists():
    listed = [name for layer in LAYERS for name in layer.files]
    assert sorted(listed) == FILES


def test_the_picture_of_the_layers_shows_what_the_code_imports(repository):
    picture = re.search(r"```mermaid\n(.*?)```", (repository / "CONTRIBUTING.md").read_text(), re.DOTALL).group(1)
    drawn = set(re.findall(r"(\w+)(?:\[.*?\])? --> (\w+)", picture))
    found = {
        (LAYERS[layer_of(name)].name, LAYERS[layer_of(imported.removesuffix(".py"))].name)
        for name in FILES
        for imported in freshness._imported((freshness.PACKAGE / f"{name}.py").read_text())
    }
    assert drawn == {(above, below) for above, below in found if above != below and below != "Ground"}


def test_no_two_files_import_one_another_in_a_circle():
    from graphlib import TopologicalSorter

    def at_import_time(name):
        tree = ast.parse((freshness.PACKAGE / f"{name}.py").read_text())
        tree.body = [node for node in tree.body if isinstance(node, (ast.Import, ast.ImportFrom))]
        return {found.removesuffix(".py") for found in freshness._imported(ast.unparse(tree))} - {name}

    TopologicalSorter({name: at_import_time(name) for name in FILES}).prepare()


@pytest.mark.parametrize("heavy", ["torch", "skfuzzy", "sympy", "papermill", "schemdraw"])
def test_the_physics_pays_for_nothing_heavy(heavy):
    code = f"import sys; from drivelib import machines, pmsm, pmsm_optimum, pmsm_angle, curves; print({heavy!r} in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


@pytest.mark.parametrize("name", FILES)
def test_files_stay_short(name):
    assert len((freshness.PACKAGE / f"{name}.py").read_text().splitlines()) <= 300


@pytest.mark.parametrize("path", sorted(freshness.PACKAGE.glob("*.py")), ids=lambda path: path.stem)
def test_everything_is_compiled_with_the_one_set_of_options(path):
    """numba's cache confuses a function with itself under other options: see `drivelib.compiled`."""
    nodes = list(ast.walk(ast.parse(path.read_text())))
    imported = {alias.name for node in nodes if isinstance(node, ast.ImportFrom) and node.module == "numba" for alias in node.names}
    attributes = {node.attr for node in nodes if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "numba"}
    assert imported <= {"njit"} and attributes <= {"__version__"}  # no other compiler, and no other name for this one
    calls = [node for node in nodes if isinstance(node, ast.Call) and ast.unparse(node.func) == "njit"]
    assert len(calls) == sum(isinstance(node, ast.Name) and node.id == "njit" for node in nodes)  # a bare decorator has no options
    for call in calls:
        assert any(keyword.arg is None and ast.unparse(keyword.value) == "OPTIONS" for keyword in call.keywords), f"line {call.lineno}"
        assert {keyword.arg for keyword in call.keywords} <= {None, "inline", "fastmath"}
        assert not call.args
