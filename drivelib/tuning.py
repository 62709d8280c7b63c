"""Tune controllers with one budget, and say whose compromises are better: Pareto fronts and what covers what.

    found = search(function, (Range("K_p", 1, 100, "N m s/rad"), …), budget=512, seed=1)
    found.best, found.results[pareto_front(found.results)]
"""

import math
from dataclasses import dataclass

import numpy as np

from drivelib.validation import number

SMALLEST = 64  # evaluations: below, neither half of the search is one
POPULATION = 16


@dataclass(frozen=True)
class Range:
    """One number to tune: its name, ends and unit; searched evenly in its logarithm unless ``linear``."""

    name: str
    low: float
    high: float
    unit: str = ""
    linear: bool = False

    def __post_init__(self):
        bound = {} if self.linear else {"above": 0}
        low = number(f"low end of {self.name}", self.low, self.unit, **bound)
        number(f"high end of {self.name}", self.high, self.unit, above=low)

    def at(self, share):
        """Return the value at a share (0 to 1) of the range."""
        if self.linear:
            return self.low + share * (self.high - self.low)
        return self.low * math.exp(share * math.log(self.high / self.low))


@dataclass(frozen=True)
class Found:
    """Every evaluation of a search, in order.

    Attributes
    ----------
    values : ndarray, shape (budget, ranges)
    results : ndarray, shape (budget, objectives)
        As the function returned them.
    scores : ndarray, shape (budget,)
    """

    ranges: tuple
    values: np.ndarray
    results: np.ndarray
    scores: np.ndarray

    @property
    def best(self):
        """Values of the lowest score, by name; of equal ones the first."""
        return dict(zip((entry.name for entry in self.ranges), self.values[np.argmin(self.scores)].tolist(), strict=True))


def search(function, score, ranges, *, budget, seed):
    """Return the `Found` of exactly ``budget`` evaluations: half a Sobol sample, half differential evolution from its best.

    Parameters
    ----------
    function : callable
        Takes the values as keywords, returns the objectives (a sequence of numbers, smaller is better). A candidate
        that fails returns infinities: it is kept and never chosen.
    score : callable
        Takes the objectives, returns the number to minimise; infinity is allowed, NaN is not.
    ranges : sequence of Range
    budget : int
        Evaluations, the same for any number of ranges: a multiple of 32, at least 64.
    seed : int

    Raises
    ------
    ValueError
        If the budget is too small or no such multiple, there is no range, or a score is NaN.

    References
    ----------
    R. Storn and K. Price, "Differential evolution", J. Global Optimization 11, 1997, doi:10.1023/A:1008202821328.
    """
    from scipy.optimize import differential_evolution
    from scipy.stats import qmc

    budget = number("budget", budget, "evaluations", at_least=SMALLEST, whole=True)
    seed = number("seed", seed, at_least=0, whole=True)
    if budget % (2 * POPULATION):
        raise ValueError(f"budget = {budget} evaluations: must be a multiple of {2 * POPULATION}, two halves of whole generations")
    ranges = tuple(ranges)
    if not ranges:
        raise ValueError("ranges is empty: there is nothing to tune")
    values, results, scores = [], [], []

    def evaluate(shares):
        values.append([entry.at(float(share)) for entry, share in zip(ranges, shares, strict=True)])
        results.append(function(**dict(zip((entry.name for entry in ranges), values[-1], strict=True))))
        scores.append(float(score(results[-1])))
        if math.isnan(scores[-1]):
            raise ValueError(f"score is NaN at {values[-1]}: a candidate that fails must score infinity")
        return min(scores[-1], 1e30)  # the evolution compares finite numbers

    half = budget // 2
    sample = qmc.Sobol(len(ranges), rng=np.random.default_rng(seed)).random_base2(math.ceil(math.log2(half)))[:half]
    first = [evaluate(shares) for shares in sample]
    start = sample[np.argsort(first, kind="stable")[:POPULATION]]
    differential_evolution(
        evaluate, [(0.0, 1.0)] * len(ranges), init=start, maxiter=half // POPULATION - 1, tol=0.0, atol=0.0, polish=False,
        rng=np.random.default_rng(seed + 1), callback=lambda *_: False,
    )  # fmt: skip
    for _ in range(budget - len(scores)):  # a population that has become one point stops early: the rest of its budget
        evaluate(np.random.default_rng((seed, len(scores))).random(len(ranges)))
    return Found(ranges, np.array(values), np.array(results, dtype=float), np.array(scores))


def pareto_front(points):
    """Return which points no other one dominates: none is as good in every objective and better in one.

    Parameters
    ----------
    points : array, shape (n, objectives)
        Smaller is better. A row with an infinity or NaN is never on the front.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    points = _points("points", points)
    sound = np.isfinite(points).all(axis=1)
    front = sound.copy()
    front[sound] = ~_dominated(points[sound], points[sound])
    return front


def coverage(ours, theirs):
    """Return the share of the points ``theirs`` that some point of ``ours`` dominates (0 to 1).

    The measure C of Zitzler and Thiele, with strict dominance: sets that are the same cover nothing of each other.

    Raises
    ------
    ValueError
        If a set is empty, holds no finite row, or the objectives differ in number.

    References
    ----------
    E. Zitzler and L. Thiele, IEEE Trans. Evolutionary Computation 3(4), 1999, doi:10.1109/4235.797969.
    """
    sets = [_points("ours", ours), _points("theirs", theirs)]
    ours, theirs = (points[np.isfinite(points).all(axis=1)] for points in sets)
    if not len(ours) or not len(theirs) or ours.shape[1] != theirs.shape[1]:
        raise ValueError(f"ours and theirs have {ours.shape} and {theirs.shape} finite rows and columns: must be at least one row, equal columns")
    return float(np.mean(_dominated(theirs, ours)))


def _points(name, points):
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or not points.size:
        raise ValueError(f"{name} has shape {points.shape}: must be (points, objectives), neither of them 0")
    return points


def _dominated(points, by):
    """Return which of ``points`` are dominated by a row of ``by``; both finite."""
    found = np.empty(len(points), dtype=bool)
    for k, point in enumerate(points):
        found[k] = np.any(np.all(by <= point, axis=1) & np.any(by < point, axis=1))
    return found
