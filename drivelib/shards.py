"""Shards of an ensemble and where they are kept: one file per shard, named by what determines its content."""

import contextlib
import hashlib
import inspect
import io
import os
import pickle
import tempfile
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

import drivelib

FORMAT = "drivelib shard 1"


class Shard(NamedTuple):
    """Draws ``start`` to ``stop`` − 1 of an ensemble, and all that it takes to compute them; see ``ensemble.stream``."""

    start: int
    stop: int
    draws: object
    seed: int | None
    function: object
    columns: tuple
    batched: bool
    flagged: tuple
    version: str


def digest(shard):
    """Return the key of a shard: equal for equal content, different when anything that it depends on changed.

    Raises
    ------
    ValueError
        If function or draws cannot be pickled.
    """
    flags = [f"{kind.__module__}.{kind.__qualname__}" for kind in shard.flagged]
    plain = (FORMAT, drivelib.sources_digest(), shard.columns, shard.seed, shard.batched, flags, shard.version)
    key = hashlib.sha256(repr(plain).encode())
    try:
        parts = [pickle.dumps(shard.function, 5)]
        # One by one: whether draws share objects must not matter.
        parts += [repr((shard.start, shard.stop)).encode()] if shard.draws is None else [pickle.dumps(draw, 5) for draw in shard.draws]
        if shard.seed is not None:
            parts.append(repr(shard.start).encode())
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ValueError(f"function and draws must be picklable to be stored in a folder, and {error}") from None
    for part in (*parts, _source(shard.function).encode()):
        key.update(len(part).to_bytes(8, "little") + part)
    return key.hexdigest()


class Store:
    """A folder of shards; ``Store(None)`` keeps nothing."""

    def __init__(self, folder):
        self.folder = None if folder is None else Path(folder)
        if self.folder is not None:
            self.folder.mkdir(parents=True, exist_ok=True)

    def read(self, shard):
        """Return the table of a shard, or None where there is none or it is damaged."""
        if self.folder is None:
            return None
        try:
            content = self._path(shard).read_bytes()
        except FileNotFoundError:
            return None
        body, check = content[:-32], content[-32:]
        if hashlib.sha256(body).digest() != check:
            return None
        return np.load(io.BytesIO(body), allow_pickle=False)

    def write(self, shard, table):
        """Keep the table of a shard: whole or not at all."""
        if self.folder is None:
            return
        body = io.BytesIO()
        np.save(body, table, allow_pickle=False)
        handle, temporary = tempfile.mkstemp(dir=self.folder, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(body.getvalue() + hashlib.sha256(body.getvalue()).digest())
            os.replace(temporary, self._path(shard))
        except BaseException:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(temporary)
            raise

    def _path(self, shard):
        return self.folder / f"{digest(shard)}.shard"


def _source(function):
    while isinstance(function, partial):
        function = function.func
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):
        return ""
