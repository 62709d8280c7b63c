"""A token in the environment of everything that one run starts, by which it is found and ended.

A program that was started with an environment of its own does not carry it. It is found as a descendant of the worker.
"""

import ctypes
import os
import sys

import psutil

TOKEN = "DRIVELIB_RUN"  # the variable's name
NO_RUN = "0" * 32  # its value in the process that is forked from
PR_SET_CHILD_SUBREAPER = 36  # from linux/prctl.h


def _address():
    """Return where this process was given `NO_RUN` when it was started, or None where nobody can tell."""
    if sys.platform != "linux" or os.environ.get(TOKEN) != NO_RUN:
        return None
    libc = ctypes.CDLL(None)
    libc.getenv.restype = ctypes.c_void_p
    return libc.getenv(TOKEN.encode())


_place = _address()


def can_wear():
    """Return whether `wear` is possible here."""
    return _place is not None


def wear(token):
    """Mark this forked process and its children with a token.

    The system shows others the environment that a program was started with, and a fork has its parent's. Setting a
    variable does not change that; writing over it where it lies does.

    Raises
    ------
    ValueError
        If this process was not started with the placeholder, or the token has another length.
    """
    if _place is None or len(token) != len(NO_RUN):
        raise ValueError(f"token {token!r}: must be {len(NO_RUN)} characters, in a process started with {TOKEN}={NO_RUN}")
    ctypes.memmove(_place, token.encode("ascii"), len(NO_RUN))


def adopt():
    """Become the parent of every descendant whose own parent ends (Linux only), so that `sweep` finds those too."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def sweep(token, worker=None):
    """Kill the kernel and whatever its cells started: all that carries a run's token or descends from its ``worker``, while that lives."""
    while True:
        found = []
        for process in {*_bearers(token), *_descendants(worker)}:
            try:
                if process.pid != os.getpid() and process.status() != psutil.STATUS_ZOMBIE:
                    process.kill()
                    found.append(process)
            except (psutil.Error, OSError):
                continue
        if not found:
            return
        psutil.wait_procs(found, timeout=2)


def _bearers(token):
    for process in psutil.process_iter():
        try:
            if process.environ().get(TOKEN) == token:
                yield process
        except (psutil.Error, OSError):
            continue


def _descendants(worker):
    try:
        return worker.children(recursive=True) if worker else []
    except psutil.Error:
        return []
