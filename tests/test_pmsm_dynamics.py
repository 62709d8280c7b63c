"""The machine in motion is the circuit of fig. 1 and eq. (4): held against its steady state, its energy and another formulation.

The other formulation, `stator_frame`, keeps the flux linkage in the stator's frame, where it is simply the
integral of the branch voltage and the held voltage is constant; scipy's DOP853 integrates it.
"""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from drivelib import pmsm, pmsm_angle, pmsm_dynamics, pmsm_optimum
from drivelib.machines import IPMSM, SPMSM, PmsmParameters
from drivelib.pmsm_dynamics import coefficients
from drivelib.pmsm_plant import held_period


def stator_frame(t, y, v_s, T_load, imposed, m):
    """Slopes of flux (2, stator frame), angle, speed, and of input, heat and shaft energy."""
    psi, theta, omega_m = complex(y[0], y[1]), y[2], y[3]
    turned = psi * cmath.exp(-1j * theta)
    i_o = complex((turned.real - m.psi_f) / m.L_d, turned.imag / m.L_q) * cmath.exp(1j * theta)
    i_s, v_o = np.linalg.solve([[m.R_s, 1.0], [1.0, -1.0 / m.R_c]], [v_s, i_o])  # v = R_s i + v_o, i = i_o + v_o/R_c
    T_e = 1.5 * m.P * (psi.conjugate() * i_o).imag
    slope = 0.0 if imposed else (T_e - T_load - m.B * omega_m) / m.J
    heat = 1.5 * (m.R_s * abs(i_s) ** 2 + abs(v_o) ** 2 / m.R_c)
    return [v_o.real, v_o.imag, m.P * omega_m, slope, 1.5 * (v_s * i_s.conjugate()).real, heat, T_e * omega_m]


def reference_period(i_o, omega_m, v, T_load, imposed, period, m):
    """Branch current and speed after a period that starts with theta = 0, and the three energies."""
    start = [m.psi_f + m.L_d * i_o.real, m.L_q * i_o.imag, 0.0, omega_m, 0.0, 0.0, 0.0]
    y = solve_ivp(stator_frame, (0, period), start, "DOP853", args=(v, T_load, imposed, m), rtol=1e-10, atol=1e-13).y[:, -1]
    turned = complex(y[0], y[1]) * cmath.exp(-1j * y[2])
    return complex((turned.real - m.psi_f) / m.L_d, turned.imag / m.L_q), y[3], y[4:]


ROUGH = IPMSM.changed(B=2e-3)

machines = st.builds(
    lambda R_s, L_d, saliency, psi_f, P, R_c: PmsmParameters(
        R_s=R_s, L_d=L_d, L_q=saliency * L_d, psi_f=psi_f, P=P, V_dc=300.0, R_c=R_c, J=1e-3, B=1e-3, omega_m_rated=200.0, T_rated=3.0
    ),
    st.floats(0.1, 10), st.floats(1e-3, 0.1), st.floats(0.5, 4), st.floats(0.02, 0.5), st.integers(1, 6), st.floats(50, 2000),
)  # fmt: skip
amps = st.floats(-10, 10)
volts = st.floats(-200, 200)


@given(machines, amps, amps, st.floats(-300, 300))
def test_standstill_of_the_states_is_the_steady_state(m, i_od, i_oq, omega_m):
    """Under the voltages of (1)–(2) no current changes, and under the torque of (3) no speed; terminal currents agree."""
    omega_e = m.P * omega_m
    v_d, v_q = pmsm.stator_voltages(m, omega_e, i_od, i_oq)
    c = coefficients(m)
    T_load = pmsm.torque(m, i_od, i_oq) - m.B * omega_m
    slopes = pmsm_dynamics.pmsm_derivatives(i_od, i_oq, omega_m, v_d, v_q, T_load, c)
    scale = 1 + abs(v_d) + abs(v_q) + abs(omega_e) * (m.psi_f + m.L_q * 10)
    assert np.abs(slopes[:2]) * m.L_d == pytest.approx(0, abs=1e-11 * scale * max(1, m.L_d / m.L_q))
    assert slopes[2] * m.J == pytest.approx(0, abs=1e-11 * (1 + abs(T_load)))
    terminal = [pmsm_dynamics.terminal_current(v, i, c) for v, i in ((v_d, i_od), (v_q, i_oq))]
    assert terminal == pytest.approx(pmsm.terminal_currents(m, omega_e, i_od, i_oq), rel=1e-9, abs=1e-9)


@given(machines, amps, amps, st.floats(-300, 300), volts, volts)
def test_power_that_enters_is_heat_shaft_power_and_stored_energy(m, i_od, i_oq, omega_m, v_d, v_q):
    """At every instant, steady or not."""
    c = coefficients(m)
    power, heat, shaft = pmsm_dynamics.power_flows(i_od, i_oq, omega_m, v_d, v_q, c)
    di_od, di_oq, _ = pmsm_dynamics.pmsm_derivatives(i_od, i_oq, omega_m, v_d, v_q, 0.0, c)
    stored = 1.5 * (m.L_d * i_od * di_od + m.L_q * i_oq * di_oq)
    assert heat >= 0
    assert power - heat - shaft - stored == pytest.approx(0, abs=1e-10 * (1 + abs(power) + heat + abs(shaft) + abs(stored)))


@given(machines, amps, amps)
def test_stored_energy_is_the_work_that_builds_the_currents(m, i_od, i_oq):
    """Its differential is 3/2 (L_d i_od di_od + L_q i_oq di_oq)."""
    c, h = coefficients(m), 1e-3
    for axis, (L, i) in enumerate(((m.L_d, i_od), (m.L_q, i_oq))):
        shift = np.eye(2)[axis] * h
        rise = pmsm_dynamics.magnetic_energy(i_od + shift[0], i_oq + shift[1], c) - pmsm_dynamics.magnetic_energy(i_od - shift[0], i_oq - shift[1], c)
        assert rise / (2 * h) == pytest.approx(1.5 * L * i, rel=1e-6, abs=1e-9)


@given(machines, amps, volts)
def test_branch_current_undoes_terminal_current(m, i_o, v):
    """With G = 1/R_c the branch current comes back; with G = 0 the terminal current stays."""
    c = coefficients(m)
    i = pmsm_dynamics.terminal_current(v, i_o, c)
    assert pmsm_dynamics.branch_current(v, i, 1 / m.R_c, c) == pytest.approx(i_o, rel=1e-10, abs=1e-10)
    assert pmsm_dynamics.branch_current(v, i, 0.0, c) == i


@given(machines, amps, st.floats(-1000, 1000), st.sampled_from(pmsm.MODELS))
def test_compiled_optimum_is_that_of_pmsm_optimum(m, i_oq, omega_e, model):
    """The drive loop's quadratic and the physics layer's are one."""
    G = pmsm.terminal_conductance(m, model)
    ours = pmsm_dynamics.loss_optimal_i_od(i_oq, omega_e, G, coefficients(m))
    assert ours == pytest.approx(float(pmsm_optimum.optimal_i_od_at_i_oq(m, omega_e, i_oq, model=model)), rel=1e-9, abs=1e-12)


def test_angle_feed_drives_the_torque_without_d_current():
    """The amplitude and angle of (17)–(20) give i_od = 0 and the torque asked for, where the iron current is neglected."""
    for m in (IPMSM, SPMSM):
        V, phi = pmsm_dynamics.angle_feed(0.5, 400.0, coefficients(m))
        i_od, i_oq = pmsm.branch_currents_at_voltage(m, 400.0, V, phi, model="simplified")
        assert i_od == pytest.approx(0, abs=1e-12)
        assert pmsm.torque(m, i_od, i_oq) == pytest.approx(0.5, rel=1e-12)
        assert phi == pytest.approx(pmsm_angle.inverter_angle(m, 400.0, i_oq), rel=1e-12)


def test_scalar_functions_broadcast():
    """NumPy runs the same source on arrays."""
    c, i = coefficients(IPMSM), np.linspace(-2, 2, 5)
    rows = pmsm_dynamics.pmsm_derivatives(i[:, None], i, 100.0, 10.0, 90.0, 1.0, c)
    assert rows[0].shape == (5, 5)
    assert rows[1][3, 1] == pmsm_dynamics.pmsm_derivatives(i[3], i[1], 100.0, 10.0, 90.0, 1.0, c)[1]


@pytest.mark.parametrize("imposed", [True, False])
@pytest.mark.parametrize("machine", [ROUGH, SPMSM], ids=["IPMSM", "SPMSM"])
def test_held_period_is_the_stator_frame_solution(machine, imposed):
    """Currents, speed and energies after 2 ms under a held voltage, to the integrator's accuracy."""
    i_o, v = complex(-1.0, 2.0), complex(-40.0, 90.0)
    expected = reference_period(i_o, 120.0, v, 0.7, imposed, 2e-3, machine)
    ours = held_period(i_o.real, i_o.imag, 120.0, v.real, v.imag, 0.7, imposed, 2e-3, 400, coefficients(machine))
    assert complex(*ours[:2]) == pytest.approx(expected[0], abs=1e-9)
    assert ours[2] == pytest.approx(expected[1], rel=1e-10)
    assert ours[3:] == pytest.approx(expected[2], rel=1e-8)
    assert (ours[2] == 120.0) == imposed


def test_integrator_converges_with_order_four():
    """Half the step, a sixteenth of the error."""
    i_o, v, c = complex(-1.0, 2.0), complex(-40.0, 90.0), coefficients(ROUGH)
    exact, omega_m, _ = reference_period(i_o, 120.0, v, 0.7, False, 5e-3, ROUGH)
    errors = []
    for substeps in (10, 20, 40):
        ours = held_period(i_o.real, i_o.imag, 120.0, v.real, v.imag, 0.7, False, 5e-3, substeps, c)
        errors.append(math.hypot(abs(complex(*ours[:2]) - exact), (ours[2] - omega_m) / 100))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(4, abs=0.3)


@given(machines, amps, amps)
def test_heat_at_rest_is_that_of_the_stator(m, i_od, i_oq):
    """At standstill without currents changing, all input is heat."""
    c = coefficients(m)
    v_d, v_q = pmsm.stator_voltages(m, 0.0, i_od, i_oq)
    power, heat, shaft = pmsm_dynamics.power_flows(i_od, i_oq, 0.0, v_d, v_q, c)
    assert shaft == 0
    assert heat == pytest.approx(float(pmsm.total_loss(m, 0.0, i_od, i_oq)), rel=1e-9, abs=1e-9)
    assert power == pytest.approx(heat, rel=1e-9, abs=1e-9)
