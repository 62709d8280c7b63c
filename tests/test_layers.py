"""Lower layers never import higher ones, and importing drivelib is cheap."""

import ast
import subprocess
import sys

import pytest

from drivelib.pack import freshness

LAYERS = (
    {"__init__", "paths", "validation", "profiles"},
    {"machines", "curves", "pmsm", "pmsm_angle", "pmsm_optimum", "circuits", "identification", "metrics", "dfim_machines", "dfim", "dfim_decoupling", "dfim_response", "pmsm_dynamics", "transients", "decimation", "table2"},
    {"control", "fuzzy", "fuzzy_facts", "fuzzy_reference", "fuzzy_sets", "neural", "levenberg", "training", "networks", "speed_law", "pmsm_law", "loss_map", "fixed_point", "export_c", "encoder", "fuzzy_noise", "operations", "map_rivals"},
    {"dfim_plant", "pwm", "dfim_control", "dfim_loop", "dfim_lanes", "dfim_many", "ensemble", "shards", "space", "dfim_scenario", "dfim_drive", "pmsm_plant", "pmsm_scenario", "pmsm_loop", "pmsm_drive", "ann_data", "contest", "table2_fit", "tuning", "fair_networks", "fair_contest"},
    {"ledger", "symbolic", "derivations", "derivations_zidani"},
    {"environment", "bootstrap", "notebook", "plotting", "diagrams", "network_diagram", "schemes", "schemes_zidani", "orientation", "record", "export"},
    {"pack/__init__", "pack/freshness", "pack/worker", "pack/runner", "pack/check", "pack/report", "pack/difference", "pack/commands", "pack/layers", "pack/publishing", "pack/review", "pack/verify", "pack/cells", "pack/processors", "__main__"},
)
FILES = sorted(path.relative_to(freshness.PACKAGE).with_suffix("").as_posix() for path in freshness.PACKAGE.rglob("*.py"))


def layer(name):
    found = [number for number, names in enumerate(LAYERS) if name in names or name == "papers/__init__"]
    assert found, f"{name} belongs to no layer; add it to LAYERS"
    return found[0]


@pytest.mark.parametrize("name", FILES)
def test_a_file_imports_its_own_layer_and_lower_ones_only(name):
    text = (freshness.PACKAGE / f"{name}.py").read_text()
    for imported in freshness._imported(text):
        assert layer(imported.removesuffix(".py")) <= layer(name), f"{name} imports {imported}"


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
