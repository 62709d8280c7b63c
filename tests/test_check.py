"""Check mode runs everything, writes nothing, and names the first number that differs."""

from drivelib.pack import check


def test_an_unchanged_pack_passes_and_is_not_touched(reproduced):
    before = reproduced.files()
    done = reproduced.run("reproduce", "--check")
    assert done.returncode == 0, done.stdout
    assert "2 notebooks run" in done.stdout
    assert reproduced.files() == before


def test_one_corrupted_value_is_named_and_the_difference_page_written(reproduced, tmp_path):
    path = reproduced.figure("fig01_line", "csv")
    text = path.read_text()
    assert text.splitlines()[-1] == "2"
    path.write_text(text.removesuffix("2\n") + "2.5\n")
    before = reproduced.files()
    done = reproduced.run("reproduce", "--check", "--keep", tmp_path / "page")
    assert done.returncode == 1
    assert "figures/mini/fig01_line.csv: line 4, column y: committed 2.5, computed 2" in done.stdout
    assert "committed 2.5, computed 2" in (tmp_path / "page" / "index.html").read_text()
    assert reproduced.files() == before


def test_a_changed_verdict_a_changed_output_and_a_stray_file_are_named(reproduced):
    path = reproduced.figure("fig01_line", "json")
    path.write_text(path.read_text().replace('"ours": 2.0', '"ours": 1.0'))
    reproduced.notebook("fig02_next").write_text(reproduced.notebook("fig02_next").read_text().replace("reproduced", "contradicted"))
    (path.parent / "leftover.png").write_bytes(b"x")
    done = reproduced.run("reproduce", "--check")
    assert done.returncode == 1
    assert "/claims/mini/slope/ours: committed 1.0, computed 2.0" in done.stdout
    assert "notebooks/mini/fig02_next.ipynb: /cells" in done.stdout
    assert "figures/mini/leftover.png: belongs to no notebook" in done.stdout


def test_a_draw_without_a_seed_is_caught(reproduced):
    """Determinism broken on purpose must not pass."""
    reproduced.write("fig01_line", "mini/slope", work="import random\nslope += random.random() * 1e-6")
    assert reproduced.run("reproduce", "mini/fig01").returncode == 0
    done = reproduced.run("reproduce", "--check")
    assert done.returncode == 1
    assert "figures/mini/fig01_line.csv: line 4, column y" in done.stdout


def test_within_tolerance_small_differences_pass_and_large_ones_do_not(tmp_path):
    old, near, far = (tmp_path / name for name in ("old.csv", "near.csv", "far.csv"))
    old.write_text("# x [m]: length\nx\n1.0\n")
    near.write_text("# x [m]: length\nx\n1.00000001\n")
    far.write_text("# x [m]: length\nx\n1.001\n")
    assert check.first_difference(old, near, 1e-6) == ""
    assert check.first_difference(old, far, 1e-6) == "line 3, column x: committed 1.0, computed 1.001"
    assert "committed 1.0" in check.first_difference(old, near, 0.0)
