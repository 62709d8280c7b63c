"""Figures held against figures: which layer catches which change, the page, and what accepting says."""

import json
import re
import shutil
import subprocess

import pytest

from drivelib import paths
from drivelib.pack import difference, layers, processors, review, runner

ITEM = "eskander/fig16_inverter_angle"
NOTEBOOK = f"notebooks/{ITEM}.ipynb"
# change: (file, what stands there, what is put there), or parameters; and exactly the layers that see it
MUTATIONS = {
    "nothing": ((NOTEBOOK, "", ""), {}, set()),
    "a curve by 0.1 %": ((NOTEBOOK, "return np.degrees(pmsm_angle", "return 1.001 * np.degrees(pmsm_angle"), {}, {"claims", "arrays", "pictures"}),
    "a label": ((NOTEBOOK, 'ylabel=\\"load (% of rated)', 'ylabel=\\"load (% of Rated)'), {}, {"pictures"}),
    "a colour": ((NOTEBOOK, "color=ALLOWED)", 'color=\\"#DDE7EF\\")'), {}, {"pictures"}),
    "a parameter": ((NOTEBOOK, "", ""), {"high_deg": 2.51}, {"claims", "arrays", "pictures"}),
    "an equation's sign": (
        ("drivelib/pmsm_angle.py", "machine.R_s * i_oq + omega_e * machine.psi_f)", "machine.R_s * i_oq - omega_e * machine.psi_f)"),
        {},
        {"claims", "arrays", "pictures"},
    ),
}


@pytest.fixture
def copy(tmp_path, repository):
    """A copy of the sources and of one notebook."""
    shutil.copytree(repository / "drivelib", tmp_path / "drivelib", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / NOTEBOOK).parent.mkdir(parents=True)
    shutil.copy(repository / NOTEBOOK, tmp_path / NOTEBOOK)
    return tmp_path


@pytest.mark.parametrize("change", MUTATIONS)
def test_each_change_is_seen_by_its_layers_and_none_slips_through(copy, change, monkeypatch):
    """Run one notebook of the pack with one thing changed and hold its files against the published ones."""
    (name, old, new), given, wanted = MUTATIONS[change]
    text = (copy / name).read_text()
    assert old in text
    (copy / name).write_text(text.replace(old, new))
    published = paths.root()
    with monkeypatch.context() as patch:
        patch.setenv("DRIVELIB_ROOT", str(copy))
        patch.setattr(processors.freshness, "PACKAGE", copy / "drivelib")
        _, failure = processors.run(copy / "run", ITEM, given, processors.NATIVE)
    assert failure is None
    (copy / "figures").mkdir()
    (copy / "run" / "out").rename(copy / "figures" / "eskander")
    (copy / NOTEBOOK).unlink()  # the layers of the files; the notebook's own text is a layer of its own
    found = layers.compare(published, copy, [ITEM])
    assert {one.layer for one in found} == wanted
    if change == "a parameter":
        assert any(one.what == "parameter high_deg: 2.5 → 2.51" for one in found)
    if change == "an equation's sign":
        assert any(one.what.endswith("fig16, verdict: reproduced, assumed → not reproduced") for one in found)
    if change == "a curve by 0.1 %":
        assert all(one.size == pytest.approx(0.001, rel=0.01) for one in found if one.layer == "arrays")


@pytest.fixture
def two(reproduced, tmp_path, monkeypatch):
    """Two trees of the miniature pack, the first of them the one at hand."""
    monkeypatch.setenv("DRIVELIB_ROOT", str(reproduced.root))
    shutil.copytree(reproduced.root, tmp_path / "other")
    other = type(reproduced).__new__(type(reproduced))
    other.root = tmp_path / "other"
    return reproduced, other


def replace(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def test_layers_come_in_order_and_the_worst_first(two):
    old, new = two
    replace(new.figure("fig01_line", "csv"), "\n2\n", "\n2.002\n")
    replace(new.figure("fig02_next", "csv"), "\n2\n", "\n2.5\n")
    replace(new.figure("fig02_next", "json"), '"verdict": "reproduced"', '"verdict": "contradicted"')
    replace(new.figure("fig01_line", "json"), '"ours": 2.0', '"ours": 2.1')
    replace(new.notebook("fig01_line"), "item.table()", "item.table() ")
    found = layers.compare(old.root, new.root, runner.items())
    assert [(one.layer, one.what) for one in found][:4] == [
        ("claims", "mini/rise, verdict: reproduced → contradicted"),
        ("claims", "mini/slope, ours: 2.0 → 2.1"),
        ("arrays", "y, value 2: 2.0 → 2.5, 25 % of the largest"),
        ("arrays", "y, value 2: 2.0 → 2.002, 0.1 % of the largest"),
    ]
    assert [one.layer for one in found[4:]] == ["notebook"]


def test_below_the_items_tolerance_an_array_is_unchanged_and_a_count_never_is(two):
    old, new = two
    replace(new.figure("fig01_line", "csv"), "\n2\n", "\n2.002\n")
    entry = '"numbers": {"n": {"value": %s, "unit": "epochs", "meaning": "x"}}'
    for mini, value in ((old, 1000), (new, 1001)):
        replace(mini.figure("fig01_line", "json"), '"numbers": {}', entry % value)
    ledger = old.root / "drivelib" / "papers" / "mini.toml"
    replace(ledger, 'title = "Fig. 1: a line"', 'title = "Fig. 1: a line"\ntolerance = 0.005')
    layers.ledger.load.cache_clear()
    assert [one.what for one in layers.compare(old.root, new.root, ["mini/fig01_line"])] == ["n in epochs: 1000 → 1001"]
    replace(ledger, "tolerance = 0.005", "tolerance = 0.05")
    layers.ledger.load.cache_clear()
    with pytest.raises(ValueError, match="item fig01_line: tolerance = 0.05: must be .* at most 0.01"):
        layers.compare(old.root, new.root, ["mini/fig01_line"])
    layers.ledger.load.cache_clear()


def test_a_changed_line_is_named_and_no_picture_is_printed(two, tmp_path):
    old, new = two
    said = lambda: [one.what for one in layers.compare(old.root, new.root, ["mini/fig01_line"]) if one.layer == "notebook"]  # noqa: E731
    content = json.loads(new.notebook("fig01_line").read_text())
    pictures = [output["data"] for cell in content["cells"] for output in cell["outputs"] if "image/png" in output.get("data", {})]
    pictures[0]["image/png"] = ["iVBORw0KGgo" + "".join(pictures[0]["image/png"])[::-1]]
    new.notebook("fig01_line").write_text(json.dumps(content))
    assert said() == ["/cells/cell-04/outputs/0/data/image/png/0: the picture differs"]
    difference.write_page(old.root, new.root, ["mini/fig01_line"], [], tmp_path / "page")
    assert "iVBORw0KGgo" not in (tmp_path / "page" / "index.html").read_text()
    replace(new.notebook("fig01_line"), "[0, slope])\\n", "[0, 1.02 * slope])\\n")
    assert said() == ["cell-04, line 2: axis.plot([0, 1], [0, slope]) → axis.plot([0, 1], [0, 1.02 * slope])"]


@pytest.mark.parametrize("suffix", ["json", "csv", "png", "svg"])
def test_a_missing_or_broken_file_is_a_difference(two, suffix):
    old, new = two
    path = new.figure("fig01_line", suffix)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    broken = layers.compare(old.root, new.root, runner.items())
    assert {one.item for one in broken} == {"mini/fig01_line"}
    difference.write_page(old.root, new.root, list(runner.items()), [], new.root / "page")
    path.unlink()
    (missing,) = layers.compare(old.root, new.root, runner.items())
    assert missing.what == f"mini/fig01_line.{suffix}: only in the old tree"


def test_the_page_shows_old_new_and_difference_and_filters(two, tmp_path):
    old, new = two
    new.figure("fig01_line", "png").write_bytes(_other_picture(new.figure("fig01_line", "png")))
    replace(new.figure("fig02_next", "csv"), "\n2\n", "\n2.5\n")
    difference.write_page(old.root, new.root, list(runner.items()), ["<said>"], tmp_path / "page")
    text = (tmp_path / "page" / "index.html").read_text()
    assert re.findall(r"<figcaption>(\w+)</figcaption>", text) == ["old", "new", "difference"]
    assert "y, value 2: 2.0 → 2.5, 25 % of the largest" in text and "&lt;said&gt;" in text
    assert '<input id="filter"' in text and text.count('data-text="') == 6
    assert "http" not in text  # it stands alone


def _other_picture(path):
    import io

    import numpy as np
    from matplotlib import image

    pixels = image.imread(path).copy()
    pixels[:20] = np.array([1.0, 0.0, 0.0, 1.0])[: pixels.shape[2]]
    out = io.BytesIO()
    image.imsave(out, pixels)
    return out.getvalue()


def test_difference_and_accept_print_old_and_new_numbers(reproduced):
    def git(*arguments):
        return subprocess.run(["git", *arguments], cwd=reproduced.root, check=True, capture_output=True, text=True).stdout

    git("init", "--quiet")
    git("add", "figures", "notebooks")
    assert reproduced.run("difference").returncode == 0
    reproduced.write_cells("fig01_line", [cell.replace("slope = 2.0", "slope = 2.5") for cell in _code(reproduced, "fig01_line")])
    done = reproduced.run("reproduce")
    assert "  changed: mini/slope, ours: 2.0 → 2.5" in done.stdout
    done = reproduced.run("difference")
    assert done.returncode == 1
    assert "claims: mini/fig01_line: parameter slope: 2.0 → 2.5" in done.stdout
    assert "claims: mini/fig01_line: mini/slope, verdict: reproduced → contradicted" in done.stdout
    assert "arrays: mini/fig01_line: y, value 2: 2.0 → 2.5, 25 % of the largest" in done.stdout
    assert "2.0 → 2.5" in (reproduced.root / "build" / "difference" / "index.html").read_text()
    done = reproduced.run("accept", "mini/fig01")
    assert done.returncode == 0
    assert "mini/slope, ours: 2.0 → 2.5" in done.stdout and "accepted: 1 changed items" in done.stdout
    assert reproduced.run("difference").returncode == 0


def _code(pack, stem):
    return ["".join(cell["source"]) for cell in json.loads(pack.notebook(stem).read_text())["cells"]]


def test_without_git_the_way_out_is_named(reproduced):
    done = reproduced.run("difference")
    assert done.returncode == 2
    assert "without git compare with --against DIR" in done.stderr


def test_another_tree_and_a_fresh_run_can_be_compared(two):
    old, new = two
    replace(new.figure("fig01_line", "csv"), "\n2\n", "\n2.5\n")
    done = old.run("difference", "--against", new.root)
    assert done.returncode == 1
    assert "arrays: mini/fig01_line: y, value 2: 2.5 → 2.0, 20 % of the largest" in done.stdout
    done = new.run("difference", "--fresh", "mini/fig01")
    assert done.returncode == 1
    assert "arrays: mini/fig01_line: y, value 2: 2.5 → 2.0, 20 % of the largest" in done.stdout


def test_the_published_figures_are_the_accepted_ones(tmp_path):
    """What `make reproduce` has changed is to be looked at: `python -m drivelib accept` prints old and new and takes it."""
    try:
        old = review.accepted(tmp_path)
    except ValueError as error:
        pytest.skip(f"needs a checkout of git: {error}")
    found = difference.write_page(old, paths.root(), list(runner.items()), [], difference.default_folder())
    assert [(one.layer, one.item, one.what) for one in found] == [], f"see {difference.default_folder() / 'index.html'}"
