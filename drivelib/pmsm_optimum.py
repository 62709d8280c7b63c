"""Loss-minimising currents of a PMSM: eq. (11) and (16) mended, with and without inverter limits.

Along a curve of constant torque, loss, squared voltage and squared current all have one form in
``i`` = i_od, with q = T_e/(1.5 P), x = λ + ΔL i > 0, ΔL = L_d − L_q and i_oq = q/x::

    F(i) = p i² + g (λ + L_d i)² + (p + g L_q²) q²/x² + c q

(the cross terms i·i_oq and (λ + L_d i)·i_oq always combine to the torque, hence the constant c q):

=================  ======  =============================  ========================
F                  p       g                              c
=================  ======  =============================  ========================
loss, simplified   R_s     ω²/R_c                         0
loss, full         R_s     ω² (R_c + R_s)/R_c²            2 R_s ω/R_c
V_s²               R_s²    ω² (1 + R_s G)²                2 R_s ω (1 + R_s G)
i_d² + i_q²        1       (ω G)²                         2 ω G
=================  ======  =============================  ========================

with G = 1/R_c at the terminals in the full model and G = 0 in the simplified one. F is strictly
convex, so each limit allows one interval of i_od, and the constrained optimum is the allowed point
nearest to the free one. F' = 0 is the paper's (11) mended; with b = g λ L_d/(p + g L_d²) and
k = (p + g L_q²)/(p + g L_d²) it reads (i + b) x = ΔL k i_oq².
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from drivelib import pmsm
from drivelib.curves import last_below
from drivelib.validation import array, choice, number

NEWTON_STEPS = 60  # convergence is monotone; quadratic except where a limit is just met


@dataclass(frozen=True)
class Optimum:
    """Loss-minimising operating points; arrays of one shape, NaN where no current meets the limits.

    Attributes
    ----------
    i_od, i_oq, i_d, i_q : ndarray
        Branch and terminal currents (A); references to an inverter are the terminal ones.
    V_s : ndarray
        Stator voltage (V, phase peak).
    loss : ndarray
        Copper plus iron loss (W).
    limited : ndarray of bool
        True where a limit moved the point away from the free optimum.
    feasible : ndarray of bool
        False where the torque cannot be reached inside the limits.
    """

    i_od: np.ndarray
    i_oq: np.ndarray
    i_d: np.ndarray
    i_q: np.ndarray
    V_s: np.ndarray
    loss: np.ndarray
    limited: np.ndarray
    feasible: np.ndarray


def optimal_i_od(machine, omega_e, T_e, *, model="full"):
    """Return the i_od of least loss at given torque (A): eq. (11) mended and made explicit, a quartic.

    With a = λ − b ΔL and x = λ + ΔL i_od it is x³ (x − a) = k (ΔL q)², whose one root x ≥ a Newton's
    method meets monotonically from above. T_e = 0 and ΔL = 0 (then it is (16) mended) need no special case.
    """
    omega_e, T_e = array("omega_e", omega_e, "rad/s"), array("T_e", T_e, "N m")
    p, g, _ = _loss_form(machine, omega_e, model)
    return _minimiser(machine, p, g, T_e / (1.5 * machine.P))


def optimal_i_od_at_i_oq(machine, omega_e, i_oq, *, model="full"):
    """Return the i_od (A) that satisfies the constant-torque condition at given i_oq (A): a quadratic.

    (i_od + b)(λ + ΔL i_od) = ΔL k i_oq², root with λ + ΔL i_od > 0. This is what a network fed with i_q*
    has to learn; it is not the minimum of the loss at fixed i_oq.
    """
    omega_e, i_oq = array("omega_e", omega_e, "rad/s"), array("i_oq", i_oq, "A")
    p, g, _ = _loss_form(machine, omega_e, model)
    b, k = _coefficients(machine, p, g)
    a = machine.psi_f - b * machine.delta_L
    x = (a + np.sqrt(a**2 + 4 * machine.delta_L**2 * k * i_oq**2)) / 2
    return machine.delta_L * k * i_oq**2 / x - b


def optimal_i_od_surface(machine, omega_e, *, model="simplified"):
    """Return −ω² L_s λ / (R_s R_c + ω² L_s²) (A), the optimum of a surface machine: eq. (16) mended.

    As printed it lacks the minus. It does not depend on the torque.

    Raises
    ------
    ValueError
        If the machine is salient.
    """
    if machine.delta_L != 0:
        raise ValueError(f"L_d − L_q = {machine.delta_L:g} H: eq. (16) holds for a surface machine only, L_d = L_q")
    p, g, _ = _loss_form(machine, array("omega_e", omega_e, "rad/s"), model)
    return -g * machine.psi_f * machine.L_d / (p + g * machine.L_d**2)


def optimum(machine, omega_e, T_e, *, model="full", convention="consistent", V_max=None, I_max=None):
    """Return the `Optimum` for each operating point, inside the limits where they are given.

    Parameters
    ----------
    machine : PmsmParameters
    omega_e, T_e : array_like
        Electrical speed (rad/s) and torque (N m); they broadcast.
    model, convention : str
        See `drivelib.pmsm`.
    V_max, I_max : float, optional
        Largest phase voltage (V, peak; see `pmsm.voltage_limit`) and terminal current (A, peak).
    """
    omega_e, T_e = np.broadcast_arrays(array("omega_e", omega_e, "rad/s"), array("T_e", T_e, "N m"))
    q = T_e / (1.5 * machine.P)
    free = _minimiser(machine, *_loss_form(machine, omega_e, model)[:2], q)
    limits = []
    if V_max is not None:
        limits.append((_voltage_form(machine, omega_e, pmsm.terminal_conductance(machine, model)), number("V_max", V_max, "V", above=0) ** 2))
    if I_max is not None:
        limits.append((_current_form(machine, omega_e, model), number("I_max", I_max, "A", above=0) ** 2))

    # The nearest point allowed by each limit alone; the one that all limits allow is nearest to all.
    candidates = [free] + [_nearest_allowed(machine, form, bound, q, free) for form, bound in limits]
    i_od = np.full(free.shape, np.nan)
    for candidate in reversed(candidates):
        allowed = np.isfinite(candidate)
        for form, bound in limits:
            allowed &= ~(_form(machine, *form, candidate, q) > bound * (1 + 1e-9))
        i_od = np.where(allowed, candidate, i_od)
    feasible = np.isfinite(i_od)
    inside = np.where(feasible, i_od, free)
    i_oq = pmsm.i_oq_at_torque(machine, T_e, inside)
    at = pmsm.operating_point(machine, omega_e, inside, i_oq, model=model, convention=convention)
    shown = (inside, i_oq, at.i_d, at.i_q, at.V_s, at.loss)
    if not feasible.all():
        shown = [np.where(feasible, values, np.nan) for values in shown]
    return Optimum(*map(np.asarray, shown), limited=feasible & (inside != free), feasible=feasible)


class FreeOptimum(NamedTuple):
    """Least loss (W) without limits, its i_od (A) and phase voltage (V, peak), and the loss (W) with i_od = 0 instead."""

    loss: np.ndarray
    i_od: np.ndarray
    V_s: np.ndarray
    loss_at_zero: np.ndarray


def free_optimum(machine, omega_e, T_e, R_c, *, model="full", convention="consistent"):
    """Return the `FreeOptimum` for each speed (rad/s), torque (N m) and iron-loss resistance (ohm); they broadcast.

    For asking which R_c fits: the machine's own is not used. Otherwise as `optimum`.
    """
    omega_e, T_e, R_c = array("omega_e", omega_e, "rad/s"), array("T_e", T_e, "N m"), array("R_c", R_c, "ohm", above=0)
    omega_e, T_e, R_c = np.broadcast_arrays(omega_e, T_e, R_c)
    q = T_e / (1.5 * machine.P)
    G = 1 / R_c if choice("model", model, pmsm.MODELS) == "full" else np.zeros(R_c.shape)
    scale = 1.5 if choice("convention", convention, pmsm.CONVENTIONS) == "consistent" else 1.0
    form = _loss_form_with(machine, omega_e, R_c, G)
    i_od = _minimiser(machine, *form[:2], q)
    V_s = np.sqrt(_form(machine, *_voltage_form(machine, omega_e, G), i_od, q))
    return FreeOptimum(scale * _form(machine, *form, i_od, q), i_od, V_s, scale * _form(machine, *form, 0.0, q))


def least_voltage(machine, omega_e, T_e, *, model="full"):
    """Return (V_s, i_od) (V phase peak, A) of the operating point that needs least voltage at given torque."""
    omega_e, T_e = array("omega_e", omega_e, "rad/s"), array("T_e", T_e, "N m")
    q = T_e / (1.5 * machine.P)
    form = _voltage_form(machine, omega_e, pmsm.terminal_conductance(machine, model))
    i_od = _minimiser(machine, *form[:2], q)
    return np.sqrt(_form(machine, *form, i_od, q)), i_od


def optimal_i_od_as_printed(machine, omega_e, T_e):
    """Return what (11) gives when taken literally (A): its last term with L_d² where L_d is due. For the errata."""
    omega_e, T_e = array("omega_e", omega_e, "rad/s"), array("T_e", T_e, "N m")
    b, k = _coefficients(machine, *_loss_form(machine, omega_e, "simplified")[:2])
    return _root(machine, b * machine.L_d, k, T_e / (1.5 * machine.P))


def largest_torque(machine, omega_e, V_max, *, model="full", T_max=1e3):
    """Return the largest torque (N m) that some current reaches inside ``V_max`` (V, peak), by bisection.

    Motoring: the speed is not negative. ``T_max`` (N m) bounds the search; NaN where the magnet's emf alone
    cannot be weakened below ``V_max``.
    """
    omega_e = array("omega_e", omega_e, "rad/s", at_least=0)  # braking, a little torque needs less voltage than none
    number("T_max", T_max, "N m", above=0)
    number("V_max", V_max, "V", above=0)
    return last_below(lambda T_e: least_voltage(machine, omega_e, T_e, model=model)[0], V_max, np.zeros(omega_e.shape), T_max)


def speed_at_loss(machine, T_e, loss, *, model="full", convention="consistent", omega_max=1e4):
    """Return the electrical speed (rad/s) at which the least loss equals ``loss`` (W), by bisection.

    The least loss rises with speed when motoring; when braking the full model's falls first, and the speed
    returned is the higher one. NaN where the loss exceeds ``loss`` at standstill or stays below it up to
    ``omega_max`` (rad/s).
    """
    T_e = array("T_e", T_e, "N m")
    number("omega_max", omega_max, "rad/s", above=1e-6)
    number("loss", loss, "W", above=0)

    def least(omega_e):
        return optimum(machine, omega_e, T_e, model=model, convention=convention).loss

    found = last_below(least, loss, np.full(T_e.shape, 1e-6), omega_max)
    return np.where(found < omega_max, found, np.nan)


def _loss_form(machine, omega_e, model):
    return _loss_form_with(machine, omega_e, machine.R_c, pmsm.terminal_conductance(machine, model))


def _loss_form_with(machine, omega_e, R_c, G):
    return machine.R_s, omega_e**2 * (1 / R_c + machine.R_s * G**2), 2 * machine.R_s * omega_e * G


def _voltage_form(machine, omega_e, G):
    scaled = omega_e * (1 + machine.R_s * G)
    return machine.R_s**2, scaled**2, 2 * machine.R_s * scaled


def _current_form(machine, omega_e, model):
    G = pmsm.terminal_conductance(machine, model)
    return 1.0, (omega_e * G) ** 2, 2 * omega_e * G


def _coefficients(machine, p, g):
    denominator = p + g * machine.L_d**2
    if not (denominator != 0).all():
        raise ValueError("R_s = 0 ohm at omega_e = 0 rad/s: every current has the same loss, so there is no optimum")
    return g * machine.psi_f * machine.L_d / denominator, (p + g * machine.L_q**2) / denominator


def _form(machine, p, g, c, i, q):
    x = machine.psi_f + machine.delta_L * i
    return p * i**2 + g * (machine.psi_f + machine.L_d * i) ** 2 + (p + g * machine.L_q**2) * (q / x) ** 2 + c * q


def _minimiser(machine, p, g, q):
    return _root(machine, *_coefficients(machine, p, g), q)


def _root(machine, b, k, q):
    a = machine.psi_f - b * machine.delta_L
    mu = k * (machine.delta_L * q) ** 2 / a**4  # y³ (y − 1) = μ with y = x/a
    excess = np.minimum(mu, np.sqrt(np.sqrt(mu)))  # y − 1, from above: the root lies below both
    for _ in range(NEWTON_STEPS):
        y = 1 + excess
        squared = y * y
        step = (squared * y * excess - mu) / (squared * (4 * excess + 1))
        excess = excess - step
        if (abs(step) <= 1e-9 * excess + 1e-300).all():  # what is left is the square of that
            break
    x = a * (1 + np.maximum(excess, 0))
    return machine.delta_L * k * (q / x) ** 2 / x - b


def _nearest_allowed(machine, form, bound, q, start):
    """Return ``start`` where F ≤ bound there, else the end of the allowed interval on its side, else NaN."""
    outside = _form(machine, *form, start, q) > bound
    i = np.array(start, dtype=float)
    if np.any(outside):
        p, g, c = form
        g, c = (np.broadcast_to(values, outside.shape)[outside] for values in (g, c))
        i[outside] = _end(machine, (p, g, c), bound, q[outside], i[outside])
    return i


def _end(machine, form, bound, q, i):
    """Return the end of the interval in which F ≤ bound that lies on the side of i, NaN where there is none; flat arrays."""
    p, g, c = form
    reachable = _form(machine, *form, _minimiser(machine, p, g, q), q) <= bound
    i = np.where(reachable, i, np.nan)
    moving = np.flatnonzero(reachable)
    for _ in range(NEWTON_STEPS):
        at, g_at, q_at = i[moving], g[moving], q[moving]
        excess = _form(machine, p, g_at, c[moving], at, q_at) - bound
        x = machine.psi_f + machine.delta_L * at
        slope = 2 * (
            p * at
            + g_at * machine.L_d * (machine.psi_f + machine.L_d * at)
            - (p + g_at * machine.L_q**2) * machine.delta_L * q_at**2 / x**3
        )
        outside = (excess > 0) & (slope != 0)
        step = np.where(outside, excess / np.where(slope == 0, 1, slope), 0.0)
        i[moving] = at - step  # convex: from outside, Newton never oversteps the end
        moving = moving[np.abs(step) > 1e-14 * np.abs(at - step) + 1e-16]
        if moving.size == 0:
            break
    return i
