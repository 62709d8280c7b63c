"""The optimum i_d: quartic (11), quadratic at given i_oq, and direct minimum of the loss, for both loss models."""

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import brentq, minimize_scalar

from drivelib import pmsm, pmsm_optimum
from drivelib.machines import IPMSM, SPMSM
from pmsm_by_hand import MACHINES, at_torque, machines, motor_branch, speeds, state, torques

SETTINGS = settings(derandomize=True, deadline=None, max_examples=80)
MODEL = st.sampled_from(pmsm.MODELS)
POINTS = [(712.0, 5.06), (712.0, -5.06), (-712.0, 5.06), (300.0, 0.0), (0.0, 3.0), (1500.0, 0.4), (40.0, 20.0)]


def slope_in_high_precision(m, omega_e, T_e, model):
    """Return dP/di_od at constant torque as a function for mpmath, the loss written out from the phasor equations."""
    R_s, L_d, L_q, lam, R_c, w, q = map(mp.mpf, (m.R_s, m.L_d, m.L_q, m.psi_f, m.R_c, omega_e, T_e / (1.5 * m.P)))

    def loss(i_od):
        i_oq = q / (lam + (L_d - L_q) * i_od)
        emf = mp.mpc(0, w) * mp.mpc(lam + L_d * i_od, L_q * i_oq)
        i = mp.mpc(i_od, i_oq) + (emf / R_c if model == "full" else 0)
        return R_s * abs(i) ** 2 + abs(emf) ** 2 / R_c

    return lambda i_od: mp.diff(loss, i_od)


@pytest.mark.parametrize("model", pmsm.MODELS)
@pytest.mark.parametrize("kind", MACHINES)
def test_the_slope_of_the_loss_vanishes_there_in_forty_digits(kind, model):
    """The root of ∂P/∂i_od, found by mpmath without any closed form, is the optimum to 1e-9."""
    m = MACHINES[kind]
    with mp.workdps(40):
        for w, T_e in POINTS:
            slope = slope_in_high_precision(m, w, T_e, model)
            edge = -m.psi_f / (m.L_d - m.L_q) if m.L_d != m.L_q else None
            low = 0.999999 * edge if m.L_d > m.L_q else -1e3
            high = 0.999999 * edge if m.L_d < m.L_q else 1e3
            root = float(mp.findroot(slope, (low, high), solver="illinois", tol=1e-20, maxsteps=200, verify=False))
            assert abs(slope(mp.mpf(root))) < 1e-9 * (1 + abs(slope(mp.mpf(low))))
            assert_allclose(pmsm_optimum.optimal_i_od(m, w, T_e, model=model), root, rtol=1e-9, atol=1e-12)


@SETTINGS
@given(machines(), speeds(), torques(), MODEL)
def test_quartic_and_quadratic_are_one_condition(m, w, T_e, model):
    """The optimum at given torque is the one at the i_oq that it needs: to 1e-9 relative plus 1e-12 A."""
    i_od = pmsm_optimum.optimal_i_od(m, w, T_e, model=model)
    i_oq = T_e / (1.5 * m.P * (m.psi_f + (m.L_d - m.L_q) * i_od))
    assert_allclose(pmsm_optimum.optimal_i_od_at_i_oq(m, w, i_oq, model=model), i_od, rtol=1e-9, atol=1e-12)


@SETTINGS
@given(machines(), speeds(), torques(), MODEL)
def test_a_blind_search_finds_no_better_current(m, w, T_e, model):
    """A float64 search meets i_d to 1e-6 and the loss to 1e-12; the loss is flat there, so loss is the sharper one."""
    i_od = pmsm_optimum.optimal_i_od(m, w, T_e, model=model)
    least = at_torque(m, w, T_e, i_od, model).loss
    grid = motor_branch(m, T_e)
    losses = at_torque(m, w, T_e, grid, model).loss
    assert least <= losses.min() * (1 + 1e-12)
    k = int(np.clip(losses.argmin(), 1, grid.size - 2))
    found = minimize_scalar(
        lambda i: at_torque(m, w, T_e, i, model).loss, bounds=(grid[k - 1], grid[k + 1]), method="bounded", options={"xatol": 1e-11}
    )
    assert_allclose(least, found.fun, rtol=1e-12, atol=1e-15)
    if least > 0:
        h = 1e-3 * (abs(i_od) + m.psi_f / m.L_d)
        bend = (at_torque(m, w, T_e, i_od + h, model).loss + at_torque(m, w, T_e, i_od - h, model).loss - 2 * least) / h**2
        resolution = 4 * np.sqrt(4e-16 * least / bend)  # where float64 no longer tells losses apart
        assert_allclose(found.x, i_od, rtol=0, atol=max(1e-6 * abs(i_od), resolution, 1e-9))


@pytest.mark.parametrize("model", pmsm.MODELS)
def test_at_the_rated_point_the_search_agrees_to_a_microampere(model):
    """At 5.06 N m and 178 rad/s the search meets the closed form to 1e-6 A."""
    found = minimize_scalar(lambda i: at_torque(IPMSM, 712.0, 5.06, i, model).loss, bracket=(-6, -4, 0), options={"xtol": 1e-12})
    assert_allclose(pmsm_optimum.optimal_i_od(IPMSM, 712.0, 5.06, model=model), found.x, rtol=0, atol=1e-6)


def test_the_two_loss_models_have_the_known_optima():
    """At 5.06 N m, 178 rad/s, 200 Ω: −3.85 A and 180 W simplified, −3.88 A and 208 W in full (losses without 3/2)."""
    for model, i_od, loss in (("simplified", -3.85, 180), ("full", -3.88, 208)):
        best = pmsm_optimum.optimum(IPMSM, 4 * 178.0, 5.06, model=model, convention="paper")
        assert abs(best.i_od - i_od) <= 0.005
        assert abs(best.loss - loss) <= 0.5
        assert_allclose(best.loss, at_torque(IPMSM, 712.0, 5.06, best.i_od, model).loss, rtol=1e-12)


def test_the_unconstrained_rated_optimum_needs_more_voltage_than_there_is():
    """At the rated point the free optimum of the simplified model needs 157 V of 144 V."""
    best = pmsm_optimum.optimum(IPMSM, 712.0, 5.06, model="simplified")
    assert abs(best.V_s - 157) <= 0.5
    assert best.V_s > pmsm.voltage_limit(IPMSM)


def test_the_condition_at_given_i_oq_is_no_minimum_at_fixed_i_oq():
    """At fixed i_oq the loss is least at −b, which ignores the reluctance torque; the quadratic counts it."""
    for m, w, i_oq, model in ((IPMSM, 712.0, 3.1, "simplified"), (IPMSM, 712.0, 3.1, "full"), (MACHINES["inverse"], 500.0, 3.0, "full")):
        fixed = minimize_scalar(lambda i, m=m, w=w, j=i_oq, model=model: state(m, w, i, j, model).loss, bracket=(-9, 0)).x
        along = pmsm_optimum.optimal_i_od_at_i_oq(m, w, i_oq, model=model)
        assert abs(along - fixed) > 0.3
        assert (along < fixed) == (m.L_d < m.L_q), "an interior machine weakens more, an inverse one less"
    fixed = minimize_scalar(lambda i: state(SPMSM, 600.0, i, 3.0, "simplified").loss, bracket=(-9, 0)).x
    assert_allclose(pmsm_optimum.optimal_i_od_at_i_oq(SPMSM, 600.0, 3.0, model="simplified"), fixed, rtol=1e-6)


@SETTINGS
@given(machines(), speeds(-1000, 1000), st.floats(-20, 20), MODEL)
def test_the_quadratic_gives_the_optimum_of_the_torque_it_makes(m, w, i_oq, model):
    """A network fed with i_q* that answers with the quadratic's i_d runs at the least loss of that torque."""
    i_oq = round(i_oq, 6)
    i_od = pmsm_optimum.optimal_i_od_at_i_oq(m, w, i_oq, model=model)
    assert m.psi_f + (m.L_d - m.L_q) * i_od > 0
    T_e = state(m, w, i_od, i_oq).torque
    least = at_torque(m, w, T_e, motor_branch(m, T_e, 1001), model).loss.min()
    assert state(m, w, i_od, i_oq, model).loss <= least * (1 + 1e-12)


@SETTINGS
@given(machines(), speeds(), MODEL)
def test_a_surface_machine_weakens_with_speed_alone(m, w, model):
    """(16) mended is the vertex of a parabola: found from three losses, negative (weakening), the same for any torque."""
    m = m.changed(L_q=m.L_d)
    i_od = pmsm_optimum.optimal_i_od_surface(m, w, model=model)
    assert i_od <= 0
    a, b, c = (at_torque(m, w, 3.0, i, model).loss for i in (-1.0, 0.0, 1.0))
    assert_allclose(i_od, (a - c) / (2 * (a + c - 2 * b)), rtol=1e-6, atol=1e-9)
    for T_e in (-5.0, 0.0, 5.0):
        assert_allclose(pmsm_optimum.optimal_i_od(m, w, T_e, model=model), i_od, rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize("saliency", [1 - 1e-3, 1 - 1e-6, 1 - 1e-9, 1 - 1e-13, 1 + 1e-13, 1 + 1e-9, 1 + 1e-6])
def test_a_machine_that_is_almost_a_surface_machine_has_almost_its_optimum(saliency):
    """The optimum moves with L_q − L_d in proportion, so a saliency of ε changes i_d by order ε and not by noise."""
    m = SPMSM.changed(L_q=SPMSM.L_d * saliency)
    for w in (0.0, 600.0):
        round_rotor = pmsm_optimum.optimal_i_od_surface(SPMSM, w, model="full")
        found = pmsm_optimum.optimal_i_od(m, w, 1.3, model="full")
        assert abs(found - round_rotor) <= 10 * abs(1 - saliency) + 1e-12
        i_oq = 1.3 / (1.5 * m.P * (m.psi_f + (m.L_d - m.L_q) * found))
        assert_allclose(pmsm_optimum.optimal_i_od_at_i_oq(m, w, i_oq), found, rtol=1e-9, atol=1e-12)


def test_without_torque_only_the_iron_loss_is_weighed():
    """T = 0 is an ordinary point: copper against iron loss of the d-axis alone, continuous with small torques."""
    R, w = IPMSM.R_s * IPMSM.R_c, 712.0
    expected = -(w**2) * IPMSM.L_d * IPMSM.psi_f / (R + w**2 * IPMSM.L_d**2)
    assert_allclose(pmsm_optimum.optimal_i_od(IPMSM, w, 0.0, model="simplified"), expected, rtol=1e-12)
    assert_allclose(pmsm_optimum.optimal_i_od(IPMSM, w, 1e-7, model="simplified"), expected, rtol=1e-9)
    assert pmsm_optimum.optimal_i_od(IPMSM, 0.0, 0.0) == 0


def test_at_standstill_the_optimum_is_maximum_torque_per_ampere():
    """At ω = 0 no iron loss is left and least loss is least current: i_d² − i_d λ/|ΔL| … the textbook formula."""
    i_oq = 4.0
    half = IPMSM.psi_f / (2 * (IPMSM.L_q - IPMSM.L_d))
    expected = half - np.hypot(half, i_oq)
    assert_allclose(pmsm_optimum.optimal_i_od_at_i_oq(IPMSM, 0.0, i_oq), expected, rtol=1e-12)


@SETTINGS
@given(machines(), speeds(), torques(), MODEL)
def test_least_voltage_is_least(m, w, T_e, model):
    """No current on the constant-torque curve needs less voltage than the one returned."""
    V_s, i_od = pmsm_optimum.least_voltage(m, w, T_e, model=model)
    assert_allclose(V_s, abs(at_torque(m, w, T_e, i_od, model).u), rtol=1e-9, atol=1e-9)
    assert V_s <= abs(at_torque(m, w, T_e, motor_branch(m, T_e), model).u).min() * (1 + 1e-9) + 1e-9


def test_eq_11_as_printed_is_off_by_the_misprint_alone():
    """L_d² for L_d in the last term of (11): it then lacks the unit of a current and weakens the field too little."""
    i_od = pmsm_optimum.optimal_i_od(IPMSM, 712.0, 5.06, model="simplified")
    i_oq = 5.06 / (6 * (0.232 - 0.04 * i_od))
    d, q = 4.3 * 200 + (712 * 0.027) ** 2, 4.3 * 200 + (712 * 0.067) ** 2
    mended = 6 * (-0.04 / 5.06) * q / d * i_oq**3 - 0.232 * 712**2 * 0.027 / d
    assert_allclose(mended, i_od, rtol=1e-9)
    printed = pmsm_optimum.optimal_i_od_as_printed(IPMSM, 712.0, 5.06)
    x = 0.232 - 0.04 * printed
    j = 5.06 / (6 * x)
    literal = 6 * (-0.04 / 5.06) * q / d * j**3 - 0.232 * 712**2 * 0.027**2 / d
    assert_allclose(printed, literal, rtol=1e-9)
    assert printed > i_od + 1


@pytest.mark.parametrize("model", pmsm.MODELS)
def test_the_speed_at_a_loss_has_this_loss(model):
    """The speed returned for 118.9 W is the one where the least loss, found by search, is 118.9 W."""

    def least(w):
        return minimize_scalar(lambda i: at_torque(IPMSM, w, 3.0, i, model).loss, bracket=(-5, 0)).fun

    expected = brentq(lambda w: least(w) - 118.9, 1.0, 5000.0, xtol=1e-9)
    found = pmsm_optimum.speed_at_loss(IPMSM, 3.0, 118.9, model=model, convention="paper")
    assert_allclose(found, expected, rtol=1e-8)
    assert np.isnan(pmsm_optimum.speed_at_loss(IPMSM, 3.0, 1.0, model=model)), "copper alone takes more than 1 W"


def test_a_hundred_thousand_optima_are_one_call():
    """100 000 operating points, constrained and not, come back finite and in shape; scalars stay scalars."""
    w, T_e = np.linspace(-800, 800, 100_000), np.linspace(-6, 6, 100_000)
    best = pmsm_optimum.optimum(IPMSM, w, T_e)
    assert best.i_od.shape == w.shape and best.feasible.all() and np.all(np.isfinite(best.loss))
    held = pmsm_optimum.optimum(IPMSM, w, T_e, V_max=144.3, I_max=8.0)
    assert held.feasible.shape == w.shape and np.all(np.isfinite(held.loss) == held.feasible)
    assert pmsm_optimum.optimum(IPMSM, w[:30, None], T_e[None, :40]).loss.shape == (30, 40)
