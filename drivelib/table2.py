"""What Zidani's table II says about itself, and which PI loops and loads could have made its rows.

A load step ΔT on the PI loop of (18)–(20) leaves, with a = ΔT/J and friction neglected, the error
e(s) = a/(s² + 2ξω_n s + ω_n²). Its integrals have closed forms; N equal steps far apart give N times each.
IAE and ISE of a row then fix (ω_n, a) for every (ξ, N): the row identifies a family, not a point.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from drivelib.validation import number


class Printed(NamedTuple):
    """One row as printed, each index with half a unit of its last digit: (value, half)."""

    IAE: tuple
    ISE: tuple
    ITAE: tuple

    def ratio(self):
        """Return (lowest, nominal, highest) ITAE/IAE (s) that rounding allows.

        Examples
        --------
        The PI row of table II: an ITAE of 1.0530 over an IAE of 0.5265 is a horizon of 2 s.

        >>> row = Printed(IAE=(0.5265, 0.00005), ISE=(1.4960, 0.00005), ITAE=(1.0530, 0.00005))
        >>> print(" to ".join(f"{value:.3f}" for value in row.ratio()[::2]))
        2.000 to 2.000
        """
        (a, da), (t, dt) = self.IAE, self.ITAE
        return (t - dt) / (a + da), t / a, (t + dt) / (a - da)

    def duration(self):
        """Return (lowest, nominal, highest) IAE²/ISE (s): the least horizon, and how long a constant error would act."""
        (a, da), (s, ds) = self.IAE, self.ISE
        return (a - da) ** 2 / (s + ds), a**2 / s, (a + da) ** 2 / (s - ds)

    def consistent(self, horizon):
        """Return the IAE (rad) in the middle of what the roundings of IAE and of ITAE = horizon · IAE both allow.

        Raises
        ------
        ValueError
            If they allow none.
        """
        (a, da), (t, dt) = self.IAE, self.ITAE
        low, high = max(a - da, (t - dt) / horizon), min(a + da, (t + dt) / horizon)
        if low > high:
            raise ValueError(f"horizon = {horizon:g} s: must make ITAE/horizon meet IAE = {a:g} ± {da:g} rad")
        return 0.5 * (low + high)

    def mean_error(self):
        """Return ISE/IAE (rad/s), the error weighted by itself: what a constant error would be."""
        return self.ISE[0] / self.IAE[0]


class LoadStep(NamedTuple):
    """Indices of one load step: IAE (rad), ISE (rad²/s), and the mean time ∫t|e|/∫|e| after it (s)."""

    IAE: float
    ISE: float
    mean_time: float


def load_step(omega_n, xi, a):
    """Return the LoadStep of a PI loop, horizon without end.

    Parameters
    ----------
    omega_n, xi : float
        Natural frequency (rad/s) and damping, both positive.
    a : float
        Load step over inertia (rad/s²).

    Notes
    -----
    ISE = a²/(4ξω_n³) for every ξ. The error keeps its sign from ξ = 1 on: IAE = a/ω_n², mean time 2ξ/ω_n. Below, half waves
    shrink by q = exp(−πξ/√(1−ξ²)): IAE = a/ω_n² · (1 + q)/(1 − q).

    Raises
    ------
    ValueError
        If an input is not positive.
    """
    omega_n, xi = number("omega_n", omega_n, "rad/s", above=0), number("xi", xi, above=0)
    a = number("a", a, "rad/s²", above=0)
    ISE = a**2 / (4.0 * xi * omega_n**3)
    if xi >= 1.0:
        return LoadStep(a / omega_n**2, ISE, 2.0 * xi / omega_n)
    root = math.sqrt(1.0 - xi**2)
    q = math.exp(-math.pi * xi / root)
    half_wave = math.pi / (omega_n * root)
    within = 2.0 * xi / omega_n + half_wave * q / (1.0 + q)  # mean time of the first half wave
    return LoadStep(a / omega_n**2 * (1.0 + q) / (1.0 - q), ISE, within + half_wave * q / (1.0 - q))


class Member(NamedTuple):
    """One PI loop that meets a row: ω_n (rad/s), ξ, number of load steps, ΔT/J (rad/s²), peak of |T_e| over ΔT."""

    omega_n: float
    xi: float
    steps: int
    a: float
    torque_peak: float


def member(IAE, ISE, xi, steps=1):
    """Return the Member of the family for a damping and a number of equal load steps, in closed form.

    The first step starts at no load; the torque passes the load by exp(−ξ acos(2ξ²−1)/√(1−ξ²)) (ξ < 1).
    With further steps, on and off in turn, the same overshoot falls below zero, never above the peak.
    """
    IAE, ISE = number("IAE", IAE, "rad", above=0), number("ISE", ISE, "rad²/s", above=0)
    steps = number("steps", steps, at_least=1, whole=True)
    unit = load_step(1.0, xi, 1.0)  # IAE = c a/ω², ISE = a²/(4ξω³)
    omega_n = 4.0 * xi * unit.IAE**2 * steps * ISE / IAE**2
    return Member(omega_n, float(xi), steps, IAE * omega_n**2 / (steps * unit.IAE), 1.0 + _torque_overshoot(xi))


def _torque_overshoot(xi):
    """Overshoot of C/C_r = (2ξω_n s + ω_n²)/(s² + 2ξω_n s + ω_n²), the loop's answer to a unit load."""
    if xi < 1.0:
        root = math.sqrt(1.0 - xi**2)
        return math.exp(-xi * 2.0 * math.acos(xi) / root)
    if xi == 1.0:
        return math.exp(-2.0)
    p, q = xi - math.sqrt(xi**2 - 1.0), xi + math.sqrt(xi**2 - 1.0)
    t = 2.0 * math.log(q / p) / (q - p)  # where p² e^{−pt} = q² e^{−qt}
    return (q * math.exp(-q * t) - p * math.exp(-p * t)) / (p - q)


def least_step(IAE, ISE, steps=1):
    """Return (ξ, ΔT/J) of the smallest load step that any member of the family needs (rad/s²)."""
    found = minimize_scalar(lambda xi: member(IAE, ISE, xi, steps).a, bounds=(0.2, 1.5), method="bounded", options={"xatol": 1e-10})
    return float(found.x), float(found.fun)


def stiffness(row, a):
    """Return the proportional gain over inertia (1/s) that leaves the row's mean error under a load a = ΔT/J (rad/s²)."""
    return number("a", a, "rad/s²", above=0) / row.mean_error()


def load_instant(row, mean_time):
    """Return when the load must come on for ITAE/IAE to be a true mean time: (instant, half the range that rounding leaves) (s).

    Parameters
    ----------
    row : Printed
    mean_time : float
        Of the error after the load comes on (s): of a transient, or half of the time for which a constant error acts.
    """
    low, nominal, high = row.ratio()
    return nominal - number("mean_time", mean_time, "s", at_least=0), 0.5 * (high - low)


def chance_of_integers(rows):
    """Return the probability that every row's ITAE/IAE lies as near a whole number as rounding allows, were it of any size."""
    return float(np.prod([high - low for low, _, high in (row.ratio() for row in rows)]))


def overdamped(IAE, ISE, a):
    """Return (K_p/J, K_i/J) (1/s, 1/s²) of the PI that meets IAE and ISE under one load step a (rad/s²), ξ > 1.

    From the closed forms: ω_n = 4ξ ISE/IAE² and a = IAE ω_n², hence ξ; then K_p/J = 2ξω_n, K_i/J = ω_n².

    Raises
    ------
    ValueError
        If the load is so small that ξ would be below 1.
    """
    omega_n = math.sqrt(number("a", a, "rad/s²", above=0) / number("IAE", IAE, "rad", above=0))
    xi = omega_n * IAE**2 / (4.0 * number("ISE", ISE, "rad²/s", above=0))
    if xi < 1.0:
        raise ValueError(f"a = {a:g} rad/s²: must be at least {16 * ISE**2 / IAE**3:g} rad/s², or the loop oscillates")
    return 2.0 * xi * omega_n, omega_n**2
