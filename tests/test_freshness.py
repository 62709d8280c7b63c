"""An item is stale exactly when something that it depends on has changed."""

from drivelib.pack import freshness


def test_status_names_the_reason(reproduced):
    assert reproduced.run("status").stdout.count("fresh") == 2
    reproduced.write("fig01_line", "mini/slope", work="extra = 1")
    out = reproduced.run("status").stdout
    assert "mini/fig01_line: stale: cells and parameters changed" in out
    assert "mini/fig02_next: fresh" in out


def test_a_claims_threshold_makes_its_item_stale_and_an_expected_verdict_does_not(reproduced):
    ledger = reproduced.root / "drivelib" / "papers" / "mini.toml"
    original = ledger.read_text()
    ledger.write_text(original.replace('printed = "2.00"', 'printed = "2.00"\nexpected_verdict = "reproduced"'))
    assert reproduced.run("status").stdout.count("fresh") == 2
    ledger.write_text(original.replace("threshold = 0.5", "threshold = 0.6"))
    out = reproduced.run("status").stdout
    assert "mini/fig01_line: fresh" in out
    assert "mini/fig02_next: stale: claims changed" in out


def test_a_changed_or_missing_artefact_makes_its_item_stale(reproduced):
    reproduced.figure("fig01_line", "csv").write_text("x\n1\n")
    reproduced.figure("fig02_next", "png").unlink()
    out = reproduced.run("status").stdout
    assert "mini/fig01_line: stale: figures/mini/fig01_line.csv was changed" in out
    assert "mini/fig02_next: stale: figures/mini/fig02_next.png is missing" in out


def test_a_truncated_json_makes_its_item_stale_and_is_mended(reproduced):
    path = reproduced.figure("fig01_line", "json")
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    done = reproduced.run("reproduce")
    assert done.returncode == 0, done.stdout + done.stderr
    assert path.read_bytes() == whole


def test_the_lock_makes_everything_stale(reproduced):
    (reproduced.root / "environment.lock").write_text("x==2\n")
    assert reproduced.run("status").stdout.count("environment.lock changed") == 2


def test_the_closure_holds_what_is_imported_and_nothing_else():
    """pmsm_optimum needs pmsm, curves and validation; it needs no figure style and no SymPy proofs."""
    closure = freshness.closure(["from drivelib import pmsm_optimum"])
    assert closure == ["__init__.py", "curves.py", "pmsm.py", "pmsm_optimum.py", "validation.py"]
