"""Execute one notebook with papermill, in a process of its own.

Papermill's word is not trusted: it calls a notebook "completed" after a dead kernel or ``sys.exit(0)``. A run
counts only when no exception was raised and finish() wrote its JSON, which the runner looks for.
"""

import os
import shutil
import threading
from multiprocessing import connection, parent_process
from pathlib import Path

import psutil

from drivelib.pack import tokens

MESSAGE = 2000  # characters of a failure that are reported


def execute(job, sender):
    """Run ``job`` (see `attempt.Job`) and send None or what went wrong through ``sender``; never return to the caller."""
    from papermill.exceptions import PapermillExecutionError

    from drivelib.pack import engine, kernels

    os.setsid() if hasattr(os, "setsid") else None
    tokens.adopt()
    log = os.open(Path(job.private) / "log", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(log, 1)
    os.dup2(log, 2)
    forked = kernels.fork(job, sender) if job.fork and kernels.can_fork(job.environment) else None
    os.environ.clear()
    os.environ.update(job.environment)
    threading.Thread(target=_follow_parent, args=(job,), daemon=True).start()
    try:
        engine.execute(job, forked)
        failure = None
    except PapermillExecutionError as error:
        injected = bool(job.parameters)  # by papermill, as a cell that no committed notebook has
        failure = f"cell {error.exec_count - injected} raised {error.ename}: {error.evalue}"
    except BaseException as error:  # noqa: BLE001 - whatever it is, the runner must hear of it
        failure = f"{type(error).__name__}: {str(error).strip() or 'no message'}"
    tokens.sweep(job.token, psutil.Process())
    # More than a pipe holds (64 KiB) would be waited for by a runner that waits for this process to end.
    sender.send(failure and failure[:MESSAGE])
    sender.close()
    os._exit(0 if failure is None else 1)


def _follow_parent(job):
    connection.wait([parent_process().sentinel])
    tokens.sweep(job.token, psutil.Process())
    shutil.rmtree(job.private, ignore_errors=True)
    os._exit(1)
