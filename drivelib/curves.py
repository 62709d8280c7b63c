"""Small questions to curves: where they bend, and where they cross a limit."""

import numpy as np

from drivelib.validation import array, number


def interior_minima(values):
    """Return the number of interior local minima along the last axis of ``values`` (shape (..., n), n ≥ 3).

    A minimum at either end does not count, a flat bottom counts once.

    Raises
    ------
    ValueError
        If fewer than three points are given or one is not finite.

    Examples
    --------
    >>> print(interior_minima([3, 1, 2, 0, 0, 4]), interior_minima([0, 1, 2]))
    2 0
    """
    values = np.atleast_1d(array("values", values))
    if values.shape[-1] < 3:
        raise ValueError(f"values has {values.shape[-1]} points: at least 3 are needed")
    sign = np.sign(np.diff(values, axis=-1))
    for step in range(1, sign.shape[-1]):  # a flat piece continues what came before it
        flat = sign[..., step] == 0
        sign[..., step] = np.where(flat, sign[..., step - 1], sign[..., step])
    return np.sum((sign[..., :-1] < 0) & (sign[..., 1:] > 0), axis=-1)


def last_below(function, limit, low, high, *, steps=60):
    """Return the largest x in [low, high] with function(x) ≤ limit, for a rising function, by bisection.

    Arrays broadcast. NaN where the function exceeds the limit already at ``low``; ``high`` where it never does,
    also for an infinite limit; NaN for a limit that is NaN.

    Raises
    ------
    ValueError
        If ``low`` exceeds ``high`` or one of them is not finite.
    """
    number("steps", steps, "", at_least=1, whole=True)
    low, high = array("low", low), array("high", high)
    low, high, limit = (np.array(values, dtype=float) for values in np.broadcast_arrays(low, high, limit))
    if np.any(low > high):
        raise ValueError(f"low = {low[low > high].flat[0]:g} lies above high = {high[low > high].flat[0]:g}: must be at most high")
    never, start = function(high) <= limit, function(low) <= limit
    top = high.copy()
    for _ in range(steps):
        middle = (low + high) / 2
        inside = function(middle) <= limit
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return np.where(start, np.where(never, top, low), np.nan)


def least_between(function, low, high, *, steps=64):
    """Return where a convex function is least in [low, high], elementwise, by golden section.

    Arrays broadcast. The place is found to the square root of the rounding error, as any search by values is; the
    function's value there is exact to rounding.

    Raises
    ------
    ValueError
        If ``low`` exceeds ``high`` or one of them is not finite.
    """
    number("steps", steps, "", at_least=1, whole=True)
    low, high = np.broadcast_arrays(array("low", low), array("high", high))
    if np.any(low > high):
        raise ValueError(f"low = {low[low > high].flat[0]:g} lies above high = {high[low > high].flat[0]:g}: must be at most high")
    ratio = (np.sqrt(5) - 1) / 2
    left, right = high - ratio * (high - low), low + ratio * (high - low)
    at_left, at_right = function(left), function(right)
    for _ in range(steps):
        keep_low = at_left <= at_right
        low, high = np.where(keep_low, low, left), np.where(keep_low, right, high)
        new = np.where(keep_low, high - ratio * (high - low), low + ratio * (high - low))
        value = function(new)
        left, right, at_left, at_right = (
            np.where(keep_low, new, right), np.where(keep_low, left, new),
            np.where(keep_low, value, at_right), np.where(keep_low, at_left, value),
        )  # fmt: skip
    return (low + high) / 2
