"""Gains against the poles they promise; limiters and frequency laws against their definition."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivelib import control

positive = st.floats(0.01, 10)


@given(positive, st.floats(0, 0.01), st.floats(5, 100), st.floats(0.3, 2))
def test_speed_gains_place_the_poles(J, f, omega_n, xi):
    """The closed loop's denominator is s² + 2ξω_n s + ω_n²; its static gain is 1."""
    numerator, denominator = control.speed_transfer_function(control.speed_gains(J, f, omega_n, xi), J, f)
    assert denominator == pytest.approx((1.0, 2 * xi * omega_n, omega_n**2))
    assert numerator[-1] == denominator[-1]


@given(positive, st.floats(1e-3, 0.01), st.integers(1, 4), st.floats(5, 100), st.floats(0.3, 2))
def test_printed_speed_gains_are_p_times_too_small(J, f, p, omega_n, xi):
    printed = control.printed_speed_gains(J, f, p, omega_n, xi)
    assert np.multiply(printed, p) == pytest.approx(control.speed_gains(J, f, omega_n, xi), rel=1e-9)


@given(positive, st.floats(1e-3, 0.1), st.floats(100, 5000))
def test_current_gains_leave_one_pole(R, L, bandwidth):
    """PI times 1/(R + L s) closed: the loop polynomial (R + L s) s + K_p s + K_i has the roots −R/L and −bandwidth."""
    K_p, K_i = control.current_gains(R, L, bandwidth)
    for s in (-R / L, -bandwidth):
        assert (R + L * s) * s + K_p * s + K_i == pytest.approx(0, abs=1e-9 * (abs(K_p * s) + K_i))


@given(st.floats(-500, 500), st.floats(-500, 500), st.floats(1, 400))
def test_clip_vector_keeps_direction_and_limit(d, q, limit):
    x, y = control.clip_vector(d, q, limit)
    assert math.hypot(x, y) == pytest.approx(min(math.hypot(d, q), limit), rel=1e-12)
    assert x * q - y * d == pytest.approx(0, abs=1e-9)


def test_back_calculation_stops_at_what_the_plant_got():
    """Under a constant error and a limit the integral settles at the limit, not at infinity."""
    K_p, K_i, h, limit, error, integral = 2.0, 30.0, 1e-3, 5.0, 4.0, 0.0
    for _ in range(5000):
        output = control.pi_output(error, integral, K_p)
        integral = control.pi_integral(integral, error, output, control.clip(output, limit), K_i, K_i / K_p, h)
    assert integral == pytest.approx(limit, abs=1e-9)
    assert control.clip(control.pi_output(-0.1, integral, K_p), limit) < limit  # leaves the limit at once


@given(st.floats(-600, 600), st.floats(-60, 60))
def test_frequency_laws_share_the_rotor_speed(omega_e, omega_r):
    assert control.stator_frequency(control.EQUAL_SPLIT, omega_e, omega_r) == omega_e / 2
    assert control.stator_frequency(control.CONSTANT_ROTOR_FREQUENCY, omega_e, omega_r) - omega_e == pytest.approx(omega_r, abs=1e-10)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: control.speed_gains(0.2, 10.0, 1.0, 0.7), r"2 xi omega_n must be above f/J = 50"),
        (lambda: control.speed_gains(-0.2, 0.0, 1.0, 0.7), r"J = -0.2 kg m²"),
        (lambda: control.printed_speed_gains(0.2, 0.0, 2, 20.0, 0.7), r"c = 0.0 N m s"),
        (lambda: control.current_gains(1.0, 0.01, math.inf), r"bandwidth = inf rad/s"),
        (lambda: control.linear_voltage_limit(0), r"V_dc = 0 V"),
    ],
)
def test_bad_values_are_refused_by_name(call, message):
    with pytest.raises(ValueError, match=message):
        call()
