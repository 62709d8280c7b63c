"""One notebook on its way: its private folders, its worker process, its deadline, and what is kept of its results."""

import hashlib
import json
import shutil
import tempfile
import time
import tomllib
import uuid
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from drivelib import environment, ledger, notebook, paths, record
from drivelib.pack import freshness, preloaded, tokens, worker
from drivelib.validation import number

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
    """How one item ended: ``failure`` is None when it passed; ``cell_seconds`` is what its cells took of ``seconds``."""

    item: str
    failure: str | None
    seconds: float
    files: dict[str, Path] = field(default_factory=dict)
    cell_seconds: float = 0.0


def limits(item_id):
    """Return (seconds, bytes of output) that an item may take, from pyproject.toml."""
    with (paths.root() / "pyproject.toml").open("rb") as stream:
        values = tomllib.load(stream).get("tool", {}).get("drivelib", {}).get("limits", {})
    wanted = "beyond_seconds" if item_id.startswith("beyond/") else "notebook_seconds", "output_bytes"
    return tuple(number(f"pyproject.toml, tool.drivelib.limits: {name}", values.get(name), above=0) for name in wanted)


def variables(private, changes, **extra):
    """Return the environment of a kernel with the folder ``private``, its pins changed as ``changes`` says."""
    found = environment.kernel(private, DRIVELIB_ROOT=paths.root(), PYTHONPATH=freshness.PACKAGE.parent, **extra)
    return found | {name: str(value) for name, value in changes.items()}


class Attempt:
    """One running notebook."""

    def __init__(self, context, item, stage, target, mirror, parameters, changes, fork):
        self.item, self.stage, self.started = item, stage, time.monotonic()
        self.limit, output_limit = limits(item)
        self.deadline = self.started + self.limit + STARTUP_SECONDS
        self.token, self.cell_seconds, self.worker = uuid.uuid4().hex, 0.0, None
        self.private = Path(tempfile.mkdtemp(prefix="drv", dir=preloaded.folder_for_sockets()))
        try:
            self._start(context, target, mirror, parameters, changes, output_limit, fork)
        except BaseException:
            shutil.rmtree(self.private, ignore_errors=True)
            raise

    def _start(self, context, target, mirror, parameters, changes, output_limit, fork):
        item, stage = self.item, self.stage
        content = notebook.read(paths.notebook(item)) | {"metadata": notebook.METADATA}  # papermill asks it for the language
        freshness.refuse_whole_package(notebook.code(content))
        for cell in content["cells"]:
            if cell["cell_type"] == "code":
                cell["outputs"], cell["execution_count"] = [], None
                cell["metadata"]["tags"] = [tag for tag in cell["metadata"].get("tags", ()) if tag != "skip-execution"]  # nbclient obeys it
        (self.private / "source.ipynb").write_bytes(notebook.dumps(content))
        # A folder of its own, so that a notebook that takes another's name in begin() spoils nothing of the other.
        self.folder = Path(tempfile.mkdtemp(prefix="run-", dir=stage))
        where = {
            **({record.PUBLISH: self.folder} if target is None else {record.OUT: self.folder, record.LIES: target}),
            paths.READ: stage / "figures" if mirror else paths.root() / "figures",
            tokens.TOKEN: self.token,
        }
        environment_ = variables(self.private, changes, **where)
        job = Job(item, str(self.private), environment_, parameters, self.limit, output_limit, self.token, fork)
        self.receiver, sender = context.Pipe(duplex=False)
        # No daemon, for those may have no children, and a kernel forked from this one may want some. `kill` ends it.
        self.process = context.Process(target=worker.execute, args=(job, sender), daemon=False)
        self.process.start()
        sender.close()
        with suppress(psutil.Error):  # multiprocessing takes it for dead as soon as the process that it was forked from is
            self.worker = psutil.Process(self.process.pid)

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
        if failure is not None:
            failure = _one_line(failure if not log or "raised" in failure else f"{failure} [{log}]")
        files = {} if failure else {path.suffix: path for path in self._staged() if path.exists()}
        return Outcome(self.item, failure, time.monotonic() - self.started, files, self.cell_seconds)

    def kill(self):
        """End every process of this run and remove its private folders."""
        if self.worker and self.worker.is_running():
            tokens.sweep(self.token, self.worker)
            with suppress(psutil.Error):
                self.worker.kill()
        self.process.join()
        tokens.sweep(self.token)
        self.receiver.close()
        for folder in (self.private, self.folder):
            shutil.rmtree(folder, ignore_errors=True)

    def _message(self):
        try:
            if not self.receiver.poll(max(0.0, self.deadline - time.monotonic())):  # it lives, and who watches over it has died
                return f"longer than its limit of {self.limit:g} s, killed"
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
        return [self.folder / f"{name}.{suffix}" for suffix in ("ipynb", *freshness.ARTEFACTS)]

    def _staged(self):
        figures = [self.stage / "figures" / f"{self.item}.{suffix}" for suffix in freshness.ARTEFACTS]
        return [self.stage / "notebooks" / f"{self.item}.ipynb", *figures]

    def _collect(self):
        """Move the results with the normalised notebook into the stage; return what is wrong with them, or None."""
        executed = notebook.read(self.private / "executed.ipynb")
        self.cell_seconds = sum(cell["metadata"]["papermill"]["duration"] or 0.0 for cell in executed["cells"])
        reasons = notebook.unpublishable(executed)
        if reasons:
            return reasons[0]
        files = self._files()
        if self.item == ledger.INDEX and not any(path.exists() for path in files[1:]):
            files, results = files[:1], {"claims": [], "artefacts": {}}  # it shows what others found and need not record anything
        elif not files[-1].exists():
            return "finish() was not reached: no results were written"
        else:
            results = json.loads(files[-1].read_text(encoding="utf-8"))
        record.write_atomically(files[0], notebook.dumps(notebook.normalised(executed)))
        wanted = set(ledger.claims_of(self.item))
        judged = {claim["id"] for claim in results["claims"]}
        if judged != wanted:
            return f"claims judged and claims listed differ: {', '.join(sorted(judged ^ wanted))}"
        for path in files:
            if not path.exists():
                return f"{path.name} was not written"
            if path.stat().st_size > SIZE_LIMITS.get(path.suffix, 2_000_000):
                return f"{path.name} has {path.stat().st_size:,} bytes, more than its limit"
            suffix = path.suffix.removeprefix(".")
            if suffix in results["artefacts"] and hashlib.sha256(path.read_bytes()).hexdigest() != results["artefacts"][suffix]:
                return f"{path.name} is not what finish() signed"
        for path, staged in zip(files, self._staged(), strict=False):  # the index may have its notebook only
            staged.parent.mkdir(parents=True, exist_ok=True)
            path.replace(staged)
        if (self.folder / record.EXPORTS).exists():
            exports = self.stage / record.EXPORTS / self.item
            exports.parent.mkdir(parents=True, exist_ok=True)
            (self.folder / record.EXPORTS).replace(exports)
        return None


def _one_line(text):
    """Return a failure as one line of what can be printed: a notebook's words must not steer the terminal."""
    return " ".join("".join(sign if sign.isprintable() else " " for sign in text).split())
