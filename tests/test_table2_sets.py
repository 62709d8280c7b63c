"""Families behind table II against sums over steps, sampling inside the digits, and the simulated drive."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivelib import table2, table2_fit, table2_sets
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.table2_fit import Load

PI = table2.Printed((0.5265, 5e-5), (1.4960, 5e-5), (1.0530, 5e-5))
FLC = table2.Printed((0.0348, 5e-5), (0.0015, 5e-5), (0.0697, 5e-5))
ANN = table2.Printed((0.01591, 5e-6), (0.0004809, 5e-8), (0.04774, 5e-6))


@settings(max_examples=40, deadline=None)
@given(st.floats(0.25, 2.0), st.lists(st.floats(0.05, 1.0), min_size=1, max_size=5))
def test_unequal_steps_act_like_a_number_in_between(xi, sizes):
    """Steps of any sizes far apart: their summed indices lead back to the loop; none of the largest is smaller than said."""
    omega_n, scale = 17.0, 120.0
    each = [table2.load_step(omega_n, xi, scale * size) for size in sizes]
    steps = sum(sizes) ** 2 / sum(size**2 for size in sizes)
    found = table2_sets.pi_family(sum(one.IAE for one in each), sum(one.ISE for one in each), xi, max(steps, 1.0))
    assert found.omega_n == pytest.approx(omega_n, rel=1e-9)
    assert found.a <= scale * max(sizes) * (1 + 1e-9)


@pytest.mark.parametrize("xi", [0.35, 0.7, 1.0, 1.4])
def test_dip_and_peak_torque_are_those_of_the_response(xi):
    """e(s) = a/(s² + 2ξω_n s + ω_n²) from its poles, torque by summing up the PI's answer."""
    found = table2_sets.pi_family(0.5265, 1.496, xi, 1.0)
    w, a = float(found.omega_n), float(found.a)
    t = np.linspace(0, 40 / w, 200_001)
    p = np.roots([1.0, 2 * (xi + 1e-7) * w, w**2]).astype(complex)
    e = (a * (np.exp(p[0] * t) - np.exp(p[1] * t)) / (p[0] - p[1])).real
    integral = np.concatenate([[0], np.cumsum((e[1:] + e[:-1]) / 2 * np.diff(t))])
    assert e.max() == pytest.approx(float(found.dip), rel=1e-5)
    assert (2 * xi * w * e + w**2 * integral).max() == pytest.approx(float(found.peak), rel=1e-5)


@settings(max_examples=40, deadline=None)
@given(st.floats(0, 1), st.floats(0, 1), st.floats(0.3, 1.5), st.sampled_from([PI, FLC]))
def test_the_corners_bound_every_reading_of_the_digits(x, y, xi, row):
    r = table2_sets.ranges(row, 2.0)
    (a0, a1), (s0, s1) = r
    here = table2_sets.pi_family(a0 + x * (a1 - a0), s0 + y * (s1 - s0), xi, 2.0)
    low, high = table2_sets.pi_family(a1, s0, xi, 2.0), table2_sets.pi_family(a0, s1, xi, 2.0)
    for value, least, most in zip(here, low, high, strict=True):
        assert least * (1 - 1e-12) <= value <= most * (1 + 1e-12)


def test_ranges_keep_what_both_digits_allow():
    """0.0697/2 = 0.03485 ± 0.000025 cuts 0.0348 ± 0.00005 above 0.034825."""
    assert table2_sets.ranges(FLC, 2.0).IAE == pytest.approx((0.034825, 0.03485))
    with pytest.raises(ValueError, match="horizon = 3"):
        table2_sets.ranges(FLC, 3.0)
    impossible = table2.Printed((1.0, 0.01), (0.1, 0.01), (2.0, 0.01))  # needs 100/11 s at least
    with pytest.raises(ValueError, match="Cauchy"):
        table2_sets.ranges(impossible, 2.0)
    with pytest.raises(ValueError, match="Cauchy"):
        table2_sets.horizon(impossible)


@pytest.mark.parametrize("row", [PI, FLC, ANN])
def test_the_horizon_is_that_of_the_extreme_digits(row):
    (a, da), _, (t, dt) = row
    corners = [(t + i * dt) / (a + j * da) for i in (-1, 1) for j in (-1, 1)]
    assert table2_sets.horizon(row) == pytest.approx((min(corners), max(corners)))
    low, high = table2_sets.horizon(row)
    table2_sets.ranges(row, low), table2_sets.ranges(row, high)
    for outside in (low - 1e-3, high + 1e-3):
        with pytest.raises(ValueError, match="horizon"):
            table2_sets.ranges(row, outside)


def test_the_slowest_sampling_is_where_the_map_begins_to_ring():
    """At that sample time the stiffness which the row needs is the largest that does not ring, within a tenth."""
    a = 2.0 * ANN.mean_error() / 1e-4
    assert table2_sets.slowest_sampling(ANN, a) == pytest.approx(1e-4)
    assert a * DEFAULT_SCENARIO.machine.J / ANN.mean_error() == pytest.approx(table2_fit.largest_stable_stiffness(DEFAULT_SCENARIO), rel=0.1)


def test_all_rows_agree_with_the_simulated_drive():
    """PI and static map in closed form against runs with quick current loops; horizons only multiply."""
    drive = DEFAULT_SCENARIO.changed(current_bandwidth=4000.0, omega_n=18.0, xi=0.7)
    values = dict(zip(table2_fit.OMITTED, (18.0, 0.7, 0.2, 30.0, 1.0, 2.0, 2.5, 3.0, 1 / 150, 27.0, 45.0, 900.0, 0.5), strict=True))
    got = table2_fit.all_rows(drive, **values)
    pi = table2_fit.under_load(drive, Load(30.0), None).indices
    steep = table2_fit.under_load(drive, Load(30.0, horizon=0.5), table2_fit.PiSpeed(900.0, 0.0)).indices
    assert got[:2] == pytest.approx((pi.IAE, pi.ISE), rel=0.01)
    assert got[6:8] == pytest.approx((steep.IAE, steep.ISE), rel=0.02)
    assert got[2::3] / got[0::3] == pytest.approx([2.0, 2.5, 3.0])
    doubled = table2_fit.all_rows(drive, **{**values, "steps": 2.0})
    assert doubled[:5] == pytest.approx([2 * value for value in got[:5]]) and doubled[6:].tolist() == got[6:].tolist()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: table2_sets.pi_family(0.0, 1.0, 0.7, 1.0), "IAE = 0.0 rad"),
        (lambda: table2_sets.pi_family(0.5, 1.0, [0.7, -0.1], 1.0), "xi = -0.1 at index 1"),
        (lambda: table2_sets.pi_family(0.5, 1.0, 0.7, 0.5), "steps = 0.5"),
        (lambda: table2_sets.ranges(PI, math.nan), "duration = nan s"),
        (lambda: table2_sets.slowest_sampling(PI, 0.0), "a = 0.0 rad/s²"),
    ],
)
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError, match=words):
        call()
