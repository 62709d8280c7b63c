"""The doubly fed motor's equations, held against symbols, energy and three-phase windings."""

import numpy as np
import pytest
import sympy as sp
from abc_machine import AbcMachine, phases, vector
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from drivelib import dfim, dfim_decoupling
from drivelib.dfim_machines import DFIM_4KW, DFIM_SETS, DfimParameters

finite = st.floats(-1.0, 1.0)


@st.composite
def machines(draw):
    L_s, L_r = draw(st.floats(0.02, 0.5)), draw(st.floats(0.02, 0.5))
    M = draw(st.floats(0.7, 0.98)) * np.sqrt(L_s * L_r)
    return DfimParameters(
        R_s=draw(st.floats(0.1, 5)), R_r=draw(st.floats(0.1, 5)), L_s=L_s, L_r=L_r, M=M, p=draw(st.integers(1, 6)),
        J=draw(st.floats(0.005, 1)), f=draw(st.floats(0, 0.01)), omega_m_rated=150.0, T_rated=20.0,
    )  # fmt: skip


def complexes(size):
    return st.builds(lambda a, b: size * complex(a, b), finite, finite)


def derivatives(phi_s, phi_r, omega_m, v_s, v_r, omega_s, machine, T_load=0.0):
    d = dfim.dfim_derivatives(
        phi_s.real, phi_s.imag, phi_r.real, phi_r.imag, omega_m, v_s.real, v_s.imag, v_r.real, v_r.imag,
        omega_s, T_load, machine.R_r, dfim.coefficients(machine),
    )  # fmt: skip
    return d[0] + 1j * d[1], d[2] + 1j * d[3], d[4]


@given(machines(), complexes(1.0), complexes(1.0), complexes(300.0), complexes(300.0), finite, finite)
@settings(max_examples=60, deadline=None)
def test_energy_is_conserved(machine, phi_s, phi_r, v_s, v_r, a, b):
    """Electrical power in equals copper loss, growth of the field energy and mechanical power, in every frame."""
    omega_m, omega_s, h = 300 * a, 600 * b, 1e-7
    power = dfim.power_balance(phi_s, phi_r, omega_m, v_s, v_r, omega_s, machine)
    scale = sum(abs(term) for term in power) + 1e-9
    assert abs(power.residual) < 1e-12 * scale
    dphi_s, dphi_r, _ = derivatives(phi_s, phi_r, omega_m, v_s, v_r, omega_s, machine)
    ahead = dfim.magnetic_energy(phi_s + h * dphi_s, phi_r + h * dphi_r, machine)
    behind = dfim.magnetic_energy(phi_s - h * dphi_s, phi_r - h * dphi_r, machine)
    assert (ahead - behind) / (2 * h) == pytest.approx(power.magnetic, abs=1e-6 * scale)


@given(machines(), complexes(20.0), complexes(20.0))
@settings(max_examples=40, deadline=None)
def test_currents_invert_flux_linkages(machine, i_s, i_r):
    back = dfim.currents(*dfim.flux_linkages(i_s, i_r, machine), machine)
    assert np.allclose(back, (i_s, i_r), atol=1e-11)


def test_sympy_torque_of_equation_10_is_the_air_gap_power_per_speed():
    """(10) is what (6)–(9) leave of 3/2 Re(v i*) once copper loss and field energy are taken out, over Ω."""
    sd, sq, rd, rq = sp.symbols("i_sd i_sq i_rd i_rq", real=True)
    L_s, L_r, M, p, omega_s, omega = sp.symbols("L_s L_r M p omega_s Omega", positive=True)
    phi = sp.Matrix([L_s * sd + M * rd, L_s * sq + M * rq, L_r * rd + M * sd, L_r * rq + M * sq])
    omega_r = omega_s - p * omega
    rotational = sp.Matrix([-omega_s * phi[1], omega_s * phi[0], -omega_r * phi[3], omega_r * phi[2]])
    power = sp.Rational(3, 2) * (sp.Matrix([sd, sq, rd, rq]).T * rotational)[0]
    printed = sp.Rational(3, 2) * p * M / L_r * (phi[2] * sq - phi[3] * sd)
    assert sp.simplify(power / omega - printed) == 0
    minus = sp.Matrix([rotational[0], rotational[1], -rotational[2], -rotational[3]])
    wrong = sp.Rational(3, 2) * (sp.Matrix([sd, sq, rd, rq]).T * minus)[0]
    assert sp.simplify(sp.diff(wrong, omega_s)) != 0  # the sign of (2): power would depend on the frame


def test_sympy_equation_13_follows_without_orientation():
    """(12) with (3), (4), (6)–(9) gives σ L_s di_s/dt and exactly the compensation terms in the code."""
    t = sp.symbols("t")
    L_s, L_r, M, R_s, R_r, omega_s, omega_r = sp.symbols("L_s L_r M R_s R_r omega_s omega_r", positive=True)
    i = [sp.Function(name)(t) for name in ("i_sd", "i_sq", "i_rd", "i_rq")]
    phi = [L_s * i[0] + M * i[2], L_s * i[1] + M * i[3], L_r * i[2] + M * i[0], L_r * i[3] + M * i[1]]
    v = [
        R_s * i[0] + sp.diff(phi[0], t) - omega_s * phi[1],
        R_s * i[1] + sp.diff(phi[1], t) + omega_s * phi[0],
        R_r * i[2] + sp.diff(phi[2], t) - omega_r * phi[3],
        R_r * i[3] + sp.diff(phi[3], t) + omega_r * phi[2],
    ]
    v_t = [v[0] - M / L_r * v[2], v[1] - M / L_r * v[3], v[2] - M / L_s * v[0], v[3] - M / L_s * v[1]]
    sigma = 1 - M**2 / (L_s * L_r)
    terms = dfim_decoupling.compensation_terms(*i, omega_s, omega_r, R_s, R_r, L_s, L_r, M)
    for k, (R, L) in enumerate([(R_s, L_s), (R_s, L_s), (R_r, L_r), (R_r, L_r)]):
        assert sp.simplify(v_t[k] - (R * i[k] + sigma * L * sp.diff(i[k], t) + terms[k])) == 0


def test_sympy_equation_16_mended_gives_flux_and_torque_and_the_printed_one_does_not():
    C, phi, L_r, M, p = sp.symbols("C phi L_r M p", positive=True)
    i_sd, i_sq = phi / M, 2 * L_r * C / (3 * p * M * phi)
    i_rd, i_rq = 0, -2 * C / (3 * p * phi)
    phi_rd, phi_rq = L_r * i_rd + M * i_sd, L_r * i_rq + M * i_sq
    assert sp.simplify(phi_rd - phi) == 0 and sp.simplify(phi_rq) == 0
    assert sp.simplify(sp.Rational(3, 2) * p * M / L_r * (phi_rd * i_sq - phi_rq * i_sd) - C) == 0
    assert sp.simplify(i_rq + M / L_r * i_sq) == 0
    assert sp.simplify(M * (L_r / M * phi) - phi) != 0  # printed i_sd* makes L_r φ, a flux times an inductance


@pytest.mark.parametrize("machine", DFIM_SETS.values(), ids=DFIM_SETS.keys())
def test_mended_references_give_the_torque_and_printed_ones_two_thirds(machine):
    """The code's (16) inserted into the code's (10)."""
    T, phi = machine.T_rated, 0.7
    i_sd, i_sq, i_rd, i_rq = dfim_decoupling.current_references(T, phi, machine)
    _, phi_r = dfim.flux_linkages(complex(i_sd, i_sq), complex(i_rd, i_rq), machine)
    assert phi_r == pytest.approx(phi, abs=1e-14)
    assert dfim.electromagnetic_torque(phi_r.real, phi_r.imag, i_sd, i_sq, machine) == pytest.approx(T, rel=1e-13)
    assert dfim_decoupling.torque_constant(phi, machine) * i_rq == pytest.approx(T, rel=1e-13)
    printed = dfim_decoupling.printed_current_references(T, phi, machine)
    assert printed[1] / i_sq == pytest.approx(1.5)
    assert printed[0] == pytest.approx(machine.L_r * i_sd)


@given(machines(), st.floats(-300, 300), st.floats(-50, 50), st.floats(0.1, 1.2), st.floats(-600, 600))
@settings(max_examples=60, deadline=None)
def test_oriented_steady_state_stands_still(machine, omega_m, T_e, phi_r, omega_s):
    """At the point that is returned all electrical derivatives vanish and the torque is the one asked for."""
    x = dfim_decoupling.oriented_steady_state(omega_m, T_e, phi_r, omega_s, machine)
    dphi_s, dphi_r, acceleration = derivatives(x.phi_s, x.phi_r, omega_m, x.v_s, x.v_r, omega_s, machine, T_e)
    assert abs(dphi_s) + abs(dphi_r) < 1e-9 * (1 + abs(x.v_s) + abs(x.v_r))
    assert acceleration * machine.J == pytest.approx(-machine.f * omega_m, abs=1e-8)
    i_s, i_r = dfim.open_loop_steady_state(omega_m, x.v_s, x.v_r, omega_s, machine)
    assert abs(i_s - x.i_s) + abs(i_r - x.i_r) < 1e-6 * (1 + abs(x.i_s) + abs(x.i_r))


@given(machines(), complexes(300.0), complexes(300.0))
@settings(max_examples=30, deadline=None)
def test_inverter_voltages_invert_the_combined_ones(machine, v_s, v_r):
    back = dfim_decoupling.inverter_voltages(*dfim_decoupling.combined_voltages(v_s, v_r, machine), machine)
    assert np.allclose(back, (v_s, v_r), atol=1e-9)


@given(machines(), complexes(20.0), complexes(20.0), st.floats(-2, 2), st.floats(-2, 2))
@settings(max_examples=30, deadline=None)
def test_resistance_error_is_what_compensation_leaves(machine, i_s, i_r, delta_R_s, delta_R_r):
    """Own compensation with the true resistances minus the one with the known ones, own-axis drop included."""
    rest = (machine.L_s, machine.L_r, machine.M)
    args = (i_s.real, i_s.imag, i_r.real, i_r.imag, 100.0, -200.0)
    known = dfim_decoupling.compensation_terms(*args, machine.R_s, machine.R_r, *rest)
    true = dfim_decoupling.compensation_terms(*args, machine.R_s + delta_R_s, machine.R_r + delta_R_r, *rest)
    left = np.subtract(known, true)
    d_s, d_r = dfim_decoupling.resistance_error_voltages(i_s, i_r, delta_R_s, delta_R_r, machine)
    assert complex(left[0], left[1]) - delta_R_s * i_s == pytest.approx(d_s, abs=1e-9)
    assert complex(left[2], left[3]) - delta_R_r * i_r == pytest.approx(d_r, abs=1e-9)


@pytest.mark.parametrize("machine", DFIM_SETS.values(), ids=DFIM_SETS.keys())
def test_open_loop_agrees_with_three_phase_windings(machine):
    """Sinusoidal feeding at 50 Hz and 12 Hz from standstill: same speed and currents as six coupled windings."""
    omega_s, omega_feed_r, v_s, v_r, T_load = 2 * np.pi * 50, 2 * np.pi * 12, 180.0, 40.0 * np.exp(0.4j), 2.0
    t = np.linspace(0.0, 0.1, 11)
    windings = AbcMachine(machine)
    abc = windings.run(
        windings.initial(0, 0, 0.0), t, lambda t: phases(v_s, omega_s * t), lambda t: phases(v_r, omega_feed_r * t), T_load
    )

    def park(t, x):
        angle_r = omega_s * t - x[5]  # the dq frame seen from the rotor
        u_r = v_r * np.exp(1j * (omega_feed_r * t - angle_r))
        d = derivatives(complex(x[0], x[1]), complex(x[2], x[3]), x[4], v_s + 0j, u_r, omega_s, machine, T_load)
        return [d[0].real, d[0].imag, d[1].real, d[1].imag, d[2], machine.p * x[4]]

    dq = solve_ivp(park, (0, t[-1]), np.zeros(6), method="DOP853", t_eval=t, rtol=1e-11, atol=1e-12).y.T
    assert np.allclose(dq[:, 4], abc[:, 6], atol=1e-7)
    assert np.abs(abc[:, 6]).max() > 0.5  # the motor moved
    for time, x, y in zip(t, dq, abc, strict=True):
        i_s, i_r = dfim.currents(complex(x[0], x[1]), complex(x[2], x[3]), machine)
        i = windings.currents(y)
        assert vector(i[:3], omega_s * time) == pytest.approx(i_s, abs=1e-6)
        assert vector(i[3:], omega_s * time - y[7]) == pytest.approx(i_r, abs=1e-6)


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"R_r": -1.0}, "R_r = -1.0 ohm"),
        ({"L_s": float("nan")}, "L_s = nan H"),
        ({"p": 0}, "p = 0 pole pairs"),
        ({"p": 1.5}, "whole"),
        ({"J": 0.0}, "above 0 kg"),
        ({"M": 0.16}, "M = 0.16 H: must be below sqrt"),
        ({"L_t": 0.16}, "Did you mean L_s or L_r"),
    ],
)
def test_bad_machines_are_refused_by_name(changes, message):
    with pytest.raises(ValueError, match=message):
        DFIM_4KW.changed(**changes)


def test_voltage_beyond_the_inverter_is_refused():
    """287 rad/s under full flux wants more than 560 V dc gives the stator when it carries all the frequency."""
    with pytest.raises(ValueError, match=r"v_s = .* must be at most 323"):
        dfim_decoupling.oriented_steady_state(287.0, 25.0, 0.85, 574.0, DFIM_4KW, v_s_limit=323.0)


def test_origins_are_stated_for_every_value_of_every_set():
    for machine in DFIM_SETS.values():
        assert all(kind != "given" and note for _, _, _, kind, note in machine.rows())
    assert dict((row[0], row[3]) for row in DFIM_4KW.changed(R_r=2.7).rows())["R_r"] == "given"


def test_parameter_sets_and_scenarios_can_go_to_another_process():
    import pickle

    from drivelib.dfim_machines import DFIM_SETS
    from drivelib.dfim_scenario import DEFAULT_SCENARIO

    for value in (*DFIM_SETS.values(), DEFAULT_SCENARIO):
        twin = pickle.loads(pickle.dumps(value))
        assert twin == value
        assert dict(twin.origins) == dict(value.origins)
