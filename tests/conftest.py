"""Fixtures: a miniature pack in a folder of its own, the command line as a user calls it, and the motors whose exports are tested."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from drivelib import environment, loss_map, notebook
from drivelib.dfim_machines import DFIM_4KW
from drivelib.machines import IPMSM_2200W
from drivelib.pack import tokens
from exported_c import CURRENT, made

REPOSITORY = Path(__file__).resolve().parent.parent

LEDGER = """
citation = "A miniature paper."
[items.fig01_line]
title = "Fig. 1: a line"
[items.fig02_next]
title = "Fig. 2: the next line"
[[claims]]
id = "slope"
item = "fig01_line"
where = "sec. 1"
text = "The slope is two."
measure = "slope"
relation = "matches"
printed = "2.00"
[[claims]]
id = "rise"
item = "fig02_next"
where = "sec. 2"
text = "It rises."
measure = "rise"
relation = ">="
threshold = 0.5
reason = "half a unit is visible"
"""

PYPROJECT = """
[tool.drivelib.limits]
notebook_seconds = 20
beyond_seconds = 20
output_bytes = 200000
"""

README = "# Mini\n\n<!-- verdicts: begin (rendered by `python -m drivelib reproduce`) -->\n<!-- verdicts: end -->\n"


def cells(item, claim, ours="slope", work=""):
    """Return the code cells of a small, complete notebook."""
    return [
        "slope = 2.0  # the one parameter",
        f"from drivelib import plotting, record\n\nitem = record.begin({item!r})",
        work,
        "fig, axis = plotting.figure('Fig. 1: a line')\naxis.plot([0, 1], [0, slope])\n"
        "item.show(fig, alt='A line.', columns=[record.Column('y', 'm', 'height', [0.0, slope])])",
        f"item.compare({claim!r}, {ours})\nitem.table()",
        "item.finish()",
    ]


def write_notebook(path, sources):
    """Write code cells as a notebook; the first is the parameters cell."""
    content = {"nbformat": 4, "nbformat_minor": 5, "metadata": {}, "cells": []}
    for number, text in enumerate(sources):
        metadata = {"tags": ["parameters"]} if number == 0 else {}
        content["cells"].append({"cell_type": "code", "metadata": metadata, "source": text, "outputs": [], "execution_count": None})
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(notebook.dumps(notebook.normalised(content)))


class Mini:
    """A pack of two tiny notebooks in ``root``."""

    def __init__(self, root):
        self.root = root
        for name, text in (("drivelib/papers/mini.toml", LEDGER), ("pyproject.toml", PYPROJECT), ("README.md", README), ("environment.lock", "x==1\n")):
            path = root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        self.write("fig01_line", "mini/slope")
        self.write("fig02_next", "mini/rise")

    def notebook(self, stem):
        return self.root / "notebooks" / "mini" / f"{stem}.ipynb"

    def figure(self, stem, suffix):
        return self.root / "figures" / "mini" / f"{stem}.{suffix}"

    def write(self, stem, claim, **options):
        write_notebook(self.notebook(stem), cells(f"mini/{stem}", claim, **options))

    def write_cells(self, stem, sources):
        write_notebook(self.notebook(stem), sources)

    def files(self):
        """Return {relative path: bytes} of everything outside build/."""
        return {
            path.relative_to(self.root).as_posix(): path.read_bytes()
            for path in sorted(self.root.rglob("*"))
            if path.is_file() and "build" not in path.relative_to(self.root).parts
        }

    def run(self, *arguments, **options):
        """Call ``python -m drivelib`` on this pack; return the finished process."""
        return subprocess.run(self.command(*arguments), **{"env": self.environment(), "capture_output": True, "text": True, "timeout": 120, **options})

    def survivors(self, spare_forked_from=True):
        """Return the processes that a run of this pack has left behind; other packs may be at work meanwhile.

        The process that kernels are forked from runs no notebook, and ends a moment after its runner.
        """
        left = []
        for process in psutil.process_iter():
            try:
                environment_ = process.environ()
                spared = (None, tokens.NO_RUN) if spare_forked_from else (None,)
                mine = environment_.get(tokens.TOKEN) not in spared and environment_.get("DRIVELIB_ROOT") == str(self.root)
                if mine and process.status() != psutil.STATUS_ZOMBIE:
                    left.append(process)
            except psutil.Error:
                continue
        return left

    def wait_for_kernel(self):
        """Wait until a kernel of this pack is at work; fail when none ever is, for then nothing would be proved."""
        deadline = time.monotonic() + 60
        while not self.survivors():
            assert time.monotonic() < deadline, "no kernel ever started"
            time.sleep(0.1)

    def command(self, *arguments):
        return [sys.executable, "-m", "drivelib", *map(str, arguments)]

    def environment(self):
        return environment.pinned(DRIVELIB_ROOT=self.root, PYTHONPATH=REPOSITORY, COLUMNS="400")

    def claims(self, stem):
        return {claim["id"]: claim for claim in json.loads(self.figure(stem, "json").read_text())["claims"]}


@pytest.fixture
def mini(tmp_path):
    """A fresh miniature pack."""
    return Mini(tmp_path / "pack")


@pytest.fixture(scope="session")
def ran(tmp_path_factory):
    """A miniature pack after one successful reproduce; copy it before changing it."""
    pack = Mini(tmp_path_factory.mktemp("ran") / "pack")
    done = pack.run("reproduce")
    assert done.returncode == 0, done.stdout + done.stderr
    return pack


@pytest.fixture
def reproduced(ran, tmp_path):
    """A copy of a miniature pack that is fresh."""
    import shutil

    shutil.copytree(ran.root, tmp_path / "pack")
    pack = Mini.__new__(Mini)
    pack.root = tmp_path / "pack"
    return pack


@pytest.fixture(scope="session")
def repository():
    """The root of this repository."""
    return REPOSITORY


@pytest.fixture(autouse=True)
def _no_stray_root(monkeypatch):
    monkeypatch.delenv("DRIVELIB_ROOT", raising=False)
    for name in ("DRIVELIB_PUBLISH", "DRIVELIB_OUT", "DRIVELIB_LIES", "DRIVELIB_READ"):
        monkeypatch.delenv(name, raising=False)
    assert os.environ.get("MPLBACKEND", "agg") == "agg"


@pytest.fixture(scope="session")
def built_site(tmp_path_factory):
    """The site of this repository, built as a user builds it; warnings are errors."""
    target = tmp_path_factory.mktemp("site") / "html"
    command = [sys.executable, "-m", "drivelib", "site", "--out", str(target)]
    done = subprocess.run(command, cwd=REPOSITORY, env=environment.pinned(PYTHONPATH=REPOSITORY), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return target


@pytest.fixture(params=[*CURRENT, DFIM_4KW], ids=lambda machine: machine.name)
def motor(request):
    """A map and its trained network, of every kind of motor."""
    return made(request.param)


@pytest.fixture(params=list(CURRENT), ids=lambda machine: machine.name)
def pmsm_motor(request):
    """A map and its trained network, of every PMSM."""
    return made(request.param)


@pytest.fixture(scope="session")
def some_map():
    """A small map of the example's motor, for networks that were never trained on it."""
    speed, torque = np.linspace(16, 160, 5), np.linspace(1, 14, 4)
    return loss_map.loss_map(IPMSM_2200W, speed, torque, V_max=300.0, I_max=9.0)
