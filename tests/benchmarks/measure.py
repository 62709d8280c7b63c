"""How the benchmark measures: functions in turn, in one run, as often as asked.

What runs on one core is timed by its thread's own processor time, which leaves out what other programs take; processes
and what uses all cores are timed by the clock on the wall.
"""

import statistics
import time
from dataclasses import dataclass, field


@dataclass
class Row:
    """One line of the table: seconds per unit of ours and of what it is held against, pair by pair.

    ``limit``: largest ratio ours/theirs (``kind`` "ratio"), smallest ratio theirs/ours ("faster"), largest value of
    ours in ``unit`` ("value"); None shows the number without judging it.
    """

    what: str
    against: str
    pairs: list = field(default_factory=list)
    kind: str = "ratio"
    limit: float | None = None
    unit: str = "s"
    scale: float = 1.0
    note: str = ""

    @property
    def samples(self):
        """The judged number of each repetition."""
        if self.kind == "value":
            return [ours * self.scale for ours, _ in self.pairs]
        return [ours / theirs if self.kind == "ratio" else theirs / ours for ours, theirs in self.pairs]

    def cells(self):
        """Return the row as text: what, ours, against, ratio with spread, target, met."""
        if not self.pairs:
            return [self.what, "", self.against, "", self._target(), self.note or "not measured"]
        ours = f"{statistics.median(a for a, _ in self.pairs) * self.scale:.4g} {self.unit}"
        theirs = f"{self.against}: {statistics.median(b for _, b in self.pairs) * self.scale:.4g} {self.unit}" if self.against and self.pairs[0][1] else self.against
        found = statistics.median(self.samples)
        spread = f"{found:.3g} ({min(self.samples):.3g} to {max(self.samples):.3g}){' ×' if self.kind != 'value' else ''}"
        return [self.what, ours, theirs, spread, self._target(), self._met(found)]

    def _target(self):
        if self.limit is None:
            return "shown"
        sign, unit = ("≥", " ×") if self.kind == "faster" else ("≤", " ×" if self.kind == "ratio" else f" {self.unit}")
        return f"{sign} {self.limit:g}{unit}"

    def _met(self, found):
        if self.limit is None:
            return self.note
        met = found >= self.limit if self.kind == "faster" else found <= self.limit
        return ("met" if met else "not met") + (f"; {self.note}" if self.note else "")


def seconds(function, inner=1, clock=time.thread_time):
    """Return the least time (s) of ``inner`` calls."""
    best = float("inf")
    for _ in range(inner):
        began = clock()
        function()
        best = min(best, clock() - began)
    return best


def in_turn(functions, repetitions, inner=1, clock=time.thread_time):
    """Return one list of seconds per function: each repetition times all of them, one after the other."""
    for function in functions:
        function()  # compiled and warm
    rounds = [[seconds(function, inner, clock) for function in functions] for _ in range(repetitions)]
    return [list(column) for column in zip(*rounds, strict=True)]


def pairs(ours, theirs, units=1.0, their_units=None):
    """Return (ours, theirs) per unit of work, repetition by repetition."""
    return [(a / units, b / (their_units or units)) for a, b in zip(ours, theirs, strict=True)]
