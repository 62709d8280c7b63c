"""Least copper loss of a DFIM against brute force, a general minimiser and a formulation without a frame; then the map, and bad input."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from drivelib import dfim, dfim_decoupling, dfim_map, dfim_optimum, loss_map
from drivelib.dfim_machines import DFIM_1500W, DFIM_4KW, DFIM_GYM
from drivelib.dfim_optimum import DfimLimits
from drivelib.training import NotConverged

MACHINES = (DFIM_4KW, DFIM_1500W, DFIM_GYM)
LIMITS = DfimLimits(phi_r=0.85, V_s=250.0, V_r=200.0, I_s=14.0, I_r=13.0)
SPEED, TORQUE = np.linspace(15, 300, 9), np.linspace(2.5, 25.5, 7)
machines = st.sampled_from(MACHINES)


def vectors(machine, omega_m, omega_s, i_s, i_r):
    """Return torque, loss, |φ_r|, |v_s|, |v_r|: current vectors alone, no orientation; torque from the currents' angle."""
    phi_s, phi_r = machine.L_s * i_s + machine.M * i_r, machine.L_r * i_r + machine.M * i_s
    v_s = machine.R_s * i_s + 1j * omega_s * phi_s
    v_r = machine.R_r * i_r + 1j * (omega_s - machine.p * omega_m) * phi_r
    torque = 1.5 * machine.p * machine.M * np.imag(np.conj(i_r) * i_s)
    return torque, 1.5 * (machine.R_s * abs(i_s) ** 2 + machine.R_r * abs(i_r) ** 2), abs(phi_r), abs(v_s), abs(v_r)


@pytest.mark.parametrize("machine", MACHINES, ids=lambda m: m.name)
@pytest.mark.parametrize("T_e", [0.5, 8.0, 25.5])
def test_without_limits_no_currents_make_the_torque_with_less_loss(machine, T_e):
    """Lengths and angle of two vectors, searched by a general minimiser from many starts; and the closed form's own properties."""
    least = dfim_optimum.least_loss(machine, T_e)

    def loss(z):
        angle = np.pi * (0.5 + 0.49 * np.tanh(z[1]))
        i_s = np.exp(z[0])
        i_r = T_e / (1.5 * machine.p * machine.M * i_s * np.sin(angle))
        return vectors(machine, 0.0, 0.0, i_s * np.exp(1j * angle), i_r)[1]

    rng = np.random.default_rng(4)
    found = [minimize(loss, rng.normal(size=2), method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12, "maxiter": 2000}).fun for _ in range(5)]
    assert abs(min(found) / least - 1) < 1e-6 and min(found) >= least * (1 - 1e-12)
    phi_r = dfim_optimum.free_flux(machine, T_e)
    i_rd = dfim_optimum.free_i_rd(machine, phi_r)
    i_sd, i_sq, i_rq = dfim_optimum.currents(machine, T_e, phi_r, i_rd)
    i_s, i_r = i_sd + 1j * i_sq, i_rd + 1j * i_rq
    torque, at, flux, *_ = vectors(machine, 0.0, 0.0, i_s, i_r)
    assert np.allclose([torque, at, flux], [T_e, least, phi_r], rtol=1e-12)
    assert np.isclose(machine.R_s * abs(i_s) ** 2, machine.R_r * abs(i_r) ** 2, rtol=1e-12)
    assert abs((np.conj(i_s) * i_r).real) < 1e-12 * abs(i_s) * abs(i_r)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(machines, st.floats(0, 400), st.floats(0.1, 30), st.floats(0.2, 1.2), st.floats(40, 350), st.floats(40, 350), st.floats(3, 20), st.floats(3, 20))
def test_inside_the_limits_brute_force_finds_nothing_better(machine, omega_m, T_e, phi, V_s, V_r, I_s, I_r):
    """A grid over flux and rotor d current: no point of it is inside where ours is infeasible, and none has less loss."""
    limits = DfimLimits(phi, V_s, V_r, I_s, I_r)
    best = dfim_optimum.optimum(machine, omega_m, T_e, limits)
    omega_s = dfim_optimum.stator_frequency(machine, omega_m, T_e, limits)
    flux, i_rd = np.meshgrid(phi * np.linspace(5e-3, 1, 200), I_r * np.linspace(-1, 1, 201), indexing="ij")
    i_sq = machine.L_r * T_e / (1.5 * machine.p * machine.M * flux)
    i_s, i_r = (flux - machine.L_r * i_rd) / machine.M + 1j * i_sq, i_rd - 1j * machine.M / machine.L_r * i_sq
    torque, loss, size, v_s, v_r = vectors(machine, omega_m, omega_s, i_s, i_r)
    assert np.allclose(torque, T_e)
    inside = (size <= phi * (1 + 1e-12)) & (v_s <= V_s) & (v_r <= V_r) & (abs(i_s) <= I_s) & (abs(i_r) <= I_r)
    if inside.any():
        assert best.feasible and best.loss <= loss[inside].min() * (1 + 1e-9)
    if best.feasible:
        own = vectors(machine, omega_m, best.omega_s, best.i_sd + 1j * best.i_sq, best.i_rd + 1j * best.i_rq)
        assert np.allclose(own[:2], [T_e, best.loss], rtol=1e-9)
        assert np.allclose(own[3:], [best.V_s, best.V_r], rtol=1e-9)
        assert np.all(np.array(own[2:]) <= np.array([phi, V_s, V_r]) * (1 + 2e-9))
        assert max(np.hypot(best.i_sd, best.i_sq) / I_s, np.hypot(best.i_rd, best.i_rq) / I_r) <= 1 + 2e-9


def test_the_optimum_inside_the_limits_is_that_of_a_general_solver():
    """SLSQP on the currents' four components with the torque as equation, from our point and from others."""
    for omega_m, T_e in ((280.0, 20.0), (320.0, 12.0), (400.0, 8.0)):
        best = dfim_optimum.optimum(DFIM_4KW, omega_m, T_e, LIMITS)
        assert best.limited and best.feasible

        def made(z, omega_m=omega_m, best=best):
            return vectors(DFIM_4KW, omega_m, float(best.omega_s), z[0] + 1j * z[1], z[2] + 1j * z[3])

        def inside(z):
            flux, v_s, v_r = made(z)[2:]
            return 1 - np.array([flux / LIMITS.phi_r, v_s / LIMITS.V_s, v_r / LIMITS.V_r, np.hypot(*z[:2]) / LIMITS.I_s, np.hypot(*z[2:]) / LIMITS.I_r])

        constraints = [{"type": "eq", "fun": lambda z, T_e=T_e, made=made: made(z)[0] / T_e - 1}, {"type": "ineq", "fun": inside}]
        found = []
        for start in ([3.0, 9.0, 2.0, -9.0], [1.0, 6.0, 1.0, -6.0], [float(v) for v in (best.i_sd, best.i_sq, best.i_rd, best.i_rq)]):
            done = minimize(lambda z, made=made: made(z)[1] / 100, start, method="SLSQP", constraints=constraints, options={"ftol": 1e-12, "maxiter": 500})
            if done.success:
                found.append(100 * done.fun)
        assert found and abs(min(found) / best.loss - 1) < 1e-6


def test_where_the_limits_leave_room_the_closed_form_stands():
    wide = DfimLimits(10.0, 1e4, 1e4, 1e3, 1e3)
    best = dfim_optimum.optimum(DFIM_4KW, 100.0, TORQUE, wide)
    assert np.allclose(best.loss, dfim_optimum.least_loss(DFIM_4KW, TORQUE), rtol=1e-12)
    assert not best.limited.any() and not best.capped.any()
    tight = dfim_optimum.optimum(DFIM_4KW, 100.0, TORQUE, DfimLimits(0.85, 1e4, 1e4, 1e3, 1e3))
    assert np.array_equal(tight.capped, dfim_optimum.free_flux(DFIM_4KW, TORQUE) > 0.85) and tight.capped.any() and not tight.capped.all()
    assert np.all(tight.phi_r[tight.capped] == 0.85)


@pytest.mark.parametrize("machine", MACHINES, ids=lambda m: m.name)
def test_both_inverters_are_equally_near_what_the_resistances_leave_them(machine):
    """In the free optimum: flux linkages and frequencies against voltages less the drop of the torque currents."""
    wide = DfimLimits(0.5, 250.0, 200.0, 1e3, 1e3)
    for T_e in (0.01, 5.0):
        best = dfim_optimum.optimum(machine, 50.0, T_e, wide)
        assert not best.limited
        phi_s, phi_r = dfim.flux_linkages(best.i_sd + 1j * best.i_sq, best.i_rd + 1j * best.i_rq, machine)
        omega_r = best.omega_s - machine.p * 50.0
        stator = best.omega_s * phi_s.real / (wide.V_s - machine.R_s * best.i_sq)
        assert np.isclose(stator, -omega_r * phi_r.real / (wide.V_r - machine.R_r * abs(best.i_rq)), rtol=1e-12)


def test_no_torque_needs_no_flux_and_standstill_is_a_speed():
    best = dfim_optimum.optimum(DFIM_4KW, [0.0, 50.0], 0.0, LIMITS)
    assert np.all(best.feasible) and np.all(best.loss < 1e-12)
    assert dfim_optimum.optimum(DFIM_4KW, 0.0, 20.0, LIMITS).feasible


def test_the_voltages_hold_the_plant_still():
    """Fed with v = R i + jωφ, the equations of motion (6)-(9) have no derivative."""
    best = dfim_optimum.optimum(DFIM_4KW, 120.0, 18.0, LIMITS)
    phi_s, phi_r = dfim.flux_linkages(best.i_sd + 1j * best.i_sq, best.i_rd + 1j * best.i_rq, DFIM_4KW)
    v_s = DFIM_4KW.R_s * (best.i_sd + 1j * best.i_sq) + 1j * best.omega_s * phi_s
    v_r = DFIM_4KW.R_r * (best.i_rd + 1j * best.i_rq) + 1j * (best.omega_s - 240.0) * phi_r
    assert np.allclose([abs(v_s), abs(v_r)], [best.V_s, best.V_r], rtol=1e-12)
    d = dfim.dfim_derivatives(
        phi_s.real, phi_s.imag, phi_r.real, phi_r.imag, 120.0, v_s.real, v_s.imag, v_r.real, v_r.imag, best.omega_s, 18.0, DFIM_4KW.R_r, dfim.coefficients(DFIM_4KW.changed(f=0.0))
    )
    assert np.max(np.abs(d)) < 1e-9


@pytest.fixture(scope="module")
def found():
    return dfim_map.dfim_map(DFIM_4KW, SPEED, TORQUE, DfimLimits(0.85, 170.0, 150.0, 12.0, 12.0))


def test_the_map_says_what_is_in_reach(found):
    assert 0 < found.reachable < 1 and found.best.limited.any()
    assert np.array_equal(found.best.feasible, TORQUE[None, :] <= found.T_max[:, None])
    ends = (found.T_max < TORQUE[-1]) & np.isfinite(found.T_max)
    for factor, wanted in ((1 - 1e-7, True), (1 + 1e-6, False)):
        assert np.all(found.optimum(SPEED[ends], found.T_max[ends] * factor).feasible == wanted)


def test_a_networks_error_is_none_for_the_optimum_and_some_for_the_papers_references(found):
    def exact(x):
        best = found.optimum(x[..., 0], x[..., 1])
        return np.stack([np.where(best.feasible, best.phi_r, 1.0), np.nan_to_num(best.i_rd)], axis=-1)

    error = dfim_map.network_error(found, exact, 1.0)
    assert np.nanmax(np.abs(error.excess)) < 1e-6 and np.nanmax(error.beyond) < 1e-8
    assert np.array_equal(np.isnan(error.excess), ~found.best.feasible)

    def paper(x):
        return np.stack([np.full(x.shape[:-1], 0.85), np.zeros(x.shape[:-1])], axis=-1)

    error = dfim_map.network_error(found, paper, 1.0)
    point = dfim_decoupling.oriented_steady_state(float(SPEED[0]), float(TORQUE[0]), 0.85, 10.0, DFIM_4KW)
    wanted = vectors(DFIM_4KW, SPEED[0], 10.0, point.i_s, point.i_r)[1]
    assert np.isclose(dfim_map.paper_loss(DFIM_4KW, TORQUE[0], 0.85), wanted, rtol=1e-12)
    assert np.isclose(error.excess[0, 0], wanted - found.best.loss[0, 0], rtol=1e-9)
    assert np.all(error.excess[(error.beyond == 0) & np.isfinite(error.excess)] > 0) and np.nanmax(error.beyond) > 0.01


def test_sharing_the_speed_otherwise_never_costs_more(found):
    """Brute force at one point: the least over all splits of the grid is what is returned."""
    least = dfim_map.best_split(found, 21)
    inside = found.best.feasible
    assert np.all(least[inside] <= found.best.loss[inside] * (1 + 1e-9))
    row, column = np.argwhere(found.best.limited)[-1]
    tried = [dfim_optimum.optimum(DFIM_4KW, SPEED[row], TORQUE[column], found.limits, omega_s=share * 2 * SPEED[row]).loss for share in np.linspace(0, 1, 21)]
    assert np.isclose(least[row, column], min(np.nanmin(tried), found.best.loss[row, column]), rtol=1e-9)


def test_a_network_learns_the_map_or_is_not_handed_out(found):
    data = loss_map.training_data(found, 16)
    assert data.targets == ("phi_r", "i_rd") and np.isfinite(data.t).all()
    limit = loss_map.torque_limit(found, data.x[:, 0], 0.95)
    assert np.all(data.x[:, 1] <= limit * (1 + 1e-9))
    with pytest.raises(NotConverged):
        loss_map.trained(data, hidden=1, starts=2, rms_percent=0.01)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: DfimLimits(0.85, -1.0, 300.0, 16.0, 16.0), "limit V_s = -1.0 V: must be a finite number above 0 V"),
        (lambda: DfimLimits(np.nan, 1.0, 300.0, 16.0, 16.0), "limit phi_r = nan Wb"),
        (lambda: DFIM_4KW.changed(R_r=-1.8), "R_r = -1.8 ohm"),
        (lambda: DFIM_4KW.changed(M=0.16), r"M = 0.16 H: must be below sqrt\(L_s L_r\)"),
        (lambda: dfim_optimum.optimum(DFIM_4KW.changed(R_r=0.0), 1.0, 1.0, LIMITS), "R_r = 0.0 ohm"),
        (lambda: dfim_optimum.optimum(DFIM_4KW, -1.0, 1.0, LIMITS), "omega_m = -1.0 rad/s"),
        (lambda: dfim_optimum.optimum(DFIM_4KW, 1.0, [1.0, np.inf], LIMITS), "T_e = inf N m"),
        (lambda: dfim_optimum.optimum(DFIM_4KW, 1.0, 1.0, LIMITS, omega_s=-3.0), "omega_s = -3.0 rad/s"),
        (lambda: dfim_optimum.currents(DFIM_4KW, 1.0, 0.0, 0.0), "phi_r = 0.0 Wb"),
        (lambda: dfim_map.dfim_map(DFIM_4KW, [100, 200], [400.0, 500.0], LIMITS), "DFIM 4 kW: no point of 100 to 200 rad/s and 400 to 500 N m"),
        (lambda: dfim_map.dfim_map(DFIM_4KW, [200, 100], [1.0, 2.0], LIMITS), "must be sorted"),
        (lambda: dfim_map.dfim_map(DFIM_4KW, [-5, 100], [1.0, 2.0], LIMITS), "omega_m = -5"),
    ],
)
def test_bad_input_names_parameter_value_and_unit(call, message):
    with pytest.raises(ValueError, match=message):
        call()
