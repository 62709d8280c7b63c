"""Operation by the inverter's angle φ: Eskander 2002, section 6, with V_q = V_s cos φ and V_d = −V_s sin φ.

Section 6 neglects the iron current in the voltages, and so does this module. It drives forward: where (20) or
its inverse is meant, negative speed, current, torque or angle is refused; `angle_of` takes any point.
"""

import numpy as np

from drivelib import pmsm
from drivelib.validation import array, number


def inverter_angle(machine, omega_e, i_oq):
    """Return φ_op = atan[ω L i_oq / (R_s i_oq + ω λ)] (rad): eq. (20), with L = L_q. It holds i_od at zero."""
    omega_e, i_oq = array("omega_e", omega_e, "rad/s", at_least=0), array("i_oq", i_oq, "A", at_least=0)
    return np.arctan2(omega_e * machine.L_q * i_oq, machine.R_s * i_oq + omega_e * machine.psi_f)


def i_oq_at_angle(machine, omega_e, phi):
    """Return the i_oq (A) whose φ_op is ``phi`` (rad): eq. (20) solved; NaN where no current reaches the angle."""
    omega_e, phi = array("omega_e", omega_e, "rad/s", above=0), array("phi", phi, "rad", at_least=0, at_most=1.5)
    reach = omega_e * machine.L_q - machine.R_s * np.tan(phi)
    return np.where(reach > 0, omega_e * machine.psi_f * np.tan(phi) / np.where(reach > 0, reach, 1), np.nan)


def angle_of(machine, omega_e, i_od, i_oq):
    """Return the angle φ (rad) and amplitude V_s (V) of the voltage that drives given currents."""
    V_d, V_q = pmsm.stator_voltages(machine, omega_e, i_od, i_oq, model="simplified")
    return np.arctan2(-V_d, V_q), np.hypot(V_d, V_q)


def zero_angle(machine, omega_e, *, V_s=None, current=None, T_e=None):
    """Return (i_od, i_oq) (A) at φ = 0 for one given quantity: voltage (V), current (A) or torque (N m).

    V_d = 0 makes i_od = r i_oq with r = ω L_q / R_s. Given the torque, NaN where φ = 0 cannot reach it.

    Raises
    ------
    ValueError
        Unless exactly one of the three is given, speed, current and torque are not negative, and R_s is not zero.
    """
    given = {"V_s": V_s, "current": current, "T_e": T_e}
    names = [name for name, value in given.items() if value is not None]
    if len(names) != 1:
        raise ValueError(f"give exactly one of V_s, current, T_e; got {', '.join(names) or 'none'}")
    omega_e = array("omega_e", omega_e, "rad/s", at_least=0)
    r = omega_e * machine.L_q / number("R_s", machine.R_s, "ohm", above=0)
    if V_s is not None:
        return pmsm.branch_currents_at_voltage(machine, omega_e, V_s, 0.0, model="simplified")
    if current is not None:
        i_oq = array("current", current, "A", at_least=0) / np.sqrt(1 + r**2)
        return r * i_oq, i_oq
    q = array("T_e", T_e, "N m", at_least=0) / (1.5 * machine.P)
    square = machine.psi_f**2 + 4 * machine.delta_L * r * q
    i_oq = np.where(square >= 0, 2 * q / (machine.psi_f + np.sqrt(np.maximum(square, 0))), np.nan)
    return r * i_oq, i_oq
