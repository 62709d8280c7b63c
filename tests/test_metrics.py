"""Error indices against closed forms and quadrature; step metrics against signals whose answer is known."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from drivelib import metrics

error = st.floats(-100, 100).map(lambda x: round(x, 3))


@given(st.floats(0, 5), st.floats(1e-4, 1), error, error)
def test_one_period_is_integrated_exactly(t, period, a, b):
    """Indices of a straight error equal adaptive quadrature split at the sign change."""

    def e(x):
        return a + (b - a) * x / period

    kinks = [period * a / (a - b)] if a * b < 0 else None
    got = metrics.interval_indices(t, period, a, b)
    expected = [
        quad(f, 0, period, points=kinks)[0]
        for f in (lambda x: abs(e(x)), lambda x: e(x) ** 2, lambda x: (t + x) * abs(e(x)))
    ]
    assert got == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_indices_of_an_exponential_error():
    """e = A exp(−t/τ): IAE = Aτ, ISE = A²τ/2, ITAE = Aτ², over a horizon of 40 τ."""
    A, tau = 7.0, 0.05
    t = np.linspace(0, 2, 200_001)
    got = metrics.error_indices(t, np.full_like(t, 10.0), 10 - A * np.exp(-t / tau))
    assert got[:3] == pytest.approx((A * tau, A**2 * tau / 2, A * tau**2), rel=1e-6)
    assert got.itae_printed == pytest.approx(2 * A * tau, rel=1e-6)


def test_a_reference_jump_counts_on_its_own_side():
    """Reference 0 → 1 at 1 s, speed 0: the error is 0 before, 1 after; nothing leaks into the period before."""
    t = np.linspace(0, 2, 21)
    reference = np.where(t > 0.999, 1.0, 0.0)
    got = metrics.error_indices(t, reference, np.zeros_like(t))
    assert got[:3] == pytest.approx((1.0, 1.0, 1.5), rel=1e-12)
    assert metrics.error_indices(t, reference, np.zeros_like(t), 0.0, 1.0)[:3] == (0.0, 0.0, 0.0)
    late = metrics.error_indices(t, reference, np.zeros_like(t), 1.0, 2.0)
    assert late.ITAE == pytest.approx(0.5) and late.horizon == 1.0


def test_step_metrics_of_a_damped_oscillation():
    """e = exp(−5t) sin(20t): peak where tan(20t) = 4, overshoot half a cycle later, exp(−5π/20) smaller."""
    t = np.linspace(0, 4, 400_001)
    e = np.exp(-5 * t) * np.sin(20 * t) + 0.01
    got = metrics.step_metrics(t, np.zeros_like(t), -e, 0.0, 4.0, band=0.05, tail=0.25)
    t_peak = np.arctan(4.0) / 20
    peak = np.exp(-5 * t_peak) * np.sin(20 * t_peak)
    assert got.peak == pytest.approx(peak + 0.01, rel=1e-7)
    assert got.peak_time == pytest.approx(t_peak, abs=1e-5)
    assert got.overshoot == pytest.approx(peak * np.exp(-5 * np.pi / 20) - 0.01, rel=1e-7)
    assert got.steady_error == pytest.approx(0.01, abs=np.exp(-15))  # what the oscillation can still add at 3 s
    inside = abs(e[np.searchsorted(t, got.recovery_time) :]) <= 0.05
    assert inside.all() and abs(e[np.searchsorted(t, got.recovery_time) - 1]) > 0.05


def test_an_error_that_stays_outside_the_band_never_recovers():
    t = np.linspace(0, 1, 101)
    got = metrics.step_metrics(t, np.ones_like(t), np.zeros_like(t), 0.0, 1.0, band=0.5)
    assert got.recovery_time == np.inf and got.steady_error == 1.0 and got.overshoot == 0.0


def test_events_split_the_record():
    t = np.linspace(0, 3, 3001)
    speed = np.where(t < 1, 0.0, np.where(t < 2, -1.0, 2.0))
    first, second, third = metrics.event_metrics(t, np.zeros_like(t), speed, [0.0, 1.0, 2.0])
    assert (first.peak, second.peak, third.peak) == (0.0, 1.0, -2.0)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda t: metrics.error_indices(t[::-1], t, t), "strictly increasing"),
        (lambda t: metrics.error_indices(t, t[:-1], t), r"omega_ref has shape \(10,\): must be \(11,\)"),
        (lambda t: metrics.error_indices(t, t, t, 0.31, 0.35), "no period"),
        (lambda t: metrics.step_metrics(t, t, t, 0.0, 1.0, band=-1), r"band = -1 rad/s"),
        (lambda t: metrics.step_metrics(t, t, t, 0.5, 1.0), "fewer than ten"),
        (lambda t: metrics.error_indices(t, t * np.nan, t), r"omega_ref = nan rad/s at index 0"),
        (lambda t: metrics.response_metrics(t, t[:-1]), r"error has shape \(10,\): must be \(11,\)"),
        (lambda t: metrics.response_metrics(t, t, tail=1.5), r"tail = 1.5"),
        (lambda t: metrics.response_metrics(t[::-1], t), "strictly increasing"),
    ],
)
def test_bad_records_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call(np.linspace(0, 1, 11))
