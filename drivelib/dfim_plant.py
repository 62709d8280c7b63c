"""One compiled step of the motor between two changes of the inverters' voltages.

The stator inverter's voltage stands still in the stator frame and the rotor inverter's in the rotor
frame while the motor is integrated in the controller's d-q frame, in which fluxes move slowly. Holding
both in one frame would be wrong by the angle between the frames per period, first order in its length.
"""

import math

from numba import njit

from drivelib.compiled import OPTIONS
from drivelib.dfim import dfim_derivatives as _dfim_derivatives

dfim_derivatives = njit(**OPTIONS, inline="always")(_dfim_derivatives)

SMALL_ANGLE = 0.125  # rad


@njit(**OPTIONS)
def turn(d, q, c, s):
    """Return the vector (d, q) turned back by the angle with cosine c and sine s."""
    return d * c + q * s, q * c - d * s


@njit(**OPTIONS)
def small_cos_sin(x):
    """Return cos x and sin x to 1e-16 for |x| ≤ 1/8: Taylor's polynomials, a fifth of the library's time."""
    z = x * x
    cos = 1.0 + z * (-1 / 2 + z * (1 / 24 + z * (-1 / 720 + z * (1 / 40320 - z / 3628800))))
    return cos, x + x * z * (-1 / 6 + z * (1 / 120 + z * (-1 / 5040 + z * (1 / 362880 - z / 39916800))))


@njit(**OPTIONS)
def cos_sin(x):
    """Return cos x and sin x; fast for the angles that a frame turns within a period."""
    if abs(x) <= SMALL_ANGLE:
        return small_cos_sin(x)
    return math.cos(x), math.sin(x)


# Inlined into the loops, as its callers are: handing over some twenty numbers costs a quarter of a drive's time.
@njit(**OPTIONS, inline="always")
def held_step(
    phi_sd, phi_sq, phi_rd, phi_rq, omega_m, v_sd, v_sq, v_rd, v_rq, omega_s, T_load, R_r, dt, coefficients
):
    """Advance the motor by one classical Runge–Kutta step with both voltages held in their own frames.

    Parameters
    ----------
    phi_sd, phi_sq, phi_rd, phi_rq, omega_m : float
        Fluxes (Wb) in the frame, and speed (rad/s), at the start.
    v_sd, v_sq, v_rd, v_rq : float
        Voltages (V) as seen from the frame in the middle of the step; the rotor's under the speed at the
        start. From a frame that turns on, a held vector turns back: the ends differ by half a step's angle.
    omega_s, T_load, R_r, dt : float
        Frame speed (rad/s), load torque (N m), rotor resistance (ohm), step (s).
    coefficients : DfimCoefficients

    Returns
    -------
    tuple of six
        The five states at the end, and the rotor's mechanical angle (rad) covered beyond omega_m · dt.
    """
    half = 0.5 * dt
    c_s, s_s = cos_sin(half * omega_s)
    c_r, s_r = cos_sin(half * (omega_s - coefficients.p * omega_m))
    return turned_step(
        phi_sd, phi_sq, phi_rd, phi_rq, omega_m, v_sd, v_sq, v_rd, v_rq, omega_s, T_load, R_r, dt, coefficients, c_s, s_s, c_r, s_r
    )


# Inlined, so that the loop over many drives can be vectorised.
@njit(**OPTIONS, inline="always")
def turned_step(
    phi_sd, phi_sq, phi_rd, phi_rq, omega_m, v_sd, v_sq, v_rd, v_rq, omega_s, T_load, R_r, dt, coefficients, c_s, s_s, c_r, s_r
):
    """Do what ``held_step`` says, given cosine and sine of half the angles that the frame turns from stator and rotor."""
    half, p = 0.5 * dt, coefficients.p
    v0_sd, v0_sq = turn(v_sd, v_sq, c_s, -s_s)
    v0_rd, v0_rq = turn(v_rd, v_rq, c_r, -s_r)
    a = dfim_derivatives(
        phi_sd, phi_sq, phi_rd, phi_rq, omega_m, v0_sd, v0_sq, v0_rd, v0_rq, omega_s, T_load, R_r, coefficients
    )
    b = dfim_derivatives(
        phi_sd + half * a[0], phi_sq + half * a[1], phi_rd + half * a[2], phi_rq + half * a[3], omega_m + half * a[4],
        v_sd, v_sq, v_rd, v_rq, omega_s, T_load, R_r, coefficients,
    )  # fmt: skip
    # The rotor runs ahead of the angle predicted with its speed at the start, and takes its voltage along:
    # the angle is the integral of the speed gained, integrated as a sixth state.
    b_angle = half * a[4]
    v1_rd, v1_rq = ahead(v_rd, v_rq, p * half * b_angle)
    c = dfim_derivatives(
        phi_sd + half * b[0], phi_sq + half * b[1], phi_rd + half * b[2], phi_rq + half * b[3], omega_m + half * b[4],
        v_sd, v_sq, v1_rd, v1_rq, omega_s, T_load, R_r, coefficients,
    )  # fmt: skip
    c_angle = half * b[4]
    v2_sd, v2_sq = turn(v_sd, v_sq, c_s, s_s)
    v2_rd, v2_rq = turn(v_rd, v_rq, c_r, s_r)
    v2_rd, v2_rq = ahead(v2_rd, v2_rq, p * dt * c_angle)
    d = dfim_derivatives(
        phi_sd + dt * c[0], phi_sq + dt * c[1], phi_rd + dt * c[2], phi_rq + dt * c[3], omega_m + dt * c[4],
        v2_sd, v2_sq, v2_rd, v2_rq, omega_s, T_load, R_r, coefficients,
    )  # fmt: skip
    d_angle = dt * c[4]
    sixth = dt / 6.0
    return (
        phi_sd + sixth * (a[0] + 2.0 * (b[0] + c[0]) + d[0]),
        phi_sq + sixth * (a[1] + 2.0 * (b[1] + c[1]) + d[1]),
        phi_rd + sixth * (a[2] + 2.0 * (b[2] + c[2]) + d[2]),
        phi_rq + sixth * (a[3] + 2.0 * (b[3] + c[3]) + d[3]),
        omega_m + sixth * (a[4] + 2.0 * (b[4] + c[4]) + d[4]),
        sixth * (2.0 * (b_angle + c_angle) + d_angle),
    )


@njit(**OPTIONS)
def ahead(d, q, x):
    """Return the vector turned forward by the tiny angle x; its cube, 1e-17 at 100 µs, is left out."""
    c = 1.0 - 0.5 * x * x
    return d * c - q * x, q * c + d * x


@njit(**OPTIONS, inline="always")
def averaged_period(
    phi_sd, phi_sq, phi_rd, phi_rq, omega_m, v_sd, v_sq, v_rd, v_rq, omega_s, T_load, R_r, period, coefficients, substeps
):
    """Advance the motor by one control period with inverters that give exactly the mean they are asked for.

    Arguments as for ``held_step``; the voltages are those seen in the middle of the period. ``substeps``
    Runge–Kutta steps share the period. Returns the five states and the angle covered beyond omega_m · period.
    """
    if substeps == 1:
        return held_step(
            phi_sd, phi_sq, phi_rd, phi_rq, omega_m, v_sd, v_sq, v_rd, v_rq, omega_s, T_load, R_r, period, coefficients
        )
    p, dt, start = coefficients.p, period / substeps, omega_m
    gained = 0.0  # mechanical angle beyond start · elapsed time
    for k in range(substeps):
        elapsed = k * dt
        back_s = omega_s * (elapsed + 0.5 * dt - 0.5 * period)
        turned = start * elapsed + gained + 0.5 * dt * omega_m
        back_r = omega_s * (elapsed + 0.5 * dt) - p * turned - 0.5 * period * (omega_s - p * start)
        u_sd, u_sq = turn(v_sd, v_sq, *cos_sin(back_s))
        u_rd, u_rq = turn(v_rd, v_rq, *cos_sin(back_r))
        before = omega_m
        phi_sd, phi_sq, phi_rd, phi_rq, omega_m, extra = held_step(
            phi_sd, phi_sq, phi_rd, phi_rq, omega_m, u_sd, u_sq, u_rd, u_rq, omega_s, T_load, R_r, dt, coefficients
        )
        gained += (before - start) * dt + extra
    return phi_sd, phi_sq, phi_rd, phi_rq, omega_m, gained
