"""Checks shared by every public function: bad input fails with name, value, unit and allowed range."""

import difflib
import math

import numpy as np


def number(name, value, unit="", *, above=None, at_least=None, at_most=None, whole=False):
    """Return ``value`` if it is a finite real scalar inside the range.

    Raises
    ------
    ValueError
        Naming the parameter, its value, unit and allowed range.

    Examples
    --------
    >>> number("R_s", 4.3, "ohm", at_least=0)
    4.3
    >>> number("R_s", -1, "ohm", at_least=0)
    Traceback (most recent call last):
    ValueError: R_s = -1 ohm: must be a finite number at least 0 ohm
    """
    # Half of an ensemble's time would go into these checks with NumPy's, which are made for arrays.
    plain = type(value) in (float, int)
    if not plain and (isinstance(value, bool | np.bool_) or not np.isscalar(value) or not np.isreal(value)):
        raise ValueError(f"{name} = {value!r}: must be a real number{_limits(above, at_least, at_most, unit) or _in(unit)}")
    good = -math.inf < value < math.inf and (not whole or value == int(value))
    good = good and (above is None or value > above) and (at_least is None or value >= at_least) and (at_most is None or value <= at_most)
    if not good:
        limits = _limits(above, at_least, at_most, unit)
        raise ValueError(f"{name} = {value}{_space(unit)}: must be a finite {'whole ' if whole else ''}number{limits}")
    return int(value) if whole else float(value)


def array(name, value, unit="", *, above=None, at_least=None, at_most=None):
    """Return ``value`` as a float array if every element is finite and inside the range.

    Raises
    ------
    ValueError
        Naming the parameter, the first offending element, unit and allowed range.
    """
    values = _real(name, value, unit)
    good = math.isfinite(values) if values.ndim == 0 else np.isfinite(values).all()
    good = good and (above is None or (values > above).all())
    if good and (at_least is None or (values >= at_least).all()) and (at_most is None or (values <= at_most).all()):
        return values
    bad = ~np.isfinite(values) | _outside(values, above, at_least, at_most)
    index = tuple(int(i) for i in np.argwhere(bad)[0])
    where = f" at index {index[0] if len(index) == 1 else index}" if index else ""
    raise ValueError(f"{name} = {values[index]}{_space(unit)}{where}: must be finite{_and(_limits(above, at_least, at_most, unit))}")


def grid(name, value, unit="s"):
    """Return ``value`` as a strictly increasing one-dimensional array of at least two elements.

    Raises
    ------
    ValueError
        If it is empty, too short, not finite or not sorted.
    """
    values = _real(name, value, unit)
    if values.ndim != 1 or values.size < 2:
        raise ValueError(f"{name} has shape {values.shape}: must be a one-dimensional grid of at least two values in {unit}")
    array(name, values, unit)
    steps = values[1:] - values[:-1]
    if not (steps > 0).all():
        index = int(np.argmax(steps <= 0))
        raise ValueError(
            f"{name}[{index + 1}] = {values[index + 1]} {unit} does not lie above {name}[{index}] = {values[index]} {unit}: "
            "must be sorted and strictly increasing"
        )
    return values


def choice(name, value, allowed):
    """Return ``value`` if it is one of ``allowed``.

    Raises
    ------
    ValueError
        Naming the allowed values and the nearest of them.
    """
    if value not in allowed:
        raise ValueError(f"{name} = {value!r}: must be one of {', '.join(map(repr, allowed))}{nearest(str(value), allowed)}")
    return value


def nearest(name, known):
    """Return a sentence that suggests the nearest known names, or nothing."""
    close = difflib.get_close_matches(name, [str(item) for item in known], n=3, cutoff=0.5)
    return f". Did you mean {' or '.join(close)}?" if close else ""


def _real(name, value, unit):
    try:
        return np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} = {value!r}: must be a real number or an array of them{_in(unit)}") from None


def _outside(value, above, at_least, at_most):
    outside = np.zeros(np.shape(value), dtype=bool)
    if above is not None:
        outside |= ~(np.asarray(value) > above)
    if at_least is not None:
        outside |= ~(np.asarray(value) >= at_least)
    if at_most is not None:
        outside |= ~(np.asarray(value) <= at_most)
    return outside


def _limits(above, at_least, at_most, unit):
    parts = []
    if above is not None:
        parts.append(f"above {above:g}{_space(unit)}")
    if at_least is not None:
        parts.append(f"at least {at_least:g}{_space(unit)}")
    if at_most is not None:
        parts.append(f"at most {at_most:g}{_space(unit)}")
    return " " + " and ".join(parts) if parts else ""


def _and(limits):
    return f" and{limits}" if limits else ""


def _in(unit):
    return f" in {unit}" if unit else ""


def _space(unit):
    return f" {unit}" if unit else ""
