"""The sliders move what they say they move, redraw the whole picture, and are nowhere in what is published."""

import io
import subprocess
import sys

import nbformat
import numpy as np
import pytest
from ipywidgets import FloatSlider
from matplotlib.image import imread

from drivelib import dfim_panels, environment, interactive, notebook, paths, plotting, pmsm, pmsm_panels
from drivelib.dfim_drive import simulate
from drivelib.dfim_machines import DFIM_4KW
from drivelib.dfim_optimum import DfimLimits
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.machines import IPMSM, IPMSM_2200W
from drivelib.pack import runner
from drivelib.speed_law import FuzzySpeed
from pmsm_by_hand import at_torque, motor_branch

VIEW = "application/vnd.jupyter.widget-view+json"


def pixels(panel):
    return imread(io.BytesIO(panel.image.value))


def test_loss_curves_follow_every_slider():
    """Against space vectors: the sum over current, its parts, and the loss over voltage."""
    panel = pmsm_panels.loss_curves(IPMSM, model="simplified", convention="paper")
    for name, value in (("R_c", 437.0), ("T_e", 4.1), ("speed", 77.0)):
        before = panel.curves["total"].get_ydata()
        panel.sliders[name].value = value
        assert not np.allclose(panel.curves["total"].get_ydata(), before)
    R_c, T_e, speed = (panel.sliders[name].value for name in ("R_c", "T_e", "speed"))
    i_od = panel.curves["total"].get_xdata()
    points = at_torque(IPMSM.changed(R_c=R_c), IPMSM.P * speed, T_e, i_od, "simplified")
    for name, wanted in (("copper", points.copper), ("iron", points.iron), ("total", points.loss), ("voltage", points.loss)):
        np.testing.assert_allclose(panel.curves[name].get_ydata(), wanted, rtol=1e-9)
    np.testing.assert_allclose(panel.curves["voltage"].get_xdata(), abs(points.u), rtol=1e-9)
    (least,) = panel.curves["least, over current"].get_ydata()
    assert least <= points.loss.min() and points.loss.min() - least < 1e-3 * least
    assert f"Least loss {least:.1f} W" in panel.text.value


def test_the_readers_motor_follows_every_slider():
    """3 % less than the torque drawn is in reach of some current inside both limits, 3 % more of none; brute force over the branch."""
    panel = pmsm_panels.own_motor(IPMSM_2200W, 9.12)
    for name, widget in panel.sliders.items():
        before = [curve.get_ydata().copy() for curve in panel.curves.values()]
        widget.value = 0.8 * widget.value
        changed = [not np.allclose(curve.get_ydata(), old, equal_nan=True) for curve, old in zip(panel.curves.values(), before, strict=True)]
        assert any(changed), name
    motor = IPMSM_2200W.changed(**{name: panel.sliders[name].value for name in pmsm_panels.FIELDS})
    speed, largest = panel.curves["reach"].get_data()
    for row in range(0, speed.size, 12):
        for factor, wanted in ((0.97, True), (1.03, False)):
            points = at_torque(motor, motor.P * speed[row], factor * largest[row], motor_branch(motor, largest[row]))
            inside = (abs(points.u) <= pmsm.voltage_limit(motor)) & (abs(points.i) <= panel.sliders["I_max"].value)
            assert np.any(inside) == wanted


def test_the_fuzzy_loop_follows_every_slider():
    """The curve is that of a simulation which records every sample."""
    panel = dfim_panels.fuzzy_loop(DEFAULT_SCENARIO)
    for name, widget in panel.sliders.items():
        before = panel.curves["FLC", "speed"].get_ydata()
        widget.value = 0.7 * widget.value
        assert not np.allclose(panel.curves["FLC", "speed"].get_ydata(), before), name
    K_e, K_de, K_u, load = (panel.sliders[name].value for name in ("K_e", "K_de", "K_u", "load"))
    drive = DEFAULT_SCENARIO.changed(load_torque=((0.0, 0.0), (1.2, load), (1.8, 0.0)), duration=2.4, speed_reference=((0.0, 100.0),))
    for name, law in (("FLC", FuzzySpeed(K_e, K_de, K_u, "incremental")), ("PI", None)):
        run = simulate(drive, law)
        np.testing.assert_array_equal(panel.curves[name, "speed"].get_ydata(), run["omega_m"][:: dfim_panels.EVERY])
        dip = 100 - run["omega_m"][(run.t >= 1.2) & (run.t < 1.8)].min()
        assert f"{dip:.2f} rad/s" in panel.text.value
    panel.sliders["load"].value = 0.0
    assert abs(panel.curves["PI", "torque"].get_ydata()[-1]) < 0.5


def test_the_readers_dfim_follows_every_slider():
    """Losses from the currents' lengths, voltages inside the limits; a torque out of reach is said to be."""
    panel = dfim_panels.own_dfim(DFIM_4KW, DfimLimits(0.85, 323.0, 323.0, 16.0, 16.0))
    for name, widget in panel.sliders.items():
        before = [curve.get_ydata().copy() for curve in panel.curves.values()]
        widget.value = 0.8 * widget.value
        changed = [not np.allclose(curve.get_ydata(), old, equal_nan=True) for curve, old in zip(panel.curves.values(), before, strict=True)]
        assert any(changed), name
    motor = DFIM_4KW.changed(R_s=panel.sliders["R_s"].value, R_r=panel.sliders["R_r"].value)
    T_e = panel.sliders["T_e"].value
    for name, i_rd in (("paper", 0.0), ("least", np.linspace(-4, 12, 4001)[:, None])):
        flux, loss = panel.curves[name].get_data()
        i_q = T_e * motor.L_r / (1.5 * motor.p * motor.M * flux)
        by_hand = motor.R_s * (((flux - motor.L_r * i_rd) / motor.M) ** 2 + i_q**2) + motor.R_r * (i_rd**2 + (motor.M / motor.L_r * i_q) ** 2)
        np.testing.assert_allclose(loss, 1.5 * (by_hand if name == "paper" else by_hand.min(axis=0)), rtol=1e-5)
    for name, dc in (("V_s", "V_dc_s"), ("V_r", "V_dc_r")):
        assert np.nanmax(panel.curves[name].get_ydata()) <= panel.sliders[dc].value / np.sqrt(3) * (1 + 1e-6)
    panel.sliders["T_e"].value = 1.5 * DFIM_4KW.T_rated
    panel.sliders["phi_max"].value = 0.5
    assert "Not possible" in panel.text.value and "out of reach" in panel.text.value


def test_only_curves_are_redrawn_and_nothing_old_is_left():
    """There and back gives the same picture, and it is the one that a whole drawing of the figure gives."""
    panel = pmsm_panels.loss_curves(IPMSM)
    start, moved = pixels(panel), panel.sliders["T_e"]
    moved.value *= 1.5
    there = pixels(panel)
    moved.value /= 1.5
    assert np.array_equal(pixels(panel), start) and not np.array_equal(there, start)
    for curve in panel.curves.values():
        curve.set_animated(False)
    whole = io.BytesIO()
    panel.canvas.figure.savefig(whole, format="png", dpi=100)
    different = np.any(abs(imread(io.BytesIO(whole.getvalue()))[..., :3] - start) > 0.02, axis=-1)
    assert np.mean(different) < 0.005  # texts that a curve now lies above instead of below


def test_what_is_impossible_is_said_and_leaves_the_picture():
    fig, axis = plotting.figure("a line")
    line = axis.plot([0, 1], [0, 1])[0]

    def update(x):
        if x > 0.5:
            raise ValueError("x = 0.7 < 1: must be at most 0.5")
        return "fine"

    panel = interactive.Panel(fig, {"line": line}, {"x": FloatSlider(value=0.0, max=1.0)}, update)
    start = panel.image.value
    panel.sliders["x"].value = 0.7
    assert panel.text.value == "<b>Not possible:</b> x = 0.7 &lt; 1: must be at most 0.5" and panel.image.value == start
    panel.sliders["x"].value = 0.2
    assert panel.text.value == "fine"


@pytest.mark.parametrize(("value", "wanted"), [(1.0, 1.0), (1.01, 1.5), (4.9, 5.0), (7.1, 10.0), (0.016, 0.02), (234.0, 300.0)])
def test_axes_end_at_round_numbers(value, wanted):
    assert interactive.nice_limit(value) == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        (("R_c", 1.0, 2.0, 1.0, "ohm"), {}, "high end of R_c = 1.0 ohm"),
        (("R_c", 5.0, 0.0, 1.0, "ohm"), {}, "R_c = 5.0 ohm"),
        (("R_c", 5.0, 0.0, 10.0, "ohm"), {"scale": "logarithmic"}, "low end of R_c = 0.0 ohm"),
        (("R_c", np.nan, 1.0, 10.0, "ohm"), {}, "R_c = nan ohm"),
        (("R_c", 2.0, 1.0, 10.0, "ohm"), {"scale": "log"}, "scale = 'log'"),
    ],
)
def test_a_slider_without_sense_is_refused(arguments, options, message):
    with pytest.raises(ValueError, match=message):
        interactive.slider(*arguments, **options)


@pytest.mark.parametrize(
    ("variables", "wanted"),
    [({}, False), ({"JPY_SESSION_NAME": "x"}, True), ({"JPY_SESSION_NAME": "x", "DRIVELIB_PUBLISH": "y"}, False), ({"JPY_SESSION_NAME": "x", "DRIVELIB_OUT": "y"}, False)],
)
def test_sliders_show_only_where_a_person_sits(variables, wanted, monkeypatch, capsys):
    monkeypatch.delenv("JPY_SESSION_NAME", raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    panel = interactive.show(pmsm_panels.loss_curves, IPMSM)
    assert (panel is not None) == wanted
    capsys.readouterr()


def executed(item, path, *more, **variables):
    """Execute a notebook and more cells with plain nbclient, in a process of its own, and return it."""
    content = nbformat.read(paths.notebook(item), as_version=4)
    content["cells"] += [nbformat.v4.new_code_cell(text) for text in more]
    nbformat.write(content, path)
    command = [sys.executable, "-m", "jupyter", "execute", "--inplace", "--kernel_name=python3", str(path)]
    subprocess.run(command, env=environment.pinned(PYTHONPATH=paths.root(), **variables), check=True, capture_output=True, timeout=200)
    return nbformat.read(path, as_version=4)


def views(content):
    """Return the widgets shown, cell by cell."""
    return [output["data"][VIEW] for cell in content["cells"] for output in cell.get("outputs", ()) if VIEW in output.get("data", ())]


def test_a_notebook_run_by_hand_shows_sliders_that_move_its_curves(tmp_path):
    """As a Jupyter server runs it; saved and cleaned, nothing of the widget is left."""
    move = """
before = panel.curves["total"].get_ydata().copy(), panel.image.value
panel.sliders["R_c"].value *= 2
print((before[0] != panel.curves["total"].get_ydata()).any(), before[1] != panel.image.value)
"""
    content = executed("eskander/fig02_loss_at_speeds", tmp_path / "fig02.ipynb", move, JPY_SESSION_NAME="fig02.ipynb")
    assert len(views(content)) == 1
    assert content["cells"][-1]["outputs"][0]["text"] == "True True\n"
    assert content["metadata"]["widgets"]
    assert any("shows a widget" in reason for reason in notebook.unpublishable(content))
    clean = notebook.normalised(content)
    assert notebook.unpublishable(clean) == [] and VIEW.encode() not in notebook.dumps(clean) and "widgets" not in clean["metadata"]


@pytest.mark.parametrize("item", [item for item in sorted(runner.items()) if "interactive.show(" in "".join(notebook.code(notebook.read(paths.notebook(item))))])
def test_published_notebooks_hold_a_sentence_instead_of_a_widget(item):
    content = notebook.read(paths.notebook(item))
    shown = [cell for cell in content["cells"] if cell["cell_type"] == "code" and "interactive.show(" in notebook.source(cell)]
    for cell in shown:
        said = ["".join(output["data"]["text/markdown"]) for output in cell["outputs"]]
        assert said and all(text.startswith("*In JupyterLab (`make lab`) this cell shows ") for text in said)
    assert views(content) == [] and "widgets" not in content["metadata"]
