"""Evaluate one function for many draws: on threads, processes or a cluster, with the same bytes each time.

    table = evaluate(10_000, study, ("dip", "holds"), seed=7, folder="build/shards")

Draws go out in shards, come back in order and are kept no longer than asked, so memory holds a few shards
(``stream``) or the table (``evaluate``), never what the function computes on the way. Draw k has a generator of its
own, spawned from the seed by its number: nothing depends on shards, order or workers. With ``folder`` each shard is
stored under the digest of everything that determines it, and a run that was cut short goes on where it stopped.
"""

import os
import traceback
from collections import deque
from concurrent.futures import Executor, ThreadPoolExecutor

import numpy as np

from drivelib import shards
from drivelib.validation import number


class EnsembleError(RuntimeError):
    """A draw's function failed, or a worker died; the message says which draws."""


def generator(seed, draw):
    """Return the random generator of one draw: spawned from the seed by the draw's number."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(draw,)))


def evaluate(draws, function, columns, **options):
    """Return one row per draw; parameters as in ``stream``.

    Returns
    -------
    structured array, shape (number of draws,)
        Field ``failure`` (0, or k where the k-th of ``flagged`` was raised and the row is NaN), then the columns.

    Examples
    --------
    Any function that returns one number per column; a thread per core unless an executor is given:

    >>> table = evaluate([1.0, 2.0, 3.0], lambda x: (x, x**2), ("x", "square"))
    >>> table["square"].tolist()
    [1.0, 4.0, 9.0]
    """
    return np.concatenate(list(stream(draws, function, columns, **options)))


def stream(
    draws, function, columns, *, seed=None, executor=None, shard_size=256, folder=None, version="", batched=False, flagged=(),
    retries=2, ahead=None,
):  # fmt: skip
    """Yield the tables of ``evaluate`` shard by shard, in order.

    Parameters
    ----------
    draws : int or sequence
        How many draws, each then being its random generator; or the draws themselves.
    function : callable
        ``function(draw)``, or ``function(draw, generator)`` for a sequence with a seed; returns one number per
        column. For processes and clusters it must be importable there.
    columns : sequence of str
        Names of what the function returns.
    seed : int, optional
        Needed where ``draws`` is a number.
    executor : concurrent.futures.Executor, or a function that makes one, optional
        Default: a thread per core, right for functions that spend their time in the compiled drive loops. A function
        that makes one (``lambda: ProcessPoolExecutor(2)``) lets the run survive a worker that dies; a Dask
        cluster's ``client.get_executor(pure=False)`` replaces its workers itself. (Pure, as is Dask's default, a shard asked for again
        right after a run was given up has the same name as the one being cancelled, and is cancelled with it.)
    shard_size : int
        Draws per shard: the unit of work, of storage and of repetition.
    folder : path, optional
        Where shards are stored and found again. The key covers draws, seed, columns, the function's own source and
        all of drivelib, but not other modules that the function calls: name their state in ``version``.
    version : str
        Anything else that the results depend on.
    batched : bool
        The function takes a list of draws (of pairs where it takes two) and returns an array (draws, columns).
    flagged : tuple of exception types
        A draw that raises one gives a flagged row of NaN; any other exception ends the run. Not with ``batched``.
    retries : int
        How often a shard is sent again after its worker died.
    ahead : int, optional
        Most shards under way at once; by default four per worker of a local pool or per core.

    Raises
    ------
    ValueError
        If a parameter is out of range or there is nothing to draw.
    EnsembleError
        If the function fails, naming the draw, or a shard could not be had in all its tries.
    """
    size = number("shard_size", shard_size, "draws", at_least=1, whole=True)
    retries = number("retries", retries, at_least=0, whole=True)
    count, columns, flagged = _checked(draws, function, columns, seed, batched, tuple(flagged))
    spans = ((start, min(start + size, count)) for start in range(0, count, size))
    work = (
        shards.Shard(start, stop, None if np.isscalar(draws) else draws[start:stop], seed, function, columns, batched, flagged, version)
        for start, stop in spans
    )
    make = executor if executor is not None and not isinstance(executor, Executor) else None
    own = executor is None or make is not None
    pool = _Pool(make or ((lambda: ThreadPoolExecutor(os.cpu_count())) if own else (lambda: executor)), own, retries, make is not None)
    try:
        yield from _in_order(work, pool, shards.Store(folder), ahead)
    finally:
        pool.close()


def _checked(draws, function, columns, seed, batched, flagged):
    if isinstance(columns, str) or not columns or len(set(columns)) != len(columns) or "failure" in columns:
        raise ValueError(f"columns = {columns!r}: must be distinct names, at least one, none of them 'failure'")
    if not callable(function):
        raise ValueError(f"function = {function!r}: must be callable")
    if batched and flagged:
        raise ValueError("flagged has no meaning with batched: such a function flags its rows itself")
    if np.isscalar(draws):
        count = number("draws", draws, at_least=1, whole=True)
        if seed is None:
            raise ValueError(f"draws = {draws} without a seed: each draw is a random generator, which a seed must determine")
    else:
        count = len(draws)
        if count == 0:
            raise ValueError("draws is empty: there is nothing to evaluate")
    if seed is not None:
        number("seed", seed, at_least=0, whole=True)
    return count, tuple(columns), flagged


def _in_order(work, pool, store, ahead):
    waiting = deque()  # of (shard, its table or its future)
    work = iter(work)
    shard = next(work, None)
    while waiting or shard is not None:
        while shard is not None and len(waiting) < (ahead or 4 * pool.workers):
            found = store.read(shard)
            waiting.append((shard, pool.submit(shard) if found is None else found))
            shard = next(work, None)
        first, answer = waiting.popleft()
        if not isinstance(answer, np.ndarray):
            answer = pool.result(first, answer, waiting)
            store.write(first, answer)
        yield answer


class _Pool:
    """An executor that is replaced when it breaks, where there is a way to make another."""

    def __init__(self, make, own, retries, replaceable):
        self.make, self.own, self.retries, self.replaceable = make, own, retries, replaceable
        self.executor = make()
        if not isinstance(self.executor, Executor):
            raise ValueError(f"executor made {self.executor!r}: must be a concurrent.futures.Executor or a function that makes one")
        self.workers = getattr(self.executor, "_max_workers", None) or os.cpu_count()
        self.under_way = set()

    def submit(self, shard):
        try:
            future = self.executor.submit(run_shard, shard)
        except Exception as error:  # a broken pool refuses; what is wrong shows when the result is asked for
            from concurrent.futures import Future

            future = Future()
            future.set_exception(error)
        self.under_way.add(future)
        return future

    def result(self, shard, future, waiting):
        for attempt in range(self.retries + 1):
            self.under_way.discard(future)
            try:
                table, failure = future.result()
            except Exception as error:
                # The function's own exceptions come back as values: this one is the executor's.
                lost = error
            else:
                if failure is not None:
                    raise EnsembleError(failure)
                return table
            if attempt < self.retries:
                if self.replaceable:
                    self._replace(waiting)
                future = self.submit(shard)
        remedy = "" if self.replaceable else ", and an executor that broke cannot be mended: give a function that makes one"
        raise EnsembleError(
            f"draws {shard.start} to {shard.stop - 1} were lost {self.retries + 1} times with their worker ({type(lost).__name__}: {lost})"
            f"{remedy}. With folder=… what was finished is kept, and the same call goes on from there"
        ) from lost

    def _replace(self, waiting):
        self.executor.shutdown(wait=False, cancel_futures=True)
        self.executor = self.make()
        for place, (shard, answer) in enumerate(waiting):
            finished = isinstance(answer, np.ndarray) or (answer.done() and not answer.cancelled() and answer.exception() is None)
            if not finished:
                self.under_way.discard(answer)
                waiting[place] = (shard, self.submit(shard))

    def close(self):
        for future in self.under_way:
            future.cancel()
        if self.own:
            self.executor.shutdown(wait=True, cancel_futures=True)


def run_shard(shard):
    """Return (table, None) of a shard, or (None, what went wrong and at which draw). Runs in the worker."""
    table = np.zeros(shard.stop - shard.start, dtype=[("failure", "u1"), *((name, "f8") for name in shard.columns)])
    draws = [_arguments(shard, k) for k in range(shard.start, shard.stop)]
    where = f"draws {shard.start} to {shard.stop - 1}"
    try:
        if shard.batched:
            rows = shard.function([arguments if len(arguments) > 1 else arguments[0] for arguments in draws])
            for column, values in zip(shard.columns, _shaped(rows, (len(draws), len(shard.columns))).T, strict=True):
                table[column] = values
            return table, None
        for row, arguments in enumerate(draws):
            where = f"draw {shard.start + row}"
            try:
                values = _shaped(shard.function(*arguments), (len(shard.columns),))
            except shard.flagged as error:
                kind = next(k for k, flag in enumerate(shard.flagged) if isinstance(error, flag))
                table[row] = (kind + 1, *[np.nan] * len(shard.columns))
            else:
                table[row] = (0, *values)
        return table, None
    except Exception:
        return None, f"{where}: {traceback.format_exc(limit=-4)}"


def _arguments(shard, k):
    rng = () if shard.seed is None else (generator(shard.seed, k),)
    return rng if shard.draws is None else (shard.draws[k - shard.start], *rng)


def _shaped(values, shape):
    values = np.asarray(values, dtype=float)
    if values.shape != shape:
        raise ValueError(f"the function returned shape {values.shape}: must be {shape}, a number per column")
    return values
