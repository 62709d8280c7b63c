"""When a signal has settled after a step: what stands behind a paper's "fast"."""

import numpy as np

from drivelib.validation import array, grid, number


def settling_time(t, y, target, band, t_step, t_end=None):
    """Return how long after ``t_step`` the signal enters ``target`` ± ``band`` for good (s).

    Parameters
    ----------
    t : array_like, shape (n,)
        Sample times (s), strictly increasing.
    y : array_like, shape (n,)
        Signal.
    target : float or array_like, shape (n,)
        Where it should go, in the unit of y; an array where the goal itself moves.
    band : float
        Half width of the band, same unit, positive.
    t_step : float
        Time of the step (s).
    t_end : float, optional
        The last sample that counts lies below this time (s), say that of the next step. By default the whole record counts.

    Returns
    -------
    float
        From the step to the first sample after the last one outside the band; 0 if none at or after the
        step lies outside; NaN if the last one does, so that the signal has not settled.

    Raises
    ------
    ValueError
        If shapes differ, a value is not finite, or no sample lies in the window.
    """
    t, y = grid("t", t), array("y", y)
    target = array("target", target)
    band = number("band", band, above=0)
    t_step = number("t_step", t_step, "s", at_least=t[0], at_most=t[-1])
    t_end = np.inf if t_end is None else number("t_end", t_end, "s", above=t_step)
    if y.shape != t.shape or target.shape not in ((), t.shape):
        raise ValueError(f"y has shape {y.shape} and target {target.shape}: y must have t's shape {t.shape}, target that or none")
    # A sample computed as k × period may lie a rounding error before the step it belongs to.
    counted = (t >= t_step - 1e-9 * (t[1] - t[0])) & (t < t_end)
    if not np.any(counted):
        raise ValueError(f"t_end = {t_end:g} s: no sample lies between t_step = {t_step:g} s and it")
    outside = np.abs(y - target)[counted] > band
    if not np.any(outside):
        return 0.0
    if outside[-1]:
        return float("nan")
    return float(t[counted][np.flatnonzero(outside)[-1] + 1] - t_step)
