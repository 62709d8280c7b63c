"""The runner reports a success only where there was one, and a failed run harms nothing that was published."""

import json
import signal
import subprocess
from functools import partial

import pytest


def test_reproduce_runs_publishes_and_renders(ran):
    assert ran.claims("fig01_line")["mini/slope"]["verdict"] == "reproduced"
    assert all(ran.figure(stem, suffix).exists() for stem in ("fig01_line", "fig02_next") for suffix in ("png", "svg", "csv", "json"))
    assert "**reproduced**" in (ran.root / "README.md").read_text()
    assert not list((ran.root / "build").glob("stage-*"))


def test_a_second_run_runs_nothing(reproduced):
    before = reproduced.files()
    done = reproduced.run("reproduce")
    assert done.returncode == 0
    assert "0 of 2 notebooks run" in done.stdout
    assert reproduced.files() == before


def test_forced_runs_give_the_same_bytes(reproduced):
    before = reproduced.files()
    done = reproduced.run("reproduce", "--force", "--jobs", "1")
    assert "2 of 2 notebooks run" in done.stdout
    assert reproduced.files() == before


FAILURES = {
    "a cell raises": (["slope = 2.0", "raise RuntimeError('no bearing')"], "RuntimeError: no bearing"),
    "a cell exits": (["slope = 2.0", "import sys\nsys.exit(0)"], "cell 2 raised SystemExit: 0"),
    "the kernel is killed": (["slope = 2.0", "import os, signal\nos.kill(os.getpid(), signal.SIGKILL)"], "Kernel died"),
    "output without end": (["slope = 2.0", "while True:\n    print('x' * 1000)"], "bytes of output"),
    "nothing is finished": (["slope = 2.0", "from drivelib import record\nitem = record.begin('mini/fig01_line')"], "finish() was not reached"),
    "a claim is not evaluated": (
        ["slope = 2.0", "from drivelib import record\nitem = record.begin('mini/fig01_line')", "item.finish()"],
        "not evaluated: mini/slope",
    ),
    "stderr is written": (["slope = 2.0", "import sys\nprint('careful', file=sys.stderr)"], "wrote to stderr: careful"),
    "a foreign claim": (
        ["slope = 2.0", "from drivelib import record\nitem = record.begin('mini/fig01_line')\nitem.compare('mini/slop', 2)"],
        "Did you mean mini/slope",
    ),
}


@pytest.mark.parametrize("case", FAILURES)
def test_a_failure_is_named_and_harms_nothing(reproduced, case):
    sources, message = FAILURES[case]
    reproduced.write_cells("fig01_line", sources)
    before = reproduced.files()
    done = reproduced.run("reproduce")
    assert done.returncode == 1
    assert "failed: mini/fig01_line: " in done.stdout
    assert message in done.stdout
    assert reproduced.files() == before
    assert not reproduced.survivors()


def test_a_long_message_is_cut_and_does_not_steer_the_terminal(reproduced):
    """More than a pipe holds, which a runner that waits for the worker's end must not be kept waiting by."""
    (reproduced.root / "pyproject.toml").write_text("[tool.drivelib.limits]\nnotebook_seconds = 20\nbeyond_seconds = 20\noutput_bytes = 5000000\n")
    reproduced.write_cells("fig01_line", ["slope = 2.0", r"raise RuntimeError('\x1b[2Jtwo\nlines' + 80_000 * 'x')"])
    done = reproduced.run("reproduce", "mini/fig01")
    assert done.returncode == 1
    assert "failed: mini/fig01_line: cell 2 raised RuntimeError: [2Jtwo linesxxx" in done.stdout
    assert "\x1b" not in done.stdout and len(done.stdout) < 8000


def test_a_cell_that_is_tagged_to_be_left_out_runs(reproduced):
    reproduced.write_cells("fig01_line", ["slope = 2.0", "raise RuntimeError('not left out')"])
    path = reproduced.notebook("fig01_line")
    content = json.loads(path.read_text())
    content["cells"][1]["metadata"]["tags"] = ["skip-execution"]
    path.write_text(json.dumps(content))
    assert "RuntimeError: not left out" in reproduced.run("reproduce", "mini/fig01").stdout


def test_a_notebook_under_anothers_name_spoils_nothing_of_the_other(reproduced):
    """The first writes a whole record in the name of the second, which has lost its finish()."""
    own, other = reproduced.notebook("fig01_line"), reproduced.notebook("fig02_next")
    content = json.loads(other.read_text())
    own.write_text(json.dumps(content))
    content["cells"].pop()
    other.write_text(json.dumps(content))
    before = reproduced.files()
    done = reproduced.run("reproduce", "--jobs", "1")
    assert "failed: mini/fig01_line: finish() was not reached" in done.stdout
    assert "failed: mini/fig02_next: finish() was not reached" in done.stdout
    assert reproduced.files() == before


def test_a_notebook_that_names_no_language_takes_parameters(reproduced, tmp_path):
    path = reproduced.notebook("fig01_line")
    path.write_text(json.dumps(json.loads(path.read_text()) | {"metadata": {}}))
    done = reproduced.run("run", "mini/fig01", "-p", "slope=3", "--out", tmp_path / "mine")
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_cell_over_its_limit_is_stopped_with_all_that_it_started(reproduced):
    (reproduced.root / "pyproject.toml").write_text("[tool.drivelib.limits]\nnotebook_seconds = 3\nbeyond_seconds = 3\noutput_bytes = 1000\n")
    work = "import subprocess, time\nsubprocess.Popen(['sleep', '600'], start_new_session=True)\ntime.sleep(600)"
    reproduced.write_cells("fig01_line", ["slope = 2.0", work])
    before = reproduced.files()
    done = reproduced.run("reproduce")
    assert done.returncode == 1
    assert "longer than the limit of 3 s" in done.stdout
    assert reproduced.files() == before
    assert not reproduced.survivors()


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_stopping_the_runner_leaves_no_process_and_no_half_written_file(reproduced, how):
    reproduced.write_cells("fig01_line", ["slope = 2.0", "import time\ntime.sleep(600)"])
    before = reproduced.files()
    options = {"env": reproduced.environment(), "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    heard = partial(signal.signal, how, signal.SIG_DFL)  # these tests may run under nohup, which is inherited
    with subprocess.Popen(reproduced.command("reproduce"), preexec_fn=heard, **options) as process:
        reproduced.wait_for_kernel()
        process.send_signal(how)
        process.communicate(timeout=60)
        assert process.returncode == 130
    assert not reproduced.survivors()
    assert reproduced.files() == before
    assert not list((reproduced.root / "build").glob("stage-*"))


def test_two_runs_in_one_tree_do_not_meet(reproduced):
    reproduced.write_cells("fig01_line", ["slope = 2.0", "import time\ntime.sleep(600)"])
    with subprocess.Popen(reproduced.command("reproduce"), env=reproduced.environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE) as first:
        reproduced.wait_for_kernel()
        second = reproduced.run("reproduce")
        first.send_signal(signal.SIGTERM)
        first.communicate(timeout=60)
    assert second.returncode == 2
    assert "another reproduce is at work" in second.stderr


def test_what_an_item_needs_runs_first_and_its_failure_is_passed_on(reproduced):
    ledger = reproduced.root / "drivelib" / "papers" / "mini.toml"
    ledger.write_text(ledger.read_text().replace("[items.fig02_next]\n", '[items.fig02_next]\nneeds = ["mini/fig01_line"]\n'))
    reproduced.write_cells("fig01_line", ["slope = 2.0", "raise RuntimeError('broken')"])
    done = reproduced.run("reproduce")
    assert done.returncode == 1
    assert "mini/fig02_next: not run, because mini/fig01_line failed" in done.stdout


def test_a_circle_of_needs_is_refused(reproduced):
    ledger = reproduced.root / "drivelib" / "papers" / "mini.toml"
    text = ledger.read_text().replace("[items.fig02_next]\n", '[items.fig02_next]\nneeds = ["mini/fig01_line"]\n')
    ledger.write_text(text.replace("[items.fig01_line]\n", '[items.fig01_line]\nneeds = ["mini/fig02_next"]\n'))
    done = reproduced.run("reproduce")
    assert done.returncode == 2
    assert "in a circle" in done.stderr


def test_other_parameters_stay_outside_the_published_results(reproduced, tmp_path):
    before = reproduced.files()
    done = reproduced.run("run", "mini/fig01", "-p", "slope=3", "--out", tmp_path / "mine")
    assert done.returncode == 0, done.stdout + done.stderr
    content = json.loads((tmp_path / "mine" / "fig01_line.json").read_text())
    assert content["parameters"] == {"slope": 3}
    assert content["claims"][0]["verdict"] == "not the published conditions"
    assert content["claims"][0]["ours"] == 3
    assert reproduced.files() == before


def test_the_notebook_of_a_run_says_where_its_files_lie(reproduced, tmp_path):
    target = tmp_path / "of mine"
    assert reproduced.run("run", "mini/fig01", "-p", "slope=3", "--out", target).returncode == 0
    text = (target / "fig01_line.ipynb").read_text()
    assert f"Written to `{target}`" in text
    assert "drivelib-run-" not in text


def test_an_error_names_the_same_cell_with_and_without_parameters(reproduced):
    reproduced.write_cells("fig01_line", ["slope = 2.0", "a = 1", "raise RuntimeError('no bearing')"])
    for command in (["reproduce", "mini/fig01"], ["run", "mini/fig01"], ["run", "mini/fig01", "-p", "slope=3"]):
        assert "cell 3 raised RuntimeError: no bearing" in reproduced.run(*command).stdout
    reproduced.write_cells("fig01_line", ["slope = 2.0", "import sys\nprint('careful', file=sys.stderr)"])
    for command in (["reproduce", "mini/fig01"], ["run", "mini/fig01", "-p", "slope=3"]):
        assert "cell 2 wrote to stderr" in reproduced.run(*command).stdout


def test_what_a_run_exports_comes_along_and_only_when_it_passed(reproduced, tmp_path):
    """Whatever lies in the run's folder of exports; a run that fails leaves nothing where it was to write."""
    work = "export = item.folder / record.EXPORTS / 'motor.h'\nexport.parent.mkdir(parents=True, exist_ok=True)\nexport.write_text('x')\n1 / (slope - 4)"
    reproduced.write("fig01_line", "mini/slope", work=work)
    for slope, wanted in ((3, ["exports/motor.h"]), (4, [])):
        target = tmp_path / str(slope)
        done = reproduced.run("run", "mini/fig01", "-p", f"slope={slope}", "--out", target)
        assert done.returncode == (0 if wanted else 1), done.stdout + done.stderr
        assert [path.relative_to(target).as_posix() for path in target.rglob("*.h")] == wanted


def test_a_users_start_up_file_and_kernelspec_do_not_reach_the_kernel(reproduced, tmp_path):
    home = tmp_path / "home"
    startup = home / ".ipython" / "profile_default" / "startup"
    startup.mkdir(parents=True)
    (startup / "00.py").write_text("raise SystemExit('start-up file was run')")
    spec = home / ".local" / "share" / "jupyter" / "kernels" / "python3"
    spec.mkdir(parents=True)
    (spec / "kernel.json").write_text('{"argv": ["/bin/false"], "display_name": "foreign", "language": "python"}')
    environment = reproduced.environment() | {"HOME": str(home), "IPYTHONDIR": str(home / ".ipython")}
    before = reproduced.files()
    done = subprocess.run(reproduced.command("reproduce", "--force"), env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    assert reproduced.files() == before
