"""The compiled loop of Zidani's drive for 64 drives abreast, so that the processor's vector units share the work.

The same source as the loop of one drive (``dfim_control``, ``dfim_plant``, ``speed_law``, ``metrics``), period by
period for all drives, in the same order of operations: each drive gets the same bits as alone. PI speed control,
averaged inverters with one step per period and the current model; the other kinds branch too much to gain anything.
"""

import numpy as np
from numba import njit

from drivelib import metrics
from drivelib.compiled import OPTIONS
from drivelib.dfim import DfimCoefficients
from drivelib.dfim_control import DriveSettings, control_sample
from drivelib.dfim_plant import SMALL_ANGLE, small_cos_sin, turned_step
from drivelib.speed_law import pi_command

LANES = 64
_interval_indices = njit(**OPTIONS)(metrics.interval_indices)

# One flat array holds everything: element r of drive j at r * LANES + j. With constant distances the compiler sees
# that no two of them overlap.
ROWS = (
    "phi_sd", "phi_sq", "phi_rd", "phi_rq", "omega_m", "u_sd", "u_sq", "u_rd", "u_rq", "memory",
    *DfimCoefficients._fields, *(f"known_{name}" for name in DriveSettings._fields), "K_p", "K_i",
    "omega_ref", "T_load", "R_factor", "first", "last", "iae", "ise", "itae", "peak",
    "hit_T", "hit_v_s", "hit_v_r", "hit_i_s", "hit_i_r", "failed", "turned",
)  # fmt: skip
(
    PHI_SD, PHI_SQ, PHI_RD, PHI_RQ, OMEGA_M, U_SD, U_SQ, U_RD, U_RQ, MEMORY,
) = (LANES * k for k in range(10))  # fmt: skip
PLANT = 10 * LANES
KNOWN = PLANT + len(DfimCoefficients._fields) * LANES
K_P = KNOWN + len(DriveSettings._fields) * LANES
K_I, OMEGA_REF, T_LOAD, R_FACTOR, FIRST, LAST, IAE, ISE, ITAE, PEAK = (K_P + LANES * k for k in range(1, 11))
HIT_T, HIT_V_S, HIT_V_R, HIT_I_S, HIT_I_R, FAILED, TURNED = (PEAK + LANES * k for k in range(1, 8))
L = LANES


@njit(**OPTIONS)
def run_lanes(steps, a, changes, profiles):
    """Run 64 drives for ``steps`` control periods.

    Parameters
    ----------
    steps : int
    a : array, shape (len(ROWS) * LANES,)
        State, parameters and results in the order of ROWS; holds the results afterwards. ``peak`` is the largest
        error (rad/s, unsigned) at the samples of the window. ``hit_…`` and ``failed``: the sample at which a limit
        was first hit and the state first out of bounds, −1 for never; ``turned``: the largest angle (rad) by which
        the frame turned in half a period, beyond SMALL_ANGLE the drive's results are not valid.
    changes : int array, shape (m + 1,)
        Samples at which some drive's profile changes, increasing, ending with one beyond the last sample.
    profiles : array, shape (m, 3, LANES)
        From each change on: speed reference (rad/s), load torque (N m), factor on the plant's R_r.
    """
    change = 0
    for k in range(steps):
        while changes[change] <= k:
            for row in range(3):
                for j in range(L):
                    a[OMEGA_REF + row * L + j] = profiles[change, row, j]
            change += 1
        now = float(k)
        for j in range(L):
            c = DfimCoefficients(
                a[PLANT + j], a[PLANT + L + j], a[PLANT + 2 * L + j], a[PLANT + 3 * L + j], a[PLANT + 4 * L + j],
                a[PLANT + 5 * L + j], a[PLANT + 6 * L + j], a[PLANT + 7 * L + j], a[PLANT + 8 * L + j],
            )  # fmt: skip
            s = DriveSettings(
                a[KNOWN + j], a[KNOWN + L + j], a[KNOWN + 2 * L + j], a[KNOWN + 3 * L + j], a[KNOWN + 4 * L + j],
                a[KNOWN + 5 * L + j], a[KNOWN + 6 * L + j], a[KNOWN + 7 * L + j], a[KNOWN + 8 * L + j],
                a[KNOWN + 9 * L + j], a[KNOWN + 10 * L + j], a[KNOWN + 11 * L + j], a[KNOWN + 12 * L + j],
                a[KNOWN + 13 * L + j], a[KNOWN + 14 * L + j], a[KNOWN + 15 * L + j], a[KNOWN + 16 * L + j],
                a[KNOWN + 17 * L + j], a[KNOWN + 18 * L + j], 0.0, 0.0, a[KNOWN + 21 * L + j], 1.0, 0.0, 0.0, 0.0,
            )  # fmt: skip
            h = s.period
            phi_sd, phi_sq, phi_rd, phi_rq = a[PHI_SD + j], a[PHI_SQ + j], a[PHI_RD + j], a[PHI_RQ + j]
            omega_m, omega_ref = a[OMEGA_M + j], a[OMEGA_REF + j]
            i_sd = c.Gamma_s * phi_sd - c.Gamma_m * phi_rd
            i_sq = c.Gamma_s * phi_sq - c.Gamma_m * phi_rq
            i_rd = c.Gamma_r * phi_rd - c.Gamma_m * phi_sd
            i_rq = c.Gamma_r * phi_rq - c.Gamma_m * phi_sq
            hat_d, hat_q = s.L_r * i_rd + s.M * i_sd, s.L_r * i_rq + s.M * i_sq

            e = omega_ref - omega_m
            T_ref, T_asked, memory = pi_command(a[K_P + j], a[K_I + j], e, a[MEMORY + j], s.T_limit, h)
            v = control_sample(
                i_sd, i_sq, i_rd, i_rq, hat_d, hat_q, omega_m, T_ref, a[U_SD + j], a[U_SQ + j], a[U_RD + j], a[U_RQ + j], s
            )
            a[MEMORY + j] = memory
            a[U_SD + j], a[U_SQ + j], a[U_RD + j], a[U_RQ + j] = v.u_sd, v.u_sq, v.u_rd, v.u_rq
            a[HIT_T + j] = _first(a[HIT_T + j], T_ref != T_asked, now)
            a[HIT_V_S + j] = _first(a[HIT_V_S + j], (v.v_sd != v.w_sd) | (v.v_sq != v.w_sq), now)
            a[HIT_V_R + j] = _first(a[HIT_V_R + j], (v.v_rd != v.w_rd) | (v.v_rq != v.w_rq), now)
            a[HIT_I_S + j] = _first(a[HIT_I_S + j], i_sd * i_sd + i_sq * i_sq > s.i_s_limit * s.i_s_limit, now)
            a[HIT_I_R + j] = _first(a[HIT_I_R + j], i_rd * i_rd + i_rq * i_rq > s.i_r_limit * s.i_r_limit, now)

            half_s, half_r = 0.5 * h * v.omega_s, 0.5 * h * (v.omega_s - c.p * omega_m)
            a[TURNED + j] = max(a[TURNED + j], max(abs(half_s), abs(half_r)))
            c_s, s_s = small_cos_sin(half_s)
            c_r, s_r = small_cos_sin(half_r)
            phi_sd, phi_sq, phi_rd, phi_rq, omega_m, _ = turned_step(
                phi_sd, phi_sq, phi_rd, phi_rq, omega_m, v.v_sd, v.v_sq, v.v_rd, v.v_rq, v.omega_s, a[T_LOAD + j],
                c.R_r * a[R_FACTOR + j], h, c, c_s, s_s, c_r, s_r,
            )  # fmt: skip
            a[PHI_SD + j], a[PHI_SQ + j], a[PHI_RD + j], a[PHI_RQ + j], a[OMEGA_M + j] = phi_sd, phi_sq, phi_rd, phi_rq, omega_m

            counts = (a[FIRST + j] <= now) & (now < a[LAST + j])
            more = _interval_indices((now - a[FIRST + j]) * h, h, e, omega_ref - omega_m)
            a[IAE + j] += more[0] if counts else 0.0
            a[ISE + j] += more[1] if counts else 0.0
            a[ITAE + j] += more[2] if counts else 0.0
            a[PEAK + j] = max(a[PEAK + j], abs(e) if counts else 0.0)
            flux = abs(phi_rd) + abs(phi_rq) + abs(phi_sd) + abs(phi_sq)
            inside = (abs(omega_m) < 1e5) & (flux < 1e2 * s.phi_ref)
            a[FAILED + j] = _first(a[FAILED + j], not inside, now + 1.0)


@njit(**OPTIONS)
def _first(before, happens, now):
    return now if (before < 0.0) & happens else before
