"""The pins reach every process, and compiled code never outlives its sources."""

import os
import shutil
import subprocess
import sys

import pytest

from drivelib import environment
from drivelib.pack import freshness


def test_the_tests_themselves_run_under_the_pins():
    """`make test` sets them; by hand use `python -m drivelib test`."""
    assert environment.missing_pins() == []


def test_a_kernel_gets_the_pins_and_nothing_of_the_user(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONSTARTUP", "x.py")
    monkeypatch.setenv("SECRET", "1")
    kernel = environment.kernel(tmp_path)
    assert environment.PINS.items() <= kernel.items()
    assert kernel["HOME"] == kernel["IPYTHONDIR"] == str(tmp_path)
    assert not {"PYTHONSTARTUP", "SECRET"} & set(kernel)


def test_a_missing_pin_is_named(monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setenv("ATEN_CPU_CAPABILITY", "avx512")
    assert environment.missing_pins() == ["ATEN_CPU_CAPABILITY", "OMP_NUM_THREADS"]


def test_provenance_names_what_computed():
    found = environment.provenance()
    assert found["packages"]["numpy"] and found["python"].startswith("3.") and found["processor"]


@pytest.fixture
def copied(tmp_path):
    """A copy of drivelib in a folder of its own, and a function that runs code against it."""
    shutil.copytree(freshness.PACKAGE, tmp_path / "drivelib", ignore=shutil.ignore_patterns("__pycache__"))

    def run(code):
        clean = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
        done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, env=clean, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return done.stdout.split()

    run.folder = tmp_path
    return run


def test_a_sign_flipped_in_a_physics_file_changes_the_compiled_result(copied):
    """The loop in pmsm_plant.py is cached; it calls pmsm_dynamics.py, whose change numba alone would not notice."""
    code = (
        "from drivelib.pmsm_drive import simulate; from drivelib.pmsm_scenario import Scenario\n"
        "run = simulate(Scenario(speed=100.0, load=((0.0, 1.0), (0.01, 2.0)), duration=0.02))\n"
        "import drivelib, os; print(repr(run['T_e'][-1]), drivelib.__file__, os.environ['NUMBA_CACHE_DIR'])"
    )
    first, where, cache = copied(code)[-3:]
    assert where.startswith(str(copied.folder)) and cache.startswith(str(copied.folder))
    assert copied(code)[-3:] == [first, where, cache]
    path = copied.folder / "drivelib" / "pmsm_dynamics.py"
    text = path.read_text()
    changed = text.replace("c.psi_f + (c.L_d - c.L_q) * i_od", "c.psi_f - (c.L_d - c.L_q) * i_od")
    assert changed != text
    path.write_text(changed)
    other, _, other_cache = copied(code)[-3:]
    assert other_cache != cache
    assert other != first
