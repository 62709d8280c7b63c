"""Eskander (1)-(9), (12)-(14) against one complex stator equation, and the powers against each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drivelib import pmsm
from drivelib.machines import IPMSM, SPMSM
from pmsm_by_hand import machines, speeds, state

SETTINGS = settings(derandomize=True, deadline=None, max_examples=60)
CURRENT = st.floats(-30, 30).map(lambda value: round(value, 6))
MODEL = st.sampled_from(pmsm.MODELS)
FACTOR = {"paper": 1.0, "consistent": 1.5}


@SETTINGS
@given(machines(), speeds(), CURRENT, CURRENT, MODEL)
def test_terminal_quantities_are_those_of_the_complex_circuit(m, w, i_od, i_oq, model):
    """Terminal current and voltage follow from Kirchhoff's laws in space vectors, for any speed and current."""
    point = state(m, w, i_od, i_oq, model)
    scale = dict(rtol=1e-12, atol=1e-12 * (1 + abs(point.u) + abs(point.i)))
    assert_allclose(pmsm.terminal_currents(m, w, i_od, i_oq, model=model), (point.i.real, point.i.imag), **scale)
    assert_allclose(pmsm.stator_voltages(m, w, i_od, i_oq, model=model), (point.u.real, point.u.imag), **scale)
    assert_allclose(pmsm.stator_voltage(m, w, i_od, i_oq, model=model), abs(point.u), **scale)


@SETTINGS
@given(machines(), speeds(), CURRENT, CURRENT, MODEL, st.sampled_from(pmsm.CONVENTIONS))
def test_losses_are_those_of_the_two_resistors(m, w, i_od, i_oq, model, convention):
    """Copper loss is in R_s, iron loss in R_c; the paper leaves the 3/2 of the amplitude-invariant frame out."""
    point, factor = state(m, w, i_od, i_oq, model), FACTOR[convention]
    kwargs = dict(convention=convention)
    i_d, i_q = point.i.real, point.i.imag
    assert_allclose(pmsm.copper_loss(m, i_d, i_q, **kwargs), factor * point.copper, rtol=1e-12)
    assert_allclose(pmsm.iron_loss(m, w, i_od, i_oq, **kwargs), factor * point.iron, rtol=1e-12)
    assert_allclose(pmsm.total_loss(m, w, i_od, i_oq, model=model, **kwargs), factor * point.loss, rtol=1e-12)


@SETTINGS
@given(machines(), speeds(), CURRENT, CURRENT, MODEL, st.sampled_from(list(FACTOR)))
def test_an_operating_point_is_what_the_complex_circuit_has(m, w, i_od, i_oq, model, convention):
    point, at = state(m, w, i_od, i_oq, model), pmsm.operating_point(m, w, i_od, i_oq, model=model, convention=convention)
    scale = dict(rtol=1e-12, atol=1e-12 * (1 + abs(point.u) + abs(point.i)))
    assert_allclose((at.i_d, at.i_q, at.V_s), (point.i.real, point.i.imag, abs(point.u)), **scale)
    assert_allclose(at.loss, FACTOR[convention] * point.loss, rtol=1e-12)


@SETTINGS
@given(machines(), st.floats(1.0, 2000.0), CURRENT, st.floats(0, 30))
def test_the_current_at_a_voltage_is_the_largest_that_needs_it(m, w, i_od, i_oq):
    """Against the complex circuit: the voltage is met, and more current needs more; below any current's voltage there is none."""
    V_s = abs(state(m, w, i_od, i_oq, "simplified").u)
    found = float(pmsm.i_oq_at_voltage(m, w, V_s * (1 + 1e-9), i_od))
    assert found >= i_oq - 1e-6 * (1 + i_oq)
    assert abs(state(m, w, i_od, found, "simplified").u) == pytest.approx(V_s, rel=1e-7, abs=1e-9)
    assert abs(state(m, w, i_od, found + 0.1, "simplified").u) > V_s
    least = min(abs(state(m, w, i_od, i, "simplified").u) for i in np.linspace(0, 100, 1001))
    assert np.isnan(pmsm.i_oq_at_voltage(m, w, 0.9 * least, i_od)) or least < 1.0


def test_without_resistance_at_standstill_no_voltage_determines_a_current():
    with pytest.raises(ValueError, match="R_s = 0 ohm at omega_e = 0 rad/s"):
        pmsm.i_oq_at_voltage(IPMSM.changed(R_s=0.0), [0.0, 10.0], 5.0, 0.0)


@SETTINGS
@given(machines(), CURRENT, CURRENT)
def test_torque_is_flux_times_current(m, i_od, i_oq):
    """The torque is 3/2 P times the cross product of flux linkage and current."""
    atol = 1e-13 * 1.5 * m.P * (m.psi_f + (m.L_d + m.L_q) * abs(i_od)) * abs(i_oq)
    assert_allclose(pmsm.torque(m, i_od, i_oq), state(m, 0.0, i_od, i_oq).torque, rtol=1e-12, atol=atol)


@SETTINGS
@given(machines(), speeds(), CURRENT, CURRENT)
def test_energy_is_conserved_only_by_the_full_model_in_one_convention(m, w, i_od, i_oq):
    """Input − shaft − loss is 0 in full; −P_Fe where the iron current is dropped; ½ P_loss where only losses lose 3/2.

    Simplified: the circuit delivers 3/2 R_s i² + Tω, so the iron loss comes from nowhere. The paper's convention
    subtracts P_loss where 3/2 P_loss flows (P without 3/2). Both at once: ½ R_s i² − P_Fe.
    """
    full, simple = state(m, w, i_od, i_oq, "full"), state(m, w, i_od, i_oq, "simplified")
    expected = {
        ("full", "consistent"): 0.0,
        ("full", "paper"): full.loss / 2,
        ("simplified", "consistent"): -1.5 * simple.iron,
        ("simplified", "paper"): simple.copper / 2 - simple.iron,
    }
    flow = 1.5 * (full.loss + simple.loss) + abs(full.input) + abs(full.torque * w / m.P) + 1e-300
    for (model, convention), residual in expected.items():
        found = pmsm.energy_balance(m, w, i_od, i_oq, model=model, convention=convention)
        assert abs(found - residual) <= 1e-9 * flow
    assert_allclose(pmsm.input_power(m, w, i_od, i_oq), full.input, rtol=1e-12, atol=1e-12 * flow)
    assert_allclose(pmsm.input_power(m, w, i_od, i_oq, model="simplified"), simple.input, rtol=1e-12, atol=1e-12 * flow)


def test_the_balance_that_is_zero_is_small_against_what_flows():
    """At the rated point of the IPMSM the full model balances to 1e-9 of the input; the simplified one does not."""
    i_oq = 3.0
    power = pmsm.input_power(IPMSM, 712.0, -3.9, i_oq)
    assert power > 500
    assert abs(pmsm.energy_balance(IPMSM, 712.0, -3.9, i_oq)) < 1e-9 * power
    assert abs(pmsm.energy_balance(IPMSM, 712.0, -3.9, i_oq, model="simplified")) > 0.01 * power


@SETTINGS
@given(machines(), speeds(), CURRENT, CURRENT, MODEL)
def test_currents_survive_the_way_to_the_terminals_and_back(m, w, i_od, i_oq, model):
    """Terminal currents, and terminal voltage with its angle, each determine the branch currents uniquely."""
    point = state(m, w, i_od, i_oq, model)
    size = abs(i_od) + abs(i_oq) + 1e-6
    if model == "full":
        back = pmsm.branch_currents(m, w, point.i.real, point.i.imag)
        assert_allclose(back, (i_od, i_oq), rtol=0, atol=1e-10 * (size + abs(point.i)))
    angle = np.arctan2(-point.u.real, point.u.imag)
    back = pmsm.branch_currents_at_voltage(m, w, abs(point.u), angle, model=model)
    assert_allclose(back, (i_od, i_oq), rtol=0, atol=1e-10 * (size + abs(point.u) / m.R_s))


@SETTINGS
@given(machines(), speeds(), CURRENT, CURRENT, MODEL)
def test_efficiency_is_defined_for_motoring_alone(m, w, i_od, i_oq, model):
    """Efficiency is shaft power over shaft power plus losses where the machine motors, NaN where it brakes or stands."""
    point = state(m, w, i_od, i_oq, model)
    shaft = point.torque * w / m.P
    found = pmsm.efficiency(m, w, i_od, i_oq, model=model)
    if shaft > 1e-9:
        assert_allclose(found, shaft / (shaft + 1.5 * point.loss), rtol=1e-9)
    elif shaft < -1e-9 or w == 0:
        assert np.isnan(found)


def test_efficiency_is_shaft_over_input_in_the_full_model():
    """With energy conserved, shaft over input is the same ratio, and it lies between 0 and 1."""
    w, i_od, i_oq = np.meshgrid([100.0, 700.0], [-4.0, 0.0], [1.0, 4.0])
    for m in (IPMSM, SPMSM):
        eta = pmsm.efficiency(m, w, i_od, i_oq)
        assert_allclose(eta, pmsm.torque(m, i_od, i_oq) * w / m.P / pmsm.input_power(m, w, i_od, i_oq), rtol=1e-12)
        assert np.all((eta > 0) & (eta < 1))


@SETTINGS
@given(machines(), speeds(), st.floats(-20, 20), st.floats(-0.9, 3.0))
def test_slopes_at_constant_torque_are_difference_quotients(m, w, T_e, reach):
    """(9) keeps the torque; the mended (10) and (8) are its slope and the slope of the simplified loss."""
    salient = m.L_d - m.L_q
    i_od = reach * m.psi_f / salient if salient else reach  # so that λ + ΔL i_od stays positive
    T_e = round(T_e, 6)
    i_oq = pmsm.i_oq_at_torque(m, T_e, i_od)
    assert_allclose(state(m, w, i_od, i_oq).torque, T_e, rtol=1e-9, atol=1e-12)
    h = 1e-4 * abs(i_od) * (1 - abs(min(reach, 0.0))) + 1e-7 * (1 if not salient else m.psi_f / abs(salient))
    nodes, weights = np.array([-2, -1, 1, 2]) * h + i_od, np.array([1, -8, 8, -1]) / (12 * h)  # fourth order
    along = [T_e / (1.5 * m.P * (m.psi_f + salient * i)) for i in nodes]
    slope = weights @ along
    assert_allclose(pmsm.di_oq_di_od(m, T_e, i_od), slope, rtol=1e-6, atol=1e-9 * (1 + max(np.abs(along)) / h))
    losses = np.array([state(m, w, i, j, "simplified").loss for i, j in zip(nodes, along, strict=True)])
    tolerance = dict(rtol=1e-5, atol=1e-12 * losses.max() / h + 1e-9)
    assert_allclose(pmsm.loss_slope(m, w, T_e, i_od), weights @ losses, **tolerance)
    assert_allclose(pmsm.loss_slope(m, w, T_e, i_od, convention="consistent"), 1.5 * weights @ losses, **tolerance)


def test_the_motion_equation_balances():
    """Newton: J dω/dt makes up what load and friction leave of the torque (4)."""
    m = IPMSM.changed(J=2e-3, B=1e-2)
    assert_allclose(pmsm.acceleration(m, 5.0, 2.0, 100.0), (5 - 2 - 1.0) / 2e-3)
    assert pmsm.acceleration(m, 0.0, 0.0, -100.0) > 0, "friction opposes the motion"
    assert_allclose(pmsm.acceleration(m, 3.0, 3.0, 0.0), 0)


def test_the_dc_link_limits_the_phase_voltage():
    """Space-vector PWM reaches the inner circle V_dc/√3 of the hexagon, six-step the fundamental 2 V_dc/π."""
    phase = np.linspace(0, 2 * np.pi, 6001)[:-1]
    six_step = np.select([phase % (2 * np.pi) < x * np.pi / 3 for x in (1, 2, 3, 4, 5, 6)], np.array([1, 2, 1, -1, -2, -1]) / 3)
    fundamental = 2 * abs(np.mean(six_step * 250 * np.exp(-1j * phase)))
    assert_allclose(pmsm.voltage_limit(IPMSM, "six-step"), fundamental, rtol=1e-3)
    corners = 2 / 3 * 250 * np.exp(1j * np.pi / 3 * np.arange(2))
    assert_allclose(pmsm.voltage_limit(IPMSM), abs(corners.mean()), rtol=1e-12)
    assert_allclose(pmsm.voltage_limit(SPMSM), 57.735, atol=5e-4)


def test_a_hundred_thousand_points_are_one_call():
    """Every function is vectorised: 100 000 operating points give 100 000 finite values, scalars give scalars."""
    w = np.linspace(-1000, 1000, 100_000)
    for function in (pmsm.total_loss, pmsm.stator_voltage, pmsm.energy_balance, pmsm.input_power):
        values = function(IPMSM, w, -2.0, 3.0)
        assert values.shape == w.shape and np.all(np.isfinite(values))
        assert np.shape(function(IPMSM, 500.0, -2.0, 3.0)) == ()
    assert pmsm.total_loss(IPMSM, w[:50, None], w[None, :60] / 500, 1.0).shape == (50, 60)
