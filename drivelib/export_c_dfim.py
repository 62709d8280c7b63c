"""The C99 text that a DFIM's exported header has of its own: parameters, currents of the references, closed form."""

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

/* Rotor flux of least copper loss, at most PHI_MAX: phi^2 = N |T| / (1.5 P M sqrt(R_S R_R)), N = M^2 R_R + L_R^2 R_S. */
static inline float @free_flux(float torque)
{
    const float n = @M * @M * @R_R + @L_R * @L_R * @R_S;
    return sqrtf(n * fabsf(torque) / (1.5f * @POLE_PAIRS * @M * sqrtf(@R_S * @R_R)));
}

/* Stator frequency (electrical rad/s); the rotor's is this less POLE_PAIRS omega_m. Both inverters are equally near
 * the voltage that the resistances leave; RHO is the ratio of the flux linkages. */
static inline float @stator_frequency(float omega_m, float torque)
{
    const float flux = @clampf(@free_flux(torque), 1e-9f * @PHI_MAX, @PHI_MAX);
    const float i_q = @L_R * torque / (1.5f * @POLE_PAIRS * @M * flux);
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

/* The optimum itself, without a network, where no voltage or current limit acts: i_rd = R_S L_R phi / N. */
#define @INSIDE 0 /* the free optimum */
#define @CAPPED 1 /* the flux is held at PHI_MAX */
#define @BEYOND 2 /* a voltage or current limit would be passed: ask the network or the table; the outputs are left alone */

static inline int @optimum(float omega_m, float torque, float *phi_r, float *i_rd)
{
    const float n = @M * @M * @R_R + @L_R * @L_R * @R_S;
    const float wanted = @free_flux(torque);
    const float flux = @clampf(wanted, 1e-9f * @PHI_MAX, @PHI_MAX);
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
        return @BEYOND;
    }
    *phi_r = flux;
    *i_rd = share;
    return wanted > @PHI_MAX ? @CAPPED : @INSIDE;
}
"""

COMMENT = (
    " * Speed is mechanical (rad/s), torque in N m. References are the rotor flux phi_r (Wb) and the rotor d current i_rd (A, peak",
    " * of an amplitude-invariant Park transformation, referred to the stator) in rotor-flux orientation. Motoring only.",
    " * Copper losses alone: no iron loss, no saturation but PHI_MAX.",
)


def defines(found):
    """Return {name: (value, unit)} of the parameters and limits of a `dfim_map.DfimMap`.

    Raises
    ------
    ValueError
        If a resistance is zero, where the optimum does not exist.
    """
    machine, limits = found.machine, found.limits
    return {
        "R_S": (checked("R_s", machine.R_s, "ohm", above=0), "ohm"), "R_R": (checked("R_r", machine.R_r, "ohm", above=0), "ohm"),
        "L_S": (machine.L_s, "H"), "L_R": (machine.L_r, "H"), "M": (machine.M, "H"), "POLE_PAIRS": (machine.p, ""),
        "PHI_MAX": (limits.phi_r, "Wb, rotor flux"),
        "V_S_MAX": (limits.V_s, "V, phase, peak"), "V_R_MAX": (limits.V_r, "V, phase, peak"),
        "I_S_MAX": (limits.I_s, "A, peak"), "I_R_MAX": (limits.I_r, "A, peak"),
        "RHO": (dfim_optimum.flux_ratio(machine), "stator flux over rotor flux"),
        "TURNING": (dfim_optimum.TURNING, "share of a voltage that counts as left in any case"),
    }  # fmt: skip
