"""The process that workers and kernels are forked from: what it imports, and how the runner starts it.

A kernel spends most of its start on imports. Done once in this process they come free to every fork. Forking is safe
while a process has one thread: only the thread that forks lives on in the child, and a lock that another holds stays
locked for ever. Importing starts none under the pins (one thread for BLAS, OpenMP and torch; no socket of ZeroMQ before
a kernel needs one). That is not taken on trust: `SINGLE` says whether it held, and without it kernels are not forked.
"""

import gc
import importlib
import multiprocessing
import os
import sys
import tempfile
import time

ROOM = 70  # bytes that a folder's path may have, for that of a socket below it has 107 at most (macOS: 103)
MODULES = "DRIVELIB_PRELOAD"  # the variable that names what to import, separated by commas
KERNEL = ("ipykernel.ipkernel", "ipykernel.kernelapp", "matplotlib_inline.backend_inline")


def context(variables, modules):
    """Return the multiprocessing context of workers; theirs is a process started with ``variables`` that has ``modules``.

    A process that an earlier call in this one started is kept as it is.
    """
    if os.name == "nt":
        return multiprocessing.get_context("spawn")
    from multiprocessing import forkserver

    forkserver.set_forkserver_preload([__name__])
    before, folder = dict(os.environ), tempfile.tempdir
    os.environ.clear()
    os.environ.update(variables | {MODULES: ",".join(modules)})
    tempfile.tempdir = folder_for_sockets()
    try:
        forkserver.ensure_running()
    finally:
        tempfile.tempdir = folder
        os.environ.clear()
        os.environ.update(before)
    return multiprocessing.get_context("forkserver")


def folder_for_sockets():
    """Return where temporary folders go that hold sockets: the usual place, or /tmp where its path is too long for them."""
    usual = tempfile.gettempdir()
    return usual if os.name == "nt" or len(os.fsencode(usual)) <= ROOM else "/tmp"


def single_threaded(patience):
    """Return whether this process has one thread, in the eyes of the system and not of Python alone (Linux only).

    A thread that ends within ``patience`` (s) is waited for, such as the timer that matplotlib sets while it looks for fonts.
    """
    deadline = time.monotonic() + patience
    while len(os.listdir("/proc/self/task")) > 1:
        if time.monotonic() > deadline:
            return False
        time.sleep(0.005)
    return True


def _preload(names):
    for name in names:
        try:
            importlib.import_module(name)
        except Exception:  # noqa: BLE001, S112 - the notebook that asks for it will say what is wrong
            continue
    gc.freeze()  # else every fork's first full collection touches, and so copies, all that was imported: 0.5 s a notebook


if MODULES in os.environ and sys.path[0] == "":
    del sys.path[0]  # nothing is imported from where the runner was called
SEARCH_PATH = tuple(sys.path)  # as a Python of its own has it; multiprocessing changes it in the workers
if MODULES in os.environ:
    _preload(filter(None, os.environ[MODULES].split(",")))
SINGLE = MODULES in os.environ and sys.platform == "linux" and single_threaded(patience=2.0)
