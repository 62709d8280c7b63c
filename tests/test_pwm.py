"""Switching inverters: volt-seconds, instants and waveforms against brute force, and their averaged limit."""

import numpy as np
import pytest
from abc_machine import AbcMachine, vector
from hypothesis import given, settings
from hypothesis import strategies as st

from drivelib import dfim, pwm
from drivelib.dfim_drive import simulate
from drivelib.dfim_machines import DFIM_4KW
from drivelib.dfim_scenario import DEFAULT_SCENARIO

V_DC = 560.0
angles = st.floats(-np.pi, np.pi)


def carrier(t, frequency):
    """Triangle, +1 at t = 0."""
    return 2 * np.abs(2 * ((t * frequency) % 1.0) - 1) - 1


@settings(deadline=None)  # the first call compiles
@given(st.floats(0, V_DC / np.sqrt(3)), angles)
def test_duties_fit_the_carrier_up_to_the_linear_limit_and_give_the_vector(size, angle):
    """Every vector up to V_dc/√3 keeps its duties within ±1, and their phase voltages are the vector."""
    v = size * np.exp(1j * angle)
    duty = np.array(pwm.duties(v.real, v.imag, V_DC))
    assert np.abs(duty).max() <= 1 + 1e-12
    assert vector(duty * V_DC / 2) == pytest.approx(v, abs=1e-9)


@settings(deadline=None)
@given(st.floats(0, 320), angles, st.floats(0, 320), angles)
def test_a_carrier_ramp_gives_the_mean_that_was_asked_for(size_s, angle_s, size_r, angle_r):
    """Vectors between the instants, weighted with their durations, average to the references of both inverters."""
    v = [size_s * np.exp(1j * angle_s), size_r * np.exp(1j * angle_r)]
    duty = [pwm.duties(x.real, x.imag, V_DC) for x in v]
    for first, slope in ((1.0, -2e4), (-1.0, 2e4)):
        instants = np.empty(6)
        n = pwm.switching_instants(duty[0], duty[1], 0.0, 1e-4, first, slope, instants)
        bounds = np.concatenate([[0.0], instants[:n], [1e-4]])
        assert np.all(np.diff(bounds) >= 0)
        for x, d in zip(v, duty, strict=True):
            mean = 0j
            for a, b in zip(bounds[:-1], bounds[1:], strict=True):
                mean += complex(*pwm.switched_vector(d, first + slope * (a + b) / 2, V_DC)) * (b - a) / 1e-4
            assert mean == pytest.approx(x, abs=1e-6)


@pytest.mark.parametrize("frequency", [1000.0, 5000.0, 7300.0, 20000.0])
def test_one_period_agrees_with_three_phase_windings_and_a_searched_switching_pattern(frequency):
    """The comparators sampled densely and their edges bisected; six windings integrated from edge to edge by DOP853."""
    m, h, t0, theta_s, theta_m, omega_s, omega_m = DFIM_4KW, 1e-4, 0.01234, 0.7, 2.3, 150.0, 140.0
    v_s, v_r = 120 + 90j, -60 - 130j
    i_s, i_r = 5.7 + 8j, 0.3 - 7.5j
    phi = dfim.flux_linkages(i_s, i_r, m)
    extremes = np.array([np.inf, -np.inf])
    got = pwm.switched_period(
        phi[0].real, phi[0].imag, phi[1].real, phi[1].imag, omega_m, v_s.real, v_s.imag, v_r.real, v_r.imag, omega_s,
        20.0, m.R_r, h, dfim.coefficients(m), theta_s, theta_m, t0, frequency, V_DC, 400.0, np.empty(6), extremes,
    )  # fmt: skip

    middle_s = theta_s + omega_s * h / 2
    middle_r = middle_s - m.p * (theta_m + omega_m * h / 2)
    duty = []
    for u, V in ((v_s * np.exp(1j * middle_s), V_DC), (v_r * np.exp(1j * middle_r), 400.0)):
        three = np.real(u * np.exp(-2j * np.pi / 3 * np.arange(3)))
        duty.append((three - (three.max() + three.min()) / 2) * 2 / V)
    duty = np.concatenate(duty)

    def on(t):
        return duty > carrier(t0 + t, frequency)

    times = np.linspace(0, h, 4001)
    edges = [0.0]
    for a, b in zip(times[:-1], times[1:], strict=True):
        while np.any(on(a) != on(b)):
            low, high = a, b
            while high - low > 1e-16 and low < (low + high) / 2 < high:
                mid = (low + high) / 2
                low, high = (mid, high) if np.all(on(mid) == on(low)) else (low, mid)
            edges.append(high)
            a = high
    edges.append(h)
    assert len(edges) > 2
    windings = AbcMachine(m)
    x = windings.initial(i_s, i_r, omega_m, theta_s, m.p * theta_m)
    torques = []
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        state = on((a + b) / 2)
        u_s, u_r = (V * (part - part.mean()) for V, part in ((V_DC, 1.0 * state[:3]), (400.0, 1.0 * state[3:])))
        if b - a > 1e-13:
            x = windings.run(x, np.array([a, b]), lambda t, u=u_s: u, lambda t, u=u_r: u, 20.0)[-1]
        torques.append(windings.torque(windings.currents(x), x[7]))
    i = windings.currents(x)
    end_s, end_r = dfim.currents(complex(got[0], got[1]), complex(got[2], got[3]), m)
    assert end_s == pytest.approx(vector(i[:3], theta_s + omega_s * h), abs=1e-6)
    assert end_r == pytest.approx(vector(i[3:], theta_s + omega_s * h - x[7]), abs=1e-6)
    assert got[4] == pytest.approx(x[6], abs=1e-8)
    assert theta_m + omega_m * h + got[5] == pytest.approx(x[7] / m.p, abs=1e-10)
    assert extremes == pytest.approx((min(torques), max(torques)), abs=1e-5)


def test_switching_tends_to_the_averaged_inverter_as_the_carrier_rises():
    """Same drive, carriers at 1, 4 and 16 times the sampling rate: the speeds close in, and the torque's ripple falls as 1/f."""
    base = DEFAULT_SCENARIO.changed(duration=0.4, speed_reference=((0.0, 30.0),), load_torque=((0.0, 0.0), (0.2, 25.0)))
    mean = simulate(base)
    gaps, ripples = [], []
    for f in (10e3, 40e3, 160e3):
        run = simulate(base.changed(inverter="switching", carrier_frequency=f))
        gaps.append(np.abs(run["omega_m"] - mean["omega_m"]).max())
        ripples.append(np.mean((run["T_max"] - run["T_min"])[-1000:-1]))
        assert np.all(run["T_min"] <= run["T_e"]) and np.all(run["T_e"] <= run["T_max"])
    assert gaps[0] > 3 * gaps[1] > 9 * gaps[2]
    assert ripples[0] / ripples[1] == pytest.approx(4, rel=0.2)


def test_a_slow_carrier_still_holds_speed_and_its_ripple_shows():
    """1 kHz under 10 kHz sampling, as in the public model: the mean speed is held, the torque ripples by newton metres."""
    base = DEFAULT_SCENARIO.changed(duration=1.5, speed_reference=((0.0, 30.0),), load_torque=((0.0, 0.0), (0.5, 25.0)))
    run = simulate(base.changed(inverter="switching", carrier_frequency=1000.0))
    assert np.mean(run["omega_m"][-2000:]) == pytest.approx(30.0, abs=0.1)
    assert run["T_max"][-2000:-1].max() - run["T_min"][-2000:-1].min() > 2.0
    fast = simulate(base.changed(inverter="switching"))
    assert np.ptp(fast["T_e"][-2000:]) < np.ptp(run["T_e"][-2000:])
