"""Faults from outside: a full disk, read-only folders, kills, many kernels. Each test first shows that its fault is real."""

import errno
import json
import os
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time

import pytest

from drivelib import notebook
from drivelib.pack import publishing, runner

NAMESPACES = shutil.which("unshare") and subprocess.run(["unshare", "-Urm", "true"], capture_output=True).returncode == 0
needs_namespaces = pytest.mark.skipif(not NAMESPACES, reason="needs user namespaces: unshare -Urm")


def in_namespace(pack, script, tmp_path):
    """Run a shell script as root of a user and mount namespace; ``$run`` reproduces, mounts end with the script."""
    variables = pack.environment() | {"pack": str(pack.root), "scratch": str(tmp_path), "python": sys.executable}
    words = ["unshare", "-Urm", "bash", "-euc", script]
    return subprocess.run(words, env=variables, capture_output=True, text=True, timeout=180)


@needs_namespaces
def test_a_full_disk_is_named_and_harms_nothing(reproduced, tmp_path):
    before = reproduced.files()
    script = """
    mkdir "$scratch/disk" && mount -t tmpfs -o size=2m tmpfs "$scratch/disk"
    cp -a "$pack/." "$scratch/disk/"
    dd if=/dev/zero of="$scratch/disk/filler" bs=1k count=10000 2>/dev/null || true
    ! head -c 9000 /dev/zero > "$scratch/disk/probe" || exit 99
    rm "$scratch/disk/probe"
    status=0; DRIVELIB_ROOT="$scratch/disk" "$python" -m drivelib reproduce --force || status=$?
    rm "$scratch/disk/filler"; mkdir "$scratch/after"; cp -a "$scratch/disk/." "$scratch/after/"
    exit $status
    """
    done = in_namespace(reproduced, script, tmp_path)
    assert "No space left on device" in done.stderr + done.stdout
    assert done.returncode == 1, done.stdout + done.stderr
    assert "failed: mini/fig01_line: " in done.stdout and "Traceback" not in done.stderr
    reproduced.root = tmp_path / "after"
    assert reproduced.files() == before


def test_a_limit_on_file_sizes_is_named_and_harms_nothing(reproduced):
    """Binds root, and needs no namespace: no process may write a file beyond 6000 bytes."""

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (6000, 6000))

    write = [sys.executable, "-c", f"with open({str(reproduced.root / 'build' / 'probe')!r}, 'wb') as file: file.write(bytes(9000))"]
    assert "File too large" in subprocess.run(write, preexec_fn=limit, capture_output=True, text=True).stderr
    assert reproduced.figure("fig01_line", "png").stat().st_size > 6000
    before = reproduced.files()
    done = reproduced.run("reproduce", "--force", preexec_fn=limit)
    assert done.returncode == 1
    assert "failed: mini/fig01_line: OSError: [Errno 27] File too large" in done.stdout
    assert reproduced.files() == before
    assert not reproduced.survivors()


@needs_namespaces
def test_read_only_figures_are_named_and_the_notebook_is_not_published_alone(reproduced, tmp_path):
    before = reproduced.files()
    script = """
    mount --bind "$pack/figures" "$pack/figures" && mount -o remount,bind,ro "$pack/figures"
    ! touch "$pack/figures/probe" 2>/dev/null || exit 99
    "$python" -m drivelib reproduce --force
    """
    reproduced.write("fig01_line", "mini/slope", work="pass")  # other cells, so that its notebook would change
    before = reproduced.files()
    done = in_namespace(reproduced, script, tmp_path)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "failed: mini/fig01_line: could not be published: [Errno 30] Read-only file system" in done.stdout
    assert "failed: mini/fig02_next: could not be published" in done.stdout
    assert reproduced.files() == before
    assert "mini/fig01_line: stale" in reproduced.run("status").stdout


@pytest.mark.parametrize("number", range(5))
def test_publishing_is_all_or_nothing(reproduced, tmp_path, monkeypatch, number):
    """Whichever of the five copies fails, nothing of the item changes and no copy is left."""
    monkeypatch.setenv("DRIVELIB_ROOT", str(reproduced.root))
    item = runner.items()["mini/fig01_line"]
    files = {}
    for suffix in (".ipynb", ".png", ".svg", ".csv", ".json"):
        files[suffix] = tmp_path / f"new{suffix}"
        files[suffix].write_bytes(b"new")
    copy, calls = shutil.copyfile, []

    def full(*arguments):
        calls.append(arguments)
        if len(calls) == number + 1:
            raise OSError(errno.ENOSPC, "No space left on device")
        return copy(*arguments)

    monkeypatch.setattr(publishing.shutil, "copyfile", full)
    before = reproduced.files()
    with pytest.raises(OSError, match="No space left"):
        publishing.publish(runner.Outcome(item.id, None, 1.0, files), item, {}, {})
    assert len(calls) == number + 1
    assert reproduced.files() == before
    monkeypatch.setattr(publishing.shutil, "copyfile", copy)
    publishing.publish(runner.Outcome(item.id, None, 1.0, files), item, {}, {})
    assert reproduced.figure("fig01_line", "json").read_bytes() == b"new"


def test_a_signal_waits_until_an_item_is_published_whole(reproduced, tmp_path, monkeypatch):
    monkeypatch.setenv("DRIVELIB_ROOT", str(reproduced.root))
    item = runner.items()["mini/fig01_line"]
    files = {suffix: tmp_path / f"new{suffix}" for suffix in (".ipynb", ".png", ".svg", ".csv", ".json")}
    for path in files.values():
        path.write_bytes(b"new")
    replace, seen = os.replace, []

    def interrupted(*arguments):
        if not seen:
            os.kill(os.getpid(), signal.SIGTERM)
        seen.append(arguments)
        replace(*arguments)

    monkeypatch.setattr(publishing.os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt), runner.interruptible():
        publishing.publish(runner.Outcome(item.id, None, 1.0, files), item, {}, {})
    published = [reproduced.notebook("fig01_line"), *(reproduced.figure("fig01_line", suffix) for suffix in ("png", "svg", "csv", "json"))]
    assert {path.read_bytes() for path in published} == {b"new"}


@needs_namespaces
def test_a_missing_kernelspec_and_a_foreign_one_in_the_notebook_do_not_matter(reproduced, tmp_path):
    """The runner starts its own interpreter's kernel, whatever is installed and whatever the notebook names."""
    before = reproduced.files()
    path = reproduced.notebook("fig01_line")
    content = json.loads(path.read_text())
    content["metadata"]["kernelspec"] = {"display_name": "Julia", "language": "julia", "name": "julia-1.9"}
    path.write_bytes(notebook.dumps(content))
    script = """
    folder=$("$python" -c 'import sys; print(sys.prefix)')/share/jupyter/kernels
    test -e "$folder/python3/kernel.json"
    mount -t tmpfs tmpfs "$folder" && test ! -e "$folder/python3"
    "$python" -m drivelib reproduce --force
    """
    done = in_namespace(reproduced, script, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert reproduced.files() == before


def test_a_notebook_without_its_last_cell_publishes_nothing(reproduced):
    path = reproduced.notebook("fig01_line")
    content = json.loads(path.read_text())
    assert notebook.source(content["cells"].pop()) == "item.finish()"
    path.write_bytes(notebook.dumps(content))
    before = reproduced.files()
    done = reproduced.run("reproduce", "mini/fig01")
    assert done.returncode == 1
    assert "failed: mini/fig01_line: finish() was not reached" in done.stdout
    assert reproduced.files() == before


def test_a_truncated_json_of_another_item_is_named_with_what_mends_it(reproduced):
    path = reproduced.figure("fig01_line", "json")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    done = reproduced.run("reproduce", "mini/fig02")
    assert done.returncode == 2
    assert "fig01_line.json: no whole record of a run" in done.stderr
    assert "`python -m drivelib reproduce mini/fig01_line` mends it" in done.stderr
    assert reproduced.run("reproduce", "mini/fig01_line").returncode == 0
    assert path.read_bytes() == whole


def test_a_long_name_of_the_temporary_folder_does_not_matter(reproduced, tmp_path):
    folder = tmp_path / ("long" * 30)
    folder.mkdir()
    with pytest.raises(OSError, match="path too long"), socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(folder / "s"))
    before = reproduced.files()
    done = reproduced.run("reproduce", "--force", env=reproduced.environment() | {"TMPDIR": str(folder)})
    assert done.returncode == 0, done.stdout + done.stderr
    assert reproduced.files() == before


def test_a_closed_terminal_does_not_end_a_run_under_nohup(reproduced):
    reproduced.write("fig01_line", "mini/slope", work="import time\ntime.sleep(2)")

    def nohup():
        signal.signal(signal.SIGHUP, signal.SIG_IGN)

    with subprocess.Popen(reproduced.command("reproduce"), env=reproduced.environment(), preexec_fn=nohup, stdout=subprocess.PIPE) as process:
        reproduced.wait_for_kernel()
        process.send_signal(signal.SIGHUP)
        assert b"1 of 2 notebooks run" in process.communicate(timeout=60)[0]
    assert process.returncode == 0


def test_of_two_that_start_at_once_one_runs_and_the_other_says_so(reproduced):
    before = reproduced.files()
    both = [
        subprocess.Popen(reproduced.command("reproduce", "--force"), env=reproduced.environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    errors = [process.communicate(timeout=120)[1] for process in both]
    assert sorted(process.returncode for process in both) == [0, 2]
    assert "another reproduce is at work" in errors[0] + errors[1]
    assert reproduced.files() == before


def test_a_runner_killed_outright_leaves_no_process_and_the_next_run_clears_its_stage(reproduced):
    whole = reproduced.notebook("fig01_line").read_bytes()
    reproduced.write_cells("fig01_line", ["slope = 2.0", "import time\ntime.sleep(600)"])
    before = reproduced.files()
    with subprocess.Popen(reproduced.command("reproduce"), env=reproduced.environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        reproduced.wait_for_kernel()
        process.kill()
        process.wait()
    deadline = time.monotonic() + 60
    while reproduced.survivors() and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not reproduced.survivors()
    assert reproduced.files() == before
    assert list((reproduced.root / "build").glob("stage-*")), "the kill came too late to leave anything"
    half = reproduced.figure("fig01_line", "json").with_name(".fig01_line.json.ab12cd_x")
    half.write_bytes(b"{")
    reproduced.notebook("fig01_line").write_bytes(whole)
    assert reproduced.run("reproduce").returncode == 0
    assert not list((reproduced.root / "build").glob("stage-*")) and not half.exists()


MANY = """
import json, sys, tempfile
from drivelib.pack import runner
chosen, stage = runner.items(), tempfile.mkdtemp(dir=sys.argv[1])
outcomes = list(runner.run(chosen, jobs=12, stage=stage))
said = {o.item: o.failure or json.loads(o.files[".json"].read_text())["number"] for o in outcomes}
print(json.dumps(said))
"""

TINY = """
import json, os
folder, stem = os.environ["DRIVELIB_PUBLISH"], f"n{number:03d}"
os.makedirs(folder, exist_ok=True)
for suffix in ("png", "svg", "csv"):
    open(f"{folder}/{stem}.{suffix}", "w").write("x")
json.dump({"number": number, "claims": [{"id": f"mini/{stem}"}], "artefacts": {}}, open(f"{folder}/{stem}.json", "w"))
"""


@pytest.mark.parametrize("count", [24, pytest.param(200, marks=pytest.mark.slow)])
def test_many_kernels_at_once_neither_hang_nor_talk_across(mini, count):
    """Each tiny notebook hands back its own number; twelve at once, and a guard against a hang."""
    shutil.rmtree(mini.root / "notebooks")
    text = 'citation = "Many."\n'
    for number in range(count):
        text += f'[items.n{number:03d}]\ntitle = "n"\n'
    for number in range(count):
        text += f'[[claims]]\nid = "n{number:03d}"\nitem = "n{number:03d}"\nwhere = "x"\ntext = "x"\n'
        mini.write_cells(f"n{number:03d}", [f"number = {number}", TINY])
    (mini.root / "drivelib" / "papers" / "mini.toml").write_text(text)
    command = [sys.executable, "-c", MANY, str(mini.root)]
    done = subprocess.run(command, env=mini.environment(), capture_output=True, text=True, timeout=60 + 5 * count)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == {f"mini/n{number:03d}": number for number in range(count)}
    assert not mini.survivors()


