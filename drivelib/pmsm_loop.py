"""The compiled loop of Eskander's drives (figures 4 and 11, section 6): law, controllers, inverter and machine.

Voltage. An averaged inverter holds its voltage fixed in the stator for a period, while the rotor frame
turns under it: v_dq(t) = v_dq(t_k) exp(−j θ), θ the electrical angle since t_k. Left alone, its mean would lag
the rotor by ω T/2, 1.1 degrees at 400 rad/s and 100 µs, where φ_op itself is a few degrees. So the controller turns
it ω T/2 forward; what remains is a mean shorter by (ω T)²/24, and a ripple.

Currents. The machine's terminal current i = i_o + v_o/R_c jumps with the voltage. What is measured is taken with
the last period's commanded (mean) voltage, as a sensor averaging over the period has it: the instant before
switching would add that same ωT/2 of the voltage vector. With the voltage it applied, the controller finds
the branch currents exactly, i_o = i − G (v − R_s i). In the full model, G = 1/R_c, it controls the branch
currents to the law's references, to which belong the terminal references

    i_d* = i_od* − G ω L_q i_oq*,    i_q* = i_oq* + G ω (λ + L_d i_od*);

the steady state is that of controlling terminal currents to these, without the iron current's jump in the
feedback. In the simplified model, G = 0, law and controllers take terminal for branch currents, as the paper does.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numba.extending import register_jitable

from drivelib import control, pmsm_dynamics, pmsm_law
from drivelib.compiled import OPTIONS
from drivelib.pmsm_law import NETWORK, ZERO
from drivelib.pmsm_plant import held_period

_compiled = njit(**OPTIONS)
for function in (pmsm_dynamics.terminal_current, pmsm_dynamics.branch_current):
    register_jitable(function)
_terminal_current, _branch_current = pmsm_dynamics.terminal_current, pmsm_dynamics.branch_current
_branch_torque = pmsm_dynamics.branch_torque
_loss_optimal_i_od = _compiled(pmsm_dynamics.loss_optimal_i_od)
_angle_feed = _compiled(pmsm_dynamics.angle_feed)
_network_output = _compiled(pmsm_law.network_output)
_clip = _compiled(control.clip)
_clip_vector = _compiled(control.clip_vector)
_pi_output = _compiled(control.pi_output)
_pi_integral = _compiled(control.pi_integral)

LIMITS = ("voltage", "current reference", "current", "torque", "training range")
VOLTAGE, REFERENCE, CURRENT, TORQUE, RANGE = (1 << bit for bit in range(len(LIMITS)))
CHANNELS = (
    "omega_ref", "omega_m", "T_ref", "T_e", "T_hat", "T_L", "i_od", "i_oq", "i_d", "i_q", "i_od_ref", "i_oq_ref",
    "i_d_ref", "i_q_ref", "v_d", "v_q", "phi", "law_input_1", "law_input_2", "E_in", "E_heat", "E_shaft",
)  # fmt: skip
STATES = ("i_od", "i_oq", "omega_m", "u_d", "u_q", "u_torque", "u_speed", "v_d", "v_q")
TORQUE_PI, DIRECT, ANGLE = range(len(pmsm_law.CONTROLS))
FROM_PROFILE, FROM_LOAD, FROM_SPEED_LOOP = range(3)
MARGIN = 1.001  # the measured current may exceed the limit by so much before that is reported
LARGEST_SPEED = 1e5  # rad/s
LARGEST_CURRENT = 1e3  # in units of the current limit


class LoopSettings(NamedTuple):
    """What the controller is set to; SI units, names as in `Scenario`, choices as the numbers above."""

    control: int
    law: int
    torque: int
    imposed: bool
    law_takes_command: bool
    torque_sensor: bool
    conductance: float
    V_max: float
    I_max: float
    T_max: float
    K_pd: float
    K_id: float
    K_pq: float
    K_iq: float
    K_pt: float
    K_it: float
    K_pw: float
    K_iw: float
    period: float
    substeps: int


def limited_i_oq(i_od, i_oq, omega_e, conductance, I_max, c):
    """Return the i_oq nearest to the one given that keeps the terminal current within ``I_max`` (A), i_od going first.

    (i_od − a i_oq)² + (i_oq + b)² = I_max² bounds an interval, with a = G ω L_q and b = G ω (λ + L_d i_od). Where it is
    empty, i_od alone exceeds the limit, and the i_oq of least current is returned.
    """
    a = conductance * omega_e * c.L_q
    b = conductance * omega_e * (c.psi_f + c.L_d * i_od)
    middle = (a * i_od - b) / (1.0 + a * a)
    squared = middle * middle - (i_od * i_od + b * b - I_max * I_max) / (1.0 + a * a)
    half = math.sqrt(max(squared, 0.0))
    return min(max(i_oq, middle - half), middle + half)


_limited_i_oq = _compiled(limited_i_oq)


@_compiled
def run_drive(profiles, lead, imposed_lead, x, plant, known, s, W1, B1, W2, B2, low, high, record, flags):
    """Run the drive sample by sample.

    Parameters
    ----------
    profiles : ndarray, shape (n, 3)
        Speed (rad/s), torque (N m) and load (N m) at each sample; NaN where a torque is not prescribed.
    lead, imposed_lead : int
        Samples before the first, with the first values of all profiles and unrecorded; so many of them at imposed speed.
    x : ndarray, shape (9,)
        State as in ``STATES``; updated, and left where a run diverged.
    plant, known : PmsmCoefficients
        The machine, and what the controller takes it for.
    s : LoopSettings
    W1, B1, W2, B2, low, high : ndarray
        As in `NetworkLaw`.
    record : ndarray, shape (n, 22)
        Filled with ``CHANNELS``.
    flags : ndarray of int, shape (n,)
        Filled with the limits hit, one bit each as in ``LIMITS``.

    Returns
    -------
    int
        Sample at which the run diverged (negative within the lead), or n.
    """
    i_od, i_oq, omega_m, u_d, u_q, u_torque, u_speed, v_d, v_q = x
    drawn = heated = worked = 0.0
    saturated = False
    n = profiles.shape[0]
    for k in range(-lead, n):
        omega_ref, T_ref, T_L = profiles[max(k, 0)]
        imposed = s.imposed or k < imposed_lead - lead
        if imposed:
            omega_m = omega_ref
        # Written so that NaN ends the run too.
        bounded = abs(i_od) + abs(i_oq) < LARGEST_CURRENT * s.I_max and abs(omega_m) < LARGEST_SPEED
        if not bounded:
            x[:] = (i_od, i_oq, omega_m, u_d, u_q, u_torque, u_speed, v_d, v_q)
            return k
        hit = 0

        # What is measured and estimated: two terminal currents, and the branch currents behind them.
        omega_e = known.P * omega_m
        i_d, i_q = _terminal_current(v_d, i_od, plant), _terminal_current(v_q, i_oq, plant)
        e_od = _branch_current(v_d, i_d, s.conductance, known)
        e_oq = _branch_current(v_q, i_q, s.conductance, known)
        T_e = _branch_torque(i_od, i_oq, plant)
        T_hat = T_e if s.torque_sensor else _branch_torque(e_od, e_oq, known)
        if i_d * i_d + i_q * i_q > (MARGIN * s.I_max) ** 2:
            hit |= CURRENT

        # Speed loop, or a given torque.
        if s.torque == FROM_SPEED_LOOP:
            wanted = _pi_output(omega_ref - omega_m, u_speed, s.K_pw)
            T_ref = _clip(wanted, s.T_max)
            if T_ref != wanted:
                hit |= TORQUE
            error = omega_ref - omega_m
            # A drive at its voltage or current limit cannot give more torque: then the integrals may only fall.
            if not (saturated and error * u_speed > 0.0):
                u_speed = _pi_integral(u_speed, error, wanted, T_ref, s.K_iw, s.K_iw / s.K_pw, s.period)
        elif s.torque == FROM_LOAD:
            T_ref = T_L

        # The law, and in fig. 4 the torque controller in front of it.
        law_omega = omega_ref if s.law_takes_command else omega_m
        first, second = law_omega, T_ref
        i_od_ref = i_oq_ref = phi = np.nan
        if s.control == TORQUE_PI:
            wanted = _pi_output(T_ref - T_hat, u_torque, s.K_pt)
            i_oq_ref = _clip(wanted, s.I_max)
            first, second = i_oq_ref, law_omega
            if s.law == NETWORK:
                i_od_ref = _network_output(W1, B1, W2, B2, first, second, 0)
            elif s.law == ZERO:
                i_od_ref = 0.0
            else:
                i_od_ref = _loss_optimal_i_od(i_oq_ref, known.P * law_omega, s.conductance, known)
        elif s.control == DIRECT:
            if s.law == NETWORK:
                i_oq_ref = _network_output(W1, B1, W2, B2, first, second, 0)
                i_od_ref = _network_output(W1, B1, W2, B2, first, second, 1)
            else:
                i_oq_ref = T_ref / (1.5 * known.P * known.psi_f)
                i_od_ref = 0.0 if s.law == ZERO else _loss_optimal_i_od(i_oq_ref, known.P * law_omega, s.conductance, known)
            wanted = i_oq_ref
        else:
            V, phi = _angle_feed(T_ref, known.P * law_omega, known)
            if s.law == NETWORK:
                phi = _network_output(W1, B1, W2, B2, first, second, 0)
            elif s.law == ZERO:
                phi = 0.0
        if first < low[0] or first > high[0] or second < low[1] or second > high[1]:
            hit |= RANGE

        # Currents to voltages.
        i_d_ref = i_q_ref = np.nan
        if s.control == ANGLE:
            wanted_d, wanted_q = -V * math.sin(phi), V * math.cos(phi)
        else:
            wanted_od, i_od_ref = i_od_ref, _clip(i_od_ref, s.I_max)
            i_oq_ref = _limited_i_oq(i_od_ref, i_oq_ref, omega_e, s.conductance, s.I_max, known)
            if i_oq_ref != wanted or i_od_ref != wanted_od:
                hit |= REFERENCE
            if s.control == TORQUE_PI:
                error = T_ref - T_hat
                if not (saturated and error * u_torque > 0.0):
                    u_torque = _pi_integral(u_torque, error, wanted, i_oq_ref, s.K_it, s.K_it / s.K_pt, s.period)
            i_d_ref = i_od_ref - s.conductance * omega_e * known.L_q * i_oq_ref
            i_q_ref = i_oq_ref + s.conductance * omega_e * (known.psi_f + known.L_d * i_od_ref)
            scale = 1.0 + known.R_s * s.conductance
            error_d, error_q = i_od_ref - e_od, i_oq_ref - e_oq
            wanted_d = _pi_output(error_d, u_d, s.K_pd) - scale * omega_e * known.L_q * e_oq
            wanted_q = _pi_output(error_q, u_q, s.K_pq) + scale * omega_e * (known.psi_f + known.L_d * e_od)
        v_d, v_q = _clip_vector(wanted_d, wanted_q, s.V_max)
        if v_d != wanted_d or v_q != wanted_q:
            hit |= VOLTAGE
        saturated = hit & (VOLTAGE | REFERENCE) != 0
        if s.control != ANGLE:
            phi = math.atan2(-v_d, v_q)
            u_d = _pi_integral(u_d, error_d, wanted_d, v_d, s.K_id, s.K_id / s.K_pd, s.period)
            u_q = _pi_integral(u_q, error_q, wanted_q, v_q, s.K_iq, s.K_iq / s.K_pq, s.period)

        if k >= 0:
            flags[k] = hit
            record[k, :] = (
                omega_ref, omega_m, T_ref, T_e, T_hat, T_L, i_od, i_oq, i_d, i_q,
                i_od_ref, i_oq_ref, i_d_ref, i_q_ref, v_d, v_q, phi, first, second, drawn, heated, worked,
            )  # fmt: skip
        if k == n - 1:
            break

        # Half a period ahead of the rotor, so that the mean over the period points along (v_d, v_q).
        ahead = 0.5 * omega_e * s.period
        cosine, sine = math.cos(ahead), math.sin(ahead)
        i_od, i_oq, omega_m, power, heat, shaft = held_period(
            i_od, i_oq, omega_m, v_d * cosine - v_q * sine, v_q * cosine + v_d * sine,
            T_L, imposed, s.period, s.substeps, plant,
        )  # fmt: skip
        if k >= 0:
            drawn, heated, worked = drawn + power, heated + heat, worked + shaft
    x[:] = (i_od, i_oq, omega_m, u_d, u_q, u_torque, u_speed, v_d, v_q)
    return n
