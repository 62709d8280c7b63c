"""A space of assumptions: what a study draws from where a paper leaves values open."""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from drivelib.validation import number

TRIES = 10_000


@dataclass(frozen=True)
class Span:
    """Values between ``low`` and ``high``, drawn uniformly, or uniformly in the logarithm."""

    low: float
    high: float
    log: bool = False

    def __post_init__(self):
        low = number("low", self.low, **({"above": 0} if self.log else {}))
        number("high", self.high, at_least=low)

    def draw(self, rng):
        if self.log:
            return float(np.exp(rng.uniform(np.log(self.low), np.log(self.high))))
        return float(rng.uniform(self.low, self.high))


@dataclass(frozen=True)
class Space:
    """Independent assumptions, and a condition that couples them.

    Parameters
    ----------
    assumptions : mapping of str to Span or sequence
        For each name a span, or the values to choose from with equal chance.
    allowed : callable, optional
        Takes a draw (dict) and says whether its values go together.

    Raises
    ------
    ValueError
        If there is no assumption, or one with nothing to choose from.
    """

    assumptions: MappingProxyType
    allowed: object = None

    def __post_init__(self):
        if not self.assumptions:
            raise ValueError("assumptions is empty: there is nothing to draw")
        for name, values in self.assumptions.items():
            if not isinstance(values, Span) and (isinstance(values, str) or len(values) == 0):
                raise ValueError(f"assumption {name} = {values!r}: must be a Span or a sequence of at least one value")
        object.__setattr__(self, "assumptions", MappingProxyType(dict(self.assumptions)))

    def __reduce__(self):
        return type(self), (dict(self.assumptions), self.allowed)

    def draw(self, rng):
        """Return one draw as a dict: the first of the generator's that is allowed.

        Raises
        ------
        ValueError
            If none of ten thousand is: the assumptions contradict one another.
        """
        for _ in range(TRIES):
            values = {name: span.draw(rng) if isinstance(span, Span) else span[int(rng.integers(len(span)))] for name, span in self.assumptions.items()}
            if self.allowed is None or self.allowed(values):
                return values
        raise ValueError(
            f"none of {TRIES} draws of {', '.join(self.assumptions)} is allowed: the assumptions contradict one another, "
            f"the last was {values}"
        )


def open_values(parameters, names=None):
    """Return the spans of a scenario's or machine's values whose origin states a range.

    Parameters
    ----------
    parameters : object with ``origins``
    names : sequence of str, optional
        Only these; by default all that have a range.

    Raises
    ------
    ValueError
        If a name has no range.
    """
    spans = {name: Span(origin.low, origin.high) for name, origin in parameters.origins.items() if origin.low is not None}
    for name in names or ():
        if name not in spans:
            raise ValueError(f"{name}: its origin states no range; those that do are {', '.join(spans)}")
    return {name: spans[name] for name in (names or spans)}
