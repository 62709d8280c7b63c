"""The exported files: CSV table and ONNX model hold what the map and the network hold, names and places are right, the rest is refused."""

import csv
import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from conftest import REPOSITORY
from drivelib import export, fixed_point, loss_map, notebook, paths, pmsm
from drivelib.dfim_machines import DFIM_4KW
from drivelib.neural import Network, Range
from exported_c import harsh, points


def test_the_table_holds_the_map_with_flags(motor):
    found, _ = motor
    m = found.machine
    lines = [line for line in export.table_csv(found).splitlines() if not line.startswith("#")]
    table = list(csv.DictReader(lines))
    assert len(table) == found.omega_m.size * found.T_e.size
    flags = np.array([int(row["flag"]) for row in table]).reshape(found.best.feasible.shape)
    assert np.array_equal(flags == 2, ~found.best.feasible) and np.array_equal(flags == 1, found.best.limited)
    for row in table:
        if row["flag"] == "2":
            assert {row[name] for name in row if name not in ("omega_m", "T_e", "flag")} == {""}
            continue
        if m is DFIM_4KW:
            torque = 1.5 * m.p * m.M * (float(row["i_sq"]) * float(row["i_rd"]) - float(row["i_sd"]) * float(row["i_rq"]))
        else:
            torque = pmsm.torque(m, *pmsm.branch_currents(m, m.P * float(row["omega_m"]), float(row["i_d"]), float(row["i_q"])))
        assert abs(torque / float(row["T_e"]) - 1) < 1e-5  # seven digits are written


def test_onnx_gives_the_same_currents(motor):
    """By the reference evaluator of the package onnx, in single precision."""
    from onnx.reference import ReferenceEvaluator

    _, network = motor
    x = points(network, 2_000)
    (got,) = ReferenceEvaluator(export.onnx_model(network, "motor")).run(None, {"x": x.astype(np.float32)})
    assert np.all(np.abs(got - network.predict(x)) <= fixed_point.float32_bound(network))


def test_onnx_names_its_range_and_warns_of_the_rest(motor):
    import onnx

    _, network = motor
    model = onnx.load_from_string(export.onnx_model(network, "motor"))
    told = {prop.key: float(prop.value) for prop in model.metadata_props}
    for end, pair in (("low", network.inputs.low), ("high", network.inputs.high)):
        assert np.allclose([told[f"omega_m_{end}"], told[f"torque_{end}"]], pair, rtol=1e-8)
    assert "extrapolates" in model.doc_string


def test_files_are_written_whole_and_named_after_the_machine(some_map, tmp_path):
    made = export.files(some_map, harsh(0))
    assert set(made) == {"ipmsm_2_2_kw.h", "ipmsm_2_2_kw.csv", "ipmsm_2_2_kw.onnx"}
    assert {path.name: path.read_bytes() for path in export.write(tmp_path / "new", made)} == made


def example(**changes):
    """Return a reader's record of your_motor: the published parameters, some of them changed."""
    published = json.loads((REPOSITORY / "figures/beyond/your_motor.json").read_text())["parameters"]
    return SimpleNamespace(item="beyond/your_motor", published=False, parameters={**published, **changes})


def test_other_numbers_never_go_under_the_examples_name():
    assert export.own_name(example()) == "IPMSM 2.2 kW"
    for changes in ({"R_s": 2.0}, {"I_max": 12.0}, {"torque_range": [0.2, 1.0]}):
        assert export.own_name(example(**changes)) == "IPMSM 2.2 kW, changed"
    assert export.own_name(example(name="mine", R_s=2.0), ["IPMSM 900 W"]) == "mine"
    with pytest.raises(ValueError, match="a name of its own"):
        export.own_name(example(name="ipmsm 900 W"), ["IPMSM 900 W"])


def test_a_readers_files_lie_beside_his_run_and_published_ones_in_build(tmp_path, monkeypatch):
    monkeypatch.setenv("DRIVELIB_ROOT", str(tmp_path / "pack"))
    for published, folder in ((False, tmp_path / "run" / "exports"), (True, tmp_path / "pack" / "build" / "exports")):
        export.keep(SimpleNamespace(published=published, folder=tmp_path / "run"), {"motor.h": b"x"})
        assert (folder / "motor.h").read_bytes() == b"x"


@pytest.mark.parametrize("stem", ["your_motor", "your_dfim"])
def test_a_notebook_exports_after_everything_else(stem):
    """So that a run that fails leaves no firmware behind: nothing is written before finish, and nothing follows."""
    cells = ["".join(cell["source"]) for cell in notebook.read(paths.notebook(f"beyond/{stem}"))["cells"] if cell["cell_type"] == "code"]
    assert cells[-1].splitlines() == ["item.finish()", "export.keep(item, made);"]
    assert not any(re.search(r"export\.(keep|write)\(|write_(bytes|text)\(", cell) for cell in cells[:-1])


@pytest.mark.parametrize(("name", "wanted"), [("IPMSM 2.2 kW", "ipmsm_2_2_kw"), ("900 W", "motor_900_w"), ("Größe */", "gr_e")])
def test_a_machines_name_becomes_an_identifier(name, wanted):
    assert export.c_name(name) == wanted


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f, n: (f, Network(n.W1, n.B1, n.W2, n.B2, n.inputs, n.targets, "logistic")), "only 'tanh'"),
        (lambda f, n: (f, Network(n.W1 * 1e4, n.B1, n.W2, n.B2, n.inputs, n.targets)), "too large for Q15"),
        (lambda f, n: (f, Network(n.W1, n.B1, n.W2[:1], n.B2[:1], n.inputs, Range([0.0], [1.0]))), "must be 2 and 2"),
        (lambda f, n: (loss_map.loss_map(f.machine.changed(R_s=0.0), f.omega_m, f.T_e, V_max=300, I_max=9), n), "R_s = 0 ohm"),
    ],
)
def test_what_cannot_be_exported_is_refused(some_map, change, message):
    with pytest.raises(ValueError, match=message):
        export.c_header(*change(some_map, harsh(3)))


def test_a_name_without_letters_is_refused():
    with pytest.raises(ValueError, match="must hold a letter"):
        export.c_name("±∞")
