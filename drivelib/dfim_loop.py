"""The compiled loop of Zidani's drive (figures 2 and 9): controllers, two inverters and the motor, sample by sample.

Orientation. In a frame locked to the estimated flux L_r i_rq + M i_sq vanishes identically: both
q-current loops would then see one error, their integrators could wind against each other without a
trace in the currents, and a frame speed taken back from the turning flux would drift with them. Here the
frequency law sets the frame's speed, and the flux estimate corrects it:

    ω_s = ω_s*(p Ω) + k φ̂_rq/φ̂_rd,     ω_r = ω_s − p Ω,

both used in the compensation as they are applied. All four currents keep an integrator, because in
this frame they are four independent states; with references that obey (11) the estimate's q component
dies out with the currents' errors, the correction with it, and the frame keeps the law's speed.
"""

import numpy as np
from numba import njit

from drivelib import metrics
from drivelib.compiled import OPTIONS
from drivelib.dfim_control import control_sample, voltage_model
from drivelib.dfim_plant import averaged_period, cos_sin
from drivelib.encoder import encoder_speed
from drivelib.pwm import switched_period
from drivelib.speed_law import WEIGHTED, speed_command, weighted_command

_interval_indices = njit(**OPTIONS)(metrics.interval_indices)

CHANNELS = (
    "omega_ref", "omega_m", "T_ref", "T_e", "T_load", "i_sd", "i_sq", "i_rd", "i_rq", "phi_rd", "phi_rq",
    "phi_hat_d", "phi_hat_q", "v_sd", "v_sq", "v_rd", "v_rq", "omega_s", "omega_r", "theta_s", "theta_m",
    "T_min", "T_max",
)  # fmt: skip
STATES = (
    "phi_sd", "phi_sq", "phi_rd", "phi_rq", "omega_m", "theta_m", "theta_s",
    "u_sd", "u_sq", "u_rd", "u_rq", "phi_hat_d", "phi_hat_q", "memory", "e_previous", "T_previous",
)  # fmt: skip
LIMITS = ("torque", "stator voltage", "rotor voltage", "stator current", "rotor current")
CURRENT_MODEL, ROTOR_VOLTAGE_MODEL = range(2)
NEVER = np.iinfo(np.int64).max  # sample of a change that does not come


@njit(**OPTIONS)
def run_drive(steps, x, plant, s, speed, changes, profiles, window, every, record, indices, hits, sensor):
    """Run the drive for ``steps`` control periods; all results go into the arrays that are passed.

    Parameters
    ----------
    steps : int
    x : array, shape (16,)
        State, in the order of STATES; holds the final state afterwards, from which a run can go on.
    plant : DfimCoefficients
        Of the motor as it is; ``s`` (DriveSettings) holds what the controller believes.
    speed : SpeedLaw
    changes : int array, shape (m + 1,)
        Samples at which a profile changes, increasing, ending with ``NEVER``.
    profiles : array, shape (m, 3)
        From each change on: speed reference (rad/s), load torque (N m), factor on the plant's R_r.
    window : tuple of two int
        First and last sample of the error indices.
    every : int
        Record each such sample; 0 records nothing.
    record : array, shape (samples, 23)
        In the order of CHANNELS, as the sample begins and with the voltages then chosen; the last two are
        the extremes of torque at the switching instants up to the next recorded sample.
    indices : array, shape (4,)
        IAE, ISE, ITAE (time from the window's start) are added to it; the last becomes the window's largest |error|
        at a sample (rad/s) where that is larger.
    hits : int array, shape (5,)
        First sample at which each of LIMITS was hit, −1 where none was.
    sensor : Sensor
        What the controller sees the speed with; indices and record hold the true speed.

    Returns
    -------
    int
        −1, or the sample at which the state had left all bounds.
    """
    phi_sd, phi_sq, phi_rd, phi_rq, omega_m, theta_m, theta_s = x[0], x[1], x[2], x[3], x[4], x[5], x[6]
    u_sd, u_sq, u_rd, u_rq, hat_d, hat_q = x[7], x[8], x[9], x[10], x[11], x[12]
    memory, e_previous, T_previous = x[13], x[14], x[15]
    h = s.period
    flux_bound, speed_bound = 1e2 * s.phi_ref, 1e5
    iae = ise = itae = peak = 0.0
    omega_ref = T_load = 0.0
    R_r, row, change = plant.R_r, 0, 0
    instants, extremes = np.empty(6), np.empty(2)

    for k in range(steps + 1):
        while changes[change] <= k:
            omega_ref, T_load, R_r = profiles[change, 0], profiles[change, 1], plant.R_r * profiles[change, 2]
            change += 1

        # Measured currents, and the rotor flux estimated from them
        i_sd = plant.Gamma_s * phi_sd - plant.Gamma_m * phi_rd
        i_sq = plant.Gamma_s * phi_sq - plant.Gamma_m * phi_rq
        i_rd = plant.Gamma_r * phi_rd - plant.Gamma_m * phi_sd
        i_rq = plant.Gamma_r * phi_rq - plant.Gamma_m * phi_sq
        model_d, model_q = s.L_r * i_rd + s.M * i_sd, s.L_r * i_rq + s.M * i_sq
        if s.estimator == CURRENT_MODEL:
            hat_d, hat_q = model_d, model_q

        # Speed controller, then everything behind it
        omega = omega_m if sensor.counts == 0.0 else encoder_speed(sensor, theta_m, k, h)
        e = omega_ref - omega
        if speed.kind == WEIGHTED:
            T_ref, T_asked, memory_next = weighted_command(speed, omega_ref, omega, memory, T_previous, s.T_limit, h, sensor.state)
        else:
            T_ref, T_asked, memory_next = speed_command(speed, e, e_previous, memory, T_previous, s.T_limit, h)
        c = control_sample(i_sd, i_sq, i_rd, i_rq, hat_d, hat_q, omega, T_ref, u_sd, u_sq, u_rd, u_rq, s)
        v_sd, v_sq, v_rd, v_rq, omega_s, omega_r = c.v_sd, c.v_sq, c.v_rd, c.v_rq, c.omega_s, c.omega_r

        if every > 0 and k % every == 0:
            T_e = plant.k_T * (phi_rd * i_sq - phi_rq * i_sd)
            values = (
                omega_ref, omega_m, T_ref, T_e, T_load, i_sd, i_sq, i_rd, i_rq, phi_rd, phi_rq,
                hat_d, hat_q, v_sd, v_sq, v_rd, v_rq, omega_s, omega_r, theta_s, theta_m,
            )  # fmt: skip
            for j in range(len(values)):
                record[row, j] = values[j]
            record[row, -2], record[row, -1] = T_e, T_e
            extremes[0], extremes[1] = T_e, T_e
            row += 1
        if k == steps:
            break

        if hits[0] < 0 and T_ref != T_asked:
            hits[0] = k
        if hits[1] < 0 and (v_sd != c.w_sd or v_sq != c.w_sq):
            hits[1] = k
        if hits[2] < 0 and (v_rd != c.w_rd or v_rq != c.w_rq):
            hits[2] = k
        if hits[3] < 0 and i_sd * i_sd + i_sq * i_sq > s.i_s_limit**2:
            hits[3] = k
        if hits[4] < 0 and i_rd * i_rd + i_rq * i_rq > s.i_r_limit**2:
            hits[4] = k

        u_sd, u_sq, u_rd, u_rq = c.u_sd, c.u_sq, c.u_rd, c.u_rq
        memory, e_previous, T_previous = memory_next, e, T_ref

        before = omega_m
        if s.carrier_frequency == 0.0:
            phi_sd, phi_sq, phi_rd, phi_rq, omega_m, gained = averaged_period(
                phi_sd, phi_sq, phi_rd, phi_rq, omega_m, v_sd, v_sq, v_rd, v_rq, omega_s, T_load, R_r, h, plant, s.substeps
            )
        else:
            phi_sd, phi_sq, phi_rd, phi_rq, omega_m, gained = switched_period(
                phi_sd, phi_sq, phi_rd, phi_rq, omega_m, v_sd, v_sq, v_rd, v_rq, omega_s, T_load, R_r, h, plant,
                theta_s, theta_m, k * h, s.carrier_frequency, s.V_dc_s, s.V_dc_r, instants, extremes,
            )  # fmt: skip
            if every > 0:
                record[row - 1, -2], record[row - 1, -1] = extremes[0], extremes[1]
        theta_s += h * omega_s
        theta_m += h * before + gained

        if s.estimator == ROTOR_VOLTAGE_MODEL:
            end_rd = plant.Gamma_r * phi_rd - plant.Gamma_m * phi_sd
            end_rq = plant.Gamma_r * phi_rq - plant.Gamma_m * phi_sq
            end_d = s.L_r * end_rd + s.M * (plant.Gamma_s * phi_sd - plant.Gamma_m * phi_rd)
            end_q = s.L_r * end_rq + s.M * (plant.Gamma_s * phi_sq - plant.Gamma_m * phi_rq)
            co, si = cos_sin(0.5 * h * omega_r)
            hat_d, hat_q = voltage_model(hat_d, hat_q, i_rd, i_rq, end_rd, end_rq, end_d, end_q, v_rd, v_rq, co, si, s)

        if window[0] <= k < window[1]:
            more = _interval_indices((k - window[0]) * h, h, omega_ref - before, omega_ref - omega_m)
            iae += more[0]
            ise += more[1]
            itae += more[2]
            peak = max(peak, abs(omega_ref - before))
        if not (abs(omega_m) < speed_bound and abs(phi_rd) + abs(phi_rq) + abs(phi_sd) + abs(phi_sq) < flux_bound):
            _keep(x, phi_sd, phi_sq, phi_rd, phi_rq, omega_m, theta_m, theta_s)
            return k + 1

    _keep(x, phi_sd, phi_sq, phi_rd, phi_rq, omega_m, theta_m, theta_s)
    x[7], x[8], x[9], x[10], x[11], x[12] = u_sd, u_sq, u_rd, u_rq, hat_d, hat_q
    x[13], x[14], x[15] = memory, e_previous, T_previous
    indices[0] += iae
    indices[1] += ise
    indices[2] += itae
    indices[3] = max(indices[3], peak)
    return -1


@njit(**OPTIONS)
def _keep(x, phi_sd, phi_sq, phi_rd, phi_rq, omega_m, theta_m, theta_s):
    x[0], x[1], x[2], x[3], x[4], x[5], x[6] = phi_sd, phi_sq, phi_rd, phi_rq, omega_m, theta_m, theta_s


def empty_record(steps, every):
    """Return the array that ``run_drive`` fills, unless the drive diverges: one row for each recorded sample of 0 … steps."""
    return np.empty((steps // every + 1 if every else 0, len(CHANNELS)))
