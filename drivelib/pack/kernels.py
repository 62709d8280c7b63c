"""How a notebook's kernel comes to life: started as a new Python, or forked from a process that has imported everything.

A forked kernel is a process like the other, with a session, an environment, a search path and random numbers of its
own. It shares nothing with other kernels but what was imported before the fork.
"""

import asyncio
import os
import signal
import sys
import traceback
from pathlib import Path

import psutil
from jupyter_client.kernelspec import KernelSpec, KernelSpecManager
from jupyter_client.provisioning import LocalProvisioner

from drivelib import environment
from drivelib.pack import preloaded, tokens

OPTIONS = ["--HistoryManager.enabled=False"]


class OwnKernel(KernelSpecManager):
    """This interpreter's ipykernel, whatever kernelspec named python3 the user has installed."""

    def get_kernel_spec(self, kernel_name):
        argv = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}", *OPTIONS]
        return KernelSpec(argv=argv, display_name="Python 3 (ipykernel)", language="python")


class Forked(psutil.Process):
    """A forked kernel with the manners of ``subprocess.Popen``; it waits until `begin` names its connection file."""

    stdin = stdout = stderr = None

    def __init__(self, pid, pipe):
        super().__init__(pid)
        self.pipe = pipe

    def begin(self, connection_file):
        with os.fdopen(self.pipe, "w") as stream:
            stream.write(connection_file)

    def poll(self):
        try:
            code = self.wait(timeout=0)
        except psutil.TimeoutExpired:
            return None
        return -signal.SIGKILL if code is None else code  # None: gone, and `tokens.sweep` was told how


class ForkedProvisioner(LocalProvisioner):
    """Hands jupyter_client a kernel that was forked before, where it would start one."""

    forked = None

    async def launch_kernel(self, cmd, **options):
        self.process, self.pid, self.pgid = self.forked, self.forked.pid, self.forked.pid
        self.forked.begin(self.parent.connection_file)
        return self.connection_info

    async def post_launch(self, **options):
        """Wait for its last socket: a client that finds none looks again only after 0.1 s."""
        socket = Path(f"{self.connection_info['ip']}-{self.connection_info['hb_port']}")
        while not socket.exists() and self.process.poll() is None:
            await asyncio.sleep(0.002)


def can_fork(variables):
    """Return whether a fork of this process is as good as a new Python that starts with these environment variables."""
    same = all(os.environ.get(name) == variables[name] for name in environment.PINS)  # libraries read them when they load
    return same and tokens.can_wear() and preloaded.SINGLE and preloaded.single_threaded(patience=0)


def fork(job, close):
    """Return a kernel for ``job`` (`attempt.Job`) as `Forked`; call it before anything here starts a thread or a socket.

    ``close`` is the connection that the kernel must not hold open, for its reader waits until all writers have ended.
    """
    read, write = os.pipe()
    pid = os.fork()
    if pid:
        os.close(read)
        return Forked(pid, write)
    status = 1
    try:
        os.close(write)
        close.close()
        os.setsid()
        tokens.wear(job.token)
        with os.fdopen(read) as stream:
            connection_file = stream.read()
        if connection_file:  # else the worker has ended
            _serve(job, connection_file)
        status = 0
    except BaseException:  # noqa: BLE001 - nothing may return into the worker's code
        traceback.print_exc()
    finally:
        os._exit(status)


def _serve(job, connection_file):
    """Be a kernel until it is told to stop."""
    import numpy
    from ipykernel.kernelapp import IPKernelApp

    variables = {"NUMBA_CACHE_DIR": os.environ["NUMBA_CACHE_DIR"], **job.environment}  # set when drivelib was imported
    os.environ.clear()
    os.environ.update(variables)
    os.chdir(job.private)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.path[:] = preloaded.SEARCH_PATH
    sys.argv = ["ipykernel_launcher", "-f", connection_file, *OPTIONS]
    numpy.random.seed()  # its old generator drew its seed when it was imported, before the fork
    IPKernelApp.launch_instance([*sys.argv[1:], f"--IPKernelApp.parent_handle={os.getppid()}"])
