"""Count what an algorithm does: numbers that tally their own arithmetic, and what that costs on a small processor.

    value, tally = counted(algorithm, 150.0, 3.0)
    cycles(tally)

The algorithms are ordinary functions of scalars. A constant that meets a counted number has to be fetched, so it counts
as a load; nothing is optimised away, which makes the counts an upper bound. No clock is read: same input, same count.
"""

import math
from collections import Counter

from drivelib.validation import number

CORTEX_M4F = {
    "add": 1, "multiply": 1, "divide": 14, "square root": 14, "convert": 1, "compare": 4, "load": 2, "integer": 1, "tanh": 60,
}  # fmt: skip
"""Cycles per operation in single precision. A comparison is VCMP, VMRS and a branch of two. tanh is no instruction: one
exponential (range reduction, polynomial) and one division, an assumption.

References
----------
Cortex-M4 Technical Reference Manual, ARM DDI 0439B, sec. 7.2.3 (floating-point instructions); the same counts in
Texas Instruments' CC13x2/CC26x2 Technical Reference Manual, SWCU192, table 3-27.
"""


class Counted:
    """A number that tallies the operations on it and on what comes of it."""

    __slots__ = ("tally", "value")

    def __init__(self, value, tally):
        self.value, self.tally = float(value), tally

    def _note(self, kind, value, *others):
        self.tally[kind] += 1
        self.tally["load"] += sum(not isinstance(other, Counted) for other in others)
        return Counted(value, self.tally)

    def __add__(self, other):
        return self._note("add", self.value + _plain(other), other)

    __radd__ = __add__

    def __sub__(self, other):
        return self._note("add", self.value - _plain(other), other)

    def __rsub__(self, other):
        return self._note("add", _plain(other) - self.value, other)

    def __mul__(self, other):
        return self._note("multiply", self.value * _plain(other), other)

    __rmul__ = __mul__

    def __truediv__(self, other):
        return self._note("divide", self.value / _plain(other), other)

    def __rtruediv__(self, other):
        return self._note("divide", _plain(other) / self.value, other)

    def __neg__(self):
        return self._note("add", -self.value)

    def __abs__(self):
        return self._note("add", abs(self.value))

    def __lt__(self, other):
        self._note("compare", 0.0, other)
        return self.value < _plain(other)

    def __gt__(self, other):
        self._note("compare", 0.0, other)
        return self.value > _plain(other)

    def sqrt(self):
        return self._note("square root", math.sqrt(self.value))

    def tanh(self):
        return self._note("tanh", math.tanh(self.value))

    def whole(self, largest):
        """Return the whole part as an int, at most ``largest``: a conversion and an integer comparison."""
        self.tally["convert"] += 1
        self.tally["integer"] += 1
        return min(int(self.value), largest)

    def fetched(self, value):
        """Return a number fetched from a table: a load and an address."""
        self.tally["load"] += 1
        self.tally["integer"] += 1
        return Counted(value, self.tally)


def _plain(value):
    return value.value if isinstance(value, Counted) else value


def counted(algorithm, *inputs):
    """Return (outputs as floats, Counter of operations) of one evaluation of an algorithm of scalars."""
    tally = Counter()
    outputs = algorithm(*(Counted(number("input", value), tally) for value in inputs))
    return tuple(_plain(value) for value in outputs), tally


def cycles(tally, costs=CORTEX_M4F):
    """Return the cycles of a Counter of operations.

    Raises
    ------
    ValueError
        If an operation has no cost.
    """
    unknown = sorted(set(tally) - set(costs))
    if unknown:
        raise ValueError(f"costs has no entry for {unknown[0]!r}: must have one for each operation counted")
    return sum(costs[kind] * count for kind, count in tally.items())
