"""The compiled drive against three-phase windings, closed forms and its own limits."""

import numpy as np
import pytest
from abc_machine import AbcMachine, phases, vector
from scipy.integrate import solve_ivp

from drivelib import dfim
from drivelib.dfim_drive import SimulationDiverged, simulate
from drivelib.dfim_machines import DFIM_4KW, DFIM_SETS
from drivelib.dfim_plant import averaged_period
from drivelib.dfim_scenario import DEFAULT_SCENARIO, Scenario
from drivelib.fuzzy import fuzzy_output
from drivelib.speed_law import FuzzySpeed, NetworkSpeed, speed_command

SHORT = DEFAULT_SCENARIO.changed(
    name="short", duration=0.5, speed_reference=((0.0, 40.0),), load_torque=((0.0, 0.0), (0.3, 25.0))
)


def held(v_s, v_r, angle_s, angle_r):
    """Phase voltages that both inverters hold over one period."""
    s, r = phases(v_s, angle_s), phases(v_r, angle_r)
    return lambda t: s, lambda t: r


@pytest.mark.parametrize("law", ["equal split", "constant rotor frequency"])
def test_closed_loop_agrees_with_three_phase_windings(law):
    """The same controller written in complex vectors, sampling six windings that DOP853 integrates at rtol 1e-10."""
    scenario = SHORT.changed(
        frequency_law=law, duration=0.03, load_torque=((0.0, 0.0), (0.02, 25.0)), rotor_resistance=((0.0, 1.0), (0.01, 1.5))
    )
    run = simulate(scenario)
    m, h, alpha = scenario.machine, scenario.period, scenario.current_bandwidth
    K_p, K_i = 2 * scenario.xi * scenario.omega_n * m.J - m.f, m.J * scenario.omega_n**2
    sigma = 1 - m.M**2 / (m.L_s * m.L_r)
    i_sd = 0.85 / m.M
    x, theta_s = AbcMachine(m).initial(i_sd, 0.0, 0.0), 0.0
    speed_integral, u_s, u_r = 0.0, complex(m.R_s * i_sd), 0j
    for k in range(scenario.steps):
        t = k * h
        windings = AbcMachine(m, R_r=m.R_r * (1.5 if t > 0.01 - h / 2 else 1.0))
        i, omega_m = windings.currents(x), x[6]
        i_s, i_r = vector(i[:3], theta_s), vector(i[3:], theta_s - x[7])
        phi = m.L_r * i_r + m.M * i_s
        law_share = m.p * omega_m / 2 if law == "equal split" else m.p * omega_m + scenario.omega_r_constant
        omega_s = law_share + scenario.orientation_bandwidth * phi.imag / phi.real
        omega_r = omega_s - m.p * omega_m
        assert run["omega_m"][k] == pytest.approx(omega_m, abs=3e-8)
        assert run["theta_m"][k] == pytest.approx(x[7] / m.p, abs=1e-9)  # 0.03 s of 3e-8 rad/s
        assert complex(run["i_sd"][k], run["i_sq"][k]) == pytest.approx(i_s, abs=1e-6)
        assert complex(run["i_rd"][k], run["i_rq"][k]) == pytest.approx(i_r, abs=1e-6)
        assert run["T_e"][k] == pytest.approx(windings.torque(i, x[7]), abs=1e-5)
        e = 40.0 - omega_m
        asked = K_p * e + speed_integral
        torque = np.clip(asked, -51.0, 51.0)
        speed_integral += h * (K_i * e + K_i / K_p * (torque - asked))
        i_q = torque / (1.5 * m.p * m.M / m.L_r * phi.real)
        e_s, e_r = i_sd + 1j * i_q - i_s, -1j * m.M / m.L_r * i_q - i_r
        phi_s = m.L_s * i_s + m.M * i_r
        own_s, own_r = 1j * omega_s * phi_s, 1j * omega_r * phi
        v_ts = alpha * sigma * m.L_s * e_s + u_s + own_s - m.M / m.L_r * (m.R_r * i_r + own_r)
        v_tr = alpha * sigma * m.L_r * e_r + u_r + own_r - m.M / m.L_s * (m.R_s * i_s + own_s)
        u_s, u_r = u_s + h * alpha * m.R_s * e_s, u_r + h * alpha * m.R_r * e_r
        v_s, v_r = np.linalg.solve([[1, -m.M / m.L_r], [-m.M / m.L_s, 1]], [v_ts, v_tr])
        assert max(abs(v_s), abs(v_r)) < 560 / np.sqrt(3)
        v = held(v_s, v_r, theta_s + omega_s * h / 2, theta_s - x[7] + omega_r * h / 2)
        x = windings.run(x, np.array([0.0, h]), *v, 25.0 if t > 0.02 - h / 2 else 0.0)[-1]
        theta_s += omega_s * h
    assert omega_m > 5.0


def test_one_step_per_period_is_enough():
    """One Runge–Kutta step per 100 µs stays within 3e-7 rad/s of sixteen, through start, reversal and load steps."""
    once, often = simulate(), simulate(DEFAULT_SCENARIO.changed(substeps=16))
    assert np.abs(once["omega_m"] - often["omega_m"]).max() < 3e-7


def test_runge_kutta_converges_with_fourth_order():
    """A period of 8 ms at 150 rad/s of a light motor, so that the speed gained in it turns the rotor's voltage visibly."""
    machine = DFIM_4KW.changed(J=0.005)
    c, T, omega_s = dfim.coefficients(machine), 0.008, 120.0
    start = (0.9, 0.1, 0.85, -0.05, 150.0)
    v_s, v_r = 20 + 120j, -15 - 140j
    omega_r = omega_s - machine.p * 150.0

    def rhs(t, x):
        u_s = v_s * np.exp(1j * omega_s * (T / 2 - t))
        u_r = v_r * np.exp(1j * (omega_r * T / 2 - omega_s * t + machine.p * x[5]))
        d = dfim.dfim_derivatives(*x[:5], u_s.real, u_s.imag, u_r.real, u_r.imag, omega_s, 5.0, machine.R_r, c)
        return [*d, x[4]]

    exact = solve_ivp(rhs, (0, T), [*start, 0.0], method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    exact[5] -= 150.0 * T
    assert abs(exact[4] - 150.0) > 3.0
    errors = []
    for n in (4, 8, 16, 32):
        x = averaged_period(*start, v_s.real, v_s.imag, v_r.real, v_r.imag, omega_s, 5.0, machine.R_r, T, c, n)
        errors.append(np.abs(np.subtract(x, exact)).max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.all((orders > 3.7) & (orders < 4.4)), orders


def test_energy_is_conserved_over_a_run():
    """What both inverters give is what copper, field, inertia, friction and load take; the sum over samples errs as h²."""
    gaps = []
    for period in (4e-5, 2e-5):
        run = simulate(SHORT.changed(period=period, start="at rest"))
        m, h = run.scenario.machine, period
        i_s, i_r = run["i_sd"] + 1j * run["i_sq"], run["i_rd"] + 1j * run["i_rq"]
        v_s, v_r = run["v_sd"] + 1j * run["v_sq"], run["v_rd"] + 1j * run["v_rq"]

        # A held voltage met by a frame that turns on: the ends of a period see it half a period's angle away.
        def given(v, i, omega, h=h):
            half = np.exp(0.5j * h * omega[:-1])
            return 0.75 * h * np.sum(np.real(v[:-1] * (half * np.conj(i[:-1]) + np.conj(half * i[1:]))))

        def spent(power, h=h):
            return h * (np.sum(power) - 0.5 * (power[0] + power[-1]))

        field = dfim.magnetic_energy(*dfim.flux_linkages(i_s[-1], i_r[-1], m), m)
        motion = 0.5 * m.J * run["omega_m"][-1] ** 2 + spent(m.f * run["omega_m"] ** 2)
        load = h * np.sum(run["T_load"][:-1] * 0.5 * (run["omega_m"][:-1] + run["omega_m"][1:]))
        copper = spent(1.5 * (m.R_s * np.abs(i_s) ** 2 + m.R_r * np.abs(i_r) ** 2))
        supply = given(v_s, i_s, run["omega_s"]) + given(v_r, i_r, run["omega_r"])
        gaps.append(abs(supply - field - motion - load - copper) / supply)
    assert gaps[0] < 1e-4 and gaps[1] < 0.35 * gaps[0], gaps


def test_load_step_dips_as_the_second_order_loop_says():
    """Peak error ΔT/(J ω_n) exp(−ξ acos(ξ)/√(1 − ξ²)), but for the current loops' 1 ms."""
    step = simulate(SHORT.changed(duration=3.0, load_torque=((0.0, 0.0), (2.0, 25.0)))).events()[1]
    xi, omega_n = 0.7, 20.0
    peak = 25.0 / (0.2 * omega_n) * np.exp(-xi / np.sqrt(1 - xi**2) * np.arccos(xi))
    assert step.peak == pytest.approx(peak, rel=0.03)


def test_indices_kept_in_the_loop_are_those_of_the_record():
    run = simulate(window=(1.5, 2.5))
    assert run.indices == pytest.approx(run.error_indices(1.5, 2.5), rel=1e-9)
    assert simulate(every=0, window=(1.5, 2.5)).indices == run.indices


def test_a_network_with_integral_input_is_the_pi_controller():
    """Small-signal tanh and logistic networks of (e, Δe, ∫e) with the PI's gains give the PI's run."""
    scenario = SHORT.changed(speed_reference=((0.0, 0.0),), load_torque=((0.0, 0.0), (0.05, 25.0)))
    K_p, K_i = scenario.speed_gains
    pi, small = simulate(scenario), 1e-6
    W1 = small * np.array([[K_p, 0.0, K_i]])
    tanh = NetworkSpeed(W1, np.zeros(1), np.array([1 / small]))
    logistic = NetworkSpeed(W1, np.zeros(1), np.array([4 / small]), B2=-2 / small, activation="logistic")
    for network in (tanh, logistic):
        assert np.abs(simulate(scenario, network)["omega_m"] - pi["omega_m"]).max() < 1e-6


def test_fuzzy_kinds_apply_gains_limit_and_increment():
    """Against the rule base called directly."""
    position, incremental = FuzzySpeed(0.1, 2.0, 30.0).law(), FuzzySpeed(0.1, 2.0, 30.0, "incremental").law()
    u = fuzzy_output(0.1 * 3.0, 2.0 * (3.0 - 2.9))
    assert u > 0.1
    assert speed_command(position, 3.0, 2.9, 0.0, 7.0, 50.0, 1e-4)[0] == pytest.approx(30 * u)
    assert speed_command(incremental, 3.0, 2.9, 0.0, 7.0, 50.0, 1e-4)[0] == pytest.approx(7 + 30 * u)
    assert speed_command(incremental, 3.0, 2.9, 0.0, 7.0, 8.0, 1e-4)[0] == 8.0


def test_the_error_integral_waits_at_the_torque_limit():
    """The network's third input does not wind up while the torque is limited."""
    law = NetworkSpeed(np.array([[0.0, 0.0, 1e-3]]), np.zeros(1), np.array([1e3])).law()
    for memory, expected in ((2.0, 2.0 + 1e-4 * 3.0), (60.0, 60.0)):
        torque, asked, after = speed_command(law, 3.0, 3.0, memory, 0.0, 50.0, 1e-4)
        assert asked == pytest.approx(memory, rel=2e-3) and torque == min(asked, 50.0)
        assert after == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("side, other", [("s", "r"), ("r", "s")])
def test_limits_are_reported_with_their_time(side, other):
    """180 V dc on one side cannot carry 150 rad/s: that limit is hit on the way, the torque limit at once; it recovers."""
    voltage = {"s": "stator voltage", "r": "rotor voltage"}
    low = Scenario(
        machine=DFIM_SETS["small inertia"], T_limit=12.0, duration=5.0, **{f"V_dc_{side}": 180.0},
        speed_reference=((0.0, 150.0), (2.0, 20.0)), load_torque=((0.0, 0.0),),
    )  # fmt: skip
    run = simulate(low)
    assert run.first_hits["torque"] == 0.0
    assert 0.3 < run.first_hits[voltage[side]] < 2.0  # 12 N m take the rotor to 120 rad/s in 0.7 s
    assert voltage[other] not in run.first_hits and "stator current" not in run.first_hits
    assert np.hypot(run[f"v_{side}d"], run[f"v_{side}q"]).max() <= 180 / np.sqrt(3) * (1 + 1e-12)
    assert abs(run["omega_m"][-1] - 20.0) < 0.01
    assert "stator current" in simulate(SHORT.changed(i_s_limit=10.0)).first_hits


def test_divergence_raises_with_time_and_state():
    with pytest.raises(SimulationDiverged, match=r"diverged at t = 0\.1001 s with omega_m = ") as caught:
        simulate(SHORT.changed(load_torque=((0.0, 0.0), (0.1, 1e9))))
    assert caught.value.time == pytest.approx(0.1001) and abs(caught.value.state["omega_m"]) > 1e5


def test_events_act_at_the_first_sample_at_or_after_their_time():
    run = simulate(SHORT.changed(load_torque=((0.0, 1.0), (0.0003, 2.0), (0.00041, 3.0))))
    assert run["T_load"][:7].tolist() == [1, 1, 1, 2, 2, 3, 3]


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"omega_m": 1}, "no value of a scenario. Did you mean"),
        ({"V_dc_s": -1.0}, r"V_dc_s = -1.0 V"),
        ({"load_torque": ((1.0, 2.0),)}, "first value at 0 s"),
        ({"load_torque": ((0.0, 2.0), (0.2, 1.0), (0.2, 3.0))}, "strictly increasing"),
        ({"speed_reference": ((0.0, float("nan")),)}, "speed_reference at 0 s = nan rad/s"),
        ({"speed_reference": "fast"}, "must be a number or a sequence"),
        ({"frequency_law": "equal-split"}, "Did you mean equal split"),
        ({"period": 1e-3}, r"at most 0.5/period = 500 rad/s"),
        ({"rotor_resistance": ((0.0, 0.0),)}, "rotor_resistance at 0 s = 0.0: .* above 0"),
    ],
)
def test_bad_scenarios_are_refused_by_name(changes, message):
    with pytest.raises(ValueError, match=message):
        SHORT.changed(**changes)


def test_bad_calls_are_refused_by_name():
    with pytest.raises(ValueError, match="window's end = 9 s"):
        simulate(SHORT, window=(0, 9))
    with pytest.raises(ValueError, match="Did you mean .*omega_m"):
        simulate(SHORT)["omega_n"]
    with pytest.raises(ValueError, match=r"shapes \(2, 4\)"):
        NetworkSpeed(np.zeros((2, 4)), np.zeros(2), np.zeros(2))
