"""Zidani's schemes: the statements hold for what is drawn and break when the drawing is spoilt; responses and vectors against independent sums."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivelib import dfim, dfim_decoupling, diagrams, orientation, schemes_zidani
from drivelib.dfim_machines import DFIM_4KW, DFIM_SETS
from drivelib.dfim_response import current_response, first_order_lag

SCHEMES = ("current", "speed", "fuzzy", "whole")


def scheme(name):
    return getattr(schemes_zidani, f"{name}_scheme")()


def statements(name, found):
    return getattr(schemes_zidani, f"{name}_statements")(found)


@pytest.mark.parametrize("name", SCHEMES)
def test_every_statement_holds(name):
    assert all(statements(name, scheme(name)).values())


@pytest.mark.parametrize(("name", "spoilt"), [(name, number) for name in SCHEMES for number, signal in enumerate(scheme(name).signals)])
def test_a_removed_signal_breaks_a_statement(name, spoilt):
    whole = scheme(name)
    rest = diagrams.Scheme(whole.blocks, tuple(signal for number, signal in enumerate(whole.signals) if number != spoilt))
    assert not all(statements(name, rest).values())


@pytest.mark.parametrize("name", SCHEMES)
def test_a_turned_sign_breaks_a_statement(name):
    whole = scheme(name)
    for number, signal in enumerate(whole.signals):
        if signal.sign < 0:
            turned = (*whole.signals[:number], replace(signal, sign=1), *whole.signals[number + 1 :])
            assert not all(statements(name, diagrams.Scheme(whole.blocks, turned)).values())


@pytest.mark.parametrize("name", SCHEMES)
def test_no_wire_runs_askew(name):
    """Every piece of every wire is horizontal or vertical, and ends on its block's edge."""
    figure, axes = plt.subplots()
    diagrams.draw(axes, scheme(name))
    wires = [line.get_xydata() for line in axes.lines if line.get_linewidth() == 1.3]
    assert len(wires) == len(scheme(name).signals)
    for points in wires:
        assert np.all(np.min(np.abs(np.diff(points, axis=0)), axis=1) < 1e-9)
    plt.close(figure)


def test_a_wire_to_the_motor_ends_on_its_circle():
    block = diagrams.Block("motor", "dfim", "DFIM", 3.0, 2.0)
    for towards in ((0.0, 2.3), (6.0, 1.6), (3.4, 5.0), (2.7, -1.0)):
        x, y = diagrams._end(block, towards)
        assert np.hypot(x - 3.0, y - 2.0) == pytest.approx(block.extent[0] / 2)


@pytest.mark.parametrize("machine", DFIM_SETS.values(), ids=DFIM_SETS.keys())
@given(omega_m=st.floats(-200, 200), omega_s=st.floats(-400, 400), phi_r=st.floats(0.1, 1.5), T_e=st.floats(-30, 30))
def test_the_solved_machines_flux_lies_on_d(machine, omega_m, omega_s, phi_r, T_e):
    found = orientation.oriented_vectors(machine, omega_m, T_e, phi_r, omega_s, 0.9, 0.4)
    assert abs(found.misalignment) < 1e-6
    assert abs(found.phi_r) == pytest.approx(phi_r, rel=1e-6)
    assert found.theta_s == pytest.approx(found.theta_m + found.theta_r)


@pytest.mark.parametrize("machine", DFIM_SETS.values(), ids=DFIM_SETS.keys())
def test_one_current_stays_free(machine):
    """What is free is i_rd: with i_sd lowered by (L_r/M) i_rd, rotor flux and torque stay as they were."""
    assert orientation.free_currents(machine, 0.85, machine.T_rated) == 1
    i_sd, i_sq, i_rd, i_rq = dfim_decoupling.current_references(machine.T_rated, 0.85, machine)
    for more in (0.0, 3.0):
        i_s, i_r = complex(i_sd - machine.L_r / machine.M * more, i_sq), complex(i_rd + more, i_rq)
        phi_r = dfim.flux_linkages(i_s, i_r, machine)[1]
        assert phi_r == pytest.approx(0.85, abs=1e-9)
        assert dfim.electromagnetic_torque(phi_r.real, phi_r.imag, i_s.real, i_s.imag, machine) == pytest.approx(machine.T_rated)


@pytest.mark.parametrize("machine", DFIM_SETS.values(), ids=DFIM_SETS.keys())
def test_without_compensation_the_response_is_the_impedance_matrix(machine):
    """The same machine from its complex impedances: V_t by (12) from Z(s) i, in a frame at rest to the stator."""
    omega, omega_m, omega_s = np.array([3.0, 60.0, 900.0]), 80.0, 40.0
    found = current_response(machine, omega, omega_m, omega_s, compensated=False)
    for response, w in zip(found, omega, strict=True):
        s, omega_r = 1j * w, omega_s - machine.p * omega_m
        turn = np.array([[0, -1], [1, 0]])
        stator, rotor = s * np.eye(2) + omega_s * turn, s * np.eye(2) + omega_r * turn
        impedance = np.block([
            [machine.R_s * np.eye(2) + machine.L_s * stator, machine.M * stator],
            [machine.M * rotor, machine.R_r * np.eye(2) + machine.L_r * rotor],
        ])  # fmt: skip
        combine = np.kron([[1, -machine.M / machine.L_r], [-machine.M / machine.L_s, 1]], np.eye(2))
        assert np.linalg.inv(combine @ impedance) == pytest.approx(response, rel=1e-6, abs=1e-9)


def test_with_compensation_only_the_lags_are_left():
    omega = np.logspace(0, 4, 9)
    found = current_response(DFIM_4KW, omega, 157.0, 170.0)
    wanted = np.zeros_like(found)
    for k, winding in enumerate("ssrr"):
        wanted[:, k, k] = first_order_lag(DFIM_4KW, omega, winding=winding)
    assert np.abs(found - wanted).max() < 1e-9


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: current_response(DFIM_4KW, np.array([np.nan]), 1.0, 1.0), "omega"),
        (lambda: current_response(DFIM_4KW, np.array([1.0]), np.inf, 1.0), "omega_m"),
        (lambda: current_response(DFIM_4KW, np.array([1.0]), 1.0, 1.0, R_r_factor=0.0), "R_r_factor"),
        (lambda: first_order_lag(DFIM_4KW, np.array([1.0]), winding="x"), "winding"),
        (lambda: orientation.oriented_vectors(DFIM_4KW, 1.0, 1.0, -1.0, 1.0, 0.0, 0.0), "phi_r"),
        (lambda: orientation.free_currents(DFIM_4KW, 0.85, np.nan), "T_e"),
    ],
)
def test_bad_input_is_named(call, name):
    with pytest.raises(ValueError, match=rf"^{name}"):
        call()
