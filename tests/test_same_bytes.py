"""Nothing of the place, the user or the moment reaches the results, and where a notebook lets it in, the check says so."""

import os
import random
import shutil
import subprocess
import sys

import pytest

from drivelib.pack import verify

# What a careless notebook would depend on: every line differs between the permutations unless the runner holds it.
PROBE = """
import locale, os, time
locale.setlocale(locale.LC_ALL, "")
print(time.tzname, locale.setlocale(locale.LC_ALL), os.environ.get("USER"), os.environ.get("LOGNAME"))
print(set("of a set of words the order hangs on the hash seed".split()))
"""


@pytest.mark.parametrize("permutation", [pytest.param(verify.PERMUTATIONS[0], marks=pytest.mark.slow, id="first"), pytest.param(verify.PERMUTATIONS[1], id="second")])
def test_place_user_language_zone_jobs_and_order_change_no_byte(reproduced, tmp_path, permutation):
    reproduced.write("fig01_line", "mini/slope", work=PROBE)
    assert reproduced.run("reproduce", "mini/fig01").returncode == 0
    variables = {"PATH": os.environ["PATH"]} | permutation.variables
    plain = subprocess.run([sys.executable, "-c", PROBE.replace("locale.setlocale(locale.LC_ALL, \"\")", "")], env=variables, capture_output=True, text=True)
    shown = reproduced.notebook("fig01_line").read_text()
    assert plain.returncode == 0 and plain.stdout.splitlines()[0].replace('"', '\\"') not in shown, "the permutation changes nothing"
    done = verify.regenerate(permutation, reproduced.root, tmp_path / "another place" / "pack")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "2 of 2 notebooks run" in done.stdout
    assert verify.compare(reproduced.root, tmp_path / "another place" / "pack") == []


def test_the_comparison_of_two_trees_sees_one_byte_and_a_missing_file(reproduced, tmp_path):
    shutil.copytree(reproduced.root, tmp_path / "b")
    assert verify.compare(reproduced.root, tmp_path / "b") == []
    csv = tmp_path / "b" / "figures" / "mini" / "fig01_line.csv"
    csv.write_text(csv.read_text() + "\n")
    (tmp_path / "b" / "notebooks" / "mini" / "fig02_next.ipynb").unlink()
    assert verify.compare(reproduced.root, tmp_path / "b") == ["figures/mini/fig01_line.csv", "notebooks/mini/fig02_next.ipynb"]


def test_a_set_and_an_address_in_a_figure_are_caught(reproduced):
    """Published under a fixed hash seed, a set has one order; the check draws another seed and finds it out."""
    words = "words = ['iron', 'copper', 'friction', 'windage', 'stray', 'inverter', 'gear', 'bearing']\n"
    reproduced.write("fig01_line", "mini/slope", work=words + "slope += float('0.' + ''.join(str(words.index(word)) for word in set(words)))")
    reproduced.write("fig02_next", "mini/rise", work="slope += id(object()) % 1e9 / 1e9")
    assert reproduced.run("reproduce").returncode == 0
    done = reproduced.run("reproduce", "--check", "--seed", "1")
    assert done.returncode == 1
    for stem in ("fig01_line", "fig02_next"):
        assert f"differs: figures/mini/{stem}.csv: line 4, column y: committed" in done.stdout
    assert "in the order of --seed 1" in done.stdout


@pytest.mark.parametrize("first", [pytest.param(True, marks=pytest.mark.slow), False])
def test_the_seed_decides_the_order(reproduced, first):
    def draws(seed):
        random_ = random.Random(seed)
        return random_.random() < random_.random()

    seed = next(seed for seed in range(100) if draws(seed) == first)
    out = reproduced.run("reproduce", "--force", "--jobs", "1", "--seed", str(seed)).stdout
    assert (out.index("mini/fig01_line") < out.index("mini/fig02_next")) == first
