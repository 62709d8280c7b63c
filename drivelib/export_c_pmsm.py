"""The C99 text that a PMSM's exported header has of its own: parameters, what holds outside the training range, the exact optimum."""

EXTENSION_FLOAT = """\
/* Outside the training range: same branch d current, branch q current in proportion to torque, iron current of the speed.
 * i_d and i_q come in as at the nearest speed and torque inside. */
static inline void @extend(float omega_m, float torque, float *i_d, float *i_q)
{
    const float speed = fabsf(omega_m);
    const float forward = omega_m < 0.0f ? -1.0f : 1.0f;
    const float share = fabsf(torque) < @TORQUE_LOW ? torque / @TORQUE_LOW : (torque < 0.0f ? -1.0f : 1.0f);
    const float given = @POLE_PAIRS * @clampf(speed, @OMEGA_LOW, @OMEGA_HIGH) / @R_C;
    const float asked = @POLE_PAIRS * @clampf(speed, 0.0f, @OMEGA_HIGH) / @R_C;
    const float branch_q = (*i_q - given * (@PSI_F + @L_D * *i_d)) / (1.0f + given * given * @L_D * @L_Q);
    const float branch_d = *i_d + given * @L_Q * branch_q;
    const float made = forward * share * branch_q;
    *i_d = branch_d - asked * @L_Q * made;
    *i_q = forward * (made + asked * (@PSI_F + @L_D * branch_d));
}
"""

EXTENSION_Q15 = """
/* The same as @extend. Constants for full-scale speed: emf of the magnets, L_D and L_Q over R_C, in Q15 of the currents. */
static inline int32_t @q15_times(int32_t a, int32_t b)
{
    const int64_t product = (int64_t)a * b;
    return (int32_t)(product >= 0 ? (product + 16384) >> 15 : -((16384 - product) >> 15));
}

static inline void @q15_extend(int32_t omega_m, int32_t torque, int16_t *i_d, int16_t *i_q)
{
    const int32_t speed = omega_m < 0 ? -omega_m : omega_m;
    const int32_t size = torque < 0 ? -torque : torque;
    const int32_t share = size < @x_low_1 ? torque * 32768 / @x_divisor : (torque < 0 ? -32768 : 32768);
    const int32_t given = @q15_clamp(speed, @x_low_0, @x_high_0);
    const int32_t asked = speed < @x_high_0 ? speed : @x_high_0;
    const int32_t turn_d = @q15_times(@iron_d, given);
    const int32_t turn_q = @q15_times(@iron_q, given);
    const int32_t left = *i_q - @q15_times(@iron_0, given) - @q15_times(turn_d, *i_d);
    const int32_t branch_q = (int32_t)((int64_t)left * 32768 / (32768 + @q15_times(turn_d, turn_q)));
    const int32_t branch_d = *i_d + @q15_times(turn_q, branch_q);
    const int32_t made = @q15_times(omega_m < 0 ? -share : share, branch_q);
    const int32_t d = branch_d - @q15_times(@q15_times(@iron_q, asked), made);
    const int32_t q = made + @q15_times(@iron_0, asked) + @q15_times(@q15_times(@iron_d, asked), branch_d);
    *i_d = (int16_t)@q15_clamp(d, -32768, 32767);
    *i_q = (int16_t)@q15_clamp(omega_m < 0 ? -q : q, -32768, 32767);
}
"""

FORMULA = """\
/* The optimum itself, without a network: every limit included, for either sign of speed and torque and any speed.
 * @NO_ANSWER: no current makes this torque inside the limits; the outputs are left alone.
 * Along a curve of constant torque, loss, voltage squared and current squared all read
 *   F(i) = p i^2 + g (PSI + L_D i)^2 + (p + g L_Q^2) q^2 / x^2 + c q,   x = PSI + DELTA_L i,   q = T / (1.5 P),
 * strictly convex in the branch current i. Newton's method finds the bottom, and where a limit is passed, its edge. */
typedef struct {
    float p, g, c;
} @form;

static inline float @form_value(@form f, float i, float q)
{
    const float flux = @PSI_F + @L_D * i;
    const float x = @PSI_F + @DELTA_L * i;
    return f.p * i * i + f.g * flux * flux + (f.p + f.g * @L_Q * @L_Q) * (q / x) * (q / x) + f.c * q;
}

static inline float @form_bottom(@form f, float q)
{
    const float scale = f.p + f.g * @L_D * @L_D;
    const float b = f.g * @PSI_F * @L_D / scale;
    const float k = (f.p + f.g * @L_Q * @L_Q) / scale;
    const float a = @PSI_F - b * @DELTA_L;
    const float ratio = @DELTA_L * q / (a * a);
    const float mu = k * ratio * ratio;
    float excess = sqrtf(sqrtf(mu));
    for (int n = 0; n < 30; ++n) {
        const float y = 1.0f + excess;
        const float step = (y * y * y * excess - mu) / (y * y * (4.0f * excess + 1.0f));
        excess -= step;
        if (fabsf(step) <= 1e-7f * excess) {
            break;
        }
    }
    const float x = a * (1.0f + (excess > 0.0f ? excess : 0.0f));
    return @DELTA_L * k * (q / x) * (q / x) / x - b;
}

/* Move i to the nearest point with F <= bound; return 0 where there is none. */
static inline int @form_inside(@form f, float bound, float q, float *i)
{
    if (@form_value(f, @form_bottom(f, q), q) > bound) {
        return 0;
    }
    for (int n = 0; n < 60; ++n) {
        const float excess = @form_value(f, *i, q) - bound;
        const float x = @PSI_F + @DELTA_L * *i;
        const float slope = 2.0f * (f.p * *i + f.g * @L_D * (@PSI_F + @L_D * *i)
            - (f.p + f.g * @L_Q * @L_Q) * @DELTA_L * (q / x) * (q / x) / x);
        if (!(excess > @ROUNDING * bound) || slope == 0.0f) {
            break;
        }
        *i -= excess / slope;
    }
    return 1;
}

static inline int @optimum(float omega_m, float torque, float *i_d, float *i_q)
{
    const float w = @POLE_PAIRS * omega_m;
    const float q = torque / (1.5f * @POLE_PAIRS);
    const float conductance = 1.0f / @R_C;
    const float scaled = w * (1.0f + @R_S * conductance);
    const @form loss = {@R_S, w * w * conductance * (1.0f + @R_S * conductance), 2.0f * @R_S * w * conductance};
    const @form limit[2] = {
        {@R_S * @R_S, scaled * scaled, 2.0f * @R_S * scaled},
        {1.0f, w * w * conductance * conductance, 2.0f * w * conductance},
    };
    const float bound[2] = {@V_MAX * @V_MAX, @I_MAX * @I_MAX};
    const float free_i = @form_bottom(loss, q);
    float i = free_i;
    int moved = 0;
    for (int n = 0; n < 2; ++n) { /* what one limit asks for, taken where it lies farther from the free optimum */
        float edge = free_i;
        if (!@form_inside(limit[n], bound[n], q, &edge)) {
            return @NO_ANSWER;
        }
        if (fabsf(edge - free_i) > fabsf(i - free_i)) {
            i = edge;
            moved = 1;
        }
    }
    for (int n = 0; n < 2; ++n) {
        if (@form_value(limit[n], i, q) > bound[n] * (1.0f + 2.0f * @ROUNDING)) {
            return @NO_ANSWER;
        }
    }
    const float branch_q = q / (@PSI_F + @DELTA_L * i);
    *i_d = i - w * @L_Q * branch_q * conductance;
    *i_q = branch_q + w * (@PSI_F + @L_D * i) * conductance;
    return moved ? @LIMITED : @INSIDE;
}
"""

COMMENT = (
    " * Speed is mechanical (rad/s), torque in N m, currents i_d, i_q are the terminal references (A, peak of an",
    " * amplitude-invariant Park transformation). Iron loss is a resistance R_C across the emf.",
    " * Range of the network: OMEGA_LOW <= omega_m <= OMEGA_HIGH, TORQUE_LOW <= torque <= TORQUE_HIGH, motoring forwards.",
    " * Less torque, none, braking, reverse and standstill (status EXTENDED): the d current of the nearest point inside",
    " * stays, the q current follows the torque, so that torque and its sign are as asked (no torque: only what feeds the",
    " * iron loss). Voltage and current are then at most those of the point inside. Braking, the loss is the least one where",
    " * no limit acts; where one does, less field weakening would do, and @optimum loses less. Beyond OMEGA_HIGH or",
    " * TORQUE_HIGH (status HELD) the answer is that of the end: not what was asked, and the voltage may not do.",
)
OPTIMUM = "the exact optimum, every limit included, in float"


def defines(found, _torque_low):
    """Return {name: (value, unit)} of the parameters and limits of a `loss_map.LossMap`.

    Raises
    ------
    ValueError
        If R_s = 0, where the optimum is not unique.
    """
    machine = found.machine
    if machine.R_s == 0:
        raise ValueError("R_s = 0 ohm: at standstill every current has the same loss, so the formula has no optimum; must be above 0")
    return {
        "R_S": (machine.R_s, "ohm"), "R_C": (machine.R_c, "ohm"), "L_D": (machine.L_d, "H"), "L_Q": (machine.L_q, "H"),
        "DELTA_L": (machine.delta_L, "H"), "PSI_F": (machine.psi_f, "Wb"), "POLE_PAIRS": (machine.P, ""),
        "V_MAX": (found.V_max, "V, phase, peak"), "I_MAX": (found.I_max, "A, peak"),
    }  # fmt: skip
