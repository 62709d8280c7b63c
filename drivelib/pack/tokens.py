"""A token in the environment of everything that one run starts, by which it is found and ended."""

import ctypes
import os
import sys

import psutil

TOKEN = "DRIVELIB_RUN"  # the variable's name
NO_RUN = "0" * 32  # its value in the process that is forked from


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


def sweep(token):
    """Kill every process that carries a run's token: the kernel and whatever its cells started."""
    while True:
        found = []
        for process in psutil.process_iter():
            try:
                if process.pid != os.getpid() and process.environ().get(TOKEN) == token and process.status() != psutil.STATUS_ZOMBIE:
                    process.kill()
                    found.append(process)
            except (psutil.Error, OSError):
                continue
        if not found:
            return
        psutil.wait_procs(found, timeout=2)
