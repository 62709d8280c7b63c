"""Execute one notebook with papermill, in a process of its own.

Papermill's word is not trusted: it calls a notebook "completed" after a dead kernel or ``sys.exit(0)``. A run
counts only when no exception was raised and finish() wrote its JSON, which the runner looks for.
"""

import os
import sys
import threading
from multiprocessing import connection, parent_process
from pathlib import Path

sys.modules.setdefault("rfc3987_syntax", None)  # half of papermill's import time, for a check that nobody asks for

import psutil  # noqa: E402
from jupyter_client.kernelspec import KernelSpec, KernelSpecManager  # noqa: E402
from jupyter_client.manager import AsyncKernelManager  # noqa: E402
from papermill.clientwrap import PapermillNotebookClient  # noqa: E402
from papermill.engines import NBClientEngine, papermill_engines  # noqa: E402
from papermill.exceptions import PapermillExecutionError  # noqa: E402
from papermill.execute import execute_notebook  # noqa: E402

TOKEN = "DRIVELIB_RUN"  # in the environment of everything that a run starts
START_TRIES = 3


class OutputTooLarge(RuntimeError):
    """A notebook wrote more than its limit."""


class StartFailure(RuntimeError):
    """The kernel did not start; nothing of the notebook has run."""


class _OwnKernel(KernelSpecManager):
    """This interpreter's ipykernel, whatever kernelspec named python3 the user has installed."""

    def get_kernel_spec(self, kernel_name):
        argv = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}", "--HistoryManager.enabled=False"]
        return KernelSpec(argv=argv, display_name="Python 3 (ipykernel)", language="python")


class _Client(PapermillNotebookClient):
    output_limit = 0
    token = ""
    _seen = 0

    def execute(self, **options):
        try:
            return super().execute(**options)
        except Exception:
            if self._seen > self.output_limit:
                raise OutputTooLarge(f"more than {self.output_limit:,} bytes of output") from None
            raise

    def process_message(self, msg, *arguments, **options):
        if msg["msg_type"] in ("stream", "display_data", "execute_result", "update_display_data", "error"):
            self._seen += len(str(msg["content"]))
            if self._seen > self.output_limit:
                sweep(self.token)  # an exception here would only be seen when the cell ends, which it may never do
        return super().process_message(msg, *arguments, **options)

    def start_new_kernel_client(self, **options):
        try:
            return super().start_new_kernel_client(**options)
        except RuntimeError as error:
            raise StartFailure(str(error)) from error


class _Engine(NBClientEngine):
    @classmethod
    def execute_managed_notebook(cls, nb_man, kernel_name, *, private, seconds, output_limit, token, **_):
        transport = {"transport": "ipc", "ip": str(private / "k")} if os.name != "nt" else {}
        manager = AsyncKernelManager(
            kernel_name=kernel_name,
            kernel_spec_manager=_OwnKernel(),
            connection_file=str(private / "kernel.json"),  # without a file of its own, kernels on ipc talk across
            **transport,
        )
        client = _Client(nb_man, km=manager, timeout=seconds, startup_timeout=60)
        client.output_limit, client.token = output_limit, token
        return client.execute()


papermill_engines.register("drivelib", _Engine)


def execute(job, sender):
    """Run ``job`` (see `runner.Job`) and send None or what went wrong through ``sender``; never return to the caller."""
    os.setsid() if hasattr(os, "setsid") else None
    log = os.open(Path(job.private) / "log", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(log, 1)
    os.dup2(log, 2)
    os.environ.clear()
    os.environ.update(job.environment)
    threading.Thread(target=_follow_parent, args=(job.token,), daemon=True).start()
    try:
        _papermill(job)
        failure = None
    except PapermillExecutionError as error:
        failure = f"cell {error.exec_count} raised {error.ename}: {error.evalue}"
    except BaseException as error:  # noqa: BLE001 - whatever it is, the runner must hear of it
        failure = f"{type(error).__name__}: {str(error).strip() or 'no message'}"
    sweep(job.token)
    sender.send(failure)
    sender.close()
    os._exit(0 if failure is None else 1)


def _papermill(job):
    private = Path(job.private)

    def literal(path):
        return str(path).replace("{", "{{").replace("}", "}}")  # papermill formats its paths

    for attempt in range(START_TRIES):
        fresh = private / str(attempt)
        fresh.mkdir()
        try:
            return execute_notebook(
                literal(private / "source.ipynb"),
                literal(private / "executed.ipynb"),
                parameters=job.parameters,
                engine_name="drivelib",
                kernel_name="python3",
                progress_bar=False,
                cwd=str(private),
                private=fresh,
                seconds=job.seconds,
                output_limit=job.output_limit,
                token=job.token,
            )
        except StartFailure:
            sweep(job.token)
            if attempt == START_TRIES - 1:
                raise


def sweep(token):
    """Kill every process that carries this run's token: the kernel and whatever its cells started."""
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


def _follow_parent(token):
    connection.wait([parent_process().sentinel])
    sweep(token)
    os._exit(1)
