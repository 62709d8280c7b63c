"""The benchmark: ``python -m drivelib bench``. One table, every figure a ratio or a time measured in this run."""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import drives
import parts
import whole_pack
from measure import Row
from rich.console import Console
from rich.table import Table

from drivelib import environment, fuzzy

HEADINGS = ("what", "ours", "against", "median (least to most)", "target", "")
# Peer as peers.py calls it, what of ours is its equal (the row's name), smallest factor.
PEERS = (
    ("motulator", "DFIM loop, averaged, per step", 1000),
    ("motulator-pwm", "with switching PWM", 1000),
    ("gym-electric-motor", "DFIM loop, averaged, per step", 500),
    ("acmsimpy", "DFIM loop, averaged, per step", None),
    ("simpful", "fuzzy controller, 49 rules, per input", None),
    ("pyfuzzylite", "fuzzy controller, 49 rules, per input", None),
    ("torch-levenberg-marquardt", "Levenberg–Marquardt, 256 starts, per start and epoch", None),
    ("pyrenn", "Levenberg–Marquardt, 256 starts, per start and epoch", None),
)


def peer_rows(pythons, repetitions, measured):
    """Return the rows of the peers, timed by Pythons of their own."""
    found = {}
    for python in pythons:
        command = [python, str(Path(__file__).with_name("peers.py")), json.dumps(fuzzy.RULES.tolist()), str(repetitions)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=1800, env=environment.pinned())
        if done.returncode:
            raise ValueError(f"--peers {python}: {done.stderr.strip().splitlines()[-1]}")
        for peer, times in json.loads(done.stdout.splitlines()[-1]).items():
            if isinstance(found.get(peer, ""), str):
                found[peer] = times
    ours = {row.what: row for row in reversed(measured)}
    rows = []
    for peer, what, least in PEERS:
        times, row = found.get(peer, "peer not installed"), ours[what]
        pairs = [] if isinstance(times, str) else [(a, b) for (a, _), b in zip(row.pairs, times, strict=True)]
        note = times if isinstance(times, str) else ""
        rows.append(Row(what, peer.replace("-pwm", ", carrier PWM"), pairs, "faster", least, "µs", 1e6, note))
    return rows


def main(arguments=None):
    """Measure, print the table, return the exit status: 0, or 2 for arguments that make no sense."""
    parser = argparse.ArgumentParser(prog="python -m drivelib bench", description=__doc__)
    parser.add_argument("--repetitions", type=int, default=5, help="of every measurement (default: 5, the least)")
    parser.add_argument(
        "--peers", metavar="PYTHON", nargs="+", default=[], help="Pythons of environments with tests/benchmarks/peers.txt"
    )
    parser.add_argument("--markdown", action="store_true", help="a table for a README")
    options = parser.parse_args(arguments)
    if options.repetitions < 5:
        parser.error(f"--repetitions {options.repetitions}: must be at least 5, or the spread says nothing")
    rows = drives.rows(options.repetitions) + parts.rows(options.repetitions)
    rows += peer_rows(options.peers, options.repetitions, rows)
    rows += whole_pack.rows(options.repetitions)
    lines = [row.cells() for row in rows]
    if options.markdown:
        print(f"| {' | '.join(HEADINGS)} |\n|{'---|' * len(HEADINGS)}")
        print("\n".join(f"| {' | '.join(line)} |" for line in lines))
        return 0
    table = Table(*HEADINGS, box=None, pad_edge=False)
    for line in lines:
        table.add_row(*line)
    Console().print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
