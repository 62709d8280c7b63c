"""What the benchmark compares computes the same thing, and its verdicts follow from its numbers."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from drivelib import dfim_many, environment
from drivelib.dfim_drive import simulate
from drivelib.dfim_loop import LIMITS, STATES
from drivelib.dfim_scenario import DEFAULT_SCENARIO

FOLDER = Path(__file__).parent / "benchmarks"
sys.path.insert(0, str(FOLDER))
import bench  # noqa: E402
import c_loop  # noqa: E402
import measure  # noqa: E402
import parts  # noqa: E402
import whole_pack  # noqa: E402

needs_gcc = pytest.mark.skipif(not c_loop.available(), reason="needs gcc")
CYCLE = DEFAULT_SCENARIO.changed(
    duration=1.5, T_limit=40.0, i_s_limit=15.0, speed_reference=((0.0, 100.0), (0.8, -50.0)), load_torque=((0.0, 0.0), (0.5, 25.0)),
    rotor_resistance=((0.0, 1.0), (0.4, 1.3)), V_dc_s=250.0,
)  # fmt: skip


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return c_loop.build(tmp_path_factory.mktemp("c"))


def assert_equal_to_simulate(scenario, state, index, hit):
    run = simulate(scenario, every=0, window=(0.2, 1.2))
    # The estimate is written at the last sample here, at the one before there.
    names = [name for name in STATES if not name.startswith("phi_hat")]
    found = [state[STATES.index(name)] for name in names]
    np.testing.assert_allclose(found, [run.state[name] for name in names], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(index, run.indices[:3], rtol=1e-9)
    first = {name: k * scenario.period for name, k in zip(LIMITS, hit, strict=True) if k >= 0}
    assert first == run.first_hits and "rotor voltage" not in first and len(first) >= 3


@needs_gcc
@pytest.mark.parametrize("law", ["equal split", "constant rotor frequency"])
def test_one_drive_in_c_gives_our_numbers(library, law):
    """States, indices and limits after start, reversal, load and heating, to 1e-9; three limits are hit on the way."""
    scenario = CYCLE.changed(frequency_law=law, omega_r_constant=5.0)
    state, index, hit = c_loop.Inputs([scenario], window=(0.2, 1.2)).run(library)
    assert_equal_to_simulate(scenario, state[:, 0], index[:, 0], hit[:, 0])


@needs_gcc
def test_sixty_four_drives_in_c_give_our_numbers(library):
    scenarios = [CYCLE.changed(omega_n=15.0 + k / 4) for k in range(64)]
    state, index, hit = c_loop.Inputs(scenarios, window=(0.2, 1.2)).run(library)
    table = dfim_many.simulate_many(scenarios, window=(0.2, 1.2))
    np.testing.assert_allclose(index[0], table["IAE"], rtol=1e-9)
    for k in (0, 63):
        assert_equal_to_simulate(scenarios[k], state[:, k], index[:, k], hit[:, k])
    with pytest.raises(ValueError, match="takes 1 or 64"):
        c_loop.Inputs(scenarios[:3]).run(library)


def test_the_network_of_the_training_rows_has_the_derivatives_it_says():
    x, t = parts.problem()
    rng = np.random.default_rng(3)
    w = rng.normal(size=9)
    for k in range(9):
        step = 1e-6 * np.eye(9)[k]
        slope = (parts.residual(w + step, x, t) - parts.residual(w - step, x, t)) / 2e-6
        np.testing.assert_allclose(parts.jacobian(w, x, t)[:, k], slope, atol=1e-8)


def test_the_busiest_worker_is_the_one_whose_cells_took_longest(tmp_path):
    """Two workers by hand: one has the notebook of 9 s, the other those of 2, 3 and 2 s; the last begins when the first is at work yet."""
    folder = tmp_path / "build" / "records" / "paper"
    folder.mkdir(parents=True)
    for number, (began, seconds) in enumerate([(0, 9), (0, 2), (2, 3), (5, 2)]):
        record = folder / f"{number}.json"
        record.write_text(json.dumps({"seconds": seconds, "cell_seconds": seconds - 0.5}))
        os.utime(record, (1e9 + began + seconds,) * 2)
    assert whole_pack.busiest(tmp_path, 2) == 8.5
    assert whole_pack.busiest(tmp_path, 1) == 14.0


def test_verdicts_follow_from_the_numbers():
    pairs = [(1.0, 2.0), (1.2, 2.0), (3.0, 2.0)]
    assert measure.Row("a", "b", pairs, limit=0.7).cells()[3:] == ["0.6 (0.5 to 1.5) ×", "≤ 0.7 ×", "met"]
    assert measure.Row("a", "b", pairs, limit=0.5).cells()[-1] == "not met"
    assert measure.Row("a", "b", pairs, "faster", 1.7).cells()[3:] == ["1.67 (0.667 to 2) ×", "≥ 1.7 ×", "not met"]
    assert measure.Row("a", "", pairs, "value", 1100, "ms", 1e3).cells()[1:] == ["1200 ms", "", "1.2e+03 (1e+03 to 3e+03)", "≤ 1100 ms", "not met"]
    assert measure.Row("a", "b", limit=3, note="peer not installed").cells()[-1] == "peer not installed"


def test_ten_thousand_drives_on_a_cluster_give_the_bytes_of_the_local_run():
    """Scheduler and workers in processes of their own, one worker killed, the run stopped half way and resumed."""
    command = [sys.executable, FOLDER / "on_cluster.py", "--drives", "10000"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment.pinned(PYTHONPATH=os.pathsep.join(sys.path)), timeout=600)
    assert done.returncode == 0 and done.stdout.rstrip().endswith("equal bytes"), done.stdout + done.stderr


def test_too_few_repetitions_are_refused():
    done = subprocess.run([sys.executable, "-m", "drivelib", "bench", "--repetitions", "2"], capture_output=True, text=True, env=environment.pinned())
    assert done.returncode == 2 and "must be at least 5" in done.stderr


def test_peers_that_are_missing_say_so():
    code = f"import sys; sys.path.insert(0, {str(FOLDER)!r}); sys.argv = ['peers', '[]', '1']; import peers; peers.main()"
    done = subprocess.run([sys.executable, "-S", "-I", "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert len(re.findall("peer not installed", done.stdout)) == len(bench.PEERS)


def test_the_benchmark_names_no_place():
    for path in FOLDER.iterdir():
        if path.suffix in (".py", ".txt", ".c"):
            assert "://" not in path.read_text(encoding="utf-8") and len(path.read_text(encoding="utf-8").splitlines()) < 300
