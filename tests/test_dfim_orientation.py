"""Orientation, decoupling and the frequency law in the closed drive: what is left of them, and what drifts."""

import numpy as np
import pytest

from drivelib import dfim, dfim_decoupling
from drivelib.dfim_drive import drive_settings, initial_state, schedule, simulate
from drivelib.dfim_loop import STATES, empty_record, run_drive
from drivelib.dfim_machines import DFIM_SETS
from drivelib.dfim_scenario import DEFAULT_SCENARIO, Scenario
from drivelib.encoder import sensor
from drivelib.speed_law import NetworkSpeed, PiSpeed

SHORT = DEFAULT_SCENARIO.changed(
    name="short", duration=0.5, speed_reference=((0.0, 40.0),), load_torque=((0.0, 0.0), (0.3, 25.0))
)


def constant_torque(T):
    """A network whose output is its bias."""
    return NetworkSpeed(W1=np.zeros((1, 1)), B1=np.zeros(1), W2=np.zeros(1), B2=T)


@pytest.mark.parametrize("omega_r", [12.6, -60.0])
def test_torque_and_speed_do_not_depend_on_the_frequency_law(omega_r):
    """What differs is due to sampling alone: it falls with the period. The inverters' voltages do differ."""
    gaps = []
    for period in (1e-4, 5e-5):
        equal = simulate(SHORT.changed(period=period))
        constant = simulate(SHORT.changed(period=period, frequency_law="constant rotor frequency", omega_r_constant=omega_r))
        voltages = [np.hypot(run["v_rd"], run["v_rq"])[-1] for run in (equal, constant)]
        assert abs(voltages[0] - voltages[1]) > 10.0
        assert np.abs(equal["omega_m"] - constant["omega_m"]).max() < 1e-3
        gaps.append(np.abs(equal["T_e"] - constant["T_e"]).max())
    assert gaps[0] < 1e-3 * SHORT.T_limit
    assert gaps[0] / gaps[1] == pytest.approx(2.0, rel=0.15)


@pytest.mark.parametrize("machine", DFIM_SETS.values(), ids=DFIM_SETS.keys())
def test_equation_15_is_what_results(machine):
    """A torque step from rest: both q currents rise as 1 − exp(−αt), the d currents stay, and the gap halves with the period."""
    T, alpha, phi = 0.5 * machine.T_rated, 500.0, 0.5
    references = dfim_decoupling.current_references(T, phi, machine)
    gaps = []
    for period in (2e-5, 1e-5):
        scenario = Scenario(
            machine=machine, phi_r_ref=phi, current_bandwidth=alpha, period=period, duration=0.02, T_limit=2 * T,
            speed_reference=((0.0, 0.0),), load_torque=((0.0, 0.0),), V_dc_s=2000.0, V_dc_r=2000.0,
        )  # fmt: skip
        run = simulate(scenario, constant_torque(T))
        rise = 1 - np.exp(-alpha * run.t)
        expected = (references[0], references[1] * rise, 0.0, references[3] * rise)
        found = (run["i_sd"], run["i_sq"], run["i_rd"], run["i_rq"])
        gaps.append(max(np.abs(a - b).max() for a, b in zip(found, expected, strict=True)) / references[1])
    assert gaps[0] < 0.5 * alpha * 2e-5
    assert gaps[0] / gaps[1] == pytest.approx(2.0, abs=0.3)


def test_the_frame_does_not_drift():
    """A minute under load: the flux correction adds nothing to the frame's angle once the start is over."""
    scenario = SHORT.changed(duration=60.0, speed_reference=((0.0, 100.0),))
    run = simulate(scenario, every=10)
    correction = run["omega_s"] - 0.5 * scenario.machine.p * run["omega_m"]
    late = run.t > 2.0
    assert np.abs(correction[~late]).max() > 1e-3  # it did act during the start
    assert np.abs(correction[late]).max() < 1e-9
    assert np.abs(run["phi_rq"][late]).max() < 1e-10


def test_integrators_set_against_each_other_unwind():
    """Opposite offsets in the q integrators, in the ratio that a locked frame could not see, die out."""
    scenario = SHORT.changed(duration=2.0, load_torque=((0.0, 10.0),))
    x = initial_state(scenario)
    free = simulate(scenario)
    speed = PiSpeed(*scenario.speed_gains).law()
    x[STATES.index("u_sq")], x[STATES.index("u_rq")] = 20.0, -20.0
    changes, profiles = schedule(scenario)
    record = empty_record(scenario.steps, 1)
    failed = run_drive(
        scenario.steps, x, dfim.coefficients(scenario.machine), drive_settings(scenario), speed, changes, profiles,
        (0, 1), 1, record, np.zeros(4), np.full(5, -1), sensor(None, 0, scenario.period),
    )  # fmt: skip
    assert failed == -1
    q = free.channels.index("phi_rq")
    assert np.abs(record[:200, q]).max() > 0.01
    physical = [j for j, name in enumerate(free.channels) if not name.startswith("theta")]  # no angle matters to the motor
    assert np.abs(record[-1] - free.data[-1])[physical].max() < 1e-6


def test_wrong_rotor_resistance_leaves_the_disturbance_that_is_derived_and_nothing_in_the_end():
    """R_r + 50 % under load: the currents leave with d/(σL) per second, the integrators bring them back.

    Back to the same samples but for how currents curve between samples, some (α h)² of the disturbance.
    """
    scenario = SHORT.changed(duration=5.0, rotor_resistance=((0.0, 1.0), (3.0, 1.5)))
    run, m, k = simulate(scenario), scenario.machine, 30000
    i_s, i_r = (run["i_sd"] + 1j * run["i_sq"])[k:], (run["i_rd"] + 1j * run["i_rq"])[k:]
    d_s, d_r = dfim_decoupling.resistance_error_voltages(i_s[0], i_r[0], 0.0, 0.5 * m.R_r, m)
    h = scenario.period
    assert i_s[1] - i_s[0] == pytest.approx(h * d_s / (m.sigma * m.L_s), rel=0.02)
    assert i_r[1] - i_r[0] == pytest.approx(h * d_r / (m.sigma * m.L_r), rel=0.02)
    disturbed = np.abs(i_s - i_s[0]).max()
    assert disturbed > 0.05 and abs(i_s[-1] - i_s[0]) + abs(i_r[-1] - i_r[0]) < 1e-4 * disturbed
    assert np.abs(run["omega_m"][k:] - 40.0).max() > 1e-4


@pytest.mark.parametrize("factor", [1.0, 1.5])
def test_rotor_voltage_model_errs_as_derived(factor):
    """(jω_r + corner)(φ̂ − φ) = (R_r − R̂_r) i_r in steady state; the trapezoid adds (ω_r h)²/12."""
    scenario = SHORT.changed(
        flux_estimator="rotor voltage model", orientation_bandwidth=0.0, duration=4.0, rotor_resistance=((0.0, factor),)
    )
    run, m = simulate(scenario), scenario.machine
    i_r = run["i_rd"][-1] + 1j * run["i_rq"][-1]
    gap = run["phi_hat_d"][-1] - run["phi_rd"][-1] + 1j * (run["phi_hat_q"][-1] - run["phi_rq"][-1])
    expected = (factor - 1) * m.R_r * i_r / (1j * run["omega_r"][-1] + scenario.estimator_corner)
    assert gap == pytest.approx(expected, abs=2e-3 * abs(m.R_r * i_r / run["omega_r"][-1]))


def test_rotor_voltage_model_follows_the_flux_through_magnetising_and_load():
    """With the right resistance, from no current at all; without the corner, so that nothing else corrects it."""
    run = simulate(SHORT.changed(flux_estimator="rotor voltage model", estimator_corner=0.0, start="at rest"))
    assert run["phi_rd"][0] == 0.0 and run["phi_rd"][-1] == pytest.approx(0.85, rel=1e-3)
    for axis in "dq":
        assert np.abs(run[f"phi_hat_{axis}"] - run[f"phi_r{axis}"]).max() < 0.01 * 0.85
