"""The comparison with other processors: run in one process it gives the runner's bytes, and it sees a difference."""

import json
import shutil

import pytest
from rich.console import Console

from drivelib.pack import cells, processors

WORK = "import numpy as np\nslope += 1e-3 * float(np.sum(np.exp(np.linspace(0, 1, 1001)) @ np.ones((1001, 7))))"
needs_qemu = pytest.mark.skipif(shutil.which(processors.EMULATOR) is None, reason=f"needs {processors.EMULATOR} (Debian: qemu-user)")


@pytest.fixture
def here(reproduced, monkeypatch):
    monkeypatch.setenv("DRIVELIB_ROOT", str(reproduced.root))
    return reproduced


def test_cells_in_one_process_write_the_bytes_of_the_kernel(here, tmp_path):
    seconds, failure = processors.run(tmp_path / "run", "mini/fig01_line", {}, processors.NATIVE)
    assert failure is None and seconds > 0
    for suffix in ("png", "svg", "csv", "json"):
        assert (tmp_path / "run" / "out" / f"fig01_line.{suffix}").read_bytes() == here.figure("fig01_line", suffix).read_bytes()


def test_a_failing_cell_is_named(here, tmp_path):
    here.write("fig01_line", "mini/slope", work="raise RuntimeError('no bearing')")
    assert processors.run(tmp_path / "run", "mini/fig01_line", {}, processors.NATIVE)[1] == "failed: RuntimeError: no bearing"


def test_the_comparison_says_why_a_run_failed(here, capsys):
    here.write("fig01_line", "mini/slope", work="import os\nassert 'OPENBLAS_CORETYPE' in os.environ, 'no bearing'")
    assert processors.compare(Console(width=200), cpus=(), names=["mini/fig01"], without=("OPENBLAS_CORETYPE",)) == 1
    said = capsys.readouterr().out.splitlines()
    assert said[0].endswith("s: the reference") and "without OPENBLAS_CORETYPE" in said[1] and said[1].endswith("failed: AssertionError: no bearing")


def test_differences_in_files_and_in_memory_are_named(here, tmp_path):
    for name, slope in (("a", 2.0), ("b", 2.0 + 4.5e-16), ("c", 2.001)):
        processors.run(tmp_path / name, "mini/fig01_line", {"slope": slope}, processors.NATIVE)
    a, b, c = (tmp_path / name for name in "abc")
    assert [line.split(":")[0] for line in processors.differences(a, c, "mini/fig01_line")] == [f"fig01_line.{suffix}" for suffix in ("png", "svg", "csv", "json")]
    assert processors.differences(a, b, "mini/fig01_line") == [
        "fig01_line.json: /parameters/slope: committed 2.0, computed 2.0000000000000004"
    ]  # a parameter is written as given, everything computed is rounded
    assert processors.in_memory(a, b) == "0 of 1 variables agree to the last bit, not slope"
    assert processors.in_memory(a, a) == "1 of 1 variables agree to the last bit"


def test_raw_sees_the_last_bit_of_whatever_a_notebook_holds():
    import numpy as np

    deep = cells.raw({"x": [{"a": (np.array([1.0]), 2.0)}], "_hidden": 1.0, "n": 3, "text": "x"})
    assert list(deep) == ["x"]
    assert cells.raw({"x": [{"a": (np.array([np.nextafter(1.0, 2)]), 2.0)}]}) != deep


def test_a_missing_emulator_and_a_wrong_pin_are_named(here, monkeypatch):
    with pytest.raises(ValueError, match="--without X: no pin; the pins are OPENBLAS_CORETYPE"):
        processors.compare(Console(), cpus=(), without=("X",))
    monkeypatch.setattr(processors.shutil, "which", lambda name: None)
    with pytest.raises(ValueError, match="qemu-x86_64 is not installed"):
        processors.compare(Console(), cpus=("Haswell",))


@pytest.mark.qemu
@needs_qemu
def test_an_emulated_haswell_writes_the_same_bytes(here):
    here.write("fig01_line", "mini/slope", work=WORK)
    done = here.run("verify", "--cpu", "Haswell", "--jobs", "1", "mini/fig01")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "mini/fig01_line on Haswell" in done.stdout and "1 of 1 variables agree to the last bit" in done.stdout
    assert json.loads(here.figure("fig01_line", "json").read_text())["claims"][0]["ours"] == 2.0  # nothing was published


def test_the_hardest_notebooks_exist_and_have_the_parameters(repository):
    from drivelib import notebook, paths
    from drivelib.pack import runner

    for name, given in processors.HARDEST.items():
        (item,) = runner.select([name])
        notebook.check_overrides(given, notebook.parameters(notebook.read(paths.notebook(item))), item)
