"""Thin out long records for figures and CSV files: smallest and largest sample of each stretch of time stay.

Metrics never come from a thinned record.
"""

import numpy as np

from drivelib.validation import grid, number


def keep_extremes(t, series, buckets, *, zooms=()):
    """Return the indices of the samples to keep: first, last, and each series' extremes in each bucket.

    Parameters
    ----------
    t : array, shape (n,)
        Sample times (s), increasing.
    series : sequence of array, shape (n,)
        The curves that share the time axis; all are taken at the indices returned.
    buckets : int
        Number of equal stretches of time into which the record is cut.
    zooms : sequence of (start, end, buckets)
        Windows (s) that are cut more finely, for insets.

    Returns
    -------
    ndarray of int
        Increasing, at most 2 + 2 (buckets + those of the zooms) per series.

    Raises
    ------
    ValueError
        If the time grid is not increasing, a series differs in length, or a bucket number is not positive.

    Examples
    --------
    One spike in a thousand samples survives a cut to four pieces:

    >>> t, spike = np.arange(1000.0), np.zeros(1000)
    >>> spike[437] = 1.0
    >>> 437 in keep_extremes(t, [spike], 4)
    True
    """
    t = grid("t", t)
    series = [np.asarray(values, dtype=float) for values in series]
    for values in series:
        if values.shape != t.shape:
            raise ValueError(f"a series has shape {values.shape}: must be {t.shape}, as t")
    kept = [np.array([0, t.size - 1])]
    for start, end, number_of_buckets in ((t[0], t[-1], buckets), *zooms):
        edges = np.linspace(start, end, number("buckets", number_of_buckets, at_least=1, whole=True) + 1)
        bounds = np.searchsorted(t, edges)
        for low, high in zip(bounds[:-1], bounds[1:], strict=True):
            if high > low:
                kept += [low + np.array([values[low:high].argmin(), values[low:high].argmax()]) for values in series]
    return np.unique(np.concatenate(kept))
