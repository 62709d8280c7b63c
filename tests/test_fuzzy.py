"""The fuzzy controller is table I and figure 5 of Zidani, evaluated exactly.

The yardstick is `centroid`: all 49 rules, the clipped sets united, and the union, which is piecewise
linear, integrated from kink to kink. It shares no formula with drivelib and runs on floats and fractions.
"""

import math
from fractions import Fraction

import numba
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from drivelib import fuzzy, fuzzy_facts
from drivelib.fuzzy import FuzzyGains, fuzzy_output, fuzzy_surface, incremental_step, position_step
from drivelib.fuzzy_reference import control_system

# Read off the paper a second time: rows e, columns Δe, both NG NM NP Z PP PM PG = −3 … 3.
PRINTED = (
    (-3, -3, -3, -2, -1, -1, 0),
    (-3, -3, -2, -1, -1, 0, 1),
    (-3, -2, -1, -1, 0, 1, 1),
    (-2, -1, -1, 0, 1, 1, 2),
    (-1, -1, 0, 1, 1, 2, 3),
    (-1, 0, 1, 1, 2, 3, 3),
    (0, 1, 1, 2, 3, 3, 3),
)


def triangle(x, k):
    """Membership of x, in units of 1/3, in set k."""
    return max(0, 1 - abs(x - k))


def clip_heights(e, de):
    x, y = (min(max(3 * v, -3), 3) for v in (e, de))
    heights = dict.fromkeys(range(-3, 4), 0)
    for i, row in enumerate(PRINTED):
        for j, k in enumerate(row):
            heights[k] = max(heights[k], min(triangle(x, i - 3), triangle(y, j - 3)))
    return {k: h for k, h in heights.items() if h > 0}


def centroid(e, de, half=0.5):
    """Centroid of the union, exact up to the arithmetic of its arguments (half: 0.5 or Fraction(1, 2))."""
    clipped = clip_heights(e, de)

    def union(x):
        return max(min(h, triangle(x, k)) for k, h in clipped.items())

    kinks = {k * half for k in range(-6, 7)}
    for k in range(-3, 4):
        kinks.update(k + side * (1 - h) for h in clipped.values() for side in (-1, 1))
    kinks = sorted(x for x in kinks if -3 <= x <= 3)
    area = moment = 0
    for left, right in zip(kinks, kinks[1:]):
        middle = (left + right) * half
        f = [union(x) for x in (left, middle, right)]
        area += (right - left) * (f[0] + 4 * f[1] + f[2])
        moment += (right - left) * (left * f[0] + 4 * middle * f[1] + right * f[2])
    return moment / area / 3


def samples(seed, count, reach=1.2):
    return np.random.default_rng(seed).uniform(-reach, reach, (count, 2))


def partition_points():
    """All corners and midpoints of the partition, and random points on each of its edges."""
    lines = [k / 6 for k in range(-7, 8)]
    free = np.random.default_rng(5).uniform(-1, 1, 20)
    return [(a, b) for a in lines for b in lines] + [p for a in lines for b in free for p in ((a, b), (b, a))]


def test_table_is_the_printed_one():
    """The 49 rules are those of table I."""
    assert fuzzy.RULES.tolist() == [list(row) for row in PRINTED]


@pytest.mark.parametrize("points", [samples(1, 5000), partition_points()], ids=["inside", "partition"])
def test_closed_form_is_the_centroid(points):
    """The closed form equals the integral of the clipped union."""
    for e, de in points:
        assert fuzzy_output(e, de) == pytest.approx(centroid(e, de), abs=1e-12)


def test_closed_form_is_the_centroid_in_exact_arithmetic():
    """The same against fractions, where the yardstick has no rounding at all."""
    for e, de in [*samples(2, 200), *partition_points()[:225]]:
        exact = centroid(Fraction(e), Fraction(de), Fraction(1, 2))
        assert abs(Fraction(float(fuzzy_output(e, de))) - exact) < Fraction(1, 10**14)


def test_closed_form_is_the_limit_of_fine_sampling():
    """A plain sampled centroid with 2^18 points comes within 1e-9."""
    x = (np.arange(2**18) + 0.5) * (6 / 2**18) - 3
    sets = {k: np.maximum(0, 1 - abs(x - k)) for k in range(-3, 4)}
    for e, de in samples(3, 60):
        union = np.zeros_like(x)
        for k, h in clip_heights(e, de).items():
            np.maximum(union, np.minimum(sets[k], h), out=union)
        assert fuzzy_output(e, de) == pytest.approx((x @ union) / union.sum() / 3, abs=1e-9)


def test_scikit_fuzzy_converges_to_the_closed_form():
    """scikit-fuzzy stays within its sampling bound 4 h², and a quarter of the step leaves a sixteenth of the error."""
    corners = [(a, b) for a in (-1, -2 / 3, 0, 1 / 6) for b in (-1, 1 / 3, 1 / 2, 1)]
    rms = {}
    for points in (25, 97):
        system = control_system(points)
        errors = []
        for e, de in [*samples(4, 50), *corners]:
            system.input["e"], system.input["de"] = e, de
            system.compute()
            errors.append(system.output["u"] - fuzzy_output(e, de))
        assert max(map(abs, errors)) < 4 * (2 / (points - 1)) ** 2
        rms[points] = np.sqrt(np.mean(np.square(errors)))
    assert 11 < rms[25] / rms[97] < 23


@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
@example(0.1, -0.1)
@example(0.0, 1 / 3)
@example(-5e-324, 1.0)
def test_odd_and_symmetric_to_the_last_bit(e, de):
    """u(−e, −Δe) = −u(e, Δe) and u(Δe, e) = u(e, Δe), without tolerance."""
    assert fuzzy_output(-e, -de) == -fuzzy_output(e, de)
    assert fuzzy_output(de, e) == fuzzy_output(e, de)


def test_opposite_inputs_cancel():
    """Error and variation of equal size and opposite sign ask for nothing, to the last bit."""
    for e in [0.0, 2.0, *np.geomspace(1e-20, 1.0, 300)]:
        assert fuzzy_output(e, -e) == 0


def test_inputs_saturate():
    """Beyond ±1 an input acts as ±1, infinity included; NaN stays NaN."""
    for e, de in samples(6, 200, reach=3.0):
        assert fuzzy_output(e, de) == fuzzy_output(np.clip(e, -1, 1), np.clip(de, -1, 1))
    assert fuzzy_output(math.inf, -0.2) == fuzzy_output(1.0, -0.2)
    assert fuzzy_output(math.inf, -math.inf) == 0
    assert math.isnan(fuzzy_output(math.nan, 0.0)) and math.isnan(fuzzy_output(0.0, math.nan))


def test_reachable_output_ends_at_the_half_triangle():
    """The outermost set is [2/3, 1] with its peak at 1, so its centroid 8/9 bounds the command."""
    assert fuzzy_output(1.0, 1.0) == pytest.approx(8 / 9, abs=1e-15)
    axis = np.linspace(-1, 1, 301)
    assert fuzzy_surface(axis[:, None], axis).max() <= 8 / 9 + 1e-15


def test_compiled_equals_plain_python():
    """Numba and Python give the same bits, for the surface and for both step functions."""
    e, de = samples(7, 3000).T
    assert fuzzy_surface(e, de).tolist() == [fuzzy_output(a, b) for a, b in zip(e, de)]
    position, incremental = numba.njit(position_step), numba.njit(incremental_step)
    for a, b in samples(8, 300, reach=20):
        assert position(a, b, 0.05, 2.0, 40.0, 25.0) == position_step(a, b, 0.05, 2.0, 40.0, 25.0)
        assert incremental(a, b, a, 0.05, 2.0, 40.0, 25.0) == incremental_step(a, b, a, 0.05, 2.0, 40.0, 25.0)


def test_surface_broadcasts():
    """A column and a row give the map e down, Δe across."""
    e, de = np.array([[-0.4], [0.9]]), np.array([0.1, 0.2, 0.3])
    u = fuzzy_surface(e, de)
    assert u.shape == (2, 3) and u[1, 2] == fuzzy_output(0.9, 0.3)
    assert fuzzy_surface(0.5, 0.25) == fuzzy_output(0.5, 0.25)


def test_steps_are_equations_21_to_24():
    """T* = K_u u(K_e e, K_de (e(k) − e(k−1))), summed up in the incremental form, both limited."""
    gains = {"K_e": 0.04, "K_de": 1.5, "K_u": 30.0}
    T, e_previous = 0.0, 0.0
    for e in 30 * np.sin(np.arange(200)):
        u = centroid(0.04 * e, 1.5 * (e - e_previous))
        expected = min(max(T + 30 * u, -22), 22)
        assert incremental_step(e, e_previous, T, **gains, T_max=22.0) == pytest.approx(expected, abs=1e-12)
        assert position_step(e, e_previous, **gains, T_max=22.0) == pytest.approx(min(max(30 * u, -22), 22), abs=1e-12)
        T, e_previous = expected, e


def test_incremental_form_does_not_wind_up():
    """After a long time at the limit the first falling command leaves it at once."""
    T = 0.0
    for _ in range(100):
        T = incremental_step(10.0, 10.0, T, 0.1, 1.0, 5.0, T_max=20.0)
    assert T == 20
    assert incremental_step(-1.0, -1.0, T, 0.1, 1.0, 5.0, T_max=20.0) < 20


def run_under_load(gains, load, J=0.2, T_s=1e-3, steps=20_000):
    """Speed error of a pure inertia after a load step (rad/s)."""
    speed = T = e_previous = 0.0
    for _ in range(steps):
        e = 0.0 - speed
        if gains.form == "position":
            T = position_step(e, e_previous, gains.K_e, gains.K_de, gains.K_u, 50.0)
        else:
            T = incremental_step(e, e_previous, T, gains.K_e, gains.K_de, gains.K_u, 50.0)
        speed += T_s * (T - load) / J
        e_previous = e
    return -speed


@pytest.mark.parametrize("load", [5.0, 12.0, 24.0])
def test_position_form_leaves_an_error_under_load(load):
    """With u the torque itself, a constant load needs a constant error: holding_input says how large."""
    gains = FuzzyGains(K_e=0.1, K_de=0.5, K_u=40.0)
    assert run_under_load(gains, load) == pytest.approx(fuzzy_facts.holding_input(load / 40) / 0.1, abs=1e-9)


def test_incremental_form_leaves_no_error_under_load():
    """With u the variation, the controller integrates: nothing is left."""
    gains = fuzzy_facts.gains_like_pi(K_p=4.0, K_i=40.0, T_s=1e-3, e_max=10.0)
    assert fuzzy_facts.equivalent_gains(gains, 1e-3) == pytest.approx((4.0, 40.0, 0.0))
    assert run_under_load(gains, 12.0) == pytest.approx(0, abs=1e-9)


def test_holding_input_is_the_smallest():
    """Any smaller error gives less; 1/3 is the first that gives 1/3; more than 2/3 cannot be held."""
    for u in (0.05, 0.2, 0.4, 0.6):
        e = fuzzy_facts.holding_input(u)
        assert centroid(e, 0.0) == pytest.approx(u, abs=1e-12) and centroid(e - 1e-6, 0.0) < u
        assert fuzzy_output(e, 0.0) >= u
        assert fuzzy_facts.holding_input(-u) == -e
    assert fuzzy_facts.holding_input(1 / 3) == pytest.approx(1 / 3, abs=1e-12)
    assert centroid(2 / 3, 0.0) == pytest.approx(1 / 3)
    with pytest.raises(ValueError, match="u = 0.7: must be a finite number at least -0.66.* and at most 0.66"):
        fuzzy_facts.holding_input(0.7)


@pytest.mark.parametrize("e, de", [(1, 0), (0, 1), (1, 1), (2, 1), (2, -1), (-1, 2), (-1, -3), (1, -1)])
def test_slope_at_the_origin(e, de):
    """origin_slope is the limit of the exact surface along each direction."""
    t = Fraction(1, 10**10)
    limit = centroid(t * e, t * de, Fraction(1, 2)) / t
    assert fuzzy_facts.origin_slope(e, de) == pytest.approx(float(limit), abs=1e-7)


def test_position_form_is_a_pd():
    """Small signals of opposite signs see K_p = 1.5 K_u K_e and K_d = 1.5 K_u K_de T_s."""
    gains = FuzzyGains(K_e=0.02, K_de=3.0, K_u=40.0)
    K_p, K_i, K_d = fuzzy_facts.equivalent_gains(gains, 1e-4)
    assert K_i == 0
    e, slope = 1e-7, -1e-4  # rad/s, rad/s²
    T = position_step(e, e - slope * 1e-4, gains.K_e, gains.K_de, gains.K_u, 50.0)
    assert T == pytest.approx(K_p * e + K_d * slope, rel=1e-5)
