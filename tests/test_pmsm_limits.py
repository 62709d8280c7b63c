"""The optimum inside the inverter's limits, against brute force and against a general optimiser."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import brentq, minimize, root

from drivelib import identification, pmsm, pmsm_optimum
from drivelib.machines import IPMSM
from pmsm_by_hand import MACHINES, at_torque, machines, motor_branch, speeds, torques

SETTINGS = settings(derandomize=True, deadline=None, max_examples=100)
MODEL = st.sampled_from(pmsm.MODELS)


@SETTINGS
@given(machines(), speeds(), torques(), MODEL, st.floats(0.3, 1.5), st.floats(0.3, 2.0), st.sampled_from(["V", "I", "VI"]))
def test_no_admissible_current_does_better(m, w, T_e, model, voltage, current, limits):
    """Of all currents of the motor's branch inside the limits, none loses less; where none is inside, it says so.

    The limits are drawn around what the free optimum needs, so that about half the points are constrained.
    """
    free = pmsm_optimum.optimum(m, w, T_e, model=model)
    V_max = voltage * float(free.V_s) + 1e-3 if "V" in limits else None
    I_max = current * float(np.hypot(free.i_d, free.i_q)) + 1e-3 if "I" in limits else None
    best = pmsm_optimum.optimum(m, w, T_e, model=model, V_max=V_max, I_max=I_max)
    grid = motor_branch(m, T_e, 8001)
    points = at_torque(m, w, T_e, grid, model)
    inside = (abs(points.u) <= (V_max or np.inf)) & (abs(points.i) <= (I_max or np.inf))
    if not best.feasible:
        assert not inside.any()
        assert np.isnan([best.i_od, best.i_oq, best.i_d, best.i_q, best.V_s, best.loss]).all()
        return
    point = at_torque(m, w, T_e, best.i_od, model)
    assert abs(point.u) <= (V_max or np.inf) * (1 + 1e-9)
    assert abs(point.i) <= (I_max or np.inf) * (1 + 1e-9)
    assert_allclose(best.loss, 1.5 * point.loss, rtol=1e-12)
    assert_allclose((best.i_d, best.i_q, best.V_s), (point.i.real, point.i.imag, abs(point.u)), rtol=1e-9, atol=1e-9)
    assert_allclose(pmsm.torque(m, best.i_od, best.i_oq), T_e, rtol=1e-9, atol=1e-9)
    assert best.loss >= free.loss * (1 - 1e-12)
    assert bool(best.limited) == (abs(best.i_od - free.i_od) > 0)
    if inside.any():
        assert best.loss <= 1.5 * points.loss[inside].min() * (1 + 1e-9)


@pytest.mark.parametrize("model", pmsm.MODELS)
@pytest.mark.parametrize(
    ("kind", "w", "T_e", "V_max", "I_max"),
    [
        ("interior", 712.0, 5.06, 144.3, None),
        ("interior", 1000.0, 2.0, 120.0, None),
        ("interior", 900.0, -3.0, 80.0, None),
        ("interior", -900.0, 3.0, 80.0, None),
        ("interior", 1000.0, 2.0, 120.0, 8.0),
        ("surface", 1400.0, 0.5, 90.0, 8.0),
        ("inverse", 1000.0, 2.0, 108.0, None),
    ],
)
def test_a_general_optimiser_agrees(kind, w, T_e, V_max, I_max, model):
    """SLSQP over both currents, torque as an equation, limits as inequalities, lands on the same point."""
    m = MACHINES[kind]

    def phasors(x):
        flux = m.psi_f + m.L_d * x[0] + 1j * m.L_q * x[1]
        e = 1j * w * flux
        i = x[0] + 1j * x[1] + (e / m.R_c if model == "full" else 0)
        return i, m.R_s * i + e, m.R_s * abs(i) ** 2 + abs(e) ** 2 / m.R_c

    constraints = [
        {"type": "eq", "fun": lambda x: 1.5 * m.P * x[1] * (m.psi_f + (m.L_d - m.L_q) * x[0]) - T_e},
        {"type": "ineq", "fun": lambda x: 1 - (abs(phasors(x)[1]) / V_max) ** 2},
    ]
    if I_max:
        constraints.append({"type": "ineq", "fun": lambda x: 1 - (abs(phasors(x)[0]) / I_max) ** 2})
    start = (-m.psi_f / m.L_d / 2, T_e / (1.5 * m.P * m.psi_f) / 2)
    found = minimize(lambda x: phasors(x)[2] / 100, start, method="SLSQP", constraints=constraints, options={"ftol": 1e-14, "maxiter": 500})
    assert found.success or found.status == 8, found.message
    best = pmsm_optimum.optimum(m, w, T_e, model=model, convention="paper", V_max=V_max, I_max=I_max)
    assert best.feasible and best.limited
    assert_allclose(best.loss, 100 * found.fun, rtol=1e-7)
    assert_allclose((best.i_od, best.i_oq), found.x, rtol=1e-4, atol=1e-4)
    assert_allclose(best.V_s, V_max, rtol=1e-9)


def test_what_no_current_can_do_is_flagged():
    """A torque beyond the voltage limit, or beyond the current limit, is infeasible: flagged and NaN, the rest kept."""
    best = pmsm_optimum.optimum(IPMSM, 712.0, [1.0, 50.0], V_max=144.3)
    assert best.feasible.tolist() == [True, False]
    assert np.isfinite(best.loss[0]) and np.isnan(best.loss[1]) and np.isnan(best.i_q[1])
    best = pmsm_optimum.optimum(IPMSM, 0.0, [1.0, 5.0], I_max=2.0)
    assert best.feasible.tolist() == [True, False]
    both = pmsm_optimum.optimum(IPMSM, 2000.0, 0.5, V_max=60.0, I_max=5.0)
    alone = [pmsm_optimum.optimum(IPMSM, 2000.0, 0.5, **{k: v}).feasible for k, v in (("V_max", 60.0), ("I_max", 5.0))]
    assert all(alone) and not both.feasible, "each limit can be met, but not by one current"


@pytest.mark.parametrize("model", pmsm.MODELS)
@pytest.mark.parametrize("kind", MACHINES)
def test_the_largest_torque_is_the_best_angle_of_the_full_voltage(kind, model):
    """At full voltage the angle of the inverter is the only freedom: the best of 20 000 angles gives the torque."""
    m = MACHINES[kind]
    for w, V_max in ((300.0, 80.0), (700.0, 144.3)):
        phi = np.linspace(-np.pi, np.pi, 20001)
        i_od, i_oq = pmsm.branch_currents_at_voltage(m, w, V_max, phi, model=model)
        motoring = m.psi_f + (m.L_d - m.L_q) * i_od > 0
        expected = pmsm.torque(m, i_od, i_oq)[motoring].max()
        assert_allclose(pmsm_optimum.largest_torque(m, w, V_max, model=model), expected, rtol=1e-6)


def test_the_largest_torque_knows_its_limits():
    """An emf that no current can weaken leaves no torque; a torque bound that the voltage exceeds is returned."""
    stiff = IPMSM.changed(L_d=1e-4, L_q=1e-4, R_s=0.5)
    assert np.isnan(pmsm_optimum.largest_torque(stiff, 2000.0, 10.0, model="simplified"))
    assert pmsm_optimum.largest_torque(IPMSM, 100.0, 1e4, T_max=3.0) == 3.0


def bound_by_equations(T_e, V_max, loss, model):
    """Return R_c where the least loss is ``loss`` exactly at ``V_max``: three equations, three unknowns, no closed form."""
    def residuals(x):
        w, i_od, R_c = x[0] * 700, x[1], x[2] * 200
        m = IPMSM.changed(R_c=R_c)
        h = 1e-4
        slope = (at_torque(m, w, T_e, i_od + h, model).loss - at_torque(m, w, T_e, i_od - h, model).loss) / (2 * h)
        point = at_torque(m, w, T_e, i_od, model)
        return slope / 10, point.loss / loss - 1, abs(point.u) / V_max - 1

    found = root(residuals, (0.9, -3.5, 1.4), tol=1e-12)
    assert np.max(np.abs(found.fun)) < 1e-9
    return found.x[2] * 200


@pytest.mark.parametrize("model", pmsm.MODELS)
@pytest.mark.parametrize("modulation", pmsm.MODULATIONS)
@pytest.mark.parametrize("T_e", [3.0, 5.06, 6.0])
def test_the_largest_iron_resistance_solves_three_equations(T_e, modulation, model):
    """At R_c,max the slope is 0, the loss 118.9 W and the voltage at its limit, all three at once."""
    V_max = pmsm.voltage_limit(IPMSM, modulation)
    expected = bound_by_equations(T_e, V_max, 118.9, model)
    assert_allclose(identification.largest_iron_resistance(IPMSM, 118.9, T_e, V_max, model=model), expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("T_e", "model", "known"),
    [
        (3.0, "simplified", (220, 280)),
        (5.06, "simplified", (260, 320)),
        (6.0, "simplified", (300, 380)),
        (5.06, "full", (300, 380)),
    ],
)
def test_the_bounds_of_the_iron_resistance_are_the_known_ones(T_e, model, known):
    """118.9 W within 144 V (159 V) is possible up to about 220 (280) … 300 (380) Ω, known in steps of 20 Ω."""
    for modulation, expected in zip(("space-vector", "six-step"), known, strict=True):
        V_max = pmsm.voltage_limit(IPMSM, modulation)
        found = identification.largest_iron_resistance(IPMSM, 118.9, T_e, V_max, model=model)
        assert expected <= found < expected + 20


def test_at_overload_the_iron_resistance_has_no_bound():
    """Where copper takes nearly all of 118.9 W, the speed stays so low that the voltage suffices for 5000 Ω too."""
    T_e, grid = 9.15, np.linspace(-8, 2, 4001)

    def least(omega_e):
        points = at_torque(IPMSM.changed(R_c=5000.0), omega_e, T_e, grid, "simplified")
        return points.loss.min(), abs(points.u[points.loss.argmin()])

    omega_e = brentq(lambda w: least(w)[0] - 118.9, 0.0, 5000.0)
    V_max = pmsm.voltage_limit(IPMSM)
    assert least(omega_e)[1] < V_max, "the premise"
    assert identification.largest_iron_resistance(IPMSM, 118.9, T_e, V_max) == np.inf
    assert np.isfinite(identification.largest_iron_resistance(IPMSM, 118.9, 8.0, V_max))


def test_identified_speeds_have_the_loss_and_the_voltage_that_they_say():
    """For each R_c and torque the speed's least loss, by brute force, is 118.9 W and needs the voltage returned."""
    R_c, T_e = [200.0, 400.0], [1.0, 3.0, 5.06]
    omega_m, V_s = identification.loss_curve(IPMSM, 118.9, R_c, T_e)
    assert omega_m.shape == V_s.shape == (2, 3)
    for a, resistance in enumerate(R_c):
        for b, load in enumerate(T_e):
            m = IPMSM.changed(R_c=resistance)
            grid = np.linspace(-8, 2, 400_001)
            points = at_torque(m, 4 * omega_m[a, b], load, grid, "simplified")
            k = points.loss.argmin()
            assert_allclose(points.loss[k], 118.9, rtol=1e-8)
            assert_allclose(abs(points.u[k]), V_s[a, b], rtol=1e-4)
    assert np.isnan(identification.loss_curve(IPMSM, 118.9, [200.0], [30.0])[0]).all(), "copper alone exceeds 118.9 W"
    assert np.isnan(identification.largest_iron_resistance(IPMSM, 118.9, 30.0, 144.3))
