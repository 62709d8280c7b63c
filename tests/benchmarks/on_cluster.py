"""An ensemble on a Dask cluster of separate processes: start, kill a worker, resume, compare with the local run.

    python tests/benchmarks/on_cluster.py --drives 1000000 --workers 2

Scheduler and workers are started with Dask's own commands, as they would be on machines
of their own; on those, give the workers the pins of ``drivelib.environment`` too, or the last bits differ.
"""

import argparse
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from drivelib import dfim_many, environment
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.ensemble import evaluate, stream
from drivelib.space import Space, Span

SHORT = DEFAULT_SCENARIO.changed(duration=0.2, speed_reference=((0.0, 60.0),), load_torque=((0.0, 5.0),))
SPACE = Space({"omega_n": Span(10.0, 40.0), "T_limit": Span(30.0, 60.0), "phi_r_ref": Span(0.7, 0.95)})


def drives(rngs):
    """Rows of drives of 0.2 s whose assumptions are drawn."""
    return dfim_many.study([SHORT.changed(**SPACE.draw(rng)) for rng in rngs])


def main():
    """Run it, print what was found, return 0 if the bytes are those of the local run."""
    from distributed import Client

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=10_000)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    size = 1000
    study = {"seed": 1, "batched": True, "shard_size": size, "ahead": 4 * options.workers}
    with tempfile.TemporaryDirectory() as folder:
        address = Path(folder) / "scheduler.json"
        common = {"env": environment.pinned(PYTHONPATH=os.pathsep.join([str(Path(__file__).parent), *sys.path])), "stderr": subprocess.DEVNULL}
        scheduler = ("distributed.cli.dask_scheduler", "--port", "0", "--no-dashboard")
        worker = ("distributed.cli.dask_worker", "--nthreads", "1", "--no-dashboard", "--no-nanny")
        started = [
            subprocess.Popen([sys.executable, "-m", *command, "--scheduler-file", str(address)], **common)
            for command in (scheduler, *[worker] * (options.workers + 1))
        ]
        try:
            with Client(scheduler_file=str(address), timeout=60) as client:
                client.wait_for_workers(options.workers + 1, timeout=60)
                began = time.perf_counter()
                for number, _ in enumerate(stream(options.drives, drives, dfim_many.COLUMNS, executor=client.get_executor(pure=False), folder=folder, **study)):
                    if number == 1:
                        started[-1].send_signal(signal.SIGKILL)
                    if 2 * number * size >= options.drives:
                        break  # as if this process had been stopped half way
                half = time.perf_counter() - began
                there = evaluate(options.drives, drives, dfim_many.COLUMNS, executor=client.get_executor(pure=False), folder=folder, **study)
                whole = time.perf_counter() - began
        finally:
            for process in reversed(started):
                process.kill()
                process.wait()
    began = time.perf_counter()
    here = evaluate(options.drives, drives, dfim_many.COLUMNS, **study)
    local = time.perf_counter() - began
    equal = there.tobytes() == here.tobytes()
    print(f"{options.drives} drives of 0.2 s, {options.workers} workers: {half:.1f} s to half way with one more worker killed, {whole:.1f} s in all")
    print(f"{options.workers * whole / options.drives * 1e6:.0f} µs per drive and worker; on threads here {local:.1f} s; {'equal' if equal else 'DIFFERENT'} bytes")
    return 0 if equal else 1


if __name__ == "__main__":
    from on_cluster import main  # the workers import this file by its name

    sys.exit(main())
