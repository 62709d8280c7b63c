"""Which values of Eskander's omitted numbers are consistent with what is printed: R_c, operating points, loads.

Printed digits count as intervals, half a unit of the last digit either way.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from drivelib import pmsm, pmsm_angle, pmsm_optimum
from drivelib.curves import last_below
from drivelib.validation import array, grid, number

FORMS = tuple((model, convention) for model in ("simplified", "full") for convention in ("paper", "consistent"))
"""How the loss may have been meant: branch or terminal currents in (5), without or with the 3/2 of (3)."""


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


def iron_resistance(machine, loss, omega_m, T_e, *, model="simplified", convention="paper", R_c_range=(0.1, 1e5)):
    """Return the R_c (ohm) with which the least loss equals ``loss`` (W) at a mechanical speed (rad/s) and torque (N m).

    Motoring: there the least loss falls as R_c rises, so there is one such value at most. Arrays broadcast. NaN where
    the copper alone loses more, and where R_c would leave its range.
    """
    number("loss", loss, "W", above=0)
    omega_m, T_e = array("omega_m", omega_m, "rad/s", at_least=0), array("T_e", T_e, "N m", at_least=0)
    R_c_range = grid("R_c_range", R_c_range, "ohm")[[0, -1]]
    number("R_c_range[0]", R_c_range[0], "ohm", above=0)
    omega_e, T_e = np.broadcast_arrays(machine.P * omega_m, T_e)

    def least(log_conductance):
        return pmsm_optimum.free_optimum(machine, omega_e, T_e, np.exp(-log_conductance), model=model, convention=convention).loss

    low, high = (np.full(omega_e.shape, -np.log(end)) for end in R_c_range[::-1])
    found = last_below(least, loss, low, high)
    return np.where(found < high, np.exp(-found), np.nan)


class ConsistentPoints(NamedTuple):
    """Where a printed loss may have been quoted; NaN where not. All of shape (speeds, torques).

    R_c (ohm), i_od (A) and V_s (V, phase peak) of the least loss; ``given_away``: efficiency that i_d = 0 would cost there
    (percentage points, losses as the form counts them).
    """

    R_c: np.ndarray
    i_od: np.ndarray
    V_s: np.ndarray
    given_away: np.ndarray


def consistent_points(machine, loss, omega_m, T_e, V_max, *, model="simplified", convention="paper", least_efficiency=0.0):
    """Return the `ConsistentPoints` of a printed loss (W) over speeds (rad/s) and torques (N m) inside a voltage (V, phase peak).

    ``least_efficiency`` (1) leaves out points that nobody would call efficient: shaft power over shaft power plus ``loss``.

    Raises
    ------
    ValueError
        If no point is consistent.
    """
    omega_m, T_e = grid("omega_m", omega_m, "rad/s")[:, None], grid("T_e", T_e, "N m")[None, :]
    number("V_max", V_max, "V", above=0)
    number("least_efficiency", least_efficiency, at_least=0, at_most=1)
    R_c = iron_resistance(machine, loss, omega_m, T_e, model=model, convention=convention)
    best = pmsm_optimum.free_optimum(machine, machine.P * omega_m, T_e, np.nan_to_num(R_c, nan=1.0), model=model, convention=convention)
    shaft = omega_m * T_e
    inside = np.isfinite(R_c) & (best.V_s <= V_max) & (shaft >= least_efficiency * (shaft + loss))
    if not inside.any():
        raise ValueError(
            f"loss = {loss:g} W: no R_c makes it a least loss inside {V_max:g} V between {omega_m.min():g} and {omega_m.max():g} rad/s, "
            f"{T_e.min():g} and {T_e.max():g} N m; what is printed contradicts these limits"
        )
    lost = 100 * (shaft / (shaft + best.loss) - shaft / (shaft + best.loss_at_zero))
    return ConsistentPoints(*(np.where(inside, values, np.nan) for values in (R_c, best.i_od, best.V_s, lost)))


def given_away(machine, omega_m, T_e, R_c):
    """Return the efficiency that i_d = 0 gives away against the least loss (percentage points), simplified model, with 3/2.

    Speeds (rad/s), torques (N m) and R_c (ohm) broadcast; motoring, with some shaft power.
    """
    omega_m, T_e = array("omega_m", omega_m, "rad/s", above=0), array("T_e", T_e, "N m", above=0)
    best = pmsm_optimum.free_optimum(machine, machine.P * omega_m, T_e, R_c, model="simplified")
    shaft = omega_m * T_e
    return 100 * (shaft / (shaft + best.loss) - shaft / (shaft + best.loss_at_zero))


def current_error(machine, omega_m, T_e, R_c, excess, *, convention="paper", reach=20.0):
    """Return how far below its optimum i_od lies (A) when the loss at the same torque is ``excess`` (W) above the least.

    Simplified model. Speeds (rad/s), torques (N m) and R_c (ohm) broadcast; ``reach`` (A) bounds the search.
    """
    number("reach", reach, "A", above=0)
    excess, R_c = array("excess", excess, "W", above=0), array("R_c", R_c, "ohm", above=0)
    omega_m, T_e, R_c, excess = np.broadcast_arrays(omega_m, T_e, R_c, excess)
    best = pmsm_optimum.free_optimum(machine, machine.P * omega_m, T_e, R_c, model="simplified", convention=convention)
    alike = machine.P * omega_m * np.sqrt(machine.R_c / R_c)  # the simplified loss knows only ω²/R_c

    def loss(below):
        i_od = best.i_od - below
        return pmsm.total_loss(machine, alike, i_od, pmsm.i_oq_at_torque(machine, T_e, i_od), model="simplified", convention=convention)

    return last_below(loss, best.loss + excess, np.zeros(excess.shape), np.full(excess.shape, reach))


def angle_torques(machine, omega_m, phi, digits):
    """Return the (least, greatest) torque (N m) whose φ_op (20) is ``phi`` (rad) at a speed (rad/s), inside printed digits.

    Parameters
    ----------
    digits : mapping
        Half a unit of the last printed digit of "R_s" (ohm), "L_q" (H) and "psi_f" (Wb).

    Notes
    -----
    T = 1.5 P λ² ω tan φ/(ω L_q − R_s tan φ) rises with R_s and λ and falls with L_q, so two corners bound it. Infinite
    where no torque reaches the angle.
    """
    units = {"R_s": "ohm", "L_q": "H", "psi_f": "Wb"}
    if set(digits) != set(units):
        raise ValueError(f"digits names {', '.join(digits) or 'nothing'}: must name {', '.join(units)}")
    halves = {name: number(f"digits[{name!r}]", digits[name], unit, at_least=0) for name, unit in units.items()}
    torques = []
    for side in (-1, 1):
        corner = machine.changed(
            R_s=machine.R_s + side * halves["R_s"], L_q=machine.L_q - side * halves["L_q"], psi_f=machine.psi_f + side * halves["psi_f"]
        )
        i_oq = pmsm_angle.i_oq_at_angle(corner, corner.P * array("omega_m", omega_m, "rad/s", above=0), phi)
        torques.append(np.where(np.isnan(i_oq), np.inf, pmsm.torque(corner, np.zeros(np.shape(i_oq)), np.nan_to_num(i_oq))))
    return tuple(torques)
