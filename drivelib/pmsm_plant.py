"""One control period of a permanent-magnet machine under a voltage held in the stator, compiled.

The rotor frame turns by θ under the voltage, dθ/dt = P ω_m: v_d + j v_q = (v_d0 + j v_q0) exp(−j θ). θ is
integrated with the currents and the speed, and so are the energies, by the classical Runge–Kutta method.
"""

import numpy as np
from numba import njit
from numba.extending import register_jitable

from drivelib import pmsm_dynamics
from drivelib.compiled import OPTIONS

# The physics layer stays free of numba; compiled callers find these functions under their own names.
for function in (
    pmsm_dynamics.branch_voltage,
    pmsm_dynamics.branch_torque,
    pmsm_dynamics.pmsm_derivatives,
    pmsm_dynamics.power_flows,
):
    register_jitable(function)

_pmsm_derivatives, _power_flows = pmsm_dynamics.pmsm_derivatives, pmsm_dynamics.power_flows


@njit(**OPTIONS)
def held_period(i_od, i_oq, omega_m, v_d, v_q, T_load, imposed, period, substeps, c):
    """Return the state after one period, and the energies that flowed in it.

    Parameters
    ----------
    i_od, i_oq, omega_m : float
        Branch currents (A) and mechanical speed (rad/s) at the start.
    v_d, v_q : float
        Terminal voltage at the start, in the rotor frame (V).
    T_load : float
        Load torque (N m).
    imposed : bool
        Whether the speed stays as it is, whatever the torques.
    period : float
        Length (s).
    substeps : int
        Runge–Kutta steps.
    c : PmsmCoefficients

    Returns
    -------
    tuple of six
        i_od, i_oq (A), ω_m (rad/s); electrical input, heat and shaft work (J).
    """
    h = period / substeps
    free = 0.0 if imposed else 1.0
    theta = 0.0
    drawn = heated = worked = 0.0
    for _ in range(substeps):
        d_od = d_oq = d_omega = d_theta = 0.0
        sum_od = sum_oq = sum_omega = sum_theta = 0.0
        for stage in range(4):
            reach = 0.0 if stage == 0 else h if stage == 3 else 0.5 * h
            share = h / 6.0 if stage in (0, 3) else h / 3.0
            x_od, x_oq, x_omega = i_od + reach * d_od, i_oq + reach * d_oq, omega_m + reach * d_omega
            x_theta = theta + reach * d_theta
            cosine, sine = np.cos(x_theta), np.sin(x_theta)
            u_d, u_q = v_d * cosine + v_q * sine, v_q * cosine - v_d * sine
            d_od, d_oq, d_omega = _pmsm_derivatives(x_od, x_oq, x_omega, u_d, u_q, T_load, c)
            d_omega *= free
            d_theta = c.P * x_omega
            sum_od += share * d_od
            sum_oq += share * d_oq
            sum_omega += share * d_omega
            sum_theta += share * d_theta
            power, heat, shaft = _power_flows(x_od, x_oq, x_omega, u_d, u_q, c)
            drawn += share * power
            heated += share * heat
            worked += share * shaft
        i_od += sum_od
        i_oq += sum_oq
        omega_m += sum_omega
        theta += sum_theta
    return i_od, i_oq, omega_m, drawn, heated, worked
