"""Papermill with a kernel of ours: private sockets, a limit on output, start failures told from failures of cells."""

import os
import sys
import time
from pathlib import Path
from queue import Empty

sys.modules.setdefault("rfc3987_syntax", None)  # half of papermill's import time, for a check that nobody asks for

import nbformat  # noqa: E402
import psutil  # noqa: E402
from jupyter_client.asynchronous import AsyncKernelClient  # noqa: E402
from jupyter_client.manager import AsyncKernelManager  # noqa: E402
from papermill.clientwrap import PapermillNotebookClient  # noqa: E402
from papermill.engines import NBClientEngine, papermill_engines  # noqa: E402
from papermill.execute import execute_notebook  # noqa: E402

from drivelib.pack import kernels, tokens  # noqa: E402

START_TRIES = 3


class OutputTooLarge(RuntimeError):
    """A notebook wrote more than its limit."""


class StartFailure(RuntimeError):
    """The kernel did not start; nothing of the notebook has run."""


class _Channels(AsyncKernelClient):
    """Jupyter's own client waits 0.2 s for stray messages before it calls a kernel ready; this one knows which come."""

    async def wait_for_ready(self, timeout):
        """Wait until a request is answered on both channels: the reply, and that the kernel is idle again."""
        deadline = time.monotonic() + timeout
        while True:
            request = self.kernel_info()
            try:
                await self.get_shell_msg(timeout=1)
                message = {"content": {}}
                while message["content"].get("execution_state") != "idle" or message["parent_header"].get("msg_id") != request:
                    message = await self.get_iopub_msg(timeout=0.2)
                return
            except Empty:  # it is not there yet, or was before we listened
                if not await self.is_alive():
                    raise RuntimeError("Kernel died before it was ready") from None
                if time.monotonic() > deadline:
                    raise RuntimeError(f"Kernel was not ready within {timeout:g} s") from None


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
                tokens.sweep(self.token, psutil.Process())  # an exception here would only be seen when the cell ends, which it may never do
        return super().process_message(msg, *arguments, **options)

    def start_new_kernel_client(self, **options):
        try:
            return super().start_new_kernel_client(**options)
        except RuntimeError as error:
            raise StartFailure(str(error)) from error


class _Engine(NBClientEngine):
    @classmethod
    def execute_managed_notebook(cls, nb_man, kernel_name, *, job, folder, forked, **_):
        transport = {"transport": "ipc", "ip": str(folder / "k")} if os.name != "nt" else {}
        manager = AsyncKernelManager(
            kernel_name=kernel_name,
            kernel_spec_manager=kernels.OwnKernel(),
            connection_file=str(folder / "kernel.json"),  # without a file of its own, kernels on ipc talk across
            client_factory=_Channels,
            **transport,
        )
        if forked is not None:
            manager.provisioner = kernels.ForkedProvisioner(kernel_spec=manager.kernel_spec, parent=manager)
            manager.provisioner.forked = forked
        client = _Client(nb_man, km=manager, timeout=job.seconds, startup_timeout=60)
        client.output_limit, client.token = job.output_limit, job.token
        return client.execute()


papermill_engines.register("drivelib", _Engine)
nbformat.validate(nbformat.v4.new_notebook())  # compiles its schema once for all forks


def execute(job, forked=None):
    """Run ``job`` (`attempt.Job`), in the ``forked`` kernel (`kernels.Forked`) where there is one; a start may be tried again."""
    private = Path(job.private)

    def literal(path):
        return str(path).replace("{", "{{").replace("}", "}}")  # papermill formats its paths

    for attempt in range(START_TRIES):
        folder = private / str(attempt)
        folder.mkdir()
        try:
            return execute_notebook(
                literal(private / "source.ipynb"),
                literal(private / "executed.ipynb"),
                parameters=job.parameters,
                engine_name="drivelib",
                kernel_name="python3",
                progress_bar=False,
                request_save_on_cell_execute=False,  # it would write the whole notebook twice per cell
                cwd=str(private),
                job=job,
                folder=folder,
                forked=forked if attempt == 0 else None,
            )
        except StartFailure:
            tokens.sweep(job.token, psutil.Process())
            if attempt == START_TRIES - 1:
                raise
