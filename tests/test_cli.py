"""The command line answers a mistake with the nearest right word and exit status 2."""

import pytest

from drivelib import __main__ as cli


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "mini/fig1_line"], "'mini/fig1_line' is no item. Did you mean mini/fig01_line"),
        (["reproduce", "mini/fig"], "'mini/fig' is no item"),
        (["run", "mini/fig01", "-p", "slop=1"], "mini/fig01_line has no parameter 'slop', it has slope. Did you mean slope"),
        (["run", "mini/fig01", "-p", "slope=steep"], "slope = 'steep': must be a number, such as 2.0"),
        (["run", "mini/fig01", "-p", "slope=True"], "slope = True: must be a number, such as 2.0"),
        (["run", "mini"], "'mini' stands for 2 items, and run takes one, such as mini/fig01_line"),
        (["reproduce", "min/fig01"], "'min/fig01' is no item. Did you mean mini/fig01_line"),
        (["reproduce", "mini/fig2"], "'mini/fig2' is no item. Did you mean mini/fig02_next?"),
        (["status", "fig02"], "'fig02' is no item. Did you mean mini/fig02_next?"),
        (["claims", "--item", "mini/fig3"], "'mini/fig3' is no item. Did you mean mini/"),
        (["run", "mini/fig01", "-p", "slope=1e999"], "slope = inf: must be finite"),
        (["run", "mini/fig01", "-p", "slope={[]: 1}"], "slope = '{[]: 1}': must be a number, such as 2.0"),
        (["difference", "--fresh", "--jobs", "0"], "--jobs 0: must be at least 1"),
        (["run", "mini/fig01", "-p", "slope"], "-p 'slope': must read NAME=VALUE"),
        (["reproduce", "--jobs", "0"], "--jobs 0: must be at least 1"),
        (["claims", "--verdict", "true"], "--verdict = 'true': must be one of 'reproduced', 'reproduced, corrected'"),
        (["claims", "--paper", "mine"], "--paper = 'mine': must be one of 'mini'. Did you mean mini?"),
    ],
)
def test_a_mistake_is_named(reproduced, arguments, message):
    done = reproduced.run(*arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_claims_lists_every_claim_with_number_and_verdict(reproduced):
    out = reproduced.run("claims").stdout
    assert "mini/slope" in out and "mini/rise" in out
    assert "2 claims" in out
    assert reproduced.run("claims", "--verdict", "open").stdout.strip().endswith("0 claims")


def test_an_identifier_is_never_broken_and_a_narrow_terminal_gets_lines(reproduced):
    ledger = reproduced.root / "drivelib" / "papers" / "mini.toml"
    long = "a/rather/long/name/of/a/claim/that/fills/half/of/the/line"
    ledger.write_text(ledger.read_text().replace('"rise"', f'"{long}"', 1).replace("It rises.", "It rises " + "and rises " * 20))
    for columns in (40, 80, 121):
        out = reproduced.run("claims", env=reproduced.environment() | {"COLUMNS": str(columns)}).stdout
        assert f"mini/{long}" in out and "mini/slope" in out and "reproduced" in out
        assert out.split().count("rises") == 21
        text = [line for line in out.splitlines() if long not in line]
        assert max(map(len, text)) <= columns


def test_a_papers_name_stands_for_all_its_items(reproduced):
    assert "0 of 2 notebooks run" in reproduced.run("reproduce", "mini").stdout
    assert len(reproduced.run("status", "mini").stdout.splitlines()) == 2
    assert "2 claims" in reproduced.run("claims", "--item", "mini").stdout


def test_the_verdicts_shown_are_those_of_the_items_asked_for(reproduced):
    out = reproduced.run("reproduce", "mini/fig02").stdout
    assert "Verdicts of mini/fig02_next:" in out
    assert out.splitlines()[1].split() == ["1", "reproduced"]


def test_the_help_of_run_says_how_parameters_are_written(reproduced):
    out = reproduced.run("run", "--help").stdout
    assert "Repeat -p" in out and "'torque_range=[0.1,1]'" in out
    assert "python -m drivelib run eskander/fig02 -p" in out


def test_clean_notebooks_brings_a_saved_notebook_into_the_committed_form(reproduced):
    path = reproduced.notebook("fig01_line")
    clean = path.read_bytes()
    path.write_bytes(clean.replace(b'"metadata": {\n', b'"metadata": {\n  "widgets": {},\n', 1))
    assert path.read_bytes() != clean
    assert "cleaned notebooks/mini/fig01_line.ipynb" in reproduced.run("clean-notebooks").stdout
    assert path.read_bytes() == clean


def test_a_tree_without_notebooks_is_no_success(reproduced, tmp_path):
    (tmp_path / "README.md").write_text("")
    done = reproduced.run("reproduce", env=reproduced.environment() | {"DRIVELIB_ROOT": str(tmp_path)})
    assert done.returncode == 2 and f"{tmp_path} holds no notebooks" in done.stderr


def test_missing_limits_are_named(reproduced):
    (reproduced.root / "pyproject.toml").write_text("")
    done = reproduced.run("reproduce", "--force", "mini/fig01")
    assert done.returncode == 1 and "limits: notebook_seconds = None: must be a real number above 0" in done.stdout


def test_a_notebook_in_no_ledger_is_named(reproduced):
    reproduced.write_cells("fig03_stray", ["a = 1"])
    done = reproduced.run("status")
    assert done.returncode == 2
    assert "notebooks/mini/fig03_stray.ipynb is listed in no ledger" in done.stderr


@pytest.mark.parametrize(("text", "wanted"), [("a=1", ("a", 1)), ("a=1.5e3", ("a", 1500.0)), ("a=[1, 2]", ("a", [1, 2])), ("a=six-step", ("a", "six-step"))])
def test_values_are_literals_or_strings(text, wanted):
    assert cli.parse_parameter(text) == wanted
