"""Which values of the omitted numbers are consistent with what is printed."""

import numpy as np
from scipy.optimize import brentq

from drivelib import pmsm_optimum
from drivelib.validation import array, grid, number


def loss_curve(machine, loss, R_c, T_e, *, model="simplified", convention="paper"):
    """Return (ω_m, V_s) (rad/s, V) at which the least loss equals ``loss`` (W), for each R_c and torque.

    Parameters
    ----------
    R_c : array_like, shape (n,)
        Iron-loss resistances (ohm).
    T_e : array_like, shape (m,)
        Torques (N m).

    Returns
    -------
    omega_m, V_s : ndarray, shape (n, m)
        Mechanical speed and stator voltage; NaN where no speed has this loss.
    """
    R_c, T_e = np.atleast_1d(array("R_c", R_c, "ohm", above=0)), np.atleast_1d(array("T_e", T_e, "N m"))
    omega_e, V_s = np.empty((2, R_c.size, T_e.size))
    for row, resistance in enumerate(R_c):
        one = machine.changed(R_c=float(resistance))
        speeds = pmsm_optimum.speed_at_loss(one, T_e, loss, model=model, convention=convention)
        at = pmsm_optimum.optimum(one, np.nan_to_num(speeds), T_e, model=model, convention=convention)
        omega_e[row], V_s[row] = speeds, np.where(np.isnan(speeds), np.nan, at.V_s)
    return omega_e / machine.P, V_s


def largest_iron_resistance(machine, loss, T_e, V_max, *, model="simplified", R_c_range=(20.0, 5000.0)):
    """Return the R_c (ohm) up to which ``loss`` (W) is a least loss inside ``V_max`` (V) at one torque.

    A larger R_c needs a higher speed for the same loss, and with it more voltage. The loss is the paper's,
    without 3/2. Infinity where the voltage suffices up to the end of the range; NaN where it does not even
    suffice at its start, or where at either end no speed has this loss.
    """
    number("V_max", V_max, "V", above=0)
    T_e = number("T_e", T_e, "N m")
    R_c_range = grid("R_c_range", R_c_range, "ohm")[[0, -1]]
    number("R_c_range[0]", R_c_range[0], "ohm", above=0)

    def excess(R_c):
        return float(loss_curve(machine, loss, R_c, T_e, model=model)[1][0, 0]) - V_max

    ends = excess(R_c_range[0]), excess(R_c_range[1])
    if np.isnan(ends).any():
        return np.nan
    if ends[1] < 0:
        return np.inf
    return brentq(excess, *R_c_range) if ends[0] < 0 else np.nan
