"""A forked kernel is like one that was started as a new Python, and where forking would not be safe none is forked."""

import json
import os
import subprocess
import sys
import time

import psutil
import pytest

from drivelib import environment
from drivelib.pack import kernels, preloaded, tokens

# What a notebook can see of the process that it runs in; the private folder's name is the only thing that may differ.
LOOK = """
import json, multiprocessing, os, random, signal, sys, threading
import numpy as np
from concurrent.futures import ProcessPoolExecutor
with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
    of_its_own = pool.submit(abs, -1).result()
seen = {
    "environment": {name: value for name, value in os.environ.items() if not name.startswith("JPY_") and name not in ("DRIVELIB_RUN", "DRIVELIB_PUBLISH")},
    "path": sys.path,
    "folder": os.getcwd(),
    "session": os.getsid(0) == os.getpid(),
    "group": os.getpgid(0) == os.getpid(),
    "signals": [str(signal.getsignal(number)) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGCHLD, signal.SIGPIPE)],
    "threads": sorted(thread.name for thread in threading.enumerate() if not thread.name.startswith("Thread-")),
    "hash": hash("drive"),
    "errors": np.geterr(),
    "smallest": 5e-324 * 1.0,
    "main": __name__,
    "daemon": multiprocessing.current_process().daemon,
    "a process of its own": of_its_own,
}
seen = json.loads(json.dumps(seen).replace(os.environ["HOME"], "PRIVATE"))
how = open("/proc/self/cmdline").read()
drawn = [np.random.random(), random.random()]
with open(os.environ["DRIVELIB_ROOT"] + "/build/seen-" + item.stem, "w") as file:
    json.dump([seen, how, drawn], file)
"""
ORPHAN = """
import os, time
if os.fork() == 0:  # a child that hides: a session of its own, and no new program
    os.setsid()
    time.sleep(600)
raise RuntimeError("left a child behind")
"""


def seen(pack, *arguments):
    """Return what both notebooks of the miniature pack saw: [(seen, how, drawn), ...]."""
    done = pack.run("reproduce", "--force", *arguments)
    assert done.returncode == 0, done.stdout + done.stderr
    return [json.loads((pack.root / "build" / f"seen-{stem}").read_text()) for stem in ("fig01_line", "fig02_next")]


def test_forked_and_plain_kernels_see_the_same_world_and_give_the_same_bytes(reproduced):
    reproduced.write("fig01_line", "mini/slope", work=LOOK)
    reproduced.write("fig02_next", "mini/rise", work=LOOK)
    forked = seen(reproduced)
    files = reproduced.files()
    plain = seen(reproduced, "--plain")
    assert reproduced.files() == files
    assert all("forkserver" in how for _, how, _ in forked) and all("ipykernel_launcher" in how for _, how, _ in plain)
    for (a, *_), (b, *_) in zip(forked, plain, strict=True):
        assert a == b
    draws = [number for *_, drawn in forked + plain for number in drawn]
    assert len(set(draws)) == 8, "random numbers are shared"


def test_a_child_that_hides_in_a_session_of_its_own_is_found(reproduced):
    reproduced.write_cells("fig01_line", ["slope = 2.0", ORPHAN])
    done = reproduced.run("reproduce", "mini/fig01")
    assert done.returncode == 1 and "left a child behind" in done.stdout
    assert not reproduced.survivors()


@pytest.mark.parametrize("line", ["import drivelib", "import drivelib.record", "import numpy, drivelib as d"])
def test_what_another_notebook_imports_serves_none_that_does_not(reproduced, line):
    """The process that is forked from has the modules of both notebooks."""
    reproduced.write("fig01_line", "mini/slope", work=f"{line}\n(d if 'd' in dir() else drivelib).fuzzy_sets")
    reproduced.write("fig02_next", "mini/rise", work="from drivelib import fuzzy_sets")
    done = reproduced.run("reproduce")
    assert done.returncode == 1 and "mini/fig01_line: could not be started: line 1 of a cell imports drivelib" in done.stdout


ESCAPE = """
import os, subprocess
subprocess.Popen(["sleep", "SECONDS"], env={})
subprocess.run(["bash", "-c", "setsid sleep SECONDS & echo $! > $0", os.environ["DRIVELIB_ROOT"] + "/build/daemon"], env={"PATH": os.environ["PATH"]})
os.environ.clear()
subprocess.Popen(["/bin/sleep", "SECONDS"])
"""


@pytest.mark.skipif(sys.platform != "linux", reason="orphans are adopted on Linux only")
@pytest.mark.parametrize("last", ["pass", "while True: pass", "os.execve('/bin/sleep', ['sleep', 'SECONDS'], {})"])
def test_a_child_with_an_environment_of_its_own_is_found(reproduced, last):
    """Also a daemon, whose parent has ended, and also where the kernel itself has become another program."""
    seconds = f"600.{os.getpid():07d}"  # which names these processes
    (reproduced.root / "pyproject.toml").write_text("[tool.drivelib.limits]\nnotebook_seconds = 5\nbeyond_seconds = 5\noutput_bytes = 100000\n")
    reproduced.write("fig01_line", "mini/slope", work=f"{ESCAPE}\n{last}".replace("SECONDS", seconds))
    done = reproduced.run("reproduce", "mini/fig01")
    assert done.returncode == (0 if last == "pass" else 1), done.stdout + done.stderr
    assert (reproduced.root / "build" / "daemon").exists()
    assert not [process for process in psutil.process_iter(["cmdline"]) if seconds in (process.info["cmdline"] or ())]


@pytest.mark.skipif(sys.platform != "linux", reason="kernels are forked on Linux only")
def test_a_kernel_whose_end_another_was_told_of_counts_as_ended():
    """Else one that was killed for too much output is waited for until its cell is over time."""
    child = os.fork()
    if child == 0:
        time.sleep(600)
    kernel = kernels.Forked(child, None)
    assert kernel.poll() is None
    os.kill(child, 9)
    os.waitpid(child, 0)
    assert kernel.poll() == -9


KILLED = """
import json, os, signal, sys, tempfile, threading, time
from multiprocessing import forkserver
from drivelib.pack import attempt, runner
attempt.STARTUP_SECONDS = 1
def kill(what, item):
    time.sleep(2)  # its kernel is at work
    os.kill(forkserver._forkserver._forkserver_pid, signal.SIGKILL)
found = [[o.item, o.failure] for o in runner.run(runner.items(), jobs=1, stage=tempfile.mkdtemp(dir=sys.argv[1]), report=kill)]
print(json.dumps(found))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="kernels are forked on Linux only")
@pytest.mark.parametrize(
    ("work", "failure"),
    [("import time\ntime.sleep(3)", None), ("import os\nos.kill(os.getppid(), 19)  # stops the worker", "longer than its limit of 20 s, killed")],
)
def test_the_death_of_the_process_that_is_forked_from_hangs_nothing(reproduced, work, failure):
    """As by a system that is out of memory: what runs goes on, or is ended in time, and what follows runs in plain kernels."""
    reproduced.write("fig01_line", "mini/slope", work=work)
    command = [sys.executable, "-c", KILLED, str(reproduced.root)]
    done = subprocess.run(command, env=reproduced.environment(), capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [["mini/fig01_line", failure], ["mini/fig02_next", None]]
    assert not reproduced.survivors()


def test_the_process_that_is_forked_from_ends_with_the_runner(reproduced):
    assert reproduced.run("reproduce", "--force").returncode == 0
    deadline = time.monotonic() + 30
    while reproduced.survivors(spare_forked_from=False):
        assert time.monotonic() < deadline
        time.sleep(0.1)


def python(code, tmp_path, modules="", **variables):
    """Return the words that a Python prints that was started as the runner starts the one that it forks from."""
    extra = {"PYTHONPATH": os.pathsep.join([str(preloaded.__file__).rsplit("/", 3)[0], str(tmp_path)]), tokens.TOKEN: tokens.NO_RUN, preloaded.MODULES: modules}
    variables = environment.pinned(**extra) | variables
    done = subprocess.run([sys.executable, "-c", code], env=variables, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.mark.skipif(sys.platform != "linux", reason="kernels are forked on Linux only")
def test_nothing_is_forked_from_a_process_with_threads(tmp_path):
    (tmp_path / "quiet.py").write_text("value = 1")
    (tmp_path / "threaded.py").write_text("import threading, time\nthreading.Thread(target=time.sleep, args=(60,), daemon=True).start()")
    (tmp_path / "broken.py").write_text("1 / 0")
    ask = "import os; from drivelib.pack import kernels, preloaded; print(preloaded.SINGLE, kernels.can_fork(os.environ)); os._exit(0)"
    assert python(ask, tmp_path, "quiet,broken,missing") == ["True", "True"]
    assert python(ask, tmp_path, "quiet,threaded") == ["False", "False"]


@pytest.mark.skipif(sys.platform != "linux", reason="kernels are forked on Linux only")
def test_what_was_imported_before_the_fork_is_left_alone_by_the_collector(tmp_path):
    (tmp_path / "quiet.py").write_text("value = [[] for _ in range(10_000)]")
    ask = "import gc; from drivelib.pack import preloaded; print(gc.get_freeze_count() > 10_000)"
    assert python(ask, tmp_path, "quiet") == ["True"]
    assert subprocess.run([sys.executable, "-c", ask.replace("> 10_000", "")], capture_output=True, text=True, check=True).stdout.split() == ["0"]


@pytest.mark.skipif(sys.platform != "linux", reason="kernels are forked on Linux only")
def test_nothing_is_forked_where_a_pin_differs_or_the_token_cannot_be_worn(tmp_path):
    (tmp_path / "quiet.py").write_text("value = 1")
    ask = "import os; from drivelib.pack import kernels; print(kernels.can_fork(os.environ), kernels.can_fork({**os.environ, 'PYTHONHASHSEED': '7'}))"
    assert python(ask, tmp_path, "quiet") == ["True", "False"]
    assert python(ask, tmp_path, "quiet", **{tokens.TOKEN: "other"}) == ["False", "False"]


@pytest.mark.skipif(sys.platform != "linux", reason="kernels are forked on Linux only")
def test_others_see_a_token_that_is_worn(tmp_path):
    token = "ab" * 16
    ask = f"import psutil; from drivelib.pack import tokens; tokens.wear({token!r}); print(psutil.Process().environ()[tokens.TOKEN])"
    assert python(ask, tmp_path) == [token]
    with pytest.raises(ValueError, match="must be 32 characters, in a process started with"):
        tokens.wear(token)
    assert psutil.Process().environ().get(tokens.TOKEN) is None
