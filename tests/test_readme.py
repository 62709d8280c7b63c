"""What the README and CONTRIBUTING promise exists: commands, targets, links, and the example runs."""

import re
import subprocess
import sys

import pytest

TEXTS = ("README.md", "CONTRIBUTING.md")


@pytest.mark.parametrize("name", TEXTS)
def test_every_command_is_known(repository, name):
    text = (repository / name).read_text()
    helped = subprocess.run([sys.executable, "-m", "drivelib", "--help"], capture_output=True, text=True, check=True).stdout
    known = set(re.findall(r"^    ([a-z-]+)\b", helped, re.MULTILINE))
    named = set(re.findall(r"-m drivelib ([a-z-]+)", text))
    assert named and named <= known


@pytest.mark.parametrize("name", TEXTS)
def test_every_make_target_and_every_link_exists(repository, name):
    text = (repository / name).read_text()
    targets = set(re.findall(r"^([a-z-]+):", (repository / "Makefile").read_text(), re.MULTILINE))
    named = set(re.findall(r"^\s*(?:`)?make ([a-z-]+)", text, re.MULTILINE)) | set(re.findall(r"`make ([a-z-]+)", text))
    assert named <= targets
    for link in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (repository / link).exists(), link


def test_the_example_runs_and_prints_a_feasible_point(repository, capsys):
    (example,) = re.findall(r"```python\n(.*?)```", (repository / "README.md").read_text(), re.DOTALL)
    exec(example, {})
    assert capsys.readouterr().out.split()[-1] == "True"


def test_the_supported_python_is_the_locked_one(repository):
    from drivelib import bootstrap

    version = ".".join(map(str, bootstrap.REFERENCE_PYTHON))
    assert f"Python {version}" in (repository / "README.md").read_text()
    assert f"=={version}.*" in (repository / "pyproject.toml").read_text()
