"""How far printed numbers determine omitted ones: what stays open, and along which directions.

A set of consistent values is an array over the omitted numbers, NaN where the print forbids the combination.
"""

from itertools import combinations
from typing import NamedTuple

import numpy as np

from drivelib.validation import array, number

ROUNDING = 1e-9  # part of a direction below which it counts as none


def spread(values, printed=()):
    """Return (median, worst) of the largest over the smallest consistent value that remain when some numbers are printed.

    Parameters
    ----------
    values : array_like
        A positive result over the omitted numbers, one axis each; NaN where the combination is not consistent.
    printed : sequence of int
        The axes whose number is printed. For each of its values with something consistent the others stay free.

    Raises
    ------
    ValueError
        If nothing is consistent, a value is not positive, or an axis does not exist.
    """
    values = np.asarray(values, dtype=float)
    printed = tuple(number("printed", axis, at_least=0, at_most=values.ndim - 1, whole=True) for axis in printed)
    if not np.isfinite(values).any():
        raise ValueError("values: no combination is consistent with what is printed; the print contradicts itself or the limits")
    array("values", values[np.isfinite(values)], above=0)
    open_axes = tuple(axis for axis in range(values.ndim) if axis not in printed)
    high = np.max(np.where(np.isfinite(values), values, -np.inf), axis=open_axes)
    low = np.min(np.where(np.isfinite(values), values, np.inf), axis=open_axes)
    there = np.isfinite(low)
    ratio = high[there] / low[there]
    return float(np.median(ratio)), float(np.max(ratio))


def sensitivity(function, values, *, step=1e-3):
    """Return ∂ log(results)/∂ log(values) by central differences.

    Parameters
    ----------
    function : callable
        Takes the values as arguments, returns the results, all positive.
    values : sequence of float
        Positive.
    step : float
        Relative step; large enough for the function's noise, small enough for its curvature.

    Returns
    -------
    ndarray, shape (results, values)
    """
    values, step = array("values", values, above=0), number("step", step, above=0, at_most=0.1)
    columns = []
    for k in range(values.size):
        ends = []
        for side in (1, -1):
            moved = values.copy()
            moved[k] *= np.exp(side * step)
            ends.append(np.log(array("results", function(*moved.tolist()), above=0)))
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.stack(columns, axis=-1)


class Directions(NamedTuple):
    """Directions among the logarithms of omitted numbers, the best determined first.

    ``moved``: half digits of the printed numbers (root of the sum of squares) that a change by the factor along each moves;
    ``open``: how many move less than one; ``determined``: for each number, whether none of the open ones changes it.
    """

    moved: np.ndarray
    open: int
    determined: np.ndarray


def directions(matrix, halves, factor):
    """Return the `Directions` that printed results determine, and how many they leave open.

    Parameters
    ----------
    matrix : array_like, shape (results, values)
        Of `sensitivity`.
    halves : array_like, shape (results,)
        Half a unit of the last digit over the printed number, each.
    factor : float
        Change along a direction of unit length in the logarithms that must show, above 1.

    Raises
    ------
    ValueError
        If shapes do not match or a number is out of range.
    """
    scaled = _in_half_digits(matrix, halves, factor)
    _, singular, vectors = np.linalg.svd(scaled, full_matrices=True)
    moved = np.zeros(scaled.shape[1])
    moved[: singular.size] = singular
    unseen = moved < 1
    share = np.sum(vectors[unseen] ** 2, axis=0)  # of the span: the basis inside it is arbitrary
    return Directions(moved, int(unseen.sum()), share < ROUNDING)


def what_to_print(matrix, halves, factor, names):
    """Return the smallest sets of omitted numbers which, once printed, leave no direction open: the best determined first.

    Parameters
    ----------
    matrix, halves, factor
        As for `directions`.
    names : sequence of str
        Of the omitted numbers.

    Returns
    -------
    list of (tuple of str, float)
        Names, and how many half digits the least determined direction of all others moves.

    Raises
    ------
    ValueError
        If shapes do not match.
    """
    scaled = _in_half_digits(matrix, halves, factor)
    if len(names) != scaled.shape[1]:
        raise ValueError(f"names has {len(names)} entries: must have {scaled.shape[1]}, one per omitted number")
    for size in range(scaled.shape[1]):
        sets = list(combinations(range(scaled.shape[1]), size))
        rest = np.stack([np.delete(scaled, one, axis=1) for one in sets])
        if rest.shape[2] > rest.shape[1]:
            continue  # more numbers than results
        least = np.linalg.svd(rest, compute_uv=False)[:, -1]
        found = [(tuple(names[k] for k in one), float(f"{moved:.4g}")) for one, moved in zip(sets, least, strict=True) if moved >= 1]
        if found:
            return sorted(found, key=lambda entry: (-entry[1], entry[0]))
    return [(tuple(names), np.inf)]


def _in_half_digits(matrix, halves, factor):
    matrix, halves = array("matrix", matrix), array("halves", halves, above=0)
    if matrix.ndim != 2 or halves.shape != matrix.shape[:1]:
        raise ValueError(f"matrix has shape {matrix.shape}, halves {halves.shape}: must be (results, values) and (results,)")
    return np.log(number("factor", factor, above=1)) * matrix / halves[:, None]
