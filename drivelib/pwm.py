"""Carrier pulse width modulation of both inverters, with exact switching instants.

Each phase compares its duty with a triangular carrier; duties are held over a control period and the
carrier is straight between its peaks, so each switching instant is the root of a line. Between two
instants both inverters stand still and the motor takes one Runge–Kutta step.
"""

import math

from numba import njit

from drivelib.compiled import OPTIONS
from drivelib.dfim_plant import held_step, turn

HALF_SQRT3 = math.sqrt(3.0) / 2.0


@njit(**OPTIONS)
def duties(alpha, beta, V_dc):
    """Return the three references in −1 … 1 that give the phase voltage vector (alpha, beta) in V on average.

    The middle of the three is centred (zero sequence −(max + min)/2), which reaches V_dc/√3 at every angle.
    """
    a, b, c = alpha, -0.5 * alpha + HALF_SQRT3 * beta, -0.5 * alpha - HALF_SQRT3 * beta
    zero = 0.5 * (max(a, b, c) + min(a, b, c))
    scale = 2.0 / V_dc
    return scale * (a - zero), scale * (b - zero), scale * (c - zero)


@njit(**OPTIONS)
def switched_vector(duty, carrier, V_dc):
    """Return the phase voltage vector (V, in the inverter's frame) while the carrier has this value."""
    a, b, c = 1.0 * (duty[0] > carrier), 1.0 * (duty[1] > carrier), 1.0 * (duty[2] > carrier)
    return V_dc * (2.0 * a - b - c) / 3.0, V_dc * HALF_SQRT3 * 2.0 / 3.0 * (b - c)


@njit(**OPTIONS)
def switching_instants(duty_s, duty_r, begin, end, carrier, slope, instants):
    """Write the times at which a straight piece of the carrier crosses the duties, in order; return their number.

    The piece runs from time ``begin`` to ``end`` (s) and starts at ``carrier`` with ``slope`` (1/s).
    """
    n = 0
    for k in range(6):
        duty = duty_s[k] if k < 3 else duty_r[k - 3]
        t = begin + (duty - carrier) / slope
        if begin < t < end:
            j = n
            while j > 0 and instants[j - 1] > t:
                instants[j] = instants[j - 1]
                j -= 1
            instants[j] = t
            n += 1
    return n


@njit(**OPTIONS)
def switched_period(
    phi_sd, phi_sq, phi_rd, phi_rq, omega_m, v_sd, v_sq, v_rd, v_rq, omega_s, T_load, R_r, period, plant,
    theta_s, theta_m, t, frequency, V_dc_s, V_dc_r, instants, extremes,
):  # fmt: skip
    """Advance the motor by one control period with both inverters switching.

    Arguments as for ``averaged_period``, then the angles of frame and rotor (rad) and the time (s) at the
    start, the carriers' frequency (Hz), the dc voltages (V), scratch of six floats, and ``extremes``: the
    smallest and the largest torque (N m) so far, which the torques at the switching instants extend.

    The carriers start at their positive peak at t = 0, both together.

    Returns
    -------
    tuple of six
        As ``averaged_period``.
    """
    p, start = plant.p, omega_m
    # Seen from the frame in the middle of the period; the inverters need them in their own frames.
    angle_s = theta_s + 0.5 * period * omega_s
    angle_r = angle_s - p * (theta_m + 0.5 * period * omega_m)
    a_s, b_s = turn(v_sd, v_sq, math.cos(angle_s), -math.sin(angle_s))
    a_r, b_r = turn(v_rd, v_rq, math.cos(angle_r), -math.sin(angle_r))
    duty_s, duty_r = duties(a_s, b_s, V_dc_s), duties(a_r, b_r, V_dc_r)

    ramp = 0.5 / frequency  # from peak to trough
    ramps = math.floor(t / ramp + 1e-9)  # the carrier is on its straight piece of this number
    now, turned = 0.0, 0.0  # elapsed time (s), mechanical angle covered (rad)
    while now < period * (1.0 - 1e-9):
        end = min((ramps + 1.0) * ramp - t, period)
        slope = -2.0 / ramp if ramps % 2.0 == 0.0 else 2.0 / ramp
        carrier = math.copysign(1.0, -slope) + slope * (t + now - ramps * ramp)
        begin = now
        count = switching_instants(duty_s, duty_r, begin, end, carrier, slope, instants)
        for j in range(count + 1):
            until = instants[j] if j < count else end
            dt = until - now
            level = carrier + slope * (now + 0.5 * dt - begin)
            angle_s = theta_s + omega_s * (now + 0.5 * dt)
            angle_r = angle_s - p * (theta_m + turned + 0.5 * dt * omega_m)
            a_s, b_s = switched_vector(duty_s, level, V_dc_s)
            a_r, b_r = switched_vector(duty_r, level, V_dc_r)
            u_sd, u_sq = turn(a_s, b_s, math.cos(angle_s), math.sin(angle_s))
            u_rd, u_rq = turn(a_r, b_r, math.cos(angle_r), math.sin(angle_r))
            turned += dt * omega_m
            phi_sd, phi_sq, phi_rd, phi_rq, omega_m, gained = held_step(
                phi_sd, phi_sq, phi_rd, phi_rq, omega_m, u_sd, u_sq, u_rd, u_rq, omega_s, T_load, R_r, dt, plant
            )
            turned += gained
            now = until
            # Rotor flux times stator current, eq. (10); the part of i_s along φ_r makes no torque
            torque = plant.k_T * plant.Gamma_s * (phi_rd * phi_sq - phi_rq * phi_sd)
            extremes[0], extremes[1] = min(extremes[0], torque), max(extremes[1], torque)
        ramps += 1.0
    return phi_sd, phi_sq, phi_rd, phi_rq, omega_m, turned - start * period
