"""The C99 text of an exported motor: the network in float and in Q15, and the exact optimum in float.

Each function returns one block of the header; `drivelib.export.c_header` joins them. Only the float blocks
need ``<math.h>`` (sqrtf, tanhf); the Q15 block is integer arithmetic alone, with no shift of a negative number and
no sum that can overflow, so its result is the same on every processor.
"""

import re

import numpy as np

from drivelib import fixed_point

HELPERS = """\
static inline float @clampf(float value, float low, float high)
{
    return value < low ? low : (value > high ? high : value);
}
"""

FLOAT_NETWORK = """\
/* Network in single precision. Inputs are clamped to the training range: it never extrapolates.
 * Against the same network in double precision at most @float_bound off,
 * if tanhf errs by at most 2 ulp. NaN in, NaN out. */
#define @HIDDEN @hidden
static const float @w1[@HIDDEN][2] = {@w1_values};
static const float @b1[@HIDDEN] = {@b1_values};
static const float @w2[2][@HIDDEN] = {@w2_values};
static const float @b2[2] = {@b2_values};

static inline void @network(float omega_m, float torque, float *@y_0, float *@y_1)
{
    float sum_0 = @b2[0];
    float sum_1 = @b2[1];
    omega_m = @clampf(omega_m, @OMEGA_LOW, @OMEGA_HIGH);
    torque = @clampf(torque, @TORQUE_LOW, @TORQUE_HIGH);
    for (int j = 0; j < @HIDDEN; ++j) {
        const float h = tanhf(@b1[j] + @w1[j][0] * omega_m + @w1[j][1] * torque);
        sum_0 += @w2[0][j] * h;
        sum_1 += @w2[1][j] * h;
    }
    *@y_0 = sum_0;
    *@y_1 = sum_1;
}
"""

Q15_NETWORK = """\
/* Network in Q15: a value is q * FULL_SCALE / 32768. Inputs are clamped to the training range, outputs saturate.
 * Row j of the weights has f[j] fractional bits, its bias f[j] + 15; no sum can leave 32 bits. tanh: @steps steps
 * per unit up to @table_end, linear between them. Against the same network in double precision at the same inputs,
 * the worst case of all roundings together is @q15_bound (derived, not sampled). */
#define @Q15_OMEGA_FULL_SCALE @x_scale_0 /* rad/s */
#define @Q15_TORQUE_FULL_SCALE @x_scale_1 /* N m */
#define @full_scale_0 @y_scale_0 /* @unit_0 */
#define @full_scale_1 @y_scale_1 /* @unit_1 */
static const int16_t @q15_w1[@HIDDEN][2] = {@W1};
static const int32_t @q15_b1[@HIDDEN] = {@B1};
static const uint8_t @q15_f1[@HIDDEN] = {@f1};
static const int16_t @q15_w2[2][@HIDDEN] = {@W2};
static const int32_t @q15_b2[2] = {@B2};
static const uint8_t @q15_f2[2] = {@f2};
static const int16_t @q15_table[@table_size] = {
@table};

static inline int32_t @q15_tanh(int32_t z, uint8_t f)
{
    const int shift = f + @shift_base;
    const uint32_t size = (uint32_t)(z < 0 ? -z : z);
    const uint32_t index = size >> shift;
    int32_t value = 32767;
    if (index < @last_index) {
        const int32_t fraction = (int32_t)((size & (((uint32_t)1 << shift) - 1u)) >> (shift - 15));
        const int32_t step = (int32_t)@q15_table[index + 1u] - (int32_t)@q15_table[index];
        value = (int32_t)@q15_table[index] + ((step * fraction + 16384) >> 15); /* step >= 0: the table rises */
    }
    return z < 0 ? -value : value;
}

static inline int16_t @q15_clamp(int16_t value, int16_t low, int16_t high)
{
    return value < low ? low : (value > high ? high : value);
}

static inline int16_t @q15_output(int32_t sum, uint8_t f)
{
    const int32_t half = (int32_t)1 << (f - 1);
    const int32_t value = sum >= 0 ? (sum + half) >> f : -((half - sum) >> f);
    return (int16_t)(value > 32767 ? 32767 : (value < -32768 ? -32768 : value));
}

static inline void @network_q15(int16_t omega_m, int16_t torque, int16_t *@y_0, int16_t *@y_1)
{
    int32_t sum_0 = @q15_b2[0];
    int32_t sum_1 = @q15_b2[1];
    omega_m = @q15_clamp(omega_m, @x_low_0, @x_high_0);
    torque = @q15_clamp(torque, @x_low_1, @x_high_1);
    for (int j = 0; j < @HIDDEN; ++j) {
        const int32_t z = @q15_b1[j] + (int32_t)@q15_w1[j][0] * omega_m + (int32_t)@q15_w1[j][1] * torque;
        const int32_t h = @q15_tanh(z, @q15_f1[j]);
        sum_0 += @q15_w2[0][j] * h;
        sum_1 += @q15_w2[1][j] * h;
    }
    *@y_0 = @q15_output(sum_0, @q15_f2[0]);
    *@y_1 = @q15_output(sum_1, @q15_f2[1]);
}
"""

FORMULA = """\
/* The optimum itself, without a network: every limit included.
 * Along a curve of constant torque, loss, voltage squared and current squared all read
 *   F(i) = p i^2 + g (PSI + L_D i)^2 + (p + g L_Q^2) q^2 / x^2 + c q,   x = PSI + DELTA_L i,   q = T / (1.5 P),
 * strictly convex in the branch current i. Newton's method finds the bottom, and where a limit is passed, its edge. */
#define @INSIDE 0      /* the free optimum */
#define @LIMITED 1     /* a limit moved it */
#define @UNREACHABLE 2 /* no current makes this torque inside the limits; the outputs are left alone */

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
            return @UNREACHABLE;
        }
        if (fabsf(edge - free_i) > fabsf(i - free_i)) {
            i = edge;
            moved = 1;
        }
    }
    for (int n = 0; n < 2; ++n) {
        if (@form_value(limit[n], i, q) > bound[n] * (1.0f + 2.0f * @ROUNDING)) {
            return @UNREACHABLE;
        }
    }
    const float branch_q = q / (@PSI_F + @DELTA_L * i);
    *i_d = i - w * @L_Q * branch_q * conductance;
    *i_q = branch_q + w * (@PSI_F + @L_D * i) * conductance;
    return moved ? @LIMITED : @INSIDE;
}
"""

TORQUE_LIMIT = """\
/* Largest torque (N m) that the network answers for, over speed; linear between @limit_size equal steps, 0 where the
 * speed is out of reach. Clamp the torque reference to it before @network. */
static const float @torque_limits[@limit_size] = {@limit_values};

static inline float @torque_limit(float omega_m)
{
    const float place = @clampf((omega_m - @OMEGA_LOW) / @limit_step, 0.0f, @limit_last);
    const int index = place < @limit_last ? (int)place : @limit_size - 2;
    return @torque_limits[index] + (place - (float)index) * (@torque_limits[index + 1] - @torque_limits[index]);
}
"""


def number(value):
    """Return a C float literal that reads back as the nearest single."""
    text = f"{np.float32(value):.8e}f"
    return f"({text})" if value < 0 else text


def rows(values, form=number):
    """Return nested values as a C initialiser without its outer braces."""
    values = np.asarray(values)
    if values.ndim > 1:
        return ", ".join("{" + rows(row, form) + "}" for row in values)
    return ", ".join(form(value) for value in values)


def output_fields(targets, prefix, *, q15, single):
    """Return the fields that name the two outputs, with the bounds of both number formats in their units.

    ``targets`` is {name: unit}, ``q15`` and ``single`` the bounds, shape (2,) each.
    """
    said = [(f"{value:{form}} {unit} in {name}" for value, (name, unit) in zip(bounds, targets.items(), strict=True)) for bounds, form in ((single, ".2g"), (q15, ".3g"))]
    found = dict(zip(("float_bound", "q15_bound"), map(" and ".join, said), strict=True))
    for n, (name, unit) in enumerate(targets.items()):
        found |= {f"y_{n}": name, f"unit_{n}": unit, f"full_scale_{n}": f"{prefix}_Q15_{name}_FULL_SCALE".upper()}
    return found


def table_lines(values, each=12):
    """Return integers as lines of a C initialiser."""
    pieces = [values[start : start + each] for start in range(0, len(values), each)]
    return "".join("    " + ", ".join(str(int(value)) for value in piece) + ",\n" for piece in pieces)


def q15_fields(q15):
    """Return what the Q15 block needs from a `fixed_point.Q15Network`."""
    ends = {f"x_{end}_{n}": str(int(getattr(q15, f"x_{end}")[n])) for end in ("low", "high") for n in (0, 1)}
    scales = {f"{axis}_scale_{n}": number(getattr(q15, f"{axis}_scale")[n]) for axis in "xy" for n in (0, 1)}
    integers = {name: rows(getattr(q15, name), lambda value: str(int(value))) for name in ("W1", "B1", "f1", "W2", "B2", "f2")}
    return {
        **ends, **scales, **integers,
        "steps": str(1 << fixed_point.STEP_BITS),
        "table_end": str(fixed_point.TABLE_END),
        "table_size": str(len(fixed_point.TABLE)),
        "last_index": f"{len(fixed_point.TABLE) - 1}u",
        "shift_base": str(15 - fixed_point.STEP_BITS),
        "table": table_lines(fixed_point.TABLE),
    }  # fmt: skip


def filled(text, fields, prefix):
    """Return a block with its @names replaced: by a field's value, else by the name with the prefix before it."""

    def replaced(match):
        name = match.group(1)
        return fields.get(name) or (prefix.upper() if name == name.upper() else prefix) + "_" + name

    return re.sub(r"@(\w+)", replaced, text)
