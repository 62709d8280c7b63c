"""What the papers' formulas give when they are taken as printed. For the errata only; nothing else may use it.

(11), (16), (19) as printed have their functions beside the mended ones: `pmsm_optimum.optimal_i_od_as_printed`,
`dfim_decoupling.printed_current_references`, `control.printed_speed_gains`.
"""

import numpy as np

from drivelib import pmsm
from drivelib.curves import last_below
from drivelib.validation import array, number


def optimum_with_printed_slope(machine, omega_e, T_e, *, low=-20.0):
    """Return the i_od (A) at which Eskander's (8) vanishes with (10) as printed, the square around the whole fraction.

    That square makes the slope of i_oq negative and next to nothing, so that the reluctance torque is lost sight of.
    The root is sought from ``low`` (A) up to a quarter of the current λ/|L_d − L_q| at which (9) breaks down; up to there the
    misprinted (8) rises.

    Parameters
    ----------
    machine : PmsmParameters
    omega_e, T_e : array_like
        Electrical speed (rad/s) and torque (N m); they broadcast.
    """
    omega_e, T_e = np.broadcast_arrays(array("omega_e", omega_e, "rad/s"), array("T_e", T_e, "N m"))
    number("low", low, "A", at_most=0)
    iron = omega_e**2 / machine.R_c

    def printed_slope(i_od):
        i_oq = pmsm.i_oq_at_torque(machine, T_e, i_od)
        return (
            i_od * (machine.R_s + iron * machine.L_d**2)
            - i_oq * (machine.delta_L * i_oq) ** 2 * (machine.R_s + iron * machine.L_q**2)
            + iron * machine.psi_f * machine.L_d
        )

    top = 0.25 * machine.psi_f / abs(machine.delta_L) if machine.delta_L else -low
    return last_below(printed_slope, 0.0, np.full(omega_e.shape, low), np.full(omega_e.shape, top))


def surface_optimum_with_printed_slope(machine, omega_e):
    """Return the i_od (A) at which Eskander's (15) as printed vanishes: R_c multiplies the last term.

    −L_s ω² λ / (R_c (R_s + ω² L_s² R_c)); the numbers are in SI units, or the sum would mean nothing.

    Raises
    ------
    ValueError
        If the machine is salient.
    """
    omega_e = array("omega_e", omega_e, "rad/s")
    if machine.delta_L != 0:
        raise ValueError(f"L_d − L_q = {machine.delta_L:g} H: eq. (15) holds for a surface machine only, L_d = L_q")
    squared = omega_e**2
    return -machine.L_d * squared * machine.psi_f / machine.R_c / (machine.R_s + squared * machine.L_d**2 * machine.R_c)


def rotor_voltage(machine, i_r, phi_r, omega_r, *, printed):
    """Return the steady rotor voltage (V, complex) of Zidani's (2): with −jω_R φ_R as printed, or with the plus of (8) and (9)."""
    return machine.R_r * i_r + (-1j if printed else 1j) * omega_r * phi_r


def rotor_flux(machine, i_s, i_r, *, printed):
    """Return the rotor flux (Wb, complex) of Zidani's (4): with I_R twice as printed, or with I_S in the second term."""
    return machine.L_r * i_r + machine.M * (i_r if printed else i_s)
