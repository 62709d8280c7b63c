"""The C99 text that every exported motor has: the network in float and in Q15, and its torque limit.

Blocks of the header; `drivelib.export.c_header` joins them with those of `export_c_pmsm` or `export_c_dfim`. Only the
float blocks need ``<math.h>`` (sqrtf, tanhf); the Q15 block is integer arithmetic alone, with no shift of a negative
number and no sum that can overflow, so its result is the same on every processor.
"""

import re

import numpy as np

from drivelib import fixed_point

HELPERS = """\
/* What @network, @network_q15 and @optimum return. */
#define @INSIDE 0    /* network: inside its training range; optimum: no limit acts */
#define @LIMITED 1   /* optimum: a limit moved it */
#define @NO_ANSWER 2 /* optimum: none, see there; the outputs are left alone */
#define @EXTENDED 3  /* network: outside its training range, torque still as asked: the rule of symmetry above */
#define @HELD 4      /* network: speed or torque lies beyond the range, or is NaN; the answer is that of its end */

static inline float @clampf(float value, float low, float high)
{
    return value < low ? low : (value > high ? high : value);
}
"""

EXTEND = {"float": "    @extend(omega_m, torque, @y_0, @y_1);\n", "q15": "    @q15_extend(omega_m, torque, @y_0, @y_1);\n"}

Q15_EXTENSION = "@extension_of_q15\n"  # where `drivelib.export` puts it, if there is one

FLOAT_NETWORK = """\
/* Network in single precision. It never extrapolates: see the range above. Inside it, against the same network in
 * double precision, at most @float_bound off,
 * if tanhf errs by at most 2 ulp. NaN in, NaN out. */
#define @HIDDEN @hidden
static const float @w1[@HIDDEN][2] = {@w1_values};
static const float @b1[@HIDDEN] = {@b1_values};
static const float @w2[2][@HIDDEN] = {@w2_values};
static const float @b2[2] = {@b2_values};

static inline int @network(float omega_m, float torque, float *@y_0, float *@y_1)
{
    const float w = @clampf(fabsf(omega_m), @OMEGA_LOW, @OMEGA_HIGH);
    const float t = @clampf(fabsf(torque), @TORQUE_LOW, @TORQUE_HIGH);
    float sum_0 = @b2[0];
    float sum_1 = @b2[1];
    for (int j = 0; j < @HIDDEN; ++j) {
        const float h = tanhf(@b1[j] + @w1[j][0] * w + @w1[j][1] * t);
        sum_0 += @w2[0][j] * h;
        sum_1 += @w2[1][j] * h;
    }
    *@y_0 = sum_0;
    *@y_1 = sum_1;
    if (omega_m == w && torque == t) {
        return @INSIDE;
    }
""" + EXTEND["float"] + """\
    return fabsf(omega_m) <= @OMEGA_HIGH && fabsf(torque) <= @TORQUE_HIGH ? @EXTENDED : @HELD;
}
"""

Q15_NETWORK = """\
/* Network in Q15: a value is q * FULL_SCALE / 32768. As in float outside the training range; outputs saturate.
 * Row j of the weights has f[j] fractional bits, its bias f[j] + 15; no sum can leave 32 bits. tanh: @steps steps
 * per unit up to @table_end, linear between them. Inside, against the same network in double precision at the same
 * inputs, the worst case of all roundings together is @q15_bound (derived, not sampled). */
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

static inline int32_t @q15_clamp(int32_t value, int32_t low, int32_t high)
{
    return value < low ? low : (value > high ? high : value);
}

static inline int16_t @q15_output(int32_t sum, uint8_t f)
{
    const int32_t half = (int32_t)1 << (f - 1);
    const int32_t value = sum >= 0 ? (sum + half) >> f : -((half - sum) >> f);
    return (int16_t)@q15_clamp(value, -32768, 32767);
}
""" + Q15_EXTENSION + """\
static inline int @network_q15(int16_t omega_m, int16_t torque, int16_t *@y_0, int16_t *@y_1)
{
    const int32_t speed = omega_m < 0 ? -(int32_t)omega_m : omega_m;
    const int32_t size = torque < 0 ? -(int32_t)torque : torque;
    const int32_t w = @q15_clamp(speed, @x_low_0, @x_high_0);
    const int32_t t = @q15_clamp(size, @x_low_1, @x_high_1);
    int32_t sum_0 = @q15_b2[0];
    int32_t sum_1 = @q15_b2[1];
    for (int j = 0; j < @HIDDEN; ++j) {
        const int32_t z = @q15_b1[j] + (int32_t)@q15_w1[j][0] * w + (int32_t)@q15_w1[j][1] * t;
        const int32_t h = @q15_tanh(z, @q15_f1[j]);
        sum_0 += @q15_w2[0][j] * h;
        sum_1 += @q15_w2[1][j] * h;
    }
    *@y_0 = @q15_output(sum_0, @q15_f2[0]);
    *@y_1 = @q15_output(sum_1, @q15_f2[1]);
    if (omega_m == w && torque == t) {
        return @INSIDE;
    }
""" + EXTEND["q15"] + """\
    return speed <= @x_high_0 && size <= @x_high_1 ? @EXTENDED : @HELD;
}
"""

TORQUE_LIMIT = """\
/* Largest torque (N m) inside the limits that the network is good for, over speed of either sign: linear between
 * @limit_size nodes, 0 where a speed is out of reach or beyond OMEGA_HIGH. Clamp the torque reference to plus and minus
 * this before @network, which knows its range but not the inverter. Braking would allow more. */
static const float @torque_limits[@limit_size] = {@limit_values};

static inline float @torque_limit(float omega_m)
{
    const float place = @clampf((fabsf(omega_m) - @OMEGA_LOW) / @limit_step, 0.0f, @limit_last);
    const int index = place < @limit_last ? (int)place : @limit_size - 2;
    if (!(fabsf(omega_m) <= @OMEGA_HIGH)) {
        return 0.0f;
    }
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
    divisor = {"x_divisor": str(max(int(q15.x_low[1]), 1))}  # no torque is below a range that starts at none
    divisor |= {f"iron_{name}": str(int(value)) for name, value in zip("0dq", q15.iron or (), strict=False)}
    ends = {f"x_{end}_{n}": str(int(getattr(q15, f"x_{end}")[n])) for end in ("low", "high") for n in (0, 1)}
    scales = {f"{axis}_scale_{n}": number(getattr(q15, f"{axis}_scale")[n]) for axis in "xy" for n in (0, 1)}
    integers = {name: rows(getattr(q15, name), lambda value: str(int(value))) for name in ("W1", "B1", "f1", "W2", "B2", "f2")}
    return {
        **ends, **divisor, **scales, **integers,
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
