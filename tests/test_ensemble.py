"""The same bytes whatever carries the work, and no silent gap: damage, death and nonsense are noticed."""

import os
import signal
import subprocess
import sys
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from drivelib import dfim_many, shards
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.ensemble import EnsembleError, evaluate, generator, stream
from drivelib.space import Space, Span, open_values

COLUMNS = ("first", "second")


def chance(rng):
    return rng.normal(), rng.uniform()


def scaled(draw, rng):
    return draw * rng.normal(), draw


def shy(draw):
    """Refuses every third draw in a way that a study expects, and 50 in one that it does not."""
    if draw == 50:
        raise RuntimeError("fifty is right out")
    if draw % 3 == 0:
        raise ArithmeticError("diverged")
    return draw, draw


def dies_once(folder, draw):
    """Kills its process at draw 13, the first time."""
    mark = Path(folder) / "died"
    if draw == 13 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return draw, 2 * draw


def dies_always(draw):
    if draw == 13:
        os.kill(os.getpid(), signal.SIGKILL)
    return draw, draw


def drives(rngs):
    """A study of open assumptions: draws from a space, a batch through the compiled loop."""
    space = Space({"omega_n": Span(10.0, 40.0), "T_limit": (30.0, 51.0)})
    short = DEFAULT_SCENARIO.changed(duration=0.02, speed_reference=((0.0, 2.0),), load_torque=((0.0, 5.0),))
    return dfim_many.study([short.changed(**space.draw(rng)) for rng in rngs])


def processes(n=2):
    # Not forked: this process has threads.
    return ProcessPoolExecutor(n, mp_context=get_context("spawn"))


class Backwards(Executor):
    """Runs what it was given last first, so that nothing comes back in order."""

    def __init__(self):
        self.pool, self.held = ThreadPoolExecutor(1), []

    def submit(self, function, *arguments):
        from concurrent.futures import Future

        future, original = Future(), self
        self.held.append((future, function, arguments))

        class Lazy(Future):
            def result(self, timeout=None):
                while original.held:
                    one, work, given = original.held.pop()
                    one.set_result(work(*given))
                return future.result()

        return Lazy()


def test_draws_are_independent_streams_of_the_seed():
    """Draw k is numpy's SeedSequence of seed and number, and no two draws are alike."""
    table = evaluate(100, chance, COLUMNS, seed=7)
    expected = np.random.default_rng(np.random.SeedSequence(7, spawn_key=(42,))).normal()
    assert table["first"][42] == expected == generator(7, 42).normal()
    assert len(np.unique(table["first"])) == 100
    assert not np.array_equal(evaluate(100, chance, COLUMNS, seed=8), table)


@pytest.mark.parametrize("size", [1, 7, 64, 1000])
def test_shards_threads_processes_and_order_do_not_matter(size):
    whole = evaluate(100, chance, COLUMNS, seed=7, executor=ThreadPoolExecutor(1), shard_size=100).tobytes()
    assert evaluate(100, chance, COLUMNS, seed=7, shard_size=size).tobytes() == whole
    assert evaluate(100, chance, COLUMNS, seed=7, shard_size=size, executor=Backwards(), ahead=5).tobytes() == whole


def test_processes_give_the_bytes_of_threads():
    draws = list(range(1, 41))
    with processes() as pool:
        for options in ({}, {"shard_size": 9}):
            here, there = evaluate(draws, scaled, COLUMNS, seed=3, **options), evaluate(draws, scaled, COLUMNS, seed=3, executor=pool, **options)
            assert there.tobytes() == here.tobytes()
        batch = {"seed": 3, "batched": True, "shard_size": 70}
        here, there = evaluate(100, drives, dfim_many.COLUMNS, **batch), evaluate(100, drives, dfim_many.COLUMNS, executor=pool, **batch)
    assert there.tobytes() == here.tobytes() == evaluate(100, drives, dfim_many.COLUMNS, **{**batch, "shard_size": 33}).tobytes()
    assert np.all(here["IAE"] > 0) and len(np.unique(here["IAE"])) == 100


def test_expected_failures_are_flagged_and_others_end_the_run_with_their_draw():
    table = evaluate(range(1, 50), shy, COLUMNS, flagged=(ArithmeticError,), shard_size=8)
    third = np.arange(1, 50) % 3 == 0
    assert np.array_equal(table["failure"] == 1, third) and np.array_equal(np.isnan(table["first"]), third)
    with pytest.raises(EnsembleError, match=r"(?s)^draw 49: .*fifty is right out"):
        evaluate(range(1, 60), shy, COLUMNS, flagged=(ArithmeticError,), shard_size=8)
    with pytest.raises(EnsembleError, match=r"(?s)^draw 2: .*diverged"):
        evaluate(range(1, 50), shy, COLUMNS)
    with pytest.raises(EnsembleError, match=r"(?s)draw 0: .*returned shape \(2,\): must be \(3,\)"):
        evaluate(5, chance, (*COLUMNS, "third"), seed=0)


def count(folder, draw):
    """Leaves a trace of each evaluation."""
    with open(Path(folder) / "calls", "a", encoding="utf-8") as file:
        file.write(f"{draw}\n")
    if draw == 25 and not (Path(folder) / "open").exists():
        raise RuntimeError("cut short")
    return draw, draw**2


def test_a_run_that_was_cut_short_goes_on_and_damaged_shards_are_computed_again(tmp_path):
    function, folder, one = partial(count, tmp_path), tmp_path / "shards", ThreadPoolExecutor(1)

    def run(**options):
        (tmp_path / "calls").write_text("")
        options = {"shard_size": 10, "folder": folder, "executor": one, "ahead": 1} | options
        table = evaluate(range(40), function, COLUMNS, **options)
        return table.tobytes(), sorted(map(int, (tmp_path / "calls").read_text().split()))

    with pytest.raises(EnsembleError, match="draw 25: "):
        run()
    (tmp_path / "open").touch()
    whole, calls = run()
    assert calls == list(range(20, 40))
    assert run() == (whole, [])
    files = sorted(folder.iterdir())
    assert len(files) == 4 and all(file.suffix == ".shard" for file in files)
    for damage in (lambda b: b[:-7], lambda b: b"", lambda b: b[:90] + bytes([b[90] ^ 1]) + b[91:]):
        files[2].write_bytes(damage(files[2].read_bytes()))
        again, calls = run()
        assert again == whole and len(calls) == 10
    assert run(version="other data")[1] == list(range(40))


def test_the_key_of_a_shard_covers_what_determines_it(monkeypatch):
    base = shards.Shard(0, 10, None, 1, chance, COLUMNS, False, (), "")
    others = [
        base._replace(start=1), base._replace(stop=11), base._replace(seed=2), base._replace(function=scaled), base._replace(columns=("a", "b")),
        base._replace(batched=True), base._replace(flagged=(ValueError,)), base._replace(version="x"), base._replace(draws=[*range(10)]),
        base._replace(draws=[*range(9), 11]), base._replace(function=partial(scaled, 1)), base._replace(function=partial(scaled, 2)),
    ]  # fmt: skip
    keys = [shards.digest(shard) for shard in (base, *others)]
    assert len(set(keys)) == len(keys) and shards.digest(base._replace()) == keys[0]
    monkeypatch.setattr("drivelib.sources_digest", lambda: "changed")
    assert shards.digest(base) != keys[0]
    with pytest.raises(ValueError, match="must be picklable"):
        shards.digest(base._replace(function=lambda rng: (0, 0)))


@pytest.mark.skipif(os.name == "nt", reason="kills a process by signal")
def test_a_worker_that_dies_is_replaced_or_reported(tmp_path):
    healed = evaluate(range(40), partial(dies_once, tmp_path), COLUMNS, executor=processes, shard_size=5, folder=tmp_path / "kept")
    assert np.array_equal(healed["second"], 2.0 * np.arange(40)) and (tmp_path / "died").exists()
    with pytest.raises(EnsembleError, match=r"draws 10 to 14 were lost 2 times with their worker .* the same call goes on"):
        evaluate(range(40), dies_always, COLUMNS, executor=partial(processes, 1), shard_size=5, retries=1)
    with pytest.raises(EnsembleError, match="give a function that makes one"):
        evaluate(range(40), dies_always, COLUMNS, executor=processes(1), shard_size=5, ahead=1)


def test_memory_holds_a_few_shards_only():
    """A function that returns little but computes much, over 200 shards: no more than ``ahead`` are under way."""
    open_, most = set(), []

    class Watching(ThreadPoolExecutor):
        def submit(self, function, shard):
            open_.add(shard.start)
            most.append(len(open_))
            return super().submit(function, shard)

    for k, table in enumerate(stream(2000, chance, COLUMNS, seed=0, shard_size=10, executor=Watching(2), ahead=6)):
        open_.remove(10 * k)
        assert len(table) == 10
    assert k == 199 and max(most) == 6


def test_a_space_draws_inside_and_says_when_it_cannot():
    space = Space({"a": Span(1.0, 2.0), "b": Span(1e-3, 1e3, log=True), "c": ("x", "y")}, allowed=lambda v: v["a"] > 1.5)
    draws = [space.draw(generator(0, k)) for k in range(400)]
    assert all(1.5 < v["a"] <= 2.0 and 1e-3 <= v["b"] <= 1e3 for v in draws) and {v["c"] for v in draws} == {"x", "y"}
    assert 0.4 < np.mean([v["b"] < 1 for v in draws]) < 0.6
    with pytest.raises(ValueError, match="none of 10000 draws of a is allowed: the assumptions contradict"):
        Space({"a": Span(0.0, 1.0)}, allowed=lambda v: v["a"] > 2).draw(generator(0, 0))
    for bad, message in (({}, "nothing to draw"), ({"c": ()}, "assumption c"), ({"c": "xy"}, "assumption c")):
        with pytest.raises(ValueError, match=message):
            Space(bad)
    with pytest.raises(ValueError, match="high = 1.0: must be .* at least 2"):
        Span(2.0, 1.0)
    spans = open_values(DEFAULT_SCENARIO)
    assert (spans["omega_n"].low, spans["omega_n"].high) == (5.0, 60.0) and "duration" not in spans
    with pytest.raises(ValueError, match="duration: its origin states no range"):
        open_values(DEFAULT_SCENARIO, ["duration"])


@pytest.mark.parametrize(
    "draws, options, message",
    [
        ([], {}, "draws is empty"),
        (0, {"seed": 1}, "draws = 0"),
        (5, {}, "without a seed"),
        (5, {"seed": 1, "columns": ()}, "columns"),
        (5, {"seed": 1, "columns": ("a", "a")}, "distinct"),
        (5, {"seed": -1}, "seed = -1"),
        (5, {"seed": 1, "shard_size": 0}, "shard_size = 0"),
        (5, {"seed": 1, "executor": int}, "executor made 0"),
        (5, {"seed": 1, "batched": True, "flagged": (ValueError,)}, "flagged has no meaning"),
    ],
)
def test_bad_calls_are_refused(draws, options, message):
    options = {"columns": COLUMNS} | options
    with pytest.raises(ValueError, match=message):
        evaluate(draws, chance, **options)


DASK = """
import sys
from distributed import Client, LocalCluster
sys.path.insert(0, sys.argv[1])
import test_ensemble as t
from drivelib import dfim_many
from drivelib.ensemble import evaluate
if __name__ == "__main__":
    options = {"seed": 3, "batched": True, "shard_size": 40}
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        there = evaluate(200, t.drives, dfim_many.COLUMNS, executor=client.get_executor(pure=False), **options)
        healed = evaluate(range(40), t.partial(t.dies_once, sys.argv[2]), t.COLUMNS, executor=client.get_executor(pure=False), shard_size=5)
    assert healed["second"].tolist() == [2.0 * k for k in range(40)]
    assert there.tobytes() == evaluate(200, t.drives, dfim_many.COLUMNS, **options).tobytes()
    print("equal")
"""


def test_a_dask_cluster_gives_the_same_bytes_and_survives_a_killed_worker(tmp_path):
    script = tmp_path / "on_dask.py"
    script.write_text(DASK)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parent), *sys.path])}
    done = subprocess.run(
        [sys.executable, script, str(Path(__file__).parent), tmp_path], env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0 and "equal" in done.stdout, done.stdout + done.stderr
