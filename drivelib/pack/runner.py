"""Run notebooks in parallel, each in processes of its own, and publish what has passed every check."""

import hashlib
import json
import os
import random
import shutil
import signal
import tempfile
import time
import tomllib
import uuid
from contextlib import contextmanager
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from multiprocessing import connection
from pathlib import Path

from drivelib import environment, ledger, notebook, paths, record
from drivelib.pack import freshness, preloaded, tokens, worker
from drivelib.validation import nearest

STARTUP_SECONDS = 60  # beyond the notebook's own limit, before the run is killed
SIZE_LIMITS = {".csv": 300_000, ".svg": 500_000, ".ipynb": 1_000_000}


@dataclass(frozen=True)
class Job:
    """What one worker needs; only plain values, because it is sent to another process."""

    item: str
    private: str
    environment: dict
    parameters: dict
    seconds: float
    output_limit: int
    token: str
    fork: bool


@dataclass
class Outcome:
    """How one item ended: ``failure`` is None when it passed."""

    item: str
    failure: str | None
    seconds: float
    files: dict[str, Path] = field(default_factory=dict)


def items():
    """Return ``{id: Item}`` of every notebook of the ledgers that exists, in the ledgers' order.

    Raises
    ------
    ValueError
        If a notebook is in no ledger, or items need one another in a circle.
    """
    listed = {id_: item for paper in ledger.papers().values() for id_, item in paper.items.items()}
    there = {path.relative_to(paths.root() / "notebooks").with_suffix("").as_posix() for path in _notebooks()}
    stray = sorted(there - set(listed))
    if stray:
        raise ValueError(f"notebooks/{stray[0]}.ipynb is listed in no ledger (drivelib/papers/*.toml)")
    found = {id_: item for id_, item in listed.items() if id_ in there}
    for item in found.values():
        for needed in item.needs:
            if needed not in found:
                raise ValueError(f"{item.id} needs {needed!r}, which has no notebook")
    try:
        TopologicalSorter({id_: item.needs for id_, item in found.items()}).prepare()
    except CycleError as error:
        raise ValueError(f"items need one another in a circle: {' → '.join(error.args[1])}") from error
    return found


def select(names):
    """Return the items that the names stand for: an id, or the start of one that fits a single item.

    Raises
    ------
    ValueError
        If a name fits none (the nearest is suggested) or more than one.
    """
    known = items()
    chosen = {}
    for name in names:
        name = name.removesuffix(".ipynb").removeprefix("notebooks/")
        fits = [id_ for id_ in known if id_ == name] or [id_ for id_ in known if id_.startswith(name + "_")]
        if len(fits) != 1:
            several = f"stands for {', '.join(fits)}" if fits else f"is no item{nearest(name, known)}"
            raise ValueError(f"{name!r} {several}")
        chosen[fits[0]] = known[fits[0]]
    return chosen or known


def limits(item_id):
    """Return (seconds, bytes of output) that an item may take, from pyproject.toml."""
    with (paths.root() / "pyproject.toml").open("rb") as stream:
        values = tomllib.load(stream)["tool"]["drivelib"]["limits"]
    return values["beyond_seconds" if item_id.startswith("beyond/") else "notebook_seconds"], values["output_bytes"]


def run(chosen, *, jobs, stage, publish=True, mirror=False, parameters=None, seed=None, fork=True, report=lambda *_: None):
    """Run items, at most ``jobs`` at once, into the folder ``stage``; yield an `Outcome` as each ends.

    An item waits for the items it needs; when one of those fails, it fails too, unrun. Whoever takes an outcome may
    set its ``failure`` before asking for the next. ``publish=False`` marks the results as not published (other
    parameters). With ``mirror=True`` items read the numbers they need from ``stage`` instead of the published ones.
    With a ``seed`` the order is shuffled; the hash seed is then drawn from it too where nothing is published (mirror).
    Kernels are forked from a process that has imported what the items need, where that is safe (see `preloaded`); with
    ``fork=False`` each is started as a new Python.
    Whatever ends this generator, no process survives it.
    """
    draw = random.Random(seed)
    rank = {id_: draw.random() if seed is not None else -freshness.record(id_).get("seconds", 10) for id_ in chosen}
    changes = {"PYTHONHASHSEED": draw.randrange(1, 2**32)} if seed is not None and mirror else {}
    order = TopologicalSorter({id_: [needed for needed in item.needs if needed in chosen] for id_, item in chosen.items()})
    order.prepare()
    waiting, running, failed = [], {}, set()
    private = Path(tempfile.mkdtemp(prefix="drv"))
    try:
        context = _context(chosen, private, changes, fork)
        while order.is_active():
            waiting += order.get_ready()
            waiting.sort(key=rank.get)  # longest first keeps all cores busy
            while waiting and len(running) < jobs:
                id_ = waiting.pop(0)
                broken = [needed for needed in chosen[id_].needs if needed in failed]
                if broken:
                    failed.add(id_)
                    order.done(id_)
                    yield Outcome(id_, f"not run, because {broken[0]} failed", 0.0)
                    continue
                began = time.monotonic()
                try:
                    run_ = _Run(context, id_, Path(stage), publish, mirror, parameters or {}, changes, fork)
                except (OSError, ValueError) as error:
                    failed.add(id_)
                    order.done(id_)
                    yield Outcome(id_, f"could not be started: {error}", time.monotonic() - began)
                    continue
                running[run_.process.sentinel] = run_
                report("start", id_)
            if not running:
                continue
            soonest = min(run_.deadline for run_ in running.values())
            ended = connection.wait(list(running), timeout=max(0.0, soonest - time.monotonic()))
            late = [sentinel for sentinel, run_ in running.items() if time.monotonic() > run_.deadline]
            for sentinel in {*ended, *late}:
                run_ = running.pop(sentinel)
                outcome = run_.end(late=sentinel not in ended)
                yield outcome
                if outcome.failure:
                    failed.add(run_.item)
                order.done(run_.item)
    finally:
        for run_ in running.values():
            run_.kill()
        shutil.rmtree(private, ignore_errors=True)


def _context(chosen, private, changes, fork):
    """Return where workers come from: a process with the kernels' environment and, to fork from, what the items import."""
    variables = _kernel_environment(private, changes) | {tokens.TOKEN: tokens.NO_RUN}
    modules = ["drivelib.pack.engine"]
    if fork:
        code = [text for id_ in chosen for text in notebook.code(notebook.read(paths.notebook(id_)))]
        files = freshness.closure(code)
        modules += [*preloaded.KERNEL, *(f"drivelib.{file.removesuffix('.py').replace('/', '.')}" for file in files)]
    return preloaded.context(variables, modules)


def _kernel_environment(private, changes, **extra):
    variables = environment.kernel(private, DRIVELIB_ROOT=paths.root(), PYTHONPATH=freshness.PACKAGE.parent, **extra)
    return variables | {name: str(value) for name, value in changes.items()}


class _Run:
    """One running notebook: its worker process, its private folder and its deadline."""

    def __init__(self, context, item, stage, publish, mirror, parameters, changes, fork):
        self.item, self.stage, self.started = item, stage, time.monotonic()
        self.limit, output_limit = limits(item)
        self.deadline = self.started + self.limit + STARTUP_SECONDS
        self.token = uuid.uuid4().hex
        self.private = Path(tempfile.mkdtemp(prefix="drv"))  # short: a unix socket's path has 107 characters at most
        try:
            self._start(context, publish, mirror, parameters, changes, output_limit, fork)
        except BaseException:
            shutil.rmtree(self.private, ignore_errors=True)
            raise

    def _start(self, context, publish, mirror, parameters, changes, output_limit, fork):
        item, stage = self.item, self.stage
        content = notebook.read(paths.notebook(item))
        for cell in content["cells"]:
            if cell["cell_type"] == "code":
                cell["outputs"], cell["execution_count"] = [], None
        (self.private / "source.ipynb").write_bytes(notebook.dumps(content))
        self.folder = stage / "figures" / Path(item).parent
        where = {
            record.PUBLISH if publish else record.OUT: self.folder,
            record.READ: stage / "figures" if mirror else paths.root() / "figures",
            tokens.TOKEN: self.token,
        }
        variables = _kernel_environment(self.private, changes, **where)
        job = Job(item, str(self.private), variables, parameters, self.limit, output_limit, self.token, fork)
        self.receiver, sender = context.Pipe(duplex=False)
        self.process = context.Process(target=worker.execute, args=(job, sender), daemon=True)
        self.process.start()
        sender.close()

    def end(self, late):
        """Return the `Outcome` after the worker has ended, or kill it when it is late."""
        failure = f"longer than its limit of {self.limit:g} s, killed" if late else self._message()
        log = self._log_tail()
        if failure is None:
            try:
                failure = self._collect()
            except (OSError, ValueError, KeyError, TypeError) as error:
                failure = f"its results cannot be read or kept: {error}"
        self.kill()
        if failure is not None and log and "raised" not in failure:
            failure += f" [{log}]"
        files = {} if failure else {path.suffix: path for path in self._files()}
        return Outcome(self.item, failure, time.monotonic() - self.started, files)

    def kill(self):
        """End every process of this run and remove its private folder."""
        self.process.kill()
        self.process.join()
        tokens.sweep(self.token)
        self.receiver.close()
        shutil.rmtree(self.private, ignore_errors=True)

    def _message(self):
        try:
            failure = self.receiver.recv()
        except EOFError:
            return f"its worker process died with exit status {self.process.exitcode}"
        if failure is not None and "CellTimeoutError" in failure:
            return f"a cell took longer than the limit of {self.limit:g} s"
        return failure

    def _log_tail(self):
        try:
            lines = (self.private / "log").read_text(errors="replace").strip().splitlines()
        except OSError:
            return ""
        return lines[-1][:200] if lines else ""

    def _files(self):
        name = self.item.rsplit("/", 1)[-1]
        figures = [self.folder / f"{name}.{suffix}" for suffix in freshness.ARTEFACTS]
        return [self.stage / "notebooks" / f"{self.item}.ipynb", *figures]

    def _collect(self):
        """Write the normalised notebook into the stage; return what is wrong with the results, or None."""
        executed = notebook.read(self.private / "executed.ipynb")
        reasons = notebook.unpublishable(executed)
        if reasons:
            return reasons[0]
        json_path = self._files()[-1]
        if not json_path.exists():
            return "finish() was not reached: no results were written"
        target = self._files()[0]
        record.write_atomically(target, notebook.dumps(notebook.normalised(executed)))
        results = json.loads(json_path.read_text(encoding="utf-8"))
        wanted = set(ledger.claims_of(self.item))
        judged = {claim["id"] for claim in results["claims"]}
        if judged != wanted:
            return f"claims judged and claims listed differ: {', '.join(sorted(judged ^ wanted))}"
        for path in self._files():
            if not path.exists():
                return f"{path.name} was not written"
            if path.stat().st_size > SIZE_LIMITS.get(path.suffix, 2_000_000):
                return f"{path.name} has {path.stat().st_size:,} bytes, more than its limit"
            suffix = path.suffix.removeprefix(".")
            if suffix in results["artefacts"] and hashlib.sha256(path.read_bytes()).hexdigest() != results["artefacts"][suffix]:
                return f"{path.name} is not what finish() signed"
        return None


@contextmanager
def interruptible():
    """Turn SIGINT and SIGTERM into KeyboardInterrupt, so that both ways to stop clean up alike.

    SIGINT too, because a process started in the background of a shell script inherits it as ignored.
    """

    def stop(*_):
        raise KeyboardInterrupt

    previous = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def _notebooks():
    return [path for path in (paths.root() / "notebooks").rglob("*.ipynb") if ".ipynb_checkpoints" not in path.parts]
