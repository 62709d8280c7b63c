"""The compiled loop of Zidani's drive for 64 drives abreast, so that the processor's vector units share the work.

The same source as the loop of one drive (``dfim_control``, ``dfim_plant``, ``speed_law``, ``metrics``), period by
period for all drives, in the same order of operations: each drive gets the same bits as alone. Averaged inverters with one
step per period, the speed known exactly, speed controllers of one family: PI, fuzzy (which branches and takes turns), or
networks.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from drivelib import metrics
from drivelib.compiled import OPTIONS
from drivelib.dfim import DfimCoefficients
from drivelib.dfim_control import DriveSettings, control_sample, voltage_model
from drivelib.dfim_loop import CURRENT_MODEL, NEVER, STATES
from drivelib.dfim_plant import small_cos_sin, turned_step
from drivelib.fuzzy import fuzzy_output
from drivelib.sigmoid import sigmoid
from drivelib.speed_law import FUZZY_INCREMENTAL, FUZZY_POSITION, NETWORK, NETWORK_INCREMENTAL, PI, limited, pi_command

LANES = 64
VECTOR = 8  # drives that share an instruction, or two
KEPT = ("omega_ref", "omega_m", "phi_rd", "phi_rq")  # the channels of ``dfim_loop`` that can be recorded here
PIS, FUZZY, NETWORKS = range(3)  # families, each in blocks of its own
FAMILIES = {PI: PIS, FUZZY_POSITION: FUZZY, FUZZY_INCREMENTAL: FUZZY, NETWORK: NETWORKS, NETWORK_INCREMENTAL: NETWORKS}
_interval_indices = njit(**OPTIONS)(metrics.interval_indices)

# One flat array holds everything: element r of drive j at r * LANES + j. With constant distances the compiler sees
# that no two of them overlap.
ROWS = (
    *STATES, *DfimCoefficients._fields, *(f"known_{name}" for name in DriveSettings._fields),
    "omega_ref", "T_load", "R_factor", "first", "last", "iae", "ise", "itae", "peak",
    "hit_T", "hit_v_s", "hit_v_r", "hit_i_s", "hit_i_r", "failed", "turned", "T_ref", "T_asked",
)  # fmt: skip
(
    PHI_SD, PHI_SQ, PHI_RD, PHI_RQ, OMEGA_M, THETA_M, THETA_S, U_SD, U_SQ, U_RD, U_RQ, HAT_D, HAT_Q, MEMORY, E_PREVIOUS, T_PREVIOUS,
) = (LANES * k for k in range(len(STATES)))  # fmt: skip
PLANT = len(STATES) * LANES
KNOWN = PLANT + len(DfimCoefficients._fields) * LANES
OMEGA_REF = KNOWN + len(DriveSettings._fields) * LANES
T_LOAD, R_FACTOR, FIRST, LAST, IAE, ISE, ITAE, PEAK = (OMEGA_REF + LANES * k for k in range(1, 9))
HIT_T, HIT_V_S, HIT_V_R, HIT_I_S, HIT_I_R, FAILED, TURNED, T_REF, T_ASKED = (PEAK + LANES * k for k in range(1, 10))
PERIOD = KNOWN + DriveSettings._fields.index("period") * LANES
ESTIMATOR = KNOWN + DriveSettings._fields.index("estimator") * LANES
T_LIMIT = KNOWN + DriveSettings._fields.index("T_limit") * LANES
L = LANES


class Laws(NamedTuple):
    """Speed controllers of one family: numbers of shape (64,), networks W1 (3, neurons, 64), B1 and W2 (neurons, 64).

    Networks are filled up with inputs and neurons of weight zero, which change no bit.
    """

    family: int
    kind: np.ndarray
    K_p: np.ndarray
    K_i: np.ndarray
    K_e: np.ndarray
    K_de: np.ndarray
    K_u: np.ndarray
    W1: np.ndarray
    B1: np.ndarray
    W2: np.ndarray
    B2: np.ndarray
    activation: np.ndarray


@njit(**OPTIONS)
def run_lanes(a, ends, at, changes, profiles, laws, record, final):
    """Run up to 64 drives, each for its own number of control periods.

    Parameters
    ----------
    a : array, shape (len(ROWS) * LANES,)
        State, parameters and results in the order of ROWS; holds the results afterwards. ``peak`` is the largest
        error (rad/s, unsigned) at the samples of the window. ``hit_…`` and ``failed``: the sample at which a limit
        was first hit and the state first out of bounds, −1 for never, and not meant from a drive's end on; ``turned``: the
        largest angle (rad) by which the frame turned in half a period, beyond SMALL_ANGLE the drive's results are not valid
        (also where that came after the drive's end, which costs a repetition and no bit).
    ends : int array, shape (n,)
        Numbers of periods of n drives, the largest first.
    at : int array, shape (n,)
        Where each drive's profiles begin in ``changes`` and ``profiles``; moves on.
    changes : int array, shape (m,)
        Samples at which a profile changes, for each drive increasing and ending with ``NEVER``.
    profiles : array, shape (m, 3)
        From each change on: speed reference (rad/s), load torque (N m), factor on the plant's R_r.
    laws : Laws
        Speed controllers.
    record : array, shape (n, 4, ends[0] + 1), or (0, 0, 0) for none
        Channels KEPT at each sample of each drive, until its end.
    final : array, shape (n, 16)
        State of each drive at its end, in the order of STATES.
    """
    live, soonest, estimators = ends.size, 0, a[ESTIMATOR : ESTIMATOR + ends.size]
    voltage = np.any(estimators != CURRENT_MODEL)
    for k in range(ends[0] + 1):
        if k >= soonest:
            soonest = NEVER
            for j in range(live):
                while changes[at[j]] <= k:
                    for row in range(3):
                        a[OMEGA_REF + row * L + j] = profiles[at[j], row]
                    at[j] += 1
                soonest = min(soonest, changes[at[j]])
        if record.size > 0:
            for j in range(live):
                record[j, 0, k], record[j, 1, k] = a[OMEGA_REF + j], a[OMEGA_M + j]
                record[j, 2, k], record[j, 3, k] = a[PHI_RD + j], a[PHI_RQ + j]
        while live > 0 and ends[live - 1] == k:
            live -= 1
            for row in range(final.shape[1]):
                final[live, row] = a[row * L + live]
        if live == 0:
            break
        if laws.family == NETWORKS:
            _networks(a, laws, live)
        else:
            _others(a, laws, live)
        whole = min(L, (live + VECTOR - 1) // VECTOR * VECTOR)
        if voltage:
            _period(a, float(k), whole, voltage)
        else:
            _period(a, float(k), whole, None)


@njit(**OPTIONS)
def _others(a, laws, live):
    """Ask the speed controllers for torques: PI, whose loop is vectorised, or fuzzy."""
    for j in range(live):
        e = a[OMEGA_REF + j] - a[OMEGA_M + j]
        if laws.family == PIS:
            torque, asked, memory = pi_command(laws.K_p[j], laws.K_i[j], e, a[MEMORY + j], a[T_LIMIT + j], a[PERIOD + j])
        else:
            asked = laws.K_u[j] * fuzzy_output(laws.K_e[j] * e, laws.K_de[j] * (e - a[E_PREVIOUS + j]))
            torque, asked, memory = limited(laws.kind[j], asked, e, a[MEMORY + j], a[T_PREVIOUS + j], a[T_LIMIT + j], a[PERIOD + j])
        a[T_REF + j], a[T_ASKED + j], a[MEMORY + j], a[E_PREVIOUS + j], a[T_PREVIOUS + j] = torque, asked, memory, e, torque


@njit(**OPTIONS)
def _networks(a, laws, live):
    """Ask networks for torques, neuron by neuron for all drives."""
    for j in range(live):
        a[T_ASKED + j] = laws.B2[j]
    for i in range(laws.B1.shape[0]):
        for j in range(live):
            e = a[OMEGA_REF + j] - a[OMEGA_M + j]
            x = laws.B1[i, j] + laws.W1[0, i, j] * e + laws.W1[1, i, j] * (e - a[E_PREVIOUS + j]) + laws.W1[2, i, j] * a[MEMORY + j]
            a[T_ASKED + j] += laws.W2[i, j] * sigmoid(x, laws.activation[j])
    for j in range(live):
        e = a[OMEGA_REF + j] - a[OMEGA_M + j]
        torque, asked, memory = limited(laws.kind[j], a[T_ASKED + j], e, a[MEMORY + j], a[T_PREVIOUS + j], a[T_LIMIT + j], a[PERIOD + j])
        a[T_REF + j], a[T_ASKED + j], a[MEMORY + j], a[E_PREVIOUS + j], a[T_PREVIOUS + j] = torque, asked, memory, e, torque


@njit(**OPTIONS)
def _period(a, now, count, voltage):
    """Take the first drives through one period: control behind the torque reference, motor, indices and limits.

    With ``voltage`` None the compiler leaves the voltage model out, a tenth of the time.
    """
    for j in range(count):
        c = DfimCoefficients(
            a[PLANT + j], a[PLANT + L + j], a[PLANT + 2 * L + j], a[PLANT + 3 * L + j], a[PLANT + 4 * L + j],
            a[PLANT + 5 * L + j], a[PLANT + 6 * L + j], a[PLANT + 7 * L + j], a[PLANT + 8 * L + j],
        )  # fmt: skip
        s = DriveSettings(
            a[KNOWN + j], a[KNOWN + L + j], a[KNOWN + 2 * L + j], a[KNOWN + 3 * L + j], a[KNOWN + 4 * L + j],
            a[KNOWN + 5 * L + j], a[KNOWN + 6 * L + j], a[KNOWN + 7 * L + j], a[KNOWN + 8 * L + j],
            a[KNOWN + 9 * L + j], a[KNOWN + 10 * L + j], a[KNOWN + 11 * L + j], a[KNOWN + 12 * L + j],
            a[KNOWN + 13 * L + j], a[KNOWN + 14 * L + j], a[KNOWN + 15 * L + j], a[KNOWN + 16 * L + j],
            a[KNOWN + 17 * L + j], a[KNOWN + 18 * L + j], a[KNOWN + 19 * L + j], a[KNOWN + 20 * L + j], a[KNOWN + 21 * L + j],
            1.0, 0.0, 0.0, 0.0,
        )  # fmt: skip
        h = s.period
        phi_sd, phi_sq, phi_rd, phi_rq = a[PHI_SD + j], a[PHI_SQ + j], a[PHI_RD + j], a[PHI_RQ + j]
        omega_m, omega_ref, T_ref = a[OMEGA_M + j], a[OMEGA_REF + j], a[T_REF + j]
        i_sd = c.Gamma_s * phi_sd - c.Gamma_m * phi_rd
        i_sq = c.Gamma_s * phi_sq - c.Gamma_m * phi_rq
        i_rd = c.Gamma_r * phi_rd - c.Gamma_m * phi_sd
        i_rq = c.Gamma_r * phi_rq - c.Gamma_m * phi_sq
        by_currents = s.estimator == CURRENT_MODEL
        hat_d, hat_q = s.L_r * i_rd + s.M * i_sd, s.L_r * i_rq + s.M * i_sq
        if voltage is not None:
            hat_d, hat_q = hat_d if by_currents else a[HAT_D + j], hat_q if by_currents else a[HAT_Q + j]

        v = control_sample(
            i_sd, i_sq, i_rd, i_rq, hat_d, hat_q, omega_m, T_ref, a[U_SD + j], a[U_SQ + j], a[U_RD + j], a[U_RQ + j], s
        )
        a[U_SD + j], a[U_SQ + j], a[U_RD + j], a[U_RQ + j] = v.u_sd, v.u_sq, v.u_rd, v.u_rq
        a[HIT_T + j] = _first(a[HIT_T + j], T_ref != a[T_ASKED + j], now)
        a[HIT_V_S + j] = _first(a[HIT_V_S + j], (v.v_sd != v.w_sd) | (v.v_sq != v.w_sq), now)
        a[HIT_V_R + j] = _first(a[HIT_V_R + j], (v.v_rd != v.w_rd) | (v.v_rq != v.w_rq), now)
        a[HIT_I_S + j] = _first(a[HIT_I_S + j], i_sd * i_sd + i_sq * i_sq > s.i_s_limit * s.i_s_limit, now)
        a[HIT_I_R + j] = _first(a[HIT_I_R + j], i_rd * i_rd + i_rq * i_rq > s.i_r_limit * s.i_r_limit, now)

        half_s, half_r = 0.5 * h * v.omega_s, 0.5 * h * (v.omega_s - c.p * omega_m)
        a[TURNED + j] = max(a[TURNED + j], max(abs(half_s), abs(half_r)))
        c_s, s_s = small_cos_sin(half_s)
        c_r, s_r = small_cos_sin(half_r)
        before = omega_m
        phi_sd, phi_sq, phi_rd, phi_rq, omega_m, gained = turned_step(
            phi_sd, phi_sq, phi_rd, phi_rq, omega_m, v.v_sd, v.v_sq, v.v_rd, v.v_rq, v.omega_s, a[T_LOAD + j],
            c.R_r * a[R_FACTOR + j], h, c, c_s, s_s, c_r, s_r,
        )  # fmt: skip
        a[PHI_SD + j], a[PHI_SQ + j], a[PHI_RD + j], a[PHI_RQ + j], a[OMEGA_M + j] = phi_sd, phi_sq, phi_rd, phi_rq, omega_m
        a[THETA_S + j] += h * v.omega_s
        a[THETA_M + j] += h * before + gained

        end_sd, end_sq = c.Gamma_s * phi_sd - c.Gamma_m * phi_rd, c.Gamma_s * phi_sq - c.Gamma_m * phi_rq
        end_rd, end_rq = c.Gamma_r * phi_rd - c.Gamma_m * phi_sd, c.Gamma_r * phi_rq - c.Gamma_m * phi_sq
        end_d, end_q = s.L_r * end_rd + s.M * end_sd, s.L_r * end_rq + s.M * end_sq
        if voltage is not None:
            half = 0.5 * h * v.omega_r  # by the pole pairs that the controller knows
            a[TURNED + j] = max(a[TURNED + j], abs(half))
            c_h, s_h = small_cos_sin(half)
            next_d, next_q = voltage_model(hat_d, hat_q, i_rd, i_rq, end_rd, end_rq, end_d, end_q, v.v_rd, v.v_rq, c_h, s_h, s)
            end_d, end_q = end_d if by_currents else next_d, end_q if by_currents else next_q
        a[HAT_D + j], a[HAT_Q + j] = end_d, end_q

        counts = (a[FIRST + j] <= now) & (now < a[LAST + j])
        e = omega_ref - before
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
