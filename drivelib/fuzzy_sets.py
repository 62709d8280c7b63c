"""Figure 5's triangles as functions, and the rules evaluated by plain sampling with them.

``fuzzy`` has the default partition in closed form. Here the partition may be another, since the paper prints
no breakpoints: outermost sets as half or as full triangles, feet nearer or further than the neighbours' peaks.
"""

import numpy as np

from drivelib.fuzzy import LABELS, PEAKS, RULES
from drivelib.validation import array, choice, number

OUTER = ("half", "full")
"""Outermost sets: half triangles that end at ±1, or full ones that reach beyond, which only the output can use."""


def memberships(x, *, reach=1.0):
    """Return the membership of x in each of the seven sets.

    Parameters
    ----------
    x : array_like, shape (n,)
        Normalised value (1); inside [−1, 1] half and full outermost triangles are the same.
    reach : float
        Distance from a peak to its feet, in distances between peaks; 1 puts the feet at the neighbours' peaks.

    Returns
    -------
    ndarray, shape (7, n)
        In the order of ``fuzzy.LABELS``, from 0 to 1.

    Raises
    ------
    ValueError
        If a value is not finite or the reach is not positive.
    """
    reach = number("reach", reach, above=0)
    peaks = np.array(PEAKS)[:, None]
    return np.maximum(1.0 - 3.0 * np.abs(array("x", x)[None, :] - peaks) / reach, 0.0)


def triangles(values, peak_tolerance=1e-12):
    """Return how many of the sampled sets (rows) rise along one straight line to 1, then fall along another to 0.

    Parameters
    ----------
    values : array_like, shape (sets, n)
        Memberships on an evenly spaced universe that holds every peak and every foot.
    peak_tolerance : float
        How far from 1 a peak may be, and from straight a flank.
    """
    count = 0
    for row in np.atleast_2d(array("values", values)):
        top, inside = int(row.argmax()), row > peak_tolerance
        first, last = np.flatnonzero(inside)[[0, -1]]
        flanks = row[max(first - 1, 0) : top + 1], row[top : last + 2]
        straight = all(np.abs(np.diff(flank, 2)).max(initial=0.0) <= peak_tolerance for flank in flanks)
        count += bool(straight and inside[first : last + 1].all() and abs(row[top] - 1.0) <= peak_tolerance)
    return count


def sampled_output(e, de, *, outer="half", reach=1.0, samples=4001):
    """Return the output of the 49 rules by max–min inference and a centroid summed over a sampled universe.

    Parameters
    ----------
    e, de : array_like
        Normalised inputs (1) that broadcast; values beyond ±1 saturate.
    outer : {"half", "full"}
        Outermost sets of the output. Full ones reach a distance between peaks beyond ±1.
    reach : float
        See `memberships`, for inputs and output.
    samples : int
        Points of the universe; the sum is the trapezoidal rule.

    Returns
    -------
    ndarray
        Normalised command u (1), of the broadcast shape.

    Raises
    ------
    ValueError
        If an input is not finite, shapes do not broadcast, or a parameter is out of range.
    """
    choice("outer", outer, OUTER)
    e, de = np.broadcast_arrays(array("e", e), array("de", de))
    edge = 1.0 if outer == "half" else 1.0 + reach / 3.0
    universe = np.linspace(-edge, edge, number("samples", samples, "points", at_least=25, whole=True))
    sets = memberships(universe, reach=reach)
    of_e, of_de = (memberships(np.clip(values.ravel(), -1.0, 1.0), reach=reach) for values in (e, de))
    weights = np.ones(universe.size)
    weights[[0, -1]] = 0.5
    output = np.empty(e.size)
    for n in range(e.size):
        fired = np.minimum(of_e[:, n, None], of_de[None, :, n])
        heights = np.array([fired[RULES == k - 3].max() for k in range(len(LABELS))])
        union = np.minimum(sets, heights[:, None]).max(axis=0) * weights
        output[n] = universe @ union / union.sum()
    return output.reshape(e.shape)
