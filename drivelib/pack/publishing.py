"""Move results into the tree: all files of an item or none."""

import os
import shutil
import signal
import tempfile
from contextlib import contextmanager
from pathlib import Path

from drivelib import paths
from drivelib.pack import freshness

SIGNALS = [signal.SIGINT, signal.SIGTERM] + ([signal.SIGHUP] if hasattr(signal, "SIGHUP") else [])  # what stops a run


def publish(outcome, item, run_parts, provenance):
    """Move an item's results into the tree, the JSON last, then write its run record.

    What can fail, a full disk or a read-only folder, fails while copies are laid beside their targets. Only then are
    they renamed, which takes no space and no time, and signals wait until it is done.

    Raises
    ------
    OSError
        If a file cannot be written; the published ones are then as they were.
    """
    targets = [path for path in freshness.artefacts(item.id) if path.suffix in outcome.files]
    copies = {}
    try:
        for path in targets:
            path.parent.mkdir(parents=True, exist_ok=True)
            copies[path] = _beside(path, outcome.files[path.suffix])
        with _uninterrupted():
            for path in targets:
                os.replace(copies[path], path)
    finally:
        for copy in copies.values():
            copy.unlink(missing_ok=True)
    freshness.write_record(item, run_parts, seconds=outcome.seconds, cell_seconds=outcome.cell_seconds, provenance=provenance)


def _beside(path, source):
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    os.close(handle)
    try:
        shutil.copyfile(source, name)
        with open(name, "rb+") as stream:
            os.fsync(stream.fileno())
        os.chmod(name, 0o644)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return Path(name)


@contextmanager
def _uninterrupted():
    """Hold back what stops a run; where signals cannot be held back (Windows) do nothing."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def clear_leftovers():
    """Remove what a killed run left behind: its stage, and copies that were never renamed. Call it under the lock."""
    for stage in paths.build().glob("stage-*"):
        shutil.rmtree(stage, ignore_errors=True)
    for folder in ("figures", "notebooks"):
        for path in (paths.root() / folder).rglob(".*.*.????????"):
            if path.is_file() and path.name.rsplit(".", 2)[1] in (*freshness.ARTEFACTS, "ipynb"):
                path.unlink()
