"""Closed forms behind table II against quadrature and the simulated drive; identification against known answers."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from drivelib import contest, table2, table2_fit
from drivelib.control import speed_gains
from drivelib.dfim_machines import DFIM_SMALL_INERTIA
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.metrics import error_indices
from drivelib.speed_law import PiSpeed
from drivelib.table2_fit import Load


def error(t, omega_n, xi, a):
    """Inverse transform of a/(s² + 2ξω_n s + ω_n²), from its two poles."""
    p = np.roots([1.0, 2 * xi * omega_n, omega_n**2]).astype(complex)
    return float((a * (np.exp(p[0] * t) - np.exp(p[1] * t)) / (p[0] - p[1])).real)


@settings(max_examples=30, deadline=None)
@given(st.floats(2.0, 50.0), st.one_of(st.floats(0.2, 0.97), st.floats(1.03, 6.0)), st.floats(1.0, 500.0))
def test_a_load_step_is_integrated_in_closed_form(omega_n, xi, a):
    """Adaptive quadrature between the zeros of the error."""
    zeros = [0.0]
    if xi < 1:
        half = math.pi / (omega_n * math.sqrt(1 - xi**2))
        zeros = [k * half for k in range(int(40 / (xi * omega_n) / half) + 2)]
    else:
        zeros += [k / omega_n for k in (1, 3, 10, 30, 100, 300, 1000)]
    total = [0.0, 0.0, 0.0]
    for low, high in zip(zeros[:-1], zeros[1:], strict=True):
        for j, f in enumerate((lambda e, t: abs(e), lambda e, t: e * e, lambda e, t: t * abs(e))):
            total[j] += quad(lambda t, f=f: f(error(t, omega_n, xi, a), t), low, high)[0]
    got = table2.load_step(omega_n, xi, a)
    assert got == pytest.approx((total[0], total[1], total[2] / total[0]), rel=1e-6)


def test_at_critical_damping_the_forms_join():
    below, at, above = (table2.load_step(10.0, xi, 100.0) for xi in (1 - 1e-9, 1.0, 1 + 1e-9))
    assert below == pytest.approx(at, rel=1e-6) and above == pytest.approx(at, rel=1e-6)
    assert at == pytest.approx((1.0, 2.5, 0.2))  # e = a t exp(−10 t)
    peaks = [table2.member(0.5, 1.5, xi).torque_peak for xi in (1 - 1e-6, 1.0, 1 + 1e-6)]
    assert peaks == pytest.approx([1 + math.exp(-2)] * 3, rel=1e-5)


@pytest.mark.parametrize("xi", [0.4, 0.7, 1.0, 1.6])
@pytest.mark.parametrize("steps", [1, 3])
def test_a_member_of_the_family_has_the_printed_indices(xi, steps):
    m = table2.member(0.5265, 1.4960, xi, steps)
    one = table2.load_step(m.omega_n, xi, m.a)
    assert (steps * one.IAE, steps * one.ISE) == pytest.approx((0.5265, 1.4960), rel=1e-12)
    t = np.linspace(0, 30 / m.omega_n, 40_001)
    e = np.array([error(x, m.omega_n, xi + 1e-9, m.a) for x in t])
    torque = 2 * xi * m.omega_n * e + m.omega_n**2 * np.concatenate([[0], np.cumsum((e[1:] + e[:-1]) / 2 * np.diff(t))])
    assert torque.max() / m.a == pytest.approx(m.torque_peak, rel=1e-5)


def test_no_member_needs_less_than_the_least_step():
    xi, a = table2.least_step(0.5265, 1.4960)
    assert a <= min(table2.member(0.5265, 1.4960, x).a for x in np.linspace(0.2, 1.5, 1301)) + 1e-9
    assert a == pytest.approx(table2.member(0.5265, 1.4960, xi).a)


def test_rounding_is_carried_through():
    """A constant error c for D seconds in the middle of a row: duration D, mean error c, ratio the centre of the time."""
    c, D, middle = 0.04, 0.8, 2.0
    row = table2.Printed((c * D, 1e-9), (c * c * D, 1e-9), (middle * c * D, 1e-9))
    assert row.duration()[1] == pytest.approx(D) and row.mean_error() == pytest.approx(c)
    assert row.ratio()[0] < middle < row.ratio()[2]
    assert table2.load_instant(row, D / 2)[0] == pytest.approx(middle - D / 2)
    assert table2.stiffness(row, 8.0) == pytest.approx(200.0)
    coarse = table2.Printed((0.1, 0.0), (1.0, 0.0), (0.2, 0.005))
    assert table2.chance_of_integers([coarse]) == pytest.approx(0.1)


def test_rounding_of_iae_and_itae_must_meet():
    """0.0697/2 = 0.03485 ± 0.000025 and 0.0348 ± 0.00005 share 0.034825 … 0.03485; with 3 s they share nothing."""
    row = table2.Printed((0.0348, 5e-5), (0.0015, 5e-5), (0.0697, 5e-5))
    assert row.consistent(2.0) == pytest.approx(0.5 * (0.034825 + 0.03485))
    with pytest.raises(ValueError, match="horizon = 3"):
        row.consistent(3.0)


def test_the_overdamped_loop_has_the_indices_it_was_made_for():
    K_p, K_i = table2.overdamped(0.0348, 0.0015, 158.0)
    omega_n = math.sqrt(K_i)
    assert table2.load_step(omega_n, K_p / (2 * omega_n), 158.0)[:2] == pytest.approx((0.0348, 0.0015), rel=1e-12)
    with pytest.raises(ValueError, match="oscillates"):
        table2.overdamped(0.5265, 1.4960, 100.0)


def test_the_simulated_drive_nears_the_closed_form_as_its_current_loops_quicken():
    """Torque lags by 1/bandwidth, so what is left of the difference falls with it."""
    gaps = []
    for bandwidth in (1000.0, 4000.0):
        drive = DEFAULT_SCENARIO.changed(current_bandwidth=bandwidth, omega_n=18.0, xi=0.7)
        got = table2_fit.under_load(drive, Load(30.0), None).indices
        expected = table2.load_step(18.0, 0.7, 30.0 / drive.machine.J)
        gaps.append([abs(got.IAE / expected.IAE - 1), abs(got.ISE / expected.ISE - 1)])
    assert max(gaps[1]) < 0.01 and gaps[0][1] > 2.5 * gaps[1][1]


def test_identification_finds_the_loop_that_made_the_numbers():
    """Indices of a known loop and load go in as the row; ω_n and load come out."""
    drive = DEFAULT_SCENARIO.changed(omega_n=25.0, xi=0.8)
    made = table2_fit.under_load(drive, Load(20.0), None).indices
    row = table2.Printed((made.IAE, 0.0), (made.ISE, 0.0), (0.0, 0.0))
    found = table2_fit.fit_pi(DEFAULT_SCENARIO, row, 0.8, Load(0.0))
    assert found.values == pytest.approx({"omega_n": 25.0, "T_load": 20.0}, rel=1e-6) and found.residual < 1e-6


def test_identification_finds_the_fuzzy_gains_that_made_the_numbers():
    drive, gains = DEFAULT_SCENARIO, speed_gains(0.2, 0.001, 66.0, 13.0)
    made = table2_fit.under_load(drive, Load(30.0), contest.fuzzy_like_pi(drive, 300.0, gains=gains)).indices
    row = table2.Printed((made.IAE, 0.0), (made.ISE, 0.0), (0.0, 0.0))
    found = table2_fit.fit_fuzzy(drive, row, Load(30.0), 300.0)
    assert found.residual < 1e-6
    assert (found.values["K_p"], found.values["K_i"]) == pytest.approx(gains, rel=1e-3)


def test_a_static_map_leaves_load_over_stiffness():
    row = table2.Printed((0.0348, 5e-5), (0.0015, 5e-5), (0.0697, 5e-5))
    found = table2_fit.fit_static(DEFAULT_SCENARIO, row, Load(30.0))
    e = row.mean_error()
    assert found.values["stiffness"] == pytest.approx(51 * math.atanh(30 / 51) / e, rel=0.02)
    assert found.values["hold"] == pytest.approx(row.duration()[1], rel=0.02)
    run = table2_fit.under_load(DEFAULT_SCENARIO, Load(30.0, horizon=found.values["hold"]), table2_fit.static_map(found.values["stiffness"], 51.0), every=1)
    check = error_indices(run.t, run["omega_ref"], run["omega_m"], table2_fit.ON)
    assert (check.IAE, check.ISE) == pytest.approx((0.0348, 0.0015), rel=2e-3)


@pytest.mark.parametrize("period", [5e-5, 1e-4, 2e-4])
def test_stiffness_is_bounded_by_the_sample_time(period):
    """Inertia and a first-order current loop behind a hold: the bound is near 2 J/T_s, whatever the bandwidth (1/2 from hold, PM ≈ 0)."""
    drive = DEFAULT_SCENARIO.changed(period=period)
    largest = table2_fit.largest_stable_stiffness(drive)
    assert largest == pytest.approx(2 * 0.2 / period, rel=0.1)
    assert not table2_fit.rings(drive, 0.9 * largest) and table2_fit.rings(drive, 1.2 * largest)


def test_one_load_for_three_rows():
    """At a third of the inertia the two steps that all rows together need stay inside the torque limit."""
    rows = (
        table2.Printed((0.5265, 5e-5), (1.4960, 5e-5), (1.0530, 5e-5)),
        table2.Printed((0.0348, 5e-5), (0.0015, 5e-5), (0.0697, 5e-5)),
        table2.Printed((0.01591, 5e-6), (0.0004809, 5e-8), (0.04774, 5e-6)),
    )
    found = table2_fit.fit_one_load(contest.with_machine(DEFAULT_SCENARIO, DFIM_SMALL_INERTIA), *rows, xi=0.7, e_max=300.0)
    for row, fit in zip(rows, found.values(), strict=True):
        assert fit.run.indices.IAE == pytest.approx(row.IAE[0], abs=row.IAE[1])
        assert fit.run.indices.ISE == pytest.approx(row.ISE[0], abs=row.ISE[1])
    assert "torque" not in found["PI"].run.first_hits


def test_a_stiffness_that_is_no_number_is_refused():
    with pytest.raises(ValueError, match="stiffness = nan"):
        table2_fit.static_map(float("nan"), 51.0)
    with pytest.raises(ValueError, match="K_p"):
        PiSpeed(-1.0, 0.0)
    with pytest.raises(ValueError, match="the lower must be calm"):
        table2_fit.largest_stable_stiffness(DEFAULT_SCENARIO, low=1e5)
