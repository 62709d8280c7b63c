"""Section 6: the inverter's angle. (17)-(20) from the complex stator equation without iron current."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drivelib import pmsm, pmsm_angle
from drivelib.machines import IPMSM, SPMSM
from pmsm_by_hand import MACHINES, machines, speeds, state

SETTINGS = settings(derandomize=True, deadline=None, max_examples=80)
CURRENT = st.floats(-10, 10).map(lambda value: round(value, 4))
MOTORING = CURRENT.map(abs)


def angle_from_q(u):
    """Return the angle (rad) by which the voltage leads the q-axis, V_q + j(−V_d) = V_s e^{jφ}."""
    return np.angle(u / 1j)


@SETTINGS
@given(machines(), speeds(0.0, 2000.0), MOTORING)
def test_phi_op_drives_no_d_axis_current(m, w, i_oq):
    """(20) is the condition i_od = 0: a voltage at φ_op with the amplitude that (17), (18) give drives i_oq alone."""
    u = state(m, w, 0.0, i_oq, "simplified").u
    assume(abs(u) > 0)
    phi = pmsm_angle.inverter_angle(m, w, i_oq)
    assert_allclose(phi, angle_from_q(u), rtol=1e-9, atol=1e-12)
    i_od, back = pmsm.branch_currents_at_voltage(m, w, abs(u), phi, model="simplified")
    assert_allclose((i_od, back), (0, i_oq), atol=1e-9 * (1 + abs(u) / m.R_s))


@SETTINGS
@given(machines(), speeds(), CURRENT, CURRENT)
def test_the_angle_of_a_voltage_is_measured_from_the_q_axis(m, w, i_od, i_oq):
    """V_q = V_s cos φ, V_d = −V_s sin φ, in all four quadrants and both directions of rotation."""
    u = state(m, w, i_od, i_oq, "simplified").u
    phi, V_s = pmsm_angle.angle_of(m, w, i_od, i_oq)
    assert_allclose(V_s, abs(u), rtol=1e-12, atol=1e-12)
    assert_allclose((V_s * np.cos(phi), -V_s * np.sin(phi)), (u.imag, u.real), rtol=0, atol=1e-12 * (1 + abs(u)))


@SETTINGS
@given(machines(), st.floats(1.0, 2000.0), MOTORING)
def test_the_current_of_an_angle_is_the_one_that_has_it(m, w, i_oq):
    """(20) solved for i_oq gives back the current, below the impedance angle and 1.5 rad."""
    u = state(m, w, 0.0, i_oq, "simplified").u
    assume(angle_from_q(u) < 1.5)
    found = pmsm_angle.i_oq_at_angle(m, w, angle_from_q(u))
    lead = np.arctan2(w * m.L_q, m.R_s) - angle_from_q(u)
    assume(lead > 1e-3)
    assert_allclose(found, i_oq, rtol=1e-6, atol=1e-9)


def test_an_angle_beyond_the_impedance_angle_has_no_current():
    """φ_op tends to atan(ωL/R_s) as the current grows; a larger angle belongs to no motoring current."""
    impedance = np.arctan(700 * IPMSM.L_q / IPMSM.R_s)
    assert pmsm_angle.i_oq_at_angle(IPMSM, 700.0, impedance - 1e-3) > 100
    assert np.isnan(pmsm_angle.i_oq_at_angle(IPMSM, 700.0, impedance + 1e-3))
    assert pmsm_angle.i_oq_at_angle(IPMSM, 700.0, 0.0) == 0


@pytest.mark.parametrize(
    ("machine", "degrees_per_newton_metre", "unit", "torques"),
    [(IPMSM, 11.9, 0.05, (0.042, 0.21)), (SPMSM, 33.5, 0.05, (0.015, 0.075))],
)
def test_at_speed_phi_op_is_a_function_of_torque_alone(machine, degrees_per_newton_metre, unit, torques):
    """R_s i_oq vanishes beside ωλ: φ_op → atan[L T/(1.5 P λ²)], 11.9° (IPMSM), 33.5° (SPMSM) per N m at first.

    Hence 0.5 to 2.5° is 0.042 to 0.21 N m for the one machine and 0.015 to 0.075 N m for the other.
    """

    def degrees(T_e):
        return np.degrees(pmsm_angle.inverter_angle(machine, 1e7, T_e / (1.5 * machine.P * machine.psi_f)))

    assert abs(degrees(1e-3) / 1e-3 - degrees_per_newton_metre) <= unit
    assert_allclose(degrees(np.array(torques)), (0.5, 2.5), rtol=0.011)
    assert_allclose(degrees(1.0), np.degrees(np.arctan(machine.L_q / (1.5 * machine.P * machine.psi_f**2))), rtol=1e-4)


def test_figure_19_loaded_side_has_the_known_angles():
    """The SPMSM at 0.2 N m runs at 2.7° (10 rad/s) to 6.4° (300 rad/s)."""
    i_oq = 0.2 / (1.5 * 2 * 0.083)
    found = np.degrees(pmsm_angle.inverter_angle(SPMSM, 2 * np.array([10.0, 300.0]), i_oq))
    by_hand = [np.degrees(angle_from_q(state(SPMSM, w, 0.0, i_oq, "simplified").u)) for w in (20.0, 600.0)]
    assert_allclose(found, by_hand, rtol=1e-12)
    assert_allclose(found[1], 6.4, atol=0.05)


@pytest.mark.parametrize("kind", MACHINES)
@pytest.mark.parametrize("given_one", [{"V_s": 120.0}, {"current": 4.0}, {"T_e": 0.3}])
def test_at_zero_angle_the_voltage_lies_on_the_q_axis(kind, given_one):
    """φ = 0 leaves V_d = 0, and the one quantity given is met."""
    m = MACHINES[kind]
    i_od, i_oq = pmsm_angle.zero_angle(m, 300.0, **given_one)
    point = state(m, 300.0, i_od, i_oq, "simplified")
    assert abs(point.u.real) < 1e-9 * abs(point.u)
    found = {"V_s": point.u.imag, "current": abs(point.i), "T_e": point.torque}
    for name, value in given_one.items():
        assert_allclose(found[name], value, rtol=1e-9)


@pytest.mark.parametrize("kind", MACHINES)
def test_at_zero_angle_and_given_torque_the_smaller_current_is_taken(kind):
    """λ i + ΔL r i² = q has two roots; the drive comes from standstill along the smaller, until the torque peaks."""
    m, w = MACHINES[kind], 100.0
    currents = np.linspace(0, 60, 600_001)
    ratio = w * m.L_q / m.R_s
    torques = 1.5 * m.P * (m.psi_f * currents + (m.L_d - m.L_q) * ratio * currents**2)
    peak = torques.max()
    for T_e in (0.2, 0.5 * min(peak, 10)):
        expected = currents[np.argmax(torques >= T_e)]
        assert_allclose(pmsm_angle.zero_angle(m, w, T_e=T_e)[1], expected, atol=2e-4)
    if torques.argmax() < currents.size - 1:
        assert np.isnan(pmsm_angle.zero_angle(m, w, T_e=1.01 * peak)[1])
        assert np.isfinite(pmsm_angle.zero_angle(m, w, T_e=0.99 * peak)[1])


@pytest.mark.parametrize("kind", MACHINES)
def test_at_zero_angle_standstill_and_no_load_are_ordinary(kind):
    """At ω = 0 the voltage drives i_oq alone; without torque no current flows."""
    m = MACHINES[kind]
    assert_allclose(pmsm_angle.zero_angle(m, 0.0, V_s=8.6), (0, 8.6 / m.R_s), rtol=1e-12)
    assert_allclose(pmsm_angle.zero_angle(m, 0.0, T_e=0.3), (0, 0.3 / (1.5 * m.P * m.psi_f)), rtol=1e-12)
    assert_allclose(pmsm_angle.zero_angle(m, 300.0, T_e=0.0), (0, 0), atol=0)


def test_with_iron_current_phi_op_no_longer_holds_i_od_at_zero():
    """(20) neglects the iron current: at R_c = 200 Ω the voltage at φ_op drives a d-axis current of the order of 0.1 A."""
    u = state(IPMSM, 712.0, 0.0, 3.0, "simplified").u
    phi = pmsm_angle.inverter_angle(IPMSM, 712.0, 3.0)
    assert_allclose(phi, angle_from_q(u), rtol=1e-12)
    assert abs(pmsm.branch_currents_at_voltage(IPMSM, 712.0, abs(u), phi)[0]) > 1e-2


def test_a_hundred_thousand_angles_are_one_call():
    """Angles broadcast: 100 000 speeds give 100 000 finite values."""
    w = np.linspace(1, 1000, 100_000)
    assert pmsm_angle.inverter_angle(IPMSM, w, 2.0).shape == w.shape
    assert np.all(np.isfinite(pmsm_angle.zero_angle(IPMSM, w, V_s=100.0)))
