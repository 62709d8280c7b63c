"""Least copper loss of a DFIM at given torque and speed, inside the limits of two inverters and of the flux.

In rotor-flux orientation (11) a steady point has three free numbers: rotor flux φ, rotor d current u = i_rd (what
the rotor contributes to magnetising) and stator frequency ω_s. With q = i_sq = T/(k_T φ), k_T = 3 p M/(2 L_r),

    i_sd = (φ − L_r u)/M      i_rq = −(M/L_r) q      P = (3/2) [R_s (i_sd² + q²) + R_r (u² + i_rq²)]

Without limits P = (3/2) [A φ² + B/φ²] at the best u, and all is closed form:

    u = R_s L_r φ/N    i_sd = R_r M φ/N    φ² = N |T|/(1.5 p M √(R_s R_r))    P = 2 √(R_s R_r) |T|/(p M),   N = M² R_r + L_r² R_s

Then R_s |i_s|² = R_r |i_r|² and both current vectors stand at right angles. Neither speed nor ω_s enters: copper does
not care how a speed is shared. Iron loss and saturation are not in the model, so the flux has a limit of its own,
and above it φ stays there with the same share u/φ.

The speed is shared by rule, in the ratio of the voltages that the resistances leave: ω_s ρ : −ω_r = V_s − R_s q : V_r − R_r |i_rq|
at the free optimum, ρ = φ_sd/φ at the best u (with equal turns nearly one), ω_s − ω_r = p Ω. Then every limit is convex in (φ, u) and for given φ allows one interval of u, c φ ± √(C − K/φ² − κ φ²)/s:

==================  ====================================  =========  ======================================
limit               C                                     κ          K
==================  ====================================  =========  ======================================
|i_s| ≤ I_s         I_s²                                  0          q²φ²
|i_r| ≤ I_r         I_r²                                  0          i_rq²φ²
|v_s| ≤ V_s         V_s² − 2 R_s ω_s T/(1.5 p)            see code   (R_s² + ω_s² (σL_s)²) q²φ²
|v_r| ≤ V_r         V_r² + 2 R_r ω_r T/(1.5 p)            ω_r²       R_r² i_rq²φ²
==================  ====================================  =========  ======================================

because the active power in v_s = R_s i_s + jω_s φ_s is ω_s T/p whatever the currents are. Two nested searches along
one axis therefore find the optimum: the intervals' common width is concave in φ, the loss within it convex.
"""

from dataclasses import dataclass

import numpy as np

from drivelib import dfim
from drivelib.curves import last_below, least_between
from drivelib.validation import array, number

SMALLEST = 1e-9  # share of the largest flux: at no torque the least loss is no flux
SLACK = 1e-9  # of a limit, for rounding
TURNING = 0.05  # share of a voltage that counts as left for turning even where a resistance takes it all
UNITS = {"phi_r": "Wb", "V_s": "V", "V_r": "V", "I_s": "A", "I_r": "A"}


@dataclass(frozen=True)
class DfimLimits:
    """Largest rotor flux (Wb), phase voltages (V, peak) and currents (A, peak) of stator and rotor inverter.

    Raises
    ------
    ValueError
        If one is not positive and finite.
    """

    phi_r: float
    V_s: float
    V_r: float
    I_s: float
    I_r: float

    def __post_init__(self):
        for name, unit in UNITS.items():
            object.__setattr__(self, name, number(f"limit {name}", getattr(self, name), unit, above=0))


@dataclass(frozen=True)
class DfimPoint:
    """Operating points in rotor-flux orientation; arrays of one shape, NaN where no current meets the limits.

    Attributes
    ----------
    phi_r : ndarray
        Rotor flux (Wb), on the d axis.
    i_sd, i_sq, i_rd, i_rq : ndarray
        Currents (A).
    omega_s, V_s, V_r : ndarray
        Stator frequency (electrical rad/s), voltages of both sides (V, phase peak).
    loss : ndarray
        Copper loss (W).
    capped : ndarray of bool
        True where the flux limit holds the flux below its free optimum.
    limited : ndarray of bool
        True where a voltage or current limit moved the point.
    feasible : ndarray of bool
        False where the torque cannot be reached inside the limits.
    """

    phi_r: np.ndarray
    i_sd: np.ndarray
    i_sq: np.ndarray
    i_rd: np.ndarray
    i_rq: np.ndarray
    omega_s: np.ndarray
    V_s: np.ndarray
    V_r: np.ndarray
    loss: np.ndarray
    capped: np.ndarray
    limited: np.ndarray
    feasible: np.ndarray


def free_flux(machine, T_e):
    """Return the rotor flux (Wb) of least copper loss at a torque (N m), without limits.

    Raises
    ------
    ValueError
        If a resistance is zero: then one side carries all the flux for nothing, and more of it always pays.
    """
    R_s, R_r = _resistances(machine)
    return np.sqrt(_N(machine) * np.abs(array("T_e", T_e, "N m")) / (1.5 * machine.p * machine.M * np.sqrt(R_s * R_r)))


def free_i_rd(machine, phi_r):
    """Return the rotor d current (A) of least copper loss at a rotor flux (Wb), without limits: R_s L_r φ/(M² R_r + L_r² R_s)."""
    R_s, _ = _resistances(machine)
    return R_s * machine.L_r * array("phi_r", phi_r, "Wb") / _N(machine)


def least_loss(machine, T_e):
    """Return the least copper loss (W) at a torque (N m), without limits: 2 √(R_s R_r) |T|/(p M), at any speed."""
    return 2 * np.sqrt(machine.R_s * machine.R_r) * np.abs(array("T_e", T_e, "N m")) / (machine.p * machine.M)


def currents(machine, T_e, phi_r, i_rd):
    """Return (i_sd, i_sq, i_rq) (A) that make a torque (N m) at a rotor flux (Wb) and rotor d current (A)."""
    T_e, phi_r, i_rd = array("T_e", T_e, "N m"), array("phi_r", phi_r, "Wb", above=0), array("i_rd", i_rd, "A")
    i_sq = machine.L_r * T_e / (1.5 * machine.p * machine.M * phi_r)
    return (phi_r - machine.L_r * i_rd) / machine.M, i_sq, -machine.M / machine.L_r * i_sq


def copper_loss(machine, i_s, i_r):
    """Return (3/2) (R_s |i_s|² + R_r |i_r|²) (W) of current vectors (A, complex)."""
    return 1.5 * (machine.R_s * np.abs(i_s) ** 2 + machine.R_r * np.abs(i_r) ** 2)


def stator_frequency(machine, omega_m, T_e, limits):
    """Return the stator frequency (electrical rad/s) at a speed (rad/s) and torque (N m), by rule; the rotor's is this less p Ω.

    In the free optimum both inverters are then equally near the voltage that their resistances leave them:
    ω_s φ_sd/(V_s − R_s i_sq) = −ω_r φ_r/(V_r − R_r |i_rq|).
    """
    omega_m, T_e = array("omega_m", omega_m, "rad/s"), array("T_e", T_e, "N m")
    phi_r = np.clip(free_flux(machine, T_e), SMALLEST * limits.phi_r, limits.phi_r)
    _, i_sq, i_rq = currents(machine, T_e, phi_r, 0.0)
    stator = np.maximum(limits.V_s - machine.R_s * i_sq, TURNING * limits.V_s)
    rotor = np.maximum(limits.V_r + machine.R_r * i_rq, TURNING * limits.V_r)
    return stator / (stator + flux_ratio(machine) * rotor) * machine.p * omega_m


def flux_ratio(machine):
    """Return ρ = φ_sd/φ_r (1) at the rotor d current of least loss: the ratio of turns, but for leakage."""
    return (machine.L_s - (machine.L_s * machine.L_r - machine.M**2) * float(free_i_rd(machine, 1.0))) / machine.M


def point(machine, omega_m, T_e, phi_r, i_rd, omega_s):
    """Return the `DfimPoint` of given references, with no regard to limits (their flags are false).

    Parameters
    ----------
    machine : DfimParameters
    omega_m, T_e, phi_r, i_rd, omega_s : array_like
        Speed (rad/s), torque (N m), rotor flux (Wb), rotor d current (A), stator frequency (rad/s); they broadcast.
    """
    omega_m, T_e, phi_r, i_rd, omega_s = np.broadcast_arrays(*(np.asarray(v, dtype=float) for v in (omega_m, T_e, phi_r, i_rd, omega_s)))
    i_sd, i_sq, i_rq = currents(machine, T_e, phi_r, i_rd)
    i_s, i_r = i_sd + 1j * i_sq, i_rd + 1j * i_rq
    phi_s, rotor = dfim.flux_linkages(i_s, i_r, machine)
    V_s = np.abs(machine.R_s * i_s + 1j * omega_s * phi_s)
    V_r = np.abs(machine.R_r * i_r + 1j * (omega_s - machine.p * omega_m) * rotor)
    no = np.zeros(T_e.shape, dtype=bool)
    return DfimPoint(phi_r, i_sd, i_sq, i_rd, i_rq, omega_s, V_s, V_r, copper_loss(machine, i_s, i_r), no, no, ~no)


def excess(found, limits):
    """Return by how much of a limit each point passes one, the largest of all five; 0 inside."""
    used = [
        found.phi_r / limits.phi_r, found.V_s / limits.V_s, found.V_r / limits.V_r,
        np.hypot(found.i_sd, found.i_sq) / limits.I_s, np.hypot(found.i_rd, found.i_rq) / limits.I_r,
    ]  # fmt: skip
    return np.maximum(np.max(used, axis=0) - 1, 0)


def optimum(machine, omega_m, T_e, limits, *, omega_s=None):
    """Return the `DfimPoint` of least copper loss at each speed and torque, inside the limits.

    Parameters
    ----------
    machine : DfimParameters
    omega_m, T_e : array_like
        Speed (rad/s) and torque (N m), motoring: neither negative. They broadcast.
    limits : DfimLimits
    omega_s : array_like, optional
        Stator frequency (electrical rad/s, not negative); by default `stator_frequency`. Broadcasts too.

    Raises
    ------
    ValueError
        If an input is negative or not finite, or a resistance is zero.
    """
    omega_m, T_e = array("omega_m", omega_m, "rad/s", at_least=0), array("T_e", T_e, "N m", at_least=0)
    omega_s = stator_frequency(machine, omega_m, T_e, limits) if omega_s is None else array("omega_s", omega_s, "rad/s", at_least=0)
    omega_m, T_e, omega_s = (np.array(values) for values in np.broadcast_arrays(omega_m, T_e, omega_s))
    shape = T_e.shape
    omega_m, T_e, omega_s = omega_m.ravel(), T_e.ravel(), omega_s.ravel()

    free = free_flux(machine, T_e)
    phi_r = np.clip(free, SMALLEST * limits.phi_r, limits.phi_r)
    i_rd = free_i_rd(machine, phi_r)
    outside = excess(point(machine, omega_m, T_e, phi_r, i_rd, omega_s), limits) > SLACK
    feasible = ~outside
    if np.any(outside):
        phi_r[outside], i_rd[outside], feasible[outside] = _constrained(machine, omega_m[outside], T_e[outside], omega_s[outside], limits)
    found = point(machine, omega_m, T_e, phi_r, i_rd, omega_s)
    names = ("phi_r", "i_sd", "i_sq", "i_rd", "i_rq", "omega_s", "V_s", "V_r", "loss")
    values = [np.where(feasible, getattr(found, name), np.nan).reshape(shape) for name in names]
    flags = [values.reshape(shape) for values in (feasible & (free > limits.phi_r), feasible & outside, feasible)]
    return DfimPoint(*values, *flags)


def _constrained(machine, omega_m, T_e, omega_s, limits):
    """Return (φ, i_rd, feasible) of flat arrays of points whose free optimum passes a limit."""
    c, s, C, K, kappa = _limits_in_u(machine, omega_m, T_e, omega_s, limits)
    with np.errstate(divide="ignore", invalid="ignore"):  # κ = 0 leaves the flux free upwards; C < 0 leaves nothing
        root = np.sqrt(C**2 - 4 * kappa * K)
        low = np.max(np.sqrt(2 * K / (C + root)), axis=0)
        high = np.min(np.where(kappa > 0, np.sqrt((C + root) / (2 * kappa)), np.inf), axis=0)
    low, high = np.maximum(low, SMALLEST * limits.phi_r), np.minimum(high, limits.phi_r)
    some = np.all(C > 0, axis=0) & (low <= high)  # false for NaN: no real root
    low, high = np.where(some, low, limits.phi_r), np.where(some, high, limits.phi_r)

    def ends(phi_r):
        half = np.sqrt(np.maximum(C - K / phi_r**2 - kappa * phi_r**2, 0)) / s
        return np.max(c * phi_r - half, axis=0), np.min(c * phi_r + half, axis=0)

    def lack(phi_r):
        first, last = ends(phi_r)
        return first - last

    def i_rd(phi_r):
        first, last = ends(phi_r)
        return np.clip(free_i_rd(machine, phi_r), first, np.maximum(first, last))

    def loss(phi_r):
        u = i_rd(phi_r)
        i_sd, i_sq, i_rq = currents(machine, T_e, phi_r, u)
        return copper_loss(machine, i_sd + 1j * i_sq, u + 1j * i_rq)

    widest = least_between(lack, low, high)
    feasible = some & (lack(widest) <= 0)
    top = np.where(feasible, last_below(lack, 0.0, widest, high), widest)
    bottom = np.where(feasible, -last_below(lambda x: lack(-x), 0.0, -widest, -low), widest)
    phi_r = least_between(loss, np.nan_to_num(bottom, nan=1.0), np.nan_to_num(top, nan=1.0))
    return phi_r, i_rd(phi_r), feasible


def _limits_in_u(machine, omega_m, T_e, omega_s, limits):
    """Return (c, s, C, K, κ), shape (4, n) each: |i_s|, |i_r|, |v_s|, |v_r| as intervals of i_rd, see the module's table."""
    R_s, R_r, L_s, L_r, M = machine.R_s, machine.R_r, machine.L_s, machine.L_r, machine.M
    q_squared = (L_r * T_e / (1.5 * machine.p * M)) ** 2  # times φ²
    rotor_q_squared = (M / L_r) ** 2 * q_squared
    omega_r = omega_s - machine.p * omega_m
    active = T_e / (1.5 * machine.p)
    drop, drop_u = R_s / M, R_s * L_r / M  # R_s i_sd = drop φ − drop_u u
    flux, flux_u = omega_s * L_s / M, omega_s * (L_s * L_r - M**2) / M  # ω_s φ_sd = flux φ − flux_u u
    scale = drop_u**2 + flux_u**2
    one, none = np.ones(T_e.shape), np.zeros(T_e.shape)
    rows = (
        (one / L_r, one * L_r / M, one * limits.I_s**2, q_squared, none),
        (none, one, one * limits.I_r**2, rotor_q_squared, none),
        (
            (drop * drop_u + flux * flux_u) / scale, np.sqrt(scale), limits.V_s**2 - 2 * R_s * omega_s * active,
            (R_s**2 + (omega_s * machine.sigma * L_s) ** 2) * q_squared, (drop * flux_u - drop_u * flux) ** 2 / scale,
        ),
        (none, one * R_r, limits.V_r**2 + 2 * R_r * omega_r * active, R_r**2 * rotor_q_squared, omega_r**2 * one),
    )  # fmt: skip
    return tuple(np.array(values) for values in zip(*rows, strict=True))


def _N(machine):
    return machine.M**2 * machine.R_r + machine.L_r**2 * machine.R_s


def _resistances(machine):
    return number("R_s", machine.R_s, "ohm", above=0), number("R_r", machine.R_r, "ohm", above=0)
