"""Doubly fed induction motor in a rotating d-q frame (Zidani, eq. 1–10).

Amplitude-invariant Park transformation: torque and power carry the factor 3/2. The frame turns at
``omega_s`` seen from the stator and at ``omega_r = omega_s − p omega_m`` seen from the rotor; both are
frame speeds and need not be the speed of any flux.

Of the paper's vector equations (1)–(4) two are mended here. Eq. (2) has −jω_R φ_R where (8), (9) and
(13) have +jω_R φ_R: the plus sign is used, with ω_R = ω_S − pΩ. Eq. (4) reads L_R I_R + M I_R: the
second current is I_S.

Space vectors are complex (d + jq) in the functions for studies; ``dfim_derivatives`` is written in
real scalars, so that NumPy broadcasts it and numba compiles the same source.
"""

from typing import NamedTuple

import numpy as np

from drivelib.validation import array, number


class DfimCoefficients(NamedTuple):
    """What the equations of motion need of a machine, as floats.

    ``Gamma_s``, ``Gamma_r``, ``Gamma_m`` (1/H) are the entries of the inverse inductance matrix:
    i_s = Gamma_s φ_s − Gamma_m φ_r, i_r = Gamma_r φ_r − Gamma_m φ_s. ``k_T`` = 3 p M / (2 L_r).
    """

    R_s: float
    R_r: float
    Gamma_s: float
    Gamma_r: float
    Gamma_m: float
    k_T: float
    p: float
    J: float
    f: float


def coefficients(machine):
    """Return the DfimCoefficients of a machine (DfimParameters)."""
    determinant = machine.L_s * machine.L_r - machine.M**2
    return DfimCoefficients(
        R_s=machine.R_s,
        R_r=machine.R_r,
        Gamma_s=machine.L_r / determinant,
        Gamma_r=machine.L_s / determinant,
        Gamma_m=machine.M / determinant,
        k_T=1.5 * machine.p * machine.M / machine.L_r,
        p=float(machine.p),
        J=machine.J,
        f=machine.f,
    )


def flux_linkages(i_s, i_r, machine):
    """Return stator and rotor flux linkage (Wb) of the currents (A): eq. (3), and (4) mended.

    Parameters
    ----------
    i_s, i_r : complex or array of complex
        Stator and rotor current in one frame (A), broadcast against each other.
    machine : DfimParameters

    Returns
    -------
    phi_s, phi_r : same shape
        φ_s = L_s i_s + M i_r and φ_r = L_r i_r + M i_s (Wb).
    """
    return machine.L_s * i_s + machine.M * i_r, machine.L_r * i_r + machine.M * i_s


def currents(phi_s, phi_r, machine):
    """Return stator and rotor current (A) of the flux linkages (Wb): the inverse of eq. (3)–(4)."""
    c = coefficients(machine)
    return c.Gamma_s * phi_s - c.Gamma_m * phi_r, c.Gamma_r * phi_r - c.Gamma_m * phi_s


def electromagnetic_torque(phi_rd, phi_rq, i_sd, i_sq, machine):
    """Return the torque (N m) of rotor flux (Wb) and stator current (A), eq. (10).

    C_em = (3 p M / 2 L_r) (φ_rd i_sq − φ_rq i_sd); positive torque drives.
    """
    return 1.5 * machine.p * machine.M / machine.L_r * (phi_rd * i_sq - phi_rq * i_sd)


def dfim_derivatives(
    phi_sd, phi_sq, phi_rd, phi_rq, omega_m, v_sd, v_sq, v_rd, v_rq, omega_s, T_load, R_r, coefficients
):
    """Return the five time derivatives of the motor: eq. (6)–(9) for the fluxes and (5), (10) for the speed.

    Runs inside compiled loops and therefore checks nothing.

    Parameters
    ----------
    phi_sd, phi_sq, phi_rd, phi_rq : float or array
        Flux linkages (Wb).
    omega_m : float or array
        Mechanical speed (rad/s).
    v_sd, v_sq, v_rd, v_rq : float or array
        Inverter voltages, peak phase values (V).
    omega_s : float or array
        Speed of the frame seen from the stator (electrical rad/s).
    T_load : float or array
        Load torque (N m).
    R_r : float or array
        Rotor resistance (ohm): beside the coefficients, because it changes during a run.
    coefficients : DfimCoefficients

    Returns
    -------
    tuple of five
        dφ_sd/dt, dφ_sq/dt, dφ_rd/dt, dφ_rq/dt (V) and dΩ/dt (rad/s²), broadcast.
    """
    c = coefficients
    i_sd = c.Gamma_s * phi_sd - c.Gamma_m * phi_rd
    i_sq = c.Gamma_s * phi_sq - c.Gamma_m * phi_rq
    i_rd = c.Gamma_r * phi_rd - c.Gamma_m * phi_sd
    i_rq = c.Gamma_r * phi_rq - c.Gamma_m * phi_sq
    omega_r = omega_s - c.p * omega_m
    torque = c.k_T * (phi_rd * i_sq - phi_rq * i_sd)
    return (
        v_sd - c.R_s * i_sd + omega_s * phi_sq,
        v_sq - c.R_s * i_sq - omega_s * phi_sd,
        v_rd - R_r * i_rd + omega_r * phi_rq,
        v_rq - R_r * i_rq - omega_r * phi_rd,
        (torque - T_load - c.f * omega_m) / c.J,
    )


class DfimPower(NamedTuple):
    """Terms of the energy balance (W): stator + rotor = copper_s + copper_r + magnetic + mechanical."""

    stator: np.ndarray
    rotor: np.ndarray
    copper_s: np.ndarray
    copper_r: np.ndarray
    magnetic: np.ndarray
    mechanical: np.ndarray

    @property
    def residual(self):
        """What the balance leaves (W): zero but for rounding."""
        return self.stator + self.rotor - self.copper_s - self.copper_r - self.magnetic - self.mechanical


def magnetic_energy(phi_s, phi_r, machine):
    """Return the field energy (J), 3/4 Re(φ_s i_s* + φ_r i_r*), of the flux linkages (Wb, complex)."""
    i_s, i_r = currents(phi_s, phi_r, machine)
    return 0.75 * np.real(phi_s * np.conj(i_s) + phi_r * np.conj(i_r))


def power_balance(phi_s, phi_r, omega_m, v_s, v_r, omega_s, machine):
    """Return the DfimPower at a state, from eq. (6)–(10).

    Parameters
    ----------
    phi_s, phi_r : complex or array of complex
        Flux linkages in the frame (Wb).
    omega_m : float or array
        Mechanical speed (rad/s).
    v_s, v_r : complex or array of complex
        Voltages in the frame (V).
    omega_s : float or array
        Frame speed seen from the stator (rad/s); the terms do not depend on it, which a test uses.
    machine : DfimParameters

    Raises
    ------
    ValueError
        If speed or frame speed is not finite.
    """
    omega_m = array("omega_m", omega_m, "rad/s")
    omega_s = array("omega_s", omega_s, "rad/s")
    i_s, i_r = currents(phi_s, phi_r, machine)
    d = dfim_derivatives(
        np.real(phi_s), np.imag(phi_s), np.real(phi_r), np.imag(phi_r), omega_m,
        np.real(v_s), np.imag(v_s), np.real(v_r), np.imag(v_r),
        omega_s, 0.0, machine.R_r, coefficients(machine),
    )  # fmt: skip
    dphi_s, dphi_r = d[0] + 1j * d[1], d[2] + 1j * d[3]
    torque = electromagnetic_torque(np.real(phi_r), np.imag(phi_r), np.real(i_s), np.imag(i_s), machine)
    return DfimPower(
        stator=1.5 * np.real(v_s * np.conj(i_s)),
        rotor=1.5 * np.real(v_r * np.conj(i_r)),
        copper_s=1.5 * machine.R_s * np.abs(i_s) ** 2,
        copper_r=1.5 * machine.R_r * np.abs(i_r) ** 2,
        magnetic=1.5 * np.real(np.conj(i_s) * dphi_s + np.conj(i_r) * dphi_r),
        mechanical=torque * omega_m,
    )


def open_loop_steady_state(omega_m, v_s, v_r, omega_s, machine):
    """Return stator and rotor current (A, complex) under constant voltages at a fixed speed: eq. (6)–(9), d/dt = 0.

    Parameters
    ----------
    omega_m : float
        Mechanical speed (rad/s).
    v_s, v_r : complex
        Voltages in the frame (V).
    omega_s : float
        Electrical frequency of the stator feeding, which is the frame's speed (rad/s).
    machine : DfimParameters

    Raises
    ------
    ValueError
        If an input is not finite.
    """
    omega_m, omega_s = number("omega_m", omega_m, "rad/s"), number("omega_s", omega_s, "rad/s")
    omega_r = omega_s - machine.p * omega_m
    impedance = np.array(
        [
            [machine.R_s + 1j * omega_s * machine.L_s, 1j * omega_s * machine.M],
            [1j * omega_r * machine.M, machine.R_r + 1j * omega_r * machine.L_r],
        ]
    )
    i_s, i_r = np.linalg.solve(impedance, np.array([v_s, v_r], dtype=complex))
    return i_s, i_r
