"""Steady state of permanent-magnet synchronous machines with iron loss: Eskander 2002, eq. (1)-(19).

Symbols follow the paper: ``i_od``, ``i_oq`` flow in the magnetising branch, ``i_d``, ``i_q`` at the
terminals; ``omega_e`` = P ω_m is the electrical speed (the paper's ω_s). Currents, voltages and flux
linkages are peak values of an amplitude-invariant Park transformation. Arguments broadcast.

Two switches recur, because the paper does not keep to one convention:

``model``
    ``"full"`` (default): terminal currents carry the iron-loss current.
    ``"simplified"``: i_d = i_od and i_q = i_oq at the terminals, as (8) assumes.
``convention``
    ``"consistent"`` (default): powers carry the 3/2 that the torque (3) carries.
    ``"paper"``: losses without it, as (5)-(7) print them.
"""

from typing import NamedTuple

import numpy as np

from drivelib.validation import array, choice

MODELS = ("full", "simplified")
CONVENTIONS = ("consistent", "paper")
MODULATIONS = {"space-vector": 1 / np.sqrt(3), "six-step": 2 / np.pi}


def terminal_currents(machine, omega_e, i_od, i_oq, *, model="full"):
    """Return (i_d, i_q) at the terminals (A): branch current plus iron-loss current.

    i_d = i_od − ω L_q i_oq / R_c,  i_q = i_oq + ω (λ + L_d i_od) / R_c  (circuit of fig. 1).
    """
    return _terminal_currents(machine, *_checked(omega_e, i_od, i_oq), terminal_conductance(machine, model))


def branch_currents(machine, omega_e, i_d, i_q):
    """Return (i_od, i_oq) (A) for terminal currents: the inverse of `terminal_currents`, full model."""
    omega_e, i_d, i_q = _checked(omega_e, i_d, i_q)
    alpha = omega_e * machine.L_q / machine.R_c
    beta = omega_e * machine.L_d / machine.R_c
    q_demand = i_q - omega_e * machine.psi_f / machine.R_c
    i_od = (i_d + alpha * q_demand) / (1 + alpha * beta)
    return i_od, q_demand - beta * i_od


def stator_voltages(machine, omega_e, i_od, i_oq, *, model="full"):
    """Return (V_d, V_q) (V, phase peak): eq. (2) and (1)."""
    omega_e, i_od, i_oq = _checked(omega_e, i_od, i_oq)
    return _voltages(machine, omega_e, i_od, i_oq, *_terminal_currents(machine, omega_e, i_od, i_oq, terminal_conductance(machine, model)))


def stator_voltage(machine, omega_e, i_od, i_oq, *, model="full"):
    """Return V_s = sqrt(V_d² + V_q²) (V, phase peak): eq. (12)."""
    return np.hypot(*stator_voltages(machine, omega_e, i_od, i_oq, model=model))


def i_oq_at_voltage(machine, omega_e, V_s, i_od):
    """Return the largest i_oq (A) at which the voltage is V_s (V, phase peak): (12) solved, simplified model; NaN where none is ≥ 0.

    Raises
    ------
    ValueError
        If V_s is negative, or neither resistance nor speed limits the current.
    """
    omega_e, V_s, i_od = _checked(omega_e, V_s, i_od, names=("omega_e", "V_s", "i_od"), units=("rad/s", "V", "A"))
    array("V_s", V_s, "V", at_least=0)
    # (R_s² + ω² L_q²) i² + 2 R_s ω (λ + ΔL i_od) i + V² = V_s², V being the voltage without i_oq
    square = machine.R_s**2 + (omega_e * machine.L_q) ** 2
    if not (square > 0).all():
        raise ValueError("R_s = 0 ohm at omega_e = 0 rad/s: nothing limits the current, so no voltage determines it")
    half = machine.R_s * omega_e * (machine.psi_f + machine.delta_L * i_od)
    missing = V_s**2 - (machine.R_s * i_od) ** 2 - (omega_e * (machine.psi_f + machine.L_d * i_od)) ** 2
    root = half**2 + square * missing
    i_oq = np.where(root >= 0, (np.sqrt(np.maximum(root, 0)) - half) / square, np.nan)
    return np.where(i_oq >= 0, i_oq, np.nan)


def branch_currents_at_voltage(machine, omega_e, V_s, phi, *, model="full"):
    """Return (i_od, i_oq) (A) that an inverter of amplitude ``V_s`` (V) and angle ``phi`` (rad) drives.

    V_q = V_s cos φ and V_d = −V_s sin φ as in (17)-(18), solved for the currents with (1)-(2).
    """
    omega_e, V_s, phi = _checked(omega_e, V_s, phi, names=("omega_e", "V_s", "phi"), units=("rad/s", "V", "rad"))
    array("V_s", V_s, "V", at_least=0)
    scale = 1 + machine.R_s * terminal_conductance(machine, model)
    reactance_d, reactance_q = scale * omega_e * machine.L_d, scale * omega_e * machine.L_q
    free_q = V_s * np.cos(phi) - scale * omega_e * machine.psi_f
    V_d = -V_s * np.sin(phi)
    determinant = machine.R_s**2 + reactance_d * reactance_q
    if np.any(determinant == 0):
        raise ValueError("R_s = 0 ohm at omega_e = 0 rad/s: nothing limits the current, so no voltage determines it")
    i_od = (machine.R_s * V_d + reactance_q * free_q) / determinant
    i_oq = (machine.R_s * free_q - reactance_d * V_d) / determinant
    return i_od, i_oq


def torque(machine, i_od, i_oq):
    """Return T_e = 1.5 P [λ i_oq + (L_d − L_q) i_od i_oq] (N m): eq. (3), (14), (19).

    Examples
    --------
    1.5 · 4 pole pairs · 0.232 Wb · 2 A, and with the saliency −0.04 H · −1 A on top:

    >>> from drivelib.machines import IPMSM
    >>> print(f"{torque(IPMSM, 0.0, 2.0):.3f} N m, {torque(IPMSM, -1.0, 2.0):.3f} N m")
    2.784 N m, 3.264 N m
    """
    return _torque(machine, array("i_od", i_od, "A"), array("i_oq", i_oq, "A"))


def acceleration(machine, T_e, T_L, omega_m):
    """Return dω_m/dt (rad/s²) from T_e = T_L + B ω_m + J dω_m/dt: eq. (4)."""
    T_e, T_L, omega_m = _checked(T_e, T_L, omega_m, names=("T_e", "T_L", "omega_m"), units=("N m", "N m", "rad/s"))
    return (T_e - T_L - machine.B * omega_m) / machine.J


def copper_loss(machine, i_d, i_q, *, convention="consistent"):
    """Return R_s (i_d² + i_q²) (W), times 3/2 in the consistent convention: eq. (5)."""
    return _copper_loss(machine, array("i_d", i_d, "A"), array("i_q", i_q, "A"), _power_factor(convention))


def iron_loss(machine, omega_e, i_od, i_oq, *, convention="consistent"):
    """Return ω² [(λ + L_d i_od)² + (L_q i_oq)²] / R_c (W), times 3/2 if consistent: eq. (6), (7), (13)."""
    return _iron_loss(machine, *_checked(omega_e, i_od, i_oq), _power_factor(convention))


def total_loss(machine, omega_e, i_od, i_oq, *, model="full", convention="consistent"):
    """Return copper plus iron loss (W): (5) + (7). The model decides which currents (5) takes."""
    omega_e, i_od, i_oq = _checked(omega_e, i_od, i_oq)
    i_d, i_q = _terminal_currents(machine, omega_e, i_od, i_oq, terminal_conductance(machine, model))
    factor = _power_factor(convention)
    return _copper_loss(machine, i_d, i_q, factor) + _iron_loss(machine, omega_e, i_od, i_oq, factor)


class OperatingPoint(NamedTuple):
    """What follows from speed and branch currents: terminal currents (A), voltage (V, phase peak), loss (W)."""

    i_d: np.ndarray
    i_q: np.ndarray
    V_s: np.ndarray
    loss: np.ndarray


def operating_point(machine, omega_e, i_od, i_oq, *, model="full", convention="consistent"):
    """Return the `OperatingPoint`: `terminal_currents`, `stator_voltage`, and `total_loss` in one."""
    omega_e, i_od, i_oq = _checked(omega_e, i_od, i_oq)
    factor = _power_factor(convention)
    i_d, i_q = _terminal_currents(machine, omega_e, i_od, i_oq, terminal_conductance(machine, model))
    V_s = np.hypot(*_voltages(machine, omega_e, i_od, i_oq, i_d, i_q))
    loss = _copper_loss(machine, i_d, i_q, factor) + _iron_loss(machine, omega_e, i_od, i_oq, factor)
    return OperatingPoint(i_d, i_q, V_s, loss)


def input_power(machine, omega_e, i_od, i_oq, *, model="full"):
    """Return 3/2 (V_d i_d + V_q i_q) (W), the electrical power of the amplitude-invariant frame."""
    V_d, V_q = stator_voltages(machine, omega_e, i_od, i_oq, model=model)
    i_d, i_q = terminal_currents(machine, omega_e, i_od, i_oq, model=model)
    return 1.5 * (V_d * i_d + V_q * i_q)


def energy_balance(machine, omega_e, i_od, i_oq, *, model="full", convention="consistent"):
    """Return input power − shaft power − losses (W).

    Zero in the full model with the consistent convention; elsewhere it is what that simplification
    or convention leaves out.
    """
    shaft = torque(machine, i_od, i_oq) * array("omega_e", omega_e, "rad/s") / machine.P
    loss = total_loss(machine, omega_e, i_od, i_oq, model=model, convention=convention)
    return input_power(machine, omega_e, i_od, i_oq, model=model) - shaft - loss


def efficiency(machine, omega_e, i_od, i_oq, *, model="full", convention="consistent"):
    """Return shaft power over shaft power plus losses (1), for motoring points; NaN elsewhere."""
    omega_e, i_od, i_oq = _checked(omega_e, i_od, i_oq)
    factor = _power_factor(convention)
    i_d, i_q = _terminal_currents(machine, omega_e, i_od, i_oq, terminal_conductance(machine, model))
    shaft = _torque(machine, i_od, i_oq) * omega_e / machine.P
    loss = _copper_loss(machine, i_d, i_q, factor) + _iron_loss(machine, omega_e, i_od, i_oq, factor)
    return np.where(shaft > 0, shaft / np.where(shaft > 0, shaft + loss, 1), np.nan)


def i_oq_at_torque(machine, T_e, i_od):
    """Return i_oq = T_e / (1.5 P [λ + (L_d − L_q) i_od]) (A): eq. (9).

    Raises
    ------
    ValueError
        Where λ + (L_d − L_q) i_od is not positive: no torque on the motor's branch.
    """
    T_e, i_od = array("T_e", T_e, "N m"), array("i_od", i_od, "A")
    return T_e / (1.5 * machine.P * _torque_flux(machine, i_od))


def di_oq_di_od(machine, T_e, i_od):
    """Return ∂i_oq/∂i_od at constant torque = −(L_d − L_q) T_e / (1.5 P [λ + (L_d − L_q) i_od]²): eq. (10) mended.

    As printed the square stands outside the whole fraction.
    """
    T_e, i_od = array("T_e", T_e, "N m"), array("i_od", i_od, "A")
    return -machine.delta_L * T_e / (1.5 * machine.P * _torque_flux(machine, i_od) ** 2)


def loss_slope(machine, omega_e, T_e, i_od, *, convention="paper"):
    """Return ∂P_L/∂i_od at constant torque (W/A): eq. (8), simplified model."""
    omega_e, i_od = array("omega_e", omega_e, "rad/s"), array("i_od", i_od, "A")
    i_oq = i_oq_at_torque(machine, T_e, i_od)
    iron = omega_e**2 / machine.R_c
    return (
        2
        * _power_factor(convention)
        * (
            i_od * (machine.R_s + iron * machine.L_d**2)
            + i_oq * di_oq_di_od(machine, T_e, i_od) * (machine.R_s + iron * machine.L_q**2)
            + iron * machine.psi_f * machine.L_d
        )
    )


def voltage_limit(machine, modulation="space-vector"):
    """Return the largest phase voltage (V, peak) that V_dc gives: V_dc/√3, or 2 V_dc/π in six-step."""
    return machine.V_dc * MODULATIONS[choice("modulation", modulation, tuple(MODULATIONS))]


def terminal_conductance(machine, model):
    """Return what terminal currents see of the iron branch (S): 1/R_c in the full model, 0 in the simplified one."""
    return 1 / machine.R_c if choice("model", model, MODELS) == "full" else 0.0


def _power_factor(convention):
    return 1.5 if choice("convention", convention, CONVENTIONS) == "consistent" else 1.0


def _torque_flux(machine, i_od):
    flux = machine.psi_f + machine.delta_L * i_od
    if not (flux > 0).all():
        limit = -machine.psi_f / machine.delta_L
        raise ValueError(
            f"i_od = {i_od[flux <= 0].flat[0]:g} A: λ + (L_d − L_q) i_od must be positive, so i_od must stay "
            f"{'below' if machine.delta_L < 0 else 'above'} {limit:.4g} A"
        )
    return flux


# The equations themselves, for arguments that have been checked.


def _terminal_currents(machine, omega_e, i_od, i_oq, conductance):
    i_d = i_od - omega_e * machine.L_q * i_oq * conductance
    return i_d, i_oq + omega_e * (machine.psi_f + machine.L_d * i_od) * conductance


def _voltages(machine, omega_e, i_od, i_oq, i_d, i_q):
    V_d = machine.R_s * i_d - omega_e * machine.L_q * i_oq
    return V_d, machine.R_s * i_q + omega_e * (machine.L_d * i_od + machine.psi_f)


def _torque(machine, i_od, i_oq):
    return 1.5 * machine.P * (machine.psi_f + machine.delta_L * i_od) * i_oq


def _copper_loss(machine, i_d, i_q, factor):
    return factor * machine.R_s * (i_d * i_d + i_q * i_q)


def _iron_loss(machine, omega_e, i_od, i_oq, factor):
    flux_squared = (machine.psi_f + machine.L_d * i_od) ** 2 + (machine.L_q * i_oq) ** 2
    return factor * omega_e**2 * flux_squared / machine.R_c


def _checked(first, second, third, names=("omega_e", "i_od", "i_oq"), units=("rad/s", "A", "A")):
    return array(names[0], first, units[0]), array(names[1], second, units[1]), array(names[2], third, units[2])
