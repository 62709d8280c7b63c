"""Sets of omitted numbers that a row of Zidani's table II allows, printed digits taken as intervals.

The closed forms are those of ``table2``; here they run over whole families. Load steps of unequal size act like a
number of equal ones in between: (Σ|ΔT|)²/ΣΔT², and none of the family's largest steps can then be smaller.
"""

import math
from typing import NamedTuple

import numpy as np

from drivelib import table2
from drivelib.validation import array, number


class Ranges(NamedTuple):
    """IAE (rad) and ISE (rad²/s) of a row, each (least, greatest)."""

    IAE: tuple
    ISE: tuple


def ranges(row, duration):
    """Return the `Ranges` that a printed row leaves when its ITAE is the horizon (s) times IAE.

    Raises
    ------
    ValueError
        If no IAE meets both, or the ISE so small that the error would have to last longer than the horizon.
    """
    middle = row.consistent(number("duration", duration, "s", above=0))  # raises where the two digits exclude each other
    (a, da), (s, ds), (t, dt) = row
    IAE = max(a - da, (t - dt) / duration), min(a + da, (t + dt) / duration)
    if IAE[0] ** 2 > duration * (s + ds):
        raise ValueError(f"IAE = {middle:g} rad, ISE = {s:g} rad²/s: no error over {duration:g} s has both (Cauchy and Schwarz)")
    return Ranges(IAE, (s - ds, s + ds))


def horizon(row):
    """Return (least, greatest) horizon (s) over which a row can have been taken, ITAE being horizon · IAE.

    Raises
    ------
    ValueError
        If an error with this IAE and ISE lasts longer than any of them (Cauchy and Schwarz).
    """
    low, _, high = row.ratio()
    least = row.duration()[0]
    if least > high:
        raise ValueError(f"ITAE/IAE = {high:g} s at most: IAE and ISE need at least {least:g} s (Cauchy and Schwarz)")
    return max(low, least), high


class PiFamily(NamedTuple):
    """PI loops and loads that meet a row, arrays: ω_n (rad/s), largest ΔT/J (rad/s²) at least, peak torque over J (rad/s²), dip (rad/s)."""

    omega_n: np.ndarray
    a: np.ndarray
    peak: np.ndarray
    dip: np.ndarray


def pi_family(IAE, ISE, xi, steps):
    """Return the `PiFamily` for each IAE (rad), ISE (rad²/s), damping and number of load steps; they broadcast.

    Parameters
    ----------
    steps : array_like
        At least 1, not necessarily whole: unequal steps act like a number in between.

    Notes
    -----
    ω_n ∝ n ISE/IAE² and ΔT/J ∝ n ISE²/IAE³, so the corner (least ISE, greatest IAE) of a row's ranges gives the least
    of both, the opposite corner the greatest. The dip ∝ ISE/IAE does not depend on n.
    """
    IAE, ISE = array("IAE", IAE, "rad", above=0), array("ISE", ISE, "rad²/s", above=0)
    xi, steps = array("xi", xi, above=0), array("steps", steps, at_least=1)
    known, where = np.unique(xi, return_inverse=True)
    unit = np.array([[*_unit(value)] for value in known])[where.reshape(xi.shape)]
    omega_n = steps * ISE / IAE**2 * unit[..., 0]
    a = steps * ISE**2 / IAE**3 * unit[..., 1]
    return PiFamily(*np.broadcast_arrays(omega_n, a, a * unit[..., 2], a / omega_n * unit[..., 3]))


def _unit(xi):
    """Return ω_n, ΔT/J, peak torque over ΔT, dip over (ΔT/J)/ω_n for IAE = ISE = 1 and one step."""
    one = table2.member(1.0, 1.0, float(xi))
    if xi < 1.0:
        root = math.sqrt(1.0 - xi**2)
        dip = math.exp(-xi / root * math.acos(xi))
    elif xi == 1.0:
        dip = math.exp(-1.0)
    else:
        root = math.sqrt(xi**2 - 1.0)
        dip = math.exp(-xi / root * math.acosh(xi))
    return one.omega_n, one.a, one.torque_peak, dip


def slowest_sampling(row, a):
    """Return the longest sample time (s) at which a static map under a load a = ΔT/J (rad/s²) meets a row and is stable.

    The map needs the stiffness ΔT/(mean error); sampled, an inertia behind a current loop carries about 2 J/T_s
    (``table2_fit.largest_stable_stiffness`` measures it). The inertia cancels.
    """
    return 2.0 * row.mean_error() / array("a", a, "rad/s²", above=0)
