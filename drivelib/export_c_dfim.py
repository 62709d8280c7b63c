"""The C99 text that a DFIM's exported header has of its own: parameters, currents of the references, closed form."""

import numpy as np

from drivelib import dfim_optimum
from drivelib.validation import number as checked

FORMULA = """\
/* Currents (A) that make the torque at the references, in rotor-flux orientation; the rotor's d current is i_rd. */
static inline void @currents(float torque, float phi_r, float i_rd, float *i_sd, float *i_sq, float *i_rq)
{
    *i_sd = (phi_r - @L_R * i_rd) / @M;
    *i_sq = @L_R * torque / (1.5f * @POLE_PAIRS * @M * phi_r);
    *i_rq = -@M / @L_R * *i_sq;
}

/* Rotor flux of least copper loss, without limits: phi^2 = N |T| / (1.5 P M sqrt(R_S R_R)), N = M^2 R_R + L_R^2 R_S. */
static inline float @free_flux(float torque)
{
    const float n = @M * @M * @R_R + @L_R * @L_R * @R_S;
    return sqrtf(n * fabsf(torque) / (1.5f * @POLE_PAIRS * @M * sqrtf(@R_S * @R_R)));
}

/* Stator frequency (electrical rad/s); the rotor's is this less POLE_PAIRS omega_m. Both inverters are equally near
 * the voltage that the resistances leave; RHO is the ratio of the flux linkages. Either sign of speed and torque. */
static inline float @stator_frequency(float omega_m, float torque)
{
    const float flux = @clampf(@free_flux(torque), 1e-9f * @PHI_MAX, @PHI_MAX);
    const float i_q = @L_R * (omega_m < 0.0f ? -torque : torque) / (1.5f * @POLE_PAIRS * @M * flux);
    const float stator = fmaxf(@V_S_MAX - @R_S * i_q, @TURNING * @V_S_MAX);
    const float rotor = fmaxf(@V_R_MAX - @R_R * @M / @L_R * i_q, @TURNING * @V_R_MAX);
    return stator / (stator + @RHO * rotor) * @POLE_PAIRS * omega_m;
}

/* Voltage squared of R i + j omega phi. */
static inline float @voltage_squared(float resistance, float omega, float i_d, float i_q, float phi_d, float phi_q)
{
    const float v_d = resistance * i_d - omega * phi_q;
    const float v_q = resistance * i_q + omega * phi_d;
    return v_d * v_d + v_q * v_q;
}

/* The optimum in closed form, without a network and at any speed: i_rd = R_S L_R phi / N, flux between PHI_MIN and PHI_MAX.
 * @LIMITED: the flux is held at PHI_MAX, or at PHI_MIN, for little torque and none: no flux would be least loss, and
 * no torque could come from it. @NO_ANSWER: a voltage or current limit would be passed, and the formula has none;
 * the outputs are left alone. Up to OMEGA_HIGH network and table know those limits, beyond it nothing here does. */
static inline int @optimum(float omega_m, float torque, float *phi_r, float *i_rd)
{
    const float n = @M * @M * @R_R + @L_R * @L_R * @R_S;
    const float wanted = @free_flux(torque);
    const float flux = @clampf(wanted, @PHI_MIN, @PHI_MAX);
    const float share = @R_S * @L_R * flux / n;
    const float omega_s = @stator_frequency(omega_m, torque);
    const float omega_r = omega_s - @POLE_PAIRS * omega_m;
    const float margin = 1.0f + 2.0f * @ROUNDING;
    float i_sd, i_sq, i_rq;
    @currents(torque, flux, share, &i_sd, &i_sq, &i_rq);
    if (i_sd * i_sd + i_sq * i_sq > @I_S_MAX * @I_S_MAX * margin
        || share * share + i_rq * i_rq > @I_R_MAX * @I_R_MAX * margin
        || @voltage_squared(@R_S, omega_s, i_sd, i_sq, @L_S * i_sd + @M * share, @L_S * i_sq + @M * i_rq) > @V_S_MAX * @V_S_MAX * margin
        || @voltage_squared(@R_R, omega_r, share, i_rq, flux, 0.0f) > @V_R_MAX * @V_R_MAX * margin) {
        return @NO_ANSWER;
    }
    *phi_r = flux;
    *i_rd = share;
    return wanted < @PHI_MIN || wanted > @PHI_MAX ? @LIMITED : @INSIDE;
}
"""

COMMENT = (
    " * Speed is mechanical (rad/s), torque in N m. References are the rotor flux phi_r (Wb) and the rotor d current i_rd (A, peak",
    " * of an amplitude-invariant Park transformation, referred to the stator) in rotor-flux orientation.",
    " * Copper losses alone: no iron loss, no saturation but PHI_MAX.",
    " * Range of the network: OMEGA_LOW <= omega_m <= OMEGA_HIGH, TORQUE_LOW <= torque <= TORQUE_HIGH, motoring forwards.",
    " * Less torque, none, braking, reverse and standstill (status EXTENDED): phi_r and i_rd depend on the size of speed and",
    " * torque alone and are those of the nearest point inside, so that the flux never falls below that of TORQUE_LOW. The",
    " * torque comes from @currents: give it the torque asked for, with its sign. Beyond OMEGA_HIGH or TORQUE_HIGH (status",
    " * HELD) they are those of the end, good for no more than that torque; beyond OMEGA_HIGH network and table have no",
    " * answer, and the inverters' voltage may not do.",
)
OPTIMUM = "the optimum in closed form, without the inverters' limits (it says where they act), in float"


def defines(found, torque_low):
    """Return {name: (value, unit)} of the parameters and limits of a `dfim_map.DfimMap`; ``torque_low`` (N m) is where its network begins.

    Raises
    ------
    ValueError
        If a resistance is zero, where the optimum does not exist, or the network begins at no torque, where the flux is none.
    """
    machine, limits = found.machine, found.limits
    floor = checked("lowest torque of the network", torque_low, "N m", above=0)
    floor = min(float(dfim_optimum.free_flux(machine, np.float32(floor))), limits.phi_r)
    return {
        "R_S": (checked("R_s", machine.R_s, "ohm", above=0), "ohm"), "R_R": (checked("R_r", machine.R_r, "ohm", above=0), "ohm"),
        "L_S": (machine.L_s, "H"), "L_R": (machine.L_r, "H"), "M": (machine.M, "H"), "POLE_PAIRS": (machine.p, ""),
        "PHI_MIN": (floor, "Wb, rotor flux of least loss at TORQUE_LOW"), "PHI_MAX": (limits.phi_r, "Wb, rotor flux"),
        "V_S_MAX": (limits.V_s, "V, phase, peak"), "V_R_MAX": (limits.V_r, "V, phase, peak"),
        "I_S_MAX": (limits.I_s, "A, peak"), "I_R_MAX": (limits.I_r, "A, peak"),
        "RHO": (dfim_optimum.flux_ratio(machine), "stator flux over rotor flux"),
        "TURNING": (dfim_optimum.TURNING, "share of a voltage that counts as left in any case"),
    }  # fmt: skip
