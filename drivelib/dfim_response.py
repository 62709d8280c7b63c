"""Frequency response of the motor's four currents to the combined voltages, with and without compensation (Zidani, fig. 2, eq. 15).

The motor is `dfim.dfim_derivatives` at frozen speed, not (13): what comes out can test (12)-(15).
"""

import numpy as np

from drivelib import dfim, dfim_decoupling
from drivelib.validation import array, choice, number

AXES = ("sd", "sq", "rd", "rq")


def current_response(machine, omega, omega_m, omega_s, *, compensated=True, R_r_factor=1.0):
    """Return the gain from each combined voltage to each current at angular frequencies ``omega``.

    Parameters
    ----------
    machine : DfimParameters
        What the compensation takes the motor for.
    omega : array
        Angular frequencies (rad/s).
    omega_m, omega_s : float
        Frozen mechanical speed, and frame speed seen from the stator (rad/s).
    compensated : bool
        Whether the compensation terms of (14) are added, so that the input is V_tc; without, the input is
        the whole combined voltage V_t.
    R_r_factor : float
        The motor's rotor resistance over the one that the compensation knows, positive.

    Returns
    -------
    complex array, shape (frequencies, 4, 4)
        Entry [k, i, n] is current i over voltage n (A/V), both in the order of AXES.

    Raises
    ------
    ValueError
        If an input is not finite or out of range.
    """
    omega = array("omega", omega, "rad/s")
    omega_m, omega_s = number("omega_m", omega_m, "rad/s"), number("omega_s", omega_s, "rad/s")
    R_r = machine.R_r * number("R_r_factor", R_r_factor, above=0)
    omega_r = omega_s - machine.p * omega_m
    inductances = np.kron(np.array([[machine.L_s, machine.M], [machine.M, machine.L_r]]), np.eye(2))

    def slopes(currents, inputs):
        fluxes = inductances @ currents
        terms = dfim_decoupling.compensation_terms(
            *currents, omega_s, omega_r, machine.R_s, machine.R_r, machine.L_s, machine.L_r, machine.M
        )
        v_t = inputs + np.array(terms) if compensated else inputs
        v_s, v_r = dfim_decoupling.inverter_voltages(v_t[:2], v_t[2:], machine)
        voltages = (*v_s, *v_r)
        found = dfim.dfim_derivatives(*fluxes, omega_m, *voltages, omega_s, 0.0, R_r, dfim.coefficients(machine))
        return np.linalg.solve(inductances, np.array(found[:4]))

    unit, none = np.eye(4), np.zeros(4)
    A = np.column_stack([slopes(column, none) for column in unit])
    B = np.column_stack([slopes(none, column) for column in unit])
    return np.linalg.solve(1j * omega[:, None, None] * unit - A, np.broadcast_to(B, (omega.size, 4, 4)))


def first_order_lag(machine, omega, *, winding="s"):
    """Return 1/(R + σL jω) of the stator (``"s"``) or rotor (``"r"``) winding (A/V), eq. (15).

    Raises
    ------
    ValueError
        If a frequency is not finite or the winding is unknown.
    """
    R, L = (machine.R_s, machine.L_s) if choice("winding", winding, ("s", "r")) == "s" else (machine.R_r, machine.L_r)
    return 1.0 / (R + 1j * array("omega", omega, "rad/s") * machine.sigma * L)
