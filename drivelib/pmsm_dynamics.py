"""Permanent-magnet machines in motion: the circuit of Eskander 2002, fig. 1, with its derivatives kept, and eq. (4).

The iron branch R_c lies parallel to L di/dt plus rotational emf, so that a branch voltage v_o drives the
branch current i_o and both add up at the terminals::

    v_od = L_d di_od/dt − ω L_q i_oq          i = i_o + v_o/R_c
    v_oq = L_q di_oq/dt + ω (λ + L_d i_od)    v = R_s i + v_o    hence  v_o = (v − R_s i_o)/(1 + R_s/R_c)

With d/dt = 0 these are the paper's (1)–(2) in the full model of `drivelib.pmsm`. Every function takes
scalars or arrays and checks nothing, because the drive loop compiles the same source.
"""

from typing import NamedTuple

import numpy as np


class PmsmCoefficients(NamedTuple):
    """A machine's values as floats, in the units of `PmsmParameters`."""

    R_s: float
    L_d: float
    L_q: float
    psi_f: float
    P: float
    R_c: float
    J: float
    B: float


def coefficients(machine):
    """Return the PmsmCoefficients of a machine (PmsmParameters)."""
    return PmsmCoefficients(*(float(getattr(machine, name)) for name in PmsmCoefficients._fields))


def branch_voltage(v, i_o, c):
    """Return v_o (V), the voltage of the iron branch in one axis, from terminal voltage (V) and branch current (A)."""
    return (v - c.R_s * i_o) / (1.0 + c.R_s / c.R_c)


def terminal_current(v, i_o, c):
    """Return i = i_o + v_o/R_c (A) in one axis. It follows a step of v at once, because R_c has no inductance."""
    return i_o + branch_voltage(v, i_o, c) / c.R_c


def branch_current(v, i, conductance, c):
    """Return i_o = i − G (v − R_s i) (A) in one axis: `terminal_current` solved, exact in transients too.

    G = 1/R_c (S) is the circuit; G = 0 takes the terminal current for the branch current, as the paper does.
    """
    return i - conductance * (v - c.R_s * i)


def branch_torque(i_od, i_oq, c):
    """Return T_e = 1.5 P [λ + (L_d − L_q) i_od] i_oq (N m): eq. (3)."""
    return 1.5 * c.P * (c.psi_f + (c.L_d - c.L_q) * i_od) * i_oq


def pmsm_derivatives(i_od, i_oq, omega_m, v_d, v_q, T_load, c):
    """Return the time derivatives of the three states: the circuit of fig. 1, and eq. (4).

    Parameters
    ----------
    i_od, i_oq : float or array
        Branch currents (A).
    omega_m : float or array
        Mechanical speed (rad/s).
    v_d, v_q : float or array
        Terminal voltages (V, phase peak) in the rotor frame.
    T_load : float or array
        Load torque (N m).
    c : PmsmCoefficients

    Returns
    -------
    tuple of three
        di_od/dt, di_oq/dt (A/s) and dω_m/dt (rad/s²), broadcast.
    """
    omega_e = c.P * omega_m
    di_od = (branch_voltage(v_d, i_od, c) + omega_e * c.L_q * i_oq) / c.L_d
    di_oq = (branch_voltage(v_q, i_oq, c) - omega_e * (c.psi_f + c.L_d * i_od)) / c.L_q
    return di_od, di_oq, (branch_torque(i_od, i_oq, c) - T_load - c.B * omega_m) / c.J


def power_flows(i_od, i_oq, omega_m, v_d, v_q, c):
    """Return electrical input, heat in R_s and R_c, and shaft power T_e ω_m (W), all with the 3/2.

    input = heat + shaft + d/dt `magnetic_energy`. The heat in R_c is that of v_o, which in a transient holds
    L di/dt beside the rotational emf of eq. (7).
    """
    v_od, v_oq = branch_voltage(v_d, i_od, c), branch_voltage(v_q, i_oq, c)
    i_d, i_q = i_od + v_od / c.R_c, i_oq + v_oq / c.R_c
    heat = c.R_s * (i_d * i_d + i_q * i_q) + (v_od * v_od + v_oq * v_oq) / c.R_c
    return 1.5 * (v_d * i_d + v_q * i_q), 1.5 * heat, branch_torque(i_od, i_oq, c) * omega_m


def magnetic_energy(i_od, i_oq, c):
    """Return 3/4 (L_d i_od² + L_q i_oq²) (J), the stored energy above that of the magnets alone."""
    return 0.75 * (c.L_d * i_od * i_od + c.L_q * i_oq * i_oq)


def loss_optimal_i_od(i_oq, omega_e, conductance, c):
    """Return the i_od (A) of least loss at the torque that it makes with ``i_oq`` (A): `optimal_i_od_at_i_oq`, compiled.

    G = 1/R_c (S) for the full model's loss, 0 for the simplified one; eq. (16) mended in a surface machine.
    """
    delta_L = c.L_d - c.L_q
    g = omega_e * omega_e * (1.0 / c.R_c + c.R_s * conductance * conductance)
    denominator = c.R_s + g * c.L_d * c.L_d
    b = g * c.psi_f * c.L_d / denominator
    right = delta_L * (c.R_s + g * c.L_q * c.L_q) / denominator * i_oq * i_oq
    a = c.psi_f - b * delta_L
    return 2.0 * right / (a + np.sqrt(a * a + 4.0 * delta_L * right)) - b


def angle_feed(torque, omega_e, c):
    """Return amplitude V_t (V, phase peak) and angle φ_op (rad) that hold i_d = 0 at a torque (N m): eq. (17)–(20)."""
    i_oq = torque / (1.5 * c.P * c.psi_f)
    v_q = c.R_s * i_oq + omega_e * c.psi_f
    minus_v_d = omega_e * c.L_q * i_oq
    return np.sqrt(v_q * v_q + minus_v_d * minus_v_d), np.arctan2(minus_v_d, v_q)
