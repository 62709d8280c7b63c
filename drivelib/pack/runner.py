"""Run notebooks in parallel, each in processes of its own, and publish what has passed every check."""

import difflib
import os
import random
import re
import shutil
import signal
import tempfile
import time
from contextlib import contextmanager, suppress
from graphlib import CycleError, TopologicalSorter
from multiprocessing import connection
from pathlib import Path

from drivelib import ledger, notebook, paths
from drivelib.pack import attempt, freshness, preloaded, publishing, tokens
from drivelib.pack.attempt import Outcome


def items():
    """Return ``{id: Item}`` of every notebook of the ledgers that exists, in the ledgers' order, and last of the index.

    Raises
    ------
    ValueError
        If there is no notebook at all, one is in no ledger, or items need one another in a circle.
    """
    listed = {id_: item for paper in ledger.papers().values() for id_, item in paper.items.items()}
    there = {path.relative_to(paths.root() / "notebooks").with_suffix("").as_posix() for path in _notebooks()}
    if not there:
        raise ValueError(f"{paths.root()} holds no notebooks")
    stray = sorted(there - set(listed) - {ledger.INDEX})
    if stray:
        raise ValueError(f"notebooks/{stray[0]}.ipynb is listed in no ledger (drivelib/papers/*.toml)")
    found = {id_: item for id_, item in listed.items() if id_ in there}
    for item in found.values():
        for needed in item.needs:
            if needed not in found:
                raise ValueError(f"{item.id} needs {needed!r}, which has no notebook")
    if ledger.INDEX in there:
        found[ledger.INDEX] = ledger.Item(id=ledger.INDEX, title="Where to start", needs=tuple(found))
    try:
        TopologicalSorter({id_: item.needs for id_, item in found.items()}).prepare()
    except CycleError as error:
        raise ValueError(f"items need one another in a circle: {' → '.join(error.args[1])}") from error
    return found


def select(names):
    """Return the items that the names stand for: an id, the start of one that fits a single item, or a paper for all of its items.

    Raises
    ------
    ValueError
        If a name fits none (the nearest are suggested) or is the start of more than one.
    """
    known = items()
    chosen = {}
    for name in names:
        name = name.removesuffix(".ipynb").removeprefix("notebooks/").rstrip("/")
        whole = [id_ for id_ in known if id_.startswith(name + "/")]
        fits = whole or [id_ for id_ in known if id_ == name] or [id_ for id_ in known if id_.startswith(name + "_")]
        if not fits:
            raise ValueError(f"{name!r} is no item{_nearest(name, known)}")
        if len(fits) > 1 and not whole:
            raise ValueError(f"{name!r} stands for {', '.join(fits)}")
        chosen |= {id_: known[id_] for id_ in fits}
    return chosen or known


def _nearest(name, known):
    """Return a sentence that suggests items; a short form counts, such as eskander/fig02, fig02 or fig2."""
    alike = {}
    for id_ in known:
        short = id_.split("_")[0]
        forms = {id_, short, re.sub(r"(?<=[a-z])0", "", short)}
        forms |= {form.split("/")[-1] for form in forms}
        alike[id_] = max(difflib.SequenceMatcher(None, name, form).ratio() for form in forms)
    best = sorted((id_ for id_ in alike if alike[id_] >= 0.6), key=lambda id_: -alike[id_])[:3]
    best = [id_ for id_ in best if alike[id_] == 1] or best
    return f". Did you mean {' or '.join(best)}?" if best else ""


def run(chosen, *, jobs, stage, target=None, mirror=False, parameters=None, seed=None, fork=True, report=lambda *_: None):
    """Run items, at most ``jobs`` at once, into the folder ``stage``; yield an `Outcome` as each ends.

    An item waits for the items it needs; when one of those fails, it fails too, unrun. Whoever takes an outcome may
    set its ``failure`` before asking for the next. With a ``target``, the folder that the caller will move them to, the
    results are marked as not published (other parameters). With ``mirror=True`` items read the numbers they need from
    ``stage`` instead of the published ones.
    With a ``seed`` the order is shuffled; the hash seed is then drawn from it too where nothing is published (mirror).
    Kernels are forked from a process that has imported what the items need, where that is safe (see `preloaded`); with
    ``fork=False`` each is started as a new Python.
    Whatever ends this generator, no process survives it.

    Raises
    ------
    ValueError
        If ``jobs`` is below 1.
    """
    if jobs < 1:
        raise ValueError(f"--jobs {jobs}: must be at least 1")
    draw = random.Random(seed)
    rank = {id_: draw.random() if seed is not None else -freshness.record(id_).get("seconds", 10) for id_ in chosen}
    changes = {"PYTHONHASHSEED": draw.randrange(1, 2**32)} if seed is not None and mirror else {}
    order = TopologicalSorter({id_: [needed for needed in item.needs if needed in chosen] for id_, item in chosen.items()})
    order.prepare()
    waiting, running, failed = [], {}, set()
    private = Path(tempfile.mkdtemp(prefix="drv", dir=preloaded.folder_for_sockets()))
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
                    run_ = attempt.Attempt(context, id_, Path(stage), target, mirror, parameters or {}, changes, fork)
                except (OSError, EOFError, ValueError) as error:
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
    variables = attempt.variables(private, changes) | {tokens.TOKEN: tokens.NO_RUN}
    modules = ["drivelib.pack.engine"]
    if fork:
        code = []
        for id_ in chosen:
            with suppress(OSError, ValueError):  # its own attempt says what is wrong with it
                code += notebook.code(notebook.read(paths.notebook(id_)))
        files = freshness.closure(code)
        modules += [*preloaded.KERNEL, *(f"drivelib.{file.removesuffix('.py').replace('/', '.')}" for file in files)]
    return preloaded.context(variables, modules)


@contextmanager
def interruptible():
    """Turn SIGINT, SIGTERM and SIGHUP (a closed terminal) into KeyboardInterrupt, so that all ways to stop clean up alike.

    SIGINT too, because a process started in the background of a shell script inherits it as ignored. Where SIGHUP is
    ignored it stays so, for that is what nohup is for.
    """

    def stop(*_):
        raise KeyboardInterrupt

    stopping = [number for number in publishing.SIGNALS if number == signal.SIGINT or signal.getsignal(number) != signal.SIG_IGN]
    previous = {number: signal.signal(number, stop) for number in stopping}
    try:
        yield
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def _notebooks():
    return [path for path in (paths.root() / "notebooks").rglob("*.ipynb") if ".ipynb_checkpoints" not in path.parts]
