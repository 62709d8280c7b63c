"""The same notebooks on this processor and on emulated ones, bytes compared (user-mode QEMU, on Linux only).

The pack does not need QEMU: on Debian ``apt-get install qemu-user`` brings it.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from drivelib import environment, paths, record
from drivelib.pack import check, freshness, runner

EMULATOR = "qemu-x86_64"
NATIVE = "this processor"
CPUS = ("Haswell", "Skylake-Client", "EPYC")  # Intel and AMD with AVX2, none with AVX-512
# What leans hardest on libraries: closed forms, network training, a speed identified from a printed loss, a drive loop with a
# network in it, and the DFIM's loops with all three controllers, identified from table II. Fewer starts and training points
# than published, so that an emulated run takes about a minute; table II's, whose loops the emulator has to compile, ten.
HARDEST = {
    "eskander/fig02": {},
    "eskander/fig05": {"starts": 16, "points": 8},
    "eskander/fig08": {"starts": 4},
    "eskander/fig09": {"starts": 4},
    "zidani/tab02": {"starts": 4},
}


def compare(console, *, cpus, names=(), given=None, without=(), jobs=1):
    """Run notebooks here and on each emulated processor; print what differs; return the number of differences.

    ``without`` names pins to leave out everywhere. The reference of the comparison is this processor with all pins.

    Raises
    ------
    ValueError
        If the emulator is missing, or a name is no pin.
    """
    if cpus and shutil.which(EMULATOR) is None:
        raise ValueError(f"{EMULATOR} is not installed (Debian: apt-get install qemu-user)")
    for pin in without:
        if pin not in environment.PINS:
            raise ValueError(f"--without {pin}: no pin; the pins are {', '.join(environment.PINS)}")
    wanted = {name: given or {} for name in names} or HARDEST
    items = {next(iter(runner.select([name]))): parameters for name, parameters in wanted.items()}
    base = Path(tempfile.mkdtemp(prefix="drivelib-cpu-"))
    cases = [(NATIVE, ())] + ([(NATIVE, without)] if without else []) + [(cpu, without) for cpu in cpus]
    work = [(item, case) for item in items for case in cases]
    differing = 0
    try:
        with ThreadPoolExecutor(jobs) as pool:
            done = pool.map(lambda one: run(base / str(work.index(one)), one[0], items[one[0]], *one[1]), work)
            for number, ((item, (cpu, left_out)), (seconds, failure)) in enumerate(zip(work, done, strict=True)):
                first = work.index((item, cases[0]))
                said = [failure] if failure else differences(base / str(first), base / str(number), item)
                differing += bool(said)
                where = cpu + (f" without {', '.join(left_out)}" if left_out else "")
                if not said and number != first:
                    said = [f"the same bytes; in memory {in_memory(base / str(first), base / str(number))}"]
                console.print(f"{item} on {where}, {seconds:.0f} s: {'; '.join(said) or 'the reference'}", highlight=False, markup=False, soft_wrap=True)
    finally:
        shutil.rmtree(base, ignore_errors=True)
    return differing


def run(folder, item, given, cpu, without=()):
    """Run one notebook's cells in a process of its own on one processor; return (seconds, failure or None).

    Compiled code is cached per run: a kernel compiled on this processor must not serve the emulated one.
    """
    folder.mkdir(parents=True)
    extra = {"DRIVELIB_ROOT": paths.root(), "PYTHONPATH": freshness.PACKAGE.parent, "NUMBA_CACHE_DIR": folder / "numba", record.PUBLISH: folder / "out"}
    environment_ = environment.kernel(folder, **extra, **{paths.READ: paths.root() / "figures"})
    for pin in without:
        del environment_[pin]
    emulated = [] if cpu == NATIVE else [shutil.which(EMULATOR), "-cpu", cpu]
    command = [*emulated, sys.executable, "-m", "drivelib.pack.cells", item, json.dumps(given)]
    began = time.monotonic()
    done = subprocess.run(command, env=environment_, cwd=folder, capture_output=True, text=True, check=False)
    lines = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
    return time.monotonic() - began, None if done.returncode == 0 else f"failed: {lines[-1]}"


def differences(reference, other, item):
    """Return what differs between the files that two runs of an item wrote."""
    stem, found = item.rsplit("/", 1)[-1], []
    for suffix in freshness.ARTEFACTS:
        old, new = (folder / "out" / f"{stem}.{suffix}" for folder in (reference, other))
        if not old.exists() or not new.exists():
            found.append(f"{stem}.{suffix} is missing")
        elif old.read_bytes() != new.read_bytes():
            found.append(f"{stem}.{suffix}: {check.first_difference(old, new, 0.0)}")
    return found


def in_memory(reference, other):
    """Return how many of the notebook's variables agree to the last bit, in words."""
    old, new = (json.loads((folder / "out" / "raw.json").read_text(encoding="utf-8")) for folder in (reference, other))
    apart = sorted(name for name in old.keys() | new.keys() if old.get(name) != new.get(name))
    return f"{len(old) - len(apart)} of {len(old)} variables agree to the last bit" + (f", not {', '.join(apart)}" if apart else "")


def jobs_default():
    """Return how many runs to start at once."""
    return os.cpu_count() or 1
