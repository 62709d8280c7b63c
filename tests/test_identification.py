"""What Eskander's print allows, against brute force on the machine of pmsm_by_hand."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pmsm_by_hand import MACHINES, at_torque
from scipy.optimize import minimize_scalar

from drivelib import identification, pmsm, pmsm_optimum
from drivelib.machines import IPMSM, SPMSM

SCALE = {"paper": 1.0, "consistent": 1.5}


def least(m, omega_e, T_e, model):
    """Least loss without 3/2, by bounded search on the complex-vector machine."""
    found = minimize_scalar(lambda i: at_torque(m, omega_e, T_e, i, model).loss, bounds=(-12.0, 2.5), method="bounded", options={"xatol": 1e-10})
    return found.x, found.fun


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize(("model", "convention"), identification.FORMS)
def test_the_free_optimum_over_iron_resistances_is_that_of_a_search(machine, model, convention):
    m, R_c, T_e = MACHINES[machine], np.array([[60.0], [900.0]]), np.array([0.5, 2.0])
    got = pmsm_optimum.free_optimum(m, 400.0, T_e, R_c, model=model, convention=convention)
    for row, resistance in enumerate(R_c[:, 0]):
        for column, T in enumerate(T_e):
            one = m.changed(R_c=float(resistance))
            i_od, loss = least(one, 400.0, float(T), model)
            there = at_torque(one, 400.0, float(T), i_od, model)
            assert got.loss[row, column] == pytest.approx(SCALE[convention] * loss, rel=1e-9)
            assert got.i_od[row, column] == pytest.approx(i_od, abs=2e-5)
            assert got.V_s[row, column] == pytest.approx(abs(there.u), rel=1e-5)
            assert got.loss_at_zero[row, column] == pytest.approx(SCALE[convention] * at_torque(one, 400.0, float(T), 0.0, model).loss, rel=1e-12)


@settings(max_examples=20, deadline=None)
@given(st.floats(20, 300), st.floats(0.2, 5), st.floats(10, 2000), st.sampled_from(identification.FORMS))
def test_the_iron_resistance_behind_a_loss_is_found_again(omega_m, T_e, R_c, form):
    model, convention = form
    loss = SCALE[convention] * least(IPMSM.changed(R_c=R_c), IPMSM.P * omega_m, T_e, model)[1]
    found = float(identification.iron_resistance(IPMSM, loss, omega_m, T_e, model=model, convention=convention))
    assert found == pytest.approx(R_c, rel=1e-4)


def test_at_one_torque_the_resistance_grows_with_the_square_of_the_speed():
    """The simplified loss knows only ω²/R_c."""
    R_c = identification.iron_resistance(IPMSM, 118.9, [50.0, 100.0, 150.0], 3.0)
    np.testing.assert_allclose(R_c / R_c[0], [1, 4, 9], rtol=1e-9)


def test_where_copper_alone_loses_more_there_is_none():
    assert np.isnan(identification.iron_resistance(IPMSM, 118.9, 100.0, 12.0))
    assert np.isnan(identification.iron_resistance(IPMSM, 118.9, 0.0, 1.0)), "at standstill no R_c matters"


def test_consistent_points_are_those_inside_the_voltage_and_the_efficiency():
    w, T = np.linspace(20, 178, 9), np.linspace(0.5, 5, 7)
    V_max = 120.0
    R_c = identification.iron_resistance(IPMSM, 118.9, w[:, None], T)
    found = identification.consistent_points(IPMSM, 118.9, w, T, V_max, least_efficiency=0.6)
    shown = 0
    for (i, j), value in np.ndenumerate(R_c):
        m = IPMSM.changed(R_c=float(value))
        i_od, loss = least(m, 4 * w[i], T[j], "simplified")
        at = at_torque(m, 4 * w[i], T[j], i_od, "simplified")
        inside = abs(at.u) <= V_max and w[i] * T[j] / (w[i] * T[j] + 118.9) >= 0.6
        assert np.isfinite(found.R_c[i, j]) == inside
        if inside:
            shown += 1
            zero = at_torque(m, 4 * w[i], T[j], 0.0, "simplified").loss
            shaft = w[i] * T[j]
            assert found.V_s[i, j] == pytest.approx(abs(at.u), rel=1e-5) and loss == pytest.approx(118.9)
            assert found.given_away[i, j] == pytest.approx(100 * (shaft / (shaft + loss) - shaft / (shaft + zero)), abs=1e-6)
    assert 0 < shown < R_c.size


def test_an_empty_set_says_so():
    with pytest.raises(ValueError, match=r"loss = 5 W: no R_c makes it a least loss inside 144 V between 10 and 20 rad/s, 4 and 5 N m.*contradicts"):
        identification.consistent_points(IPMSM, 5.0, [10.0, 20.0], [4.0, 5.0], 144.0)
    with pytest.raises(ValueError, match="no R_c"):
        identification.consistent_points(IPMSM, 118.9, [100.0, 178.0], [1.0, 5.0], 3.0)


def test_what_zero_current_gives_away_carries_the_three_halves():
    m = SPMSM.changed(R_c=80.0)
    best, zero = 1.5 * least(m, 500.0, 0.6, "simplified")[1], 1.5 * at_torque(m, 500.0, 0.6, 0.0, "simplified").loss
    shaft = 250.0 * 0.6
    assert identification.given_away(SPMSM, 250.0, 0.6, 80.0) == pytest.approx(100 * (shaft / (shaft + best) - shaft / (shaft + zero)), rel=1e-6)


@pytest.mark.parametrize("R_c", [90.0, 600.0])
def test_the_current_error_costs_what_was_asked(R_c):
    m = IPMSM.changed(R_c=R_c)
    i_od, loss = least(m, 640.0, 2.0, "simplified")
    below = float(identification.current_error(IPMSM, 160.0, 2.0, R_c, 0.1))
    assert below > 0 and at_torque(m, 640.0, 2.0, i_od - below, "simplified").loss - loss == pytest.approx(0.1, rel=1e-4)


@settings(max_examples=50, deadline=None)
@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1), st.floats(9, 300))
def test_torques_of_an_angle_bound_every_machine_inside_the_digits(a, b, c, omega_m):
    digits = {"R_s": 0.5, "L_q": 5e-5, "psi_f": 5e-4}
    R, L, psi = SPMSM.R_s + a * 0.5, SPMSM.L_q + b * 5e-5, SPMSM.psi_f + c * 5e-4
    low, high = identification.angle_torques(SPMSM, omega_m, math.radians(2.5), digits)
    tangent, w = math.tan(math.radians(2.5)), SPMSM.P * omega_m
    i_oq = w * psi * tangent / (w * L - R * tangent)  # (20) solved by hand; positive at all these speeds
    assert low <= 1.5 * SPMSM.P * psi * i_oq * (1 + 1e-9) and 1.5 * SPMSM.P * psi * i_oq <= high * (1 + 1e-9)


def test_where_no_torque_reaches_the_angle_any_is_allowed():
    low, high = identification.angle_torques(SPMSM, [2.0, 30.0], math.radians(2.5), {"R_s": 0.5, "L_q": 5e-5, "psi_f": 5e-4})
    assert np.isinf(low[0]) and np.isinf(high[0]) and np.isfinite([low[1], high[1]]).all()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: identification.iron_resistance(IPMSM, -1.0, 100.0, 1.0), "loss = -1.0 W"),
        (lambda: identification.iron_resistance(IPMSM, 118.9, -5.0, 1.0), "omega_m = -5.0 rad/s"),
        (lambda: identification.iron_resistance(IPMSM, 118.9, 5.0, float("nan")), "T_e = nan N m"),
        (lambda: identification.iron_resistance(IPMSM, 118.9, 5.0, 1.0, R_c_range=(0.0, 10.0)), "R_c_range"),
        (lambda: identification.consistent_points(IPMSM, 118.9, [2.0, 1.0], [1.0, 2.0], 144.0), "omega_m"),
        (lambda: identification.consistent_points(IPMSM, 118.9, [1.0, 2.0], [1.0, 2.0], 144.0, least_efficiency=1.5), "least_efficiency = 1.5"),
        (lambda: identification.given_away(IPMSM, 0.0, 1.0, 200.0), "omega_m = 0.0 rad/s"),
        (lambda: identification.current_error(IPMSM, 100.0, 1.0, 200.0, 0.0), "excess = 0.0 W"),
        (lambda: identification.angle_torques(IPMSM, 100.0, 0.04, {"R_s": -1.0, "L_q": 0.0, "psi_f": 0.0}), "digits"),
        (lambda: identification.angle_torques(IPMSM, 100.0, 0.04, {"R_s": 0.05, "L": 5e-4}), "digits names R_s, L: must name"),
        (lambda: pmsm_optimum.free_optimum(IPMSM, 100.0, 1.0, 0.0), "R_c = 0.0 ohm"),
        (lambda: pmsm_optimum.free_optimum(IPMSM, 100.0, 1.0, 10.0, model="fulll"), "Did you mean full"),
    ],
)
def test_bad_input_is_named(call, words):
    with pytest.raises(ValueError, match=words):
        call()


def test_the_voltage_of_a_reading_depends_on_its_currents():
    """Terminal currents carry the iron current, so the same point needs more voltage."""
    branch, terminal = (pmsm_optimum.free_optimum(IPMSM, 600.0, 3.0, 150.0, model=model).V_s for model in pmsm.MODELS[::-1])
    assert terminal > branch
