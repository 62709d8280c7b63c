"""Claims over draws: every claim has its place, shares are counted right, and nothing that goes wrong leaves a silent gap."""

import json
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from drivelib import (
    ann_data, dfim_pieces, ledger, metrics, paths, robustness, robustness_ann, robustness_dfim, robustness_ipmsm, robustness_scope, robustness_spmsm,
    robustness_steady, table2,
)  # fmt: skip
from drivelib.dfim_drive import simulate
from drivelib.dfim_loop import NEVER, STATES
from drivelib.dfim_pieces import Drive, Piece
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.ensemble import EnsembleError, generator
from drivelib.robustness import DIVERGED, NETWORK, REACH, Study, run, summary
from drivelib.space import Space, Span
from drivelib.speed_law import PiSpeed

CLAIMS = {id_: claim for paper in ("eskander", "zidani") for id_, claim in ledger.papers()[paper].claims.items()}
ROWS = {
    name: table2.Printed(*((float(claim.printed), claim.tolerance) for claim in (CLAIMS[f"zidani/tab02/{name}-{index}"] for index in ("iae", "ise", "itae"))))
    for name in ("pi", "ann")
}
DFIM = robustness_dfim.study(ROWS["pi"], ROWS["ann"])
STUDIES = (robustness_steady.STUDY, robustness_ipmsm.STUDY, robustness_spmsm.STUDY, DFIM)
ONE = ThreadPoolExecutor(1)
ALWAYS = np.array([0, NEVER])  # one value from the first sample on


def published(item, claim):
    content = json.loads(paths.figure(item, "json").read_text())
    return next(entry["ours"] for entry in content["claims"] if entry["id"] == claim)


def coin(values, rng):
    """A study's measure: holds where x is above 0.3, or the kind is b; every tenth of x is out of reach."""
    if values["x"] > 0.9:
        return {}, REACH
    return {"eskander/fig06": 0.0 if values["x"] > 0.3 or values["kind"] == "b" else 100.0}, 0


TOY = Study("toy", Space({"x": Span(0.0, 1.0), "kind": ("a", "b", "c"), "idle": Span(0.0, 1.0)}), ("eskander/fig06",), coin, {"x": "length [m]"})


def test_each_claim_of_the_papers_is_drawn_or_decided_or_compares_nothing():
    drawn = [claim for study in STUDIES for claim in study.claims]
    places = [*drawn, *robustness_scope.THEOREMS, *robustness_scope.NOT_COMPARATIVE]
    assert len(places) == len(set(places)) and set(places) == set(CLAIMS)


def test_each_assumption_has_a_label_and_each_default_of_the_figures_lies_in_the_box():
    for study in STUDIES:
        assert set(study.labels) == set(study.space.assumptions)
    values = {"omega_n": 20.0, "xi": 0.7, "current_bandwidth": 1000.0, "period": 1e-4, "phi_r_ref": 0.85, "V_dc": 560.0, "T_limit": 2.0, "e_max": 150.0, "load": 25 / 25.5, "hold": 2.0}
    assert all(DFIM.space.assumptions[name].low <= value <= DFIM.space.assumptions[name].high for name, value in values.items())


def test_shares_intervals_and_deciding_assumptions():
    table = run(TOY, 4000, 1, executor=ONE)
    (row,) = summary(TOY, table, CLAIMS)
    counts = table["x"] <= 0.9
    holds = counts & ((table["x"] > 0.3) | (table["kind"] == 1))
    assert (row.draws, row.flagged, row.holding) == (4000, int((~counts).sum()), int(holds.sum()))
    n, p, z = counts.sum(), holds.sum() / counts.sum(), 1.959963984540054
    middle, half = (p + z**2 / (2 * n)) / (1 + z**2 / n), z / (1 + z**2 / n) * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
    assert (row.share, row.low, row.high) == pytest.approx((p, middle - half, middle + half), rel=1e-12)
    assert row.deciding == ("x", "kind")
    assert row.rule == "length ≤ 0.3 m: (kind = b: 100 %; else 0 %); else 100 %"
    assert robustness.reasons(table) == f"{int((~counts).sum())} point out of reach"
    always = Study("always", TOY.space, TOY.claims, lambda values, rng: ({"eskander/fig06": 0.0}, 0))
    (row,) = summary(always, run(always, 20, 1, executor=ONE), CLAIMS)
    assert (row.share, row.deciding, row.rule) == (1.0, (), "in every draw")
    x = np.linspace(0.0, 1.0, 1000)
    table = np.rec.fromarrays([x, 0 * x, 0 * x], names="x,kind,idle")
    assert robustness.decided_by(TOY, table, x < 0.9975) == ((), "in all but 3 draws")
    assert robustness.decided_by(TOY, table, x < 0.0015) == ((), "in 2 of 1000 draws")


def test_an_empty_a_contradictory_and_a_fully_flagged_space_are_refused():
    with pytest.raises(ValueError, match="assumptions is empty"):
        Study("empty", Space({}), TOY.claims, coin)
    never = Study("never", Space({"x": Span(0.0, 1.0), "kind": ("a",)}, allowed=lambda values: False), TOY.claims, coin)
    with pytest.raises(EnsembleError, match=r"(?s)draw 0: .*none of 10000 draws of x, kind is allowed: the assumptions contradict"):
        run(never, 3, 1, executor=ONE)
    far = Study("far", Space({"x": Span(0.95, 1.0), "kind": ("a",)}), TOY.claims, coin)
    with pytest.raises(ValueError, match=r"all 5 draws are flagged \(5 point out of reach\)"):
        summary(far, run(far, 5, 1, executor=ONE), CLAIMS)
    wrong = Study("wrong", TOY.space, ("eskander/fig05",), coin)
    with pytest.raises(EnsembleError, match="eskander/fig06, which are not among its claims"):
        run(wrong, 20, 1, executor=ONE)


@pytest.mark.parametrize("study", STUDIES, ids=lambda study: study.name)
def test_draws_do_not_depend_on_chunks_or_neighbours(study):
    whole = run(study, 12, 6, executor=ONE)
    assert run(study, 12, 6, executor=ThreadPoolExecutor(3), shard_size=5).tobytes() == whole.tobytes()
    last = robustness.one_draw(study, generator(6, 11))
    np.testing.assert_array_equal(np.array(last), np.array([whole[name][11] for name in study.columns]))


def test_a_draw_that_fails_among_many_is_named():
    def failing(values, rng):
        yield []
        raise ArithmeticError("no sense")

    with pytest.raises(ArithmeticError, match="no sense") as caught:
        robustness.measured(replace(DFIM, measure=failing), [{}] * 3, [None] * 3)
    assert caught.value.__notes__ == ["in draw 0 of the 3 that were worked out together"]


def test_a_truncated_shard_is_worked_out_again_and_the_others_are_not(tmp_path):
    study = robustness_steady.STUDY
    options = {"executor": ONE, "shard_size": 4, "folder": tmp_path}
    whole = run(study, 12, 6, **options).tobytes()
    files = sorted(tmp_path.iterdir())
    assert len(files) == 3
    kept = {file: file.stat().st_mtime_ns for file in files}
    files[1].write_bytes(files[1].read_bytes()[:-5])
    os.utime(files[1], ns=(0, 0))
    assert run(study, 12, 6, **options).tobytes() == whole
    assert [file.stat().st_mtime_ns == kept[file] for file in (files[0], files[2])] == [True, True] and files[1].stat().st_mtime_ns != 0


class DiesOnce:
    """A study's measure that takes its process with it, the first time."""

    def __init__(self, folder):
        self.mark = Path(folder) / "died"

    def __call__(self, values, rng):
        if not self.mark.exists():
            self.mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return robustness_steady.measure(values, rng)


@pytest.mark.skipif(os.name == "nt", reason="kills a process by signal")
def test_a_worker_that_dies_costs_nothing_but_time(tmp_path):
    steady = robustness_steady.STUDY
    mortal = Study(steady.name, steady.space, steady.claims, DiesOnce(tmp_path))
    table = run(mortal, 8, 6, executor=partial(robustness.processes, 1), shard_size=4)
    assert (tmp_path / "died").exists() and table.tobytes() == run(steady, 8, 6, executor=ONE).tobytes()


DASK = """
import sys
from distributed import Client, LocalCluster
import test_robustness as t
from drivelib.robustness import run
if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        for study, draws in ((t.STUDIES[0], 24), (t.DFIM, 12)):
            there = run(study, draws, 6, executor=client.get_executor(pure=False), shard_size=5)
            assert there.tobytes() == run(study, draws, 6, executor=t.ONE, shard_size=7).tobytes(), study.name
    print("equal")
"""


def test_a_dask_cluster_of_two_workers_gives_the_bytes_of_the_local_run(tmp_path):
    script = tmp_path / "on_dask.py"
    script.write_text(DASK)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    done = subprocess.run([sys.executable, script], env=environment, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0 and "equal" in done.stdout, done.stdout + done.stderr


def drawn(study, **values):
    return study.space.draw(generator(6, 0)) | values


def test_a_point_out_of_the_motors_reach_is_flagged():
    """400 W at 300 rad/s are beyond the SPMSM's 57.7 V, whatever the current (figure 1)."""
    found, flag = robustness_steady.measure(drawn(robustness_steady.STUDY, machine="SPMSM", load=1.0, speed=1.0, modulation="space-vector", omega_rated_spmsm=300.0), None)
    assert flag == REACH and "eskander/eq20/x" not in found and "eskander/fig16" in found
    values = drawn(robustness_ipmsm.STUDY, ipmsm="as printed", model="full", R_c_ipmsm=200.0, load=1.0, load_before=1.0, speed=1.0, speed_before=0.5, period=1e-4, current_bandwidth=1000.0, torque_bandwidth=200.0)
    found, flag = robustness_ipmsm.measure(values, generator(6, 0))
    assert flag == REACH and "eskander/fig09" not in found and "eskander/fig05" in found


def test_a_network_that_did_not_converge_is_flagged(monkeypatch):
    monkeypatch.setattr(robustness_ipmsm, "EPOCHS", 1)
    monkeypatch.setattr(robustness_ann, "EPOCHS", 1)
    found, flag = robustness_ipmsm.measure(drawn(robustness_ipmsm.STUDY), generator(6, 0))
    assert flag == NETWORK and found == {"eskander/fig05": robustness_ipmsm.NEVER}
    ((found, flag),) = robustness.measured(DFIM, [drawn(DFIM)], [generator(6, 0)])
    assert flag == NETWORK and "zidani/end-2" not in found and "zidani/fig10/pi" in found and "zidani/fig10/flc" in found


@pytest.mark.parametrize("when", ["onset", "later"])
def test_a_drive_that_diverges_is_flagged_and_harms_no_other(when):
    """The fuzzy drive of the first of two draws is lost: at the load's coming, or after it."""

    def together(pieces):
        ours = dfim_pieces.together(pieces)
        lost = [k for k, piece in enumerate(pieces) if piece.law.K_u > 0 and (piece.x[STATES.index("T_previous")] == start) == (when == "onset")]
        for k in lost[:1]:
            ours[k] = None
        return ours

    values, rngs = [drawn(DFIM)] * 2, [generator(6, k) for k in (0, 1)]
    start = robustness_dfim.settled_state(robustness_dfim.scenario_of(values[0]))[STATES.index("T_previous")]
    (found, flag), second = robustness.measured(replace(DFIM, together=together), values, rngs)
    assert flag == DIVERGED and "zidani/end-2" in found and "zidani/end-3" not in found and "zidani/end-1" not in found
    assert second == robustness.measured(DFIM, values[1:], [generator(6, 1)])[0]


@pytest.mark.parametrize(
    "item, claim, values, tolerance",
    [
        ("fig02_loss_at_speeds", "eq05/08", {"load": 1.0, "speed": 1.0, "convention": "paper"}, 1e-6),
        ("fig02_loss_at_speeds", "fig02/voltage", {"load": 3.0 / 5.06, "model": "simplified"}, 1e-6),
        ("fig03_loss_at_torques", "fig03/voltage", {"speed": 1000 * np.pi / 30 / 178, "model": "simplified"}, 1e-6),
        ("fig17_angle_benefit", "fig17/torque", {"load": 0.3, "constraint": "equal voltage"}, 0.03),
        ("fig17_angle_benefit", "fig17/efficiency", {"load": 0.3, "constraint": "equal voltage"}, 0.03),
        ("fig18_two_schemes", "fig18/efficiency", {"load": 0.3}, 1e-3),
        ("fig18_two_schemes", "fig18/torque", {"load": 0.3, "constraint": "equal current"}, 0.005),
        ("fig18_two_schemes", "end-2", {"load": 0.3, "weakening": "by (16)"}, 1e-3),
        ("fig18_two_schemes", "end-3", {"load": 0.3}, 0.05),
        ("fig19_angle_torque_step", "fig19/range", {"lowest_speed": 10.0}, 1e-6),
    ],
)
def test_at_the_figures_own_values_the_study_measures_what_the_figure_measured(item, claim, values, tolerance):
    """The notebooks take finer grids of speed, hence the tolerances of medians."""
    defaults = {"ipmsm": "as printed", "R_c_ipmsm": 200.0, "R_c_spmsm": 200.0, "omega_rated_spmsm": 300.0, "machine": "SPMSM", "convention": "consistent", "modulation": "space-vector"}
    found, _ = robustness_steady.measure(drawn(robustness_steady.STUDY, **defaults | values), None)
    assert found[f"eskander/{claim}"] == pytest.approx(published(f"eskander/{item}", f"eskander/{claim}"), rel=tolerance)


def test_the_drive_started_at_its_set_point_answers_the_load_as_one_that_has_run_up():
    scenario = DEFAULT_SCENARIO.changed(duration=2.5, speed_reference=((0.0, 30.0),), load_torque=((0.0, 0.0), (2.0, 20.0)))
    steps, x = round(0.5 / scenario.period), robustness_dfim.settled_state(scenario)
    whole = Piece(Drive.of(scenario), PiSpeed(*scenario.speed_gains).law(), x, (ALWAYS, np.array([[30.0, 20.0, 1.0]]), steps))
    part = dfim_pieces.alone(whole)
    run_up = simulate(scenario)
    # The settled state leaves out the current that 0.03 N m of friction take: 1.5e-4 rad/s in the first milliseconds.
    np.testing.assert_allclose(part["omega_m"], run_up["omega_m"][-steps - 1 :], rtol=0, atol=3e-4)
    half = whole._replace(profiles=(*whole.profiles[:2], steps // 2))
    first = dfim_pieces.alone(half)
    both = dfim_pieces.joined(first, dfim_pieces.alone(half._replace(x=first.x)))
    np.testing.assert_array_equal(both["omega_m"], part["omega_m"])
    t = scenario.period * np.arange(steps + 1)
    expected = metrics.error_indices(t, part["omega_ref"], part["omega_m"])
    np.testing.assert_allclose(both.indices, expected, rtol=1e-9)


def test_the_short_teacher_teaches_what_the_whole_drive_teaches():
    """The command's variance that the error leaves unexplained, and the slope at zero error of the learned map."""
    error, command = robustness_ann.teacher_data(DEFAULT_SCENARIO, DEFAULT_SCENARIO.speed_gains)
    whole = ann_data.pi_data(samples=10**6)
    shares = [ann_data.unexplained_share(*data, 0.5) for data in ((error, command), whole)]
    assert shares[0] == pytest.approx(shares[1], abs=0.02)
    fits = [robustness_ann.trained(error, command, generator(6, k)) for k in range(15)]
    slope = np.median([ann_data.map_slope(one.network) for one in fits])
    best = ann_data.trained_network(starts=8).best(unfinished=True)
    assert slope == pytest.approx(ann_data.map_slope(best), rel=0.15)
    e, u, counts = robustness_ann.classes(error, command)
    assert counts.sum() == error.size and counts @ u == pytest.approx(command.sum()) and len(e) < 120


def test_the_published_table_has_each_drawn_claim_with_its_published_verdict():
    lines = [line.split(",") for line in paths.figure("beyond/claim_robustness", "csv").read_text().splitlines() if not line.startswith("#")]
    columns = {name: [line[k] for line in lines[1:]] for k, name in enumerate(lines[0])}
    assert sorted(columns["claim"]) == sorted(claim for study in STUDIES for claim in study.claims)
    expected = {id_: verdict for paper in ("eskander", "zidani") for id_, (verdict, _) in ledger.papers()[paper].expected.items()}
    assert columns["verdict"] == [expected[claim].replace(",", ";") for claim in columns["claim"]]
    assert all(int(draws) >= 10_000 for draws in columns["draws"])
