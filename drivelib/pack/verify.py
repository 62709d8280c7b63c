"""The expensive checks: the pack regenerated elsewhere and otherwise, and on other processors.

A permutation changes all that must not matter: place, user, home, working directory, language, time zone, number of
jobs and order.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from drivelib import notebook, paths
from drivelib.__main__ import parse_parameter
from drivelib.pack import freshness, processors, runner

TREE = ("notebooks", "figures", "drivelib", "README.md", "pyproject.toml", "environment.lock")


@dataclass(frozen=True)
class Permutation:
    """One way to run the pack that must not change a byte."""

    name: str
    jobs: int
    seed: int
    variables: dict
    working_directory: str = "/"
    uid: int | None = None  # in a user namespace, where the system has them
    plain: bool = False  # every kernel a new Python, none forked


PERMUTATIONS = (
    Permutation(
        "one at a time, plain kernels, shuffled, Turkish, Kathmandu",
        1,
        7,
        {"LC_ALL": "tr_TR.UTF-8", "LANG": "tr_TR.UTF-8", "TZ": "Asia/Kathmandu", "USER": "rosa"},
        plain=True,
    ),
    Permutation(
        "many at a time, shuffled otherwise, plain C, another user, Newfoundland",
        2 * (os.cpu_count() or 1),
        2026,
        {"LC_ALL": "C", "LANG": "C", "TZ": "America/St_Johns", "USER": "emma", "PYTHONHASHSEED": "random"},
        working_directory=tempfile.gettempdir(),
        uid=1234,
    ),
)


def verify(options):
    """Run the permutations, or with --cpu or --without compare processors; exit status 1 when a byte differs."""
    console = Console()
    if options.jobs < 1:
        raise ValueError(f"--jobs {options.jobs}: must be at least 1")
    given = dict(map(parse_parameter, options.parameters))
    if options.cpu or options.without:
        for name in options.items:
            (item,) = runner.select([name])
            notebook.check_overrides(given, notebook.parameters(notebook.read(paths.notebook(item))), item)
        count = processors.compare(
            console, cpus=options.cpu, names=options.items, given=given, without=tuple(options.without), jobs=options.jobs
        )
        console.print(f"{count} differences", highlight=False)
        return 1 if count else 0
    if options.items or given:
        raise ValueError("items and -p go with --cpu or --without; permutations are of the whole pack")
    failed = 0
    for permutation in PERMUTATIONS:
        with tempfile.TemporaryDirectory(prefix="drivelib verify ") as folder:  # a blank in the path is part of the test
            done = regenerate(permutation, paths.root(), Path(folder) / "elsewhere")
            apart = compare(paths.root(), Path(folder) / "elsewhere")
        failed += bool(done.returncode or apart)
        for line in [*apart, *((done.stdout + done.stderr).strip().splitlines()[-5:] if done.returncode else [])]:
            console.print(f"  {line}", markup=False, highlight=False, soft_wrap=True)
        console.print(f"{permutation.name}: {'FAILED' if done.returncode or apart else 'the same bytes'}", highlight=False)
    return 1 if failed else 0


def regenerate(permutation, source, target):
    """Copy a tree and reproduce everything in the copy under one permutation; return the finished process."""
    for name in TREE:
        copy = shutil.copytree if (source / name).is_dir() else shutil.copy2
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        copy(source / name, target / name, **({"ignore": shutil.ignore_patterns("__pycache__")} if copy is shutil.copytree else {}))
    home = target.parent / "home of another"
    home.mkdir()
    package = target if (target / "drivelib" / "__init__.py").exists() else freshness.PACKAGE.parent
    variables = {name: value for name, value in os.environ.items() if name not in ("PYTHONHASHSEED", "LC_ALL", "LANG", "TZ")}
    variables |= {"HOME": str(home), "LOGNAME": permutation.variables["USER"], "DRIVELIB_ROOT": str(target), "PYTHONPATH": str(package)}
    command = [sys.executable, "-m", "drivelib", "reproduce", "--force", "--jobs", str(permutation.jobs), "--seed", str(permutation.seed)]
    command += ["--plain"] if permutation.plain else []
    return subprocess.run(
        [*_as_user(permutation.uid), *command],
        env=variables | permutation.variables,
        cwd=permutation.working_directory,
        capture_output=True,
        text=True,
        check=False,
    )


def compare(source, target):
    """Return the names of the notebooks and figures, and the README, whose bytes differ or that one tree lacks."""
    names = {path.relative_to(root).as_posix() for root in (source, target) for path in _files(root)}
    return sorted(name for name in names if _bytes(source / name) != _bytes(target / name))


def _files(root):
    yield root / "README.md"
    for folder in ("notebooks", "figures"):
        yield from (path for path in (root / folder).rglob("*") if path.is_file() and ".ipynb_checkpoints" not in path.parts)


def _bytes(path):
    return path.read_bytes() if path.exists() else None


def _as_user(uid):
    """Return the words that run a command as another user, or none where the system has no user namespaces."""
    words = ["unshare", "--user", f"--map-user={uid}", f"--map-group={uid}"]
    if uid is None or shutil.which("unshare") is None:
        return []
    probe = subprocess.run([*words, "true"], capture_output=True, check=False)
    return words if probe.returncode == 0 else []
