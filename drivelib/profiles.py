"""Piecewise-constant profiles over a run: set points, loads and factors that step at given times."""

import numpy as np

from drivelib.validation import number


def profile(name, value, unit, duration):
    """Return a profile as a tuple of (time in s, value), checked.

    Parameters
    ----------
    name : str
        What messages call it.
    value : float or sequence of (float, float)
        One value for the whole run, or pairs of time and value, the first at 0 s, strictly increasing.
    unit : str
        Of the values.
    duration : float
        Length of the run (s).

    Raises
    ------
    ValueError
        Naming what is wrong with which entry.
    """
    if np.isscalar(value) and not isinstance(value, str):
        value = ((0.0, value),)
    try:
        pairs = tuple((time, entry) for time, entry in value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} = {value!r}: must be a number or a sequence of (time in s, value in {unit})") from None
    if not pairs or pairs[0][0] != 0:
        raise ValueError(f"{name} = {value!r}: must have its first value at 0 s")
    checked = []
    for time, entry in pairs:
        time = number(f"{name}'s time", time, "s", at_least=0, at_most=duration)
        if checked and time <= checked[-1][0]:
            raise ValueError(f"{name}'s time {time:g} s does not lie above {checked[-1][0]:g} s: must be strictly increasing")
        checked.append((time, number(f"{name} at {time:g} s", entry, unit)))
    return tuple(checked)
