"""CONTRIBUTING's worked example, done word for word, adds a paper to the pack."""

import re

import pytest


@pytest.fixture
def example(repository, mini):
    """Return (ledger, notebook cells) as printed, and a pack without them."""
    text = (repository / "CONTRIBUTING.md").read_text()
    part = text.split("## Add a paper: a worked example", 1)[1].split("\n## ", 1)[0]
    (toml,) = re.findall(r"```toml\n(.*?)```", part, re.DOTALL)
    return toml, [cell.strip() for cell in re.findall(r"```python\n(.*?)```", part, re.DOTALL)], mini


def add(mini, toml, cells):
    (mini.root / "drivelib/papers/kloss.toml").write_text(toml)
    mini.write_cells("../kloss/fig01_torque", cells)


def test_the_example_adds_a_paper_end_to_end(example):
    toml, cells, mini = example
    add(mini, toml, cells)
    done = mini.run("reproduce")
    assert done.returncode == 0, done.stdout + done.stderr
    for suffix in ("png", "svg", "csv", "json"):
        assert (mini.root / f"figures/kloss/fig01_torque.{suffix}").exists()
    out = mini.run("claims", "--paper", "kloss").stdout
    assert "kloss/fig01/half" in out and "reproduced" in out
    assert "[Fig. 1: torque over slip](notebooks/kloss/fig01_torque.ipynb) | 1 reproduced | `fig01/half`: 0.8, asked 0.80 | 1 |" in (mini.root / "README.md").read_text()


def test_a_claim_forgotten_in_the_example_is_named(example):
    toml, cells, mini = example
    add(mini, toml, [cell for cell in cells if "item.compare" not in cell])
    done = mini.run("reproduce", "kloss/fig01")
    assert done.returncode == 1
    assert "not evaluated: kloss/fig01/half" in done.stdout + done.stderr
    assert not (mini.root / "figures/kloss").exists()
