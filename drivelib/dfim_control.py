"""One sample of Zidani's controller (figure 2): measured currents in, inverter voltages and its next state out.

Both loops compile this same source: the one that simulates a single drive and the one that takes many abreast.
"""

from typing import NamedTuple

from numba import njit

from drivelib import control, dfim_decoupling
from drivelib.compiled import OPTIONS
from drivelib.dfim_plant import turn

# Division by zero gives inf or NaN here, which the loops' bounds catch; a check at each would cost a branch.
_compensation_terms = njit(**OPTIONS)(dfim_decoupling.compensation_terms)
_clip_vector = njit(**OPTIONS)(control.clip_vector)
_pi_output = njit(**OPTIONS)(control.pi_output)
_pi_integral = njit(**OPTIONS)(control.pi_integral)
_stator_frequency = njit(**OPTIONS)(control.stator_frequency)


class DriveSettings(NamedTuple):
    """What the controller knows and is set to; SI units, names as in ``Scenario``. Carrier frequency 0: averaged."""

    R_s: float
    R_r: float
    L_s: float
    L_r: float
    M: float
    p: float
    K_ps: float
    K_is: float
    K_pr: float
    K_ir: float
    phi_ref: float
    T_limit: float
    v_s_limit: float
    v_r_limit: float
    i_s_limit: float
    i_r_limit: float
    law: int
    omega_r_constant: float
    k_orientation: float
    estimator: int
    corner: float
    period: float
    substeps: int
    carrier_frequency: float
    V_dc_s: float
    V_dc_r: float


class Command(NamedTuple):
    """What a sample gives: frame speeds (rad/s), inverter voltages limited and as asked (V), integral terms of the next sample (V)."""

    omega_s: float
    omega_r: float
    v_sd: float
    v_sq: float
    v_rd: float
    v_rq: float
    w_sd: float
    w_sq: float
    w_rd: float
    w_rq: float
    u_sd: float
    u_sq: float
    u_rd: float
    u_rq: float


# Inlined: the caller keeps only what it uses, and a loop over many drives can then be vectorised.
@njit(**OPTIONS, inline="always")
def control_sample(i_sd, i_sq, i_rd, i_rq, hat_d, hat_q, omega_m, T_ref, u_sd, u_sq, u_rd, u_rq, s):
    """Return the Command of one sample: everything behind the speed controller.

    Parameters
    ----------
    i_sd, i_sq, i_rd, i_rq, hat_d, hat_q : float
        Measured currents (A) and estimated rotor flux (Wb), in the frame.
    omega_m, T_ref : float
        Speed (rad/s) and torque reference (N m).
    u_sd, u_sq, u_rd, u_rq : float
        Integral terms of the four current controllers (V).
    s : DriveSettings
    """
    k_r, k_s = s.M / s.L_r, s.M / s.L_s
    sigma = 1.0 - s.M * s.M / (s.L_s * s.L_r)

    # Frame speed: the law's share of the rotor speed, and the correction towards the estimated flux
    omega_e = s.p * omega_m
    usable = max(hat_d, 0.2 * s.phi_ref)
    omega_s = _stator_frequency(s.law, omega_e, s.omega_r_constant) + s.k_orientation * hat_q / usable
    omega_r = omega_s - omega_e

    # Current references, eq. (16) mended
    i_sq_ref = 2.0 * s.L_r / (3.0 * s.p * s.M) * T_ref / usable
    e_sd, e_sq, e_rd, e_rq = s.phi_ref / s.M - i_sd, i_sq_ref - i_sq, -i_rd, -k_r * i_sq_ref - i_rq

    # Four current controllers, compensation (13)–(14), inverter voltages from (12)
    c_sd, c_sq, c_rd, c_rq = _compensation_terms(i_sd, i_sq, i_rd, i_rq, omega_s, omega_r, s.R_s, s.R_r, s.L_s, s.L_r, s.M)
    t_sd, t_sq = _pi_output(e_sd, u_sd, s.K_ps) + c_sd, _pi_output(e_sq, u_sq, s.K_ps) + c_sq
    t_rd, t_rq = _pi_output(e_rd, u_rd, s.K_pr) + c_rd, _pi_output(e_rq, u_rq, s.K_pr) + c_rq
    w_sd, w_sq = (t_sd + k_r * t_rd) / sigma, (t_sq + k_r * t_rq) / sigma
    w_rd, w_rq = (t_rd + k_s * t_sd) / sigma, (t_rq + k_s * t_sq) / sigma
    v_sd, v_sq = _clip_vector(w_sd, w_sq, s.v_s_limit)
    v_rd, v_rq = _clip_vector(w_rd, w_rq, s.v_r_limit)

    # Integrators: back-calculation from the combined voltages that both inverters really gave
    a_s, a_r = s.K_is / s.K_ps, s.K_ir / s.K_pr
    u_sd = _pi_integral(u_sd, e_sd, t_sd, v_sd - k_r * v_rd, s.K_is, a_s, s.period)
    u_sq = _pi_integral(u_sq, e_sq, t_sq, v_sq - k_r * v_rq, s.K_is, a_s, s.period)
    u_rd = _pi_integral(u_rd, e_rd, t_rd, v_rd - k_s * v_sd, s.K_ir, a_r, s.period)
    u_rq = _pi_integral(u_rq, e_rq, t_rq, v_rq - k_s * v_sq, s.K_ir, a_r, s.period)
    return Command(omega_s, omega_r, v_sd, v_sq, v_rd, v_rq, w_sd, w_sq, w_rd, w_rq, u_sd, u_sq, u_rd, u_rq)


@njit(**OPTIONS, inline="always")
def voltage_model(hat_d, hat_q, i_rd, i_rq, end_rd, end_rq, end_d, end_q, v_rd, v_rq, c, s_, s):
    """Return the rotor flux (Wb) that the voltage model estimates a period later.

    Trapezoid of v_r − R_r i_r in the rotor frame, seen from the controller's; the corner ties it to the currents.

    Parameters
    ----------
    hat_d, hat_q : float
        Estimate at the period's start (Wb).
    i_rd, i_rq, end_rd, end_rq : float
        Rotor currents at its start and its end (A).
    end_d, end_q : float
        Flux that the currents at its end give (Wb).
    v_rd, v_rq : float
        Rotor voltage (V), as seen in the middle.
    c, s_ : float
        Cosine and sine of half the angle by which the frame turns from the rotor.
    s : DriveSettings
    """
    h = s.period
    hat_d, hat_q = turn(hat_d - 0.5 * h * s.R_r * i_rd, hat_q - 0.5 * h * s.R_r * i_rq, c, s_)
    hat_d, hat_q = turn(hat_d + h * v_rd, hat_q + h * v_rq, c, s_)
    hat_d += -0.5 * h * s.R_r * end_rd + h * s.corner * (end_d - hat_d)
    hat_q += -0.5 * h * s.R_r * end_rq + h * s.corner * (end_q - hat_q)
    return hat_d, hat_q
