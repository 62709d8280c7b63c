"""Controllers of the doubly fed drive: gains by pole placement, and one step of each as a scalar function.

The ``…_step``-like functions at the end are compiled inside the drive loop and check nothing.

Speed loop. With torque as the controller's output, (5) gives Ω(s)/C(s) = 1/(J s + f); poles at natural
frequency ω_n and damping ξ need K_p = 2 ξ ω_n J − f and K_i = J ω_n². Zidani's (19)–(20) write
K_m = P/c and T_m = J/c with an undefined c: the plant would be P/(J s + c), so that with c = f the
printed gains are these divided by P, right only if P times the output is the torque.
"""

import math
from typing import NamedTuple

from drivelib.validation import number


class PiGains(NamedTuple):
    """Proportional and integral gain: output per unit of error, and per unit of error and second."""

    K_p: float
    K_i: float


def speed_gains(J, f, omega_n, xi):
    """Return the speed controller's PiGains (N m s/rad, N m/rad): eq. (20) with torque output.

    Parameters
    ----------
    J, f : float
        Inertia (kg m²), positive, and viscous friction (N m s), at least 0.
    omega_n, xi : float
        Natural frequency (rad/s) and damping of the closed loop, positive.

    Raises
    ------
    ValueError
        If an input is out of range, or the poles asked for are slower than friction alone makes them
        (K_p would not be positive).

    Examples
    --------
    K_p = 2 · 0.7 · 20 rad/s · 0.2 kg m², K_i = 0.2 kg m² · (20 rad/s)²:

    >>> gains = speed_gains(J=0.2, f=0.0, omega_n=20.0, xi=0.7)
    >>> print(f"{gains.K_p:.2f} N m s/rad, {gains.K_i:.2f} N m/rad")
    5.60 N m s/rad, 80.00 N m/rad
    """
    J, f = number("J", J, "kg m²", above=0), number("f", f, "N m s", at_least=0)
    omega_n, xi = number("omega_n", omega_n, "rad/s", above=0), number("xi", xi, above=0)
    K_p = 2.0 * xi * omega_n * J - f
    if K_p <= 0:
        raise ValueError(
            f"omega_n = {omega_n:g} rad/s with xi = {xi:g}: 2 xi omega_n must be above f/J = {f / J:g} rad/s, or K_p is not positive"
        )
    return PiGains(K_p, J * omega_n**2)


def printed_speed_gains(J, c, p, omega_n, xi):
    """Return the PiGains of eq. (20) as printed, with K_m = p/c and T_m = J/c. For the errata.

    They are ``speed_gains`` divided by p if c is the friction.

    Raises
    ------
    ValueError
        If an input is out of range; c = 0 too, since (19) divides by it.
    """
    J, c = number("J", J, "kg m²", above=0), number("c", c, "N m s", above=0)
    p = number("p", p, "pole pairs", at_least=1, whole=True)
    omega_n, xi = number("omega_n", omega_n, "rad/s", above=0), number("xi", xi, above=0)
    K_m, T_m = p / c, J / c
    return PiGains((2.0 * xi * omega_n * T_m - 1.0) / K_m, T_m * omega_n**2 / K_m)


def speed_transfer_function(gains, J, f):
    """Return numerator and denominator (powers of s, highest first) of Ω(s)/Ω*(s): eq. (19) with torque output.

    The zero at −K_i/K_p makes a reference step overshoot even at ξ = 1.
    """
    return (gains.K_p / J, gains.K_i / J), (1.0, (f + gains.K_p) / J, gains.K_i / J)


def current_gains(R, L_sigma, bandwidth):
    """Return the PiGains (ohm, ohm/s) of one current loop on the plant 1/(R + σL s) of eq. (15).

    The controller's zero cancels the plant's pole, what remains is bandwidth/(s + bandwidth):
    K_p = bandwidth σL, K_i = bandwidth R.

    Parameters
    ----------
    R : float
        Resistance of the winding (ohm), positive.
    L_sigma : float
        Leakage inductance σ L_s or σ L_r (H), positive.
    bandwidth : float
        Of the closed loop (rad/s), positive.

    Raises
    ------
    ValueError
        If an input is out of range.
    """
    R, L_sigma = number("R", R, "ohm", above=0), number("L_sigma", L_sigma, "H", above=0)
    bandwidth = number("bandwidth", bandwidth, "rad/s", above=0)
    return PiGains(bandwidth * L_sigma, bandwidth * R)


def pi_output(error, integral, K_p):
    """Return the output of a PI controller whose integral term is ``integral``, in output units."""
    return K_p * error + integral


def pi_integral(integral, error, output, realised, K_i, tracking, period):
    """Return the integral term for the next sample, by back-calculation.

    Where a limit held the output at ``realised``, the integral follows what the plant really got.
    ``tracking`` (1/s) is how fast; K_i/K_p, the controller's own zero, leaves no parameter to choose.
    """
    return integral + period * (K_i * error + tracking * (realised - output))


def clip(value, limit):
    """Return ``value`` held within ±limit; NaN passes, so that a diverged loop shows."""
    if value > limit:
        return limit
    if value < -limit:
        return -limit
    return value


def clip_vector(d, q, limit):
    """Return the vector (d, q), shortened to the length ``limit`` where it is longer."""
    squared = d * d + q * q
    if squared <= limit * limit:
        return d, q
    scale = limit / math.sqrt(squared)
    return d * scale, q * scale


EQUAL_SPLIT = 0
CONSTANT_ROTOR_FREQUENCY = 1
FREQUENCY_LAWS = {"equal split": EQUAL_SPLIT, "constant rotor frequency": CONSTANT_ROTOR_FREQUENCY}


def stator_frequency(law, omega_e, omega_r_constant):
    """Return ω_s* (rad/s), the stator's share of the electrical rotor speed ω_e = p Ω (rad/s).

    Law 0, equal split: ω_s* = ω_e/2, so that ω_r* = −ω_e/2. Law 1, constant rotor frequency:
    ω_s* = ω_e + ω_r_constant. The paper names none; torque and speed do not depend on it.
    """
    return 0.5 * omega_e if law == EQUAL_SPLIT else omega_e + omega_r_constant


def linear_voltage_limit(V_dc):
    """Return the largest peak phase voltage V_dc/√3 (V) that a three-phase inverter gives at every angle.

    Raises
    ------
    ValueError
        If the dc voltage is not positive.
    """
    return number("V_dc", V_dc, "V", above=0) / math.sqrt(3.0)
