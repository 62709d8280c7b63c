"""Eskander's drives in time do what figures 4 and 11 and section 6 say.

The yardstick is `reference`: the controllers written a second time, in complex numbers, with scipy's DOP853
(rtol 1e-10) and the stator-frame machine of `test_pmsm_dynamics` between samples.
"""

import cmath
import math

import numpy as np
import pytest
from scipy import signal
from test_pmsm_dynamics import reference_period

from drivelib import control, pmsm, pmsm_optimum
from drivelib.machines import IPMSM, SPMSM
from drivelib.pmsm_drive import sampled_profiles, simulate
from drivelib.pmsm_law import LAW_OUTPUTS, NetworkLaw
from drivelib.pmsm_loop import limited_i_oq
from drivelib.pmsm_scenario import Scenario


def some_network(kind):
    """A network of the printed size with plausible outputs; what it was trained on does not matter here."""
    if kind == "torque-pi":
        return NetworkLaw([[0.4, 1e-3], [-0.2, 4e-3]], [-0.5, 0.1], [[-1.0, -1.2]], [-1.0])
    W1, B1 = [[1e-3, 0.8], [4e-3, -0.3]], [0.1, -0.4]
    if kind == "direct":
        return NetworkLaw(W1, B1, [[3.0, 0.2], [-0.1, -0.4]], [-0.3, -0.1])
    return NetworkLaw(W1, B1, [[0.3, -0.05]], [-0.02])


def reference(scenario, i_o, omega_m):
    """Rows of (i_od, i_oq, omega_m, v_d, v_q) per sample, for a run that starts with controllers at zero."""
    s, m, k = scenario, scenario.machine, scenario.known_machine
    G = 1 / k.R_c if s.model == "full" else 0.0
    (Kd, _), (Kq, _) = s.current_gains
    alpha, T = s.current_bandwidth, s.period
    I_d = I_q = I_T = I_w = 0.0
    v, stuck, rows = 0j, False, []
    for omega_ref, T_ref, T_L in sampled_profiles(s):
        if s.mechanics == "imposed":
            omega_m = omega_ref
        w = k.P * omega_m
        i = (m.R_c * i_o + v) / (m.R_c + m.R_s)
        e = i - G * (v - k.R_s * i)
        torque = 1.5 * k.P * (k.psi_f + (k.L_d - k.L_q) * e.real) * e.imag
        if s.torque == "speed-loop":
            K_p, K_i = s.speed_gains
            raw = K_p * (omega_ref - omega_m) + I_w
            T_ref = max(-s.T_limit, min(s.T_limit, raw))
            if not (stuck and (omega_ref - omega_m) * I_w > 0):
                I_w += T * (K_i * (omega_ref - omega_m) + K_i / K_p * (T_ref - raw))
        elif s.torque == "load":
            T_ref = T_L
        law_omega = omega_ref if s.law_speed == "command" else omega_m
        if s.control == "angle":
            i_q = T_ref / (1.5 * k.P * k.psi_f)
            V = abs(complex(k.P * law_omega * k.L_q * i_q, k.R_s * i_q + k.P * law_omega * k.psi_f))
            asked = 1j * V * cmath.exp(1j * float(s.law([law_omega, T_ref])[0]))
        else:
            if s.control == "torque-pi":
                raw = s.torque_gains.K_p * (T_ref - torque) + I_T
                i_q = max(-s.I_limit, min(s.I_limit, raw))
                i_d = float(s.law([i_q, law_omega])[0])
            else:
                raw, i_d = (float(y) for y in s.law([law_omega, T_ref]))
                i_q = raw
            i_d = max(-s.I_limit, min(s.I_limit, i_d))
            i_q = limited_i_oq(i_d, i_q, w, G, s.I_limit, k)
            if s.control == "torque-pi" and not (stuck and (T_ref - torque) * I_T > 0):
                K_p, K_i = s.torque_gains
                I_T += T * (K_i * (T_ref - torque) + K_i / K_p * (i_q - raw))
            emf = 1j * w * complex(k.psi_f + k.L_d * e.real, k.L_q * e.imag)
            asked = complex(Kd * (i_d - e.real) + I_d, Kq * (i_q - e.imag) + I_q) + (1 + k.R_s * G) * emf
        v = asked if abs(asked) <= s.V_max else asked * s.V_max / abs(asked)
        if s.control != "angle":
            I_d += T * (alpha * k.R_s * (i_d - e.real) + k.R_s / k.L_d * (v - asked).real)
            I_q += T * (alpha * k.R_s * (i_q - e.imag) + k.R_s / k.L_q * (v - asked).imag)
        stuck = v != asked or (s.control != "angle" and i_q != raw)
        rows.append((i_o.real, i_o.imag, omega_m, v.real, v.imag))
        held = v * cmath.exp(0.5j * w * T)
        i_o, omega_m, _ = reference_period(i_o, omega_m, held, T_L, s.mechanics == "imposed", T, m)
    return np.array(rows)


CASES = {
    "figure 4, imposed speed, voltage limit hit": Scenario(
        machine=IPMSM, law=some_network("torque-pi"), speed=((0.0, 100.0), (0.005, 170.0)), load=((0.0, 3.0), (0.015, 1.0)),
        duration=0.02,
    ),
    "figure 4, speed loop, torque limit hit, wrong R_c and friction": Scenario(
        machine=IPMSM.changed(B=1e-3), controller_machine=IPMSM.changed(R_c=300.0), law=some_network("torque-pi"),
        speed=((0.0, 100.0), (0.005, 115.0)), load=((0.0, 0.5), (0.01, 1.5)), torque="speed-loop", mechanics="free",
        law_speed="command", omega_n=60.0, T_max=1.0, duration=0.02,
    ),
    "figure 11, simplified, current limit hit": Scenario(
        machine=SPMSM, control="direct", law=some_network("direct"), model="simplified", speed=150.0,
        load=((0.0, 0.2), (0.005, 1.4)), I_max=2.0, duration=0.02,
    ),
    "figure 11, speed loop, current limit hit": Scenario(
        machine=SPMSM, control="direct", law=some_network("direct"), speed=((0.0, 100.0), (0.005, 120.0)), load=0.3,
        torque="speed-loop", mechanics="free", I_max=1.5, duration=0.02,
    ),
    "section 6, free speed": Scenario(
        machine=SPMSM, control="angle", law=some_network("angle"), mechanics="free", law_speed="command",
        speed=((0.0, 150.0), (0.007, 180.0)), load=0.3, duration=0.02,
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_compiled_loop_is_the_reference_loop(case):
    """Currents, speed and voltages at every sample; the machine is integrated finely, so that controllers alone are compared."""
    scenario = CASES[case].changed(substeps=10)
    start = (-0.5, 1.0, scenario.speed[0][1])
    run = simulate(scenario, start=start)
    expected = reference(scenario, complex(*start[:2]), start[2])
    ours = np.stack([run[name] for name in ("i_od", "i_oq", "omega_m", "v_d", "v_q")], axis=1)
    assert np.abs(ours - expected) == pytest.approx(0, abs=1e-7)
    for limit in ("voltage", "torque", "current"):
        if f"{limit} limit hit" in case:
            assert limit in run.first_hits or f"{limit} reference" in run.first_hits


@pytest.mark.parametrize("case", CASES)
def test_one_step_per_period_is_enough(case):
    """Against ten steps per period no current moves by more than 1e-5 of the rated one, no speed by 1e-6 of the rated."""
    start = (-0.5, 1.0, CASES[case].speed[0][1])
    coarse, fine = (simulate(CASES[case].changed(substeps=n), start=start) for n in (1, 10))
    machine = CASES[case].machine
    I_rated = machine.T_rated / (1.5 * machine.P * machine.psi_f)
    for name, bound in (("i_od", 1e-5 * I_rated), ("i_oq", 1e-5 * I_rated), ("omega_m", 1e-6 * machine.omega_m_rated)):
        assert np.max(np.abs(coarse[name] - fine[name])) < bound


@pytest.mark.parametrize("model", pmsm.MODELS)
def test_figure_4_settles_at_the_steady_state_of_equations_1_to_3(model):
    """The sensed torque is the command, the voltages are those of (1)–(2); what is left of them falls with the period squared."""
    gaps = []
    for period in (2e-4, 1e-4):
        scenario = Scenario(machine=IPMSM, model=model, torque_feedback="actual", speed=120.0, load=2.5, duration=0.01, period=period)
        run = simulate(scenario)
        V = np.array(pmsm.stator_voltages(IPMSM, run.omega_e, run["i_od"], run["i_oq"]))
        gaps.append(np.max(np.hypot(*(V - (run["v_d"], run["v_q"]))) / np.hypot(*V)))
        assert run["T_e"] == pytest.approx(2.5, rel=1e-6)
    assert gaps[1] < 1e-3
    assert gaps[0] / gaps[1] == pytest.approx(4, rel=0.1)


def test_closed_form_leaves_the_least_loss():
    """In the full model, settled, the loss is the minimum that a search over the constant-torque curve finds."""
    run = simulate(Scenario(machine=IPMSM, speed=120.0, load=2.5, duration=0.01))
    i_od = np.linspace(-4, 0, 4001)
    by_search = np.min(pmsm.total_loss(IPMSM, 480.0, i_od, pmsm.i_oq_at_torque(IPMSM, 2.5, i_od)))
    assert run.loss()[-1] == pytest.approx(by_search, rel=1e-6)
    assert run.least_loss()[-1] == pytest.approx(by_search, rel=1e-6)


def test_simplified_control_misses_the_torque_by_the_iron_current():
    """Taking terminal for branch currents, the terminal currents settle at the references and the torque below its command."""
    run = simulate(Scenario(machine=SPMSM, control="direct", model="simplified", speed=200.0, load=0.4, duration=0.01))
    assert run["i_q"][-1] == pytest.approx(0.4 / (1.5 * 2 * 0.083), rel=1e-9)
    i_od, i_oq = pmsm.branch_currents(SPMSM, 400.0, run["i_d"][-1], run["i_q"][-1])
    assert run["T_e"][-1] == pytest.approx(float(pmsm.torque(SPMSM, i_od, i_oq)), rel=1e-3)
    assert run["T_hat"][-1] == pytest.approx(0.4, rel=1e-9)


def test_full_references_are_the_terminal_currents_of_the_branch_references():
    """References to an inverter are terminal ones; settled, the measured currents are these."""
    run = simulate(Scenario(machine=IPMSM, speed=120.0, load=2.5, duration=0.01))
    mapped = pmsm.terminal_currents(IPMSM, 480.0, run["i_od_ref"], run["i_oq_ref"])
    assert (run["i_d_ref"], run["i_q_ref"]) == (pytest.approx(mapped[0]), pytest.approx(mapped[1]))
    assert run["i_d"][-1] == pytest.approx(run["i_d_ref"][-1], abs=1e-3)
    assert run["i_q"][-1] == pytest.approx(run["i_q_ref"][-1], abs=1e-3)


def test_current_loop_has_its_bandwidth():
    """A reference step is followed as 1 − exp(−α t), at a control period short against 1/α."""
    load = ((0.0, 0.1), (0.001, 0.3))
    run = simulate(Scenario(machine=SPMSM, control="direct", law="zero", speed=50.0, load=load, duration=0.006, period=1e-5))
    t = run.t - 0.001
    expected = 0.1 + 0.2 * np.where(t > 0, -np.expm1(-1000.0 * t), 0.0)
    assert run["T_e"] == pytest.approx(expected, abs=0.01 * 0.2)


def test_torque_loop_has_its_bandwidth():
    """Fig. 4's PI makes the torque follow as 1 − exp(−α_T t) where no reluctance torque speeds it up."""
    run = simulate(Scenario(machine=SPMSM, law="zero", speed=50.0, load=((0.0, 0.1), (0.005, 0.3)), duration=0.03, period=1e-5))
    t = run.t - 0.005
    expected = 0.1 + 0.2 * np.where(t > 0, -np.expm1(-200.0 * t), 0.0)
    assert run["T_e"] == pytest.approx(expected, abs=0.01 * 0.2)


def test_speed_loop_has_its_poles():
    """A small command step is followed as the transfer function of pole placement says, current loops far away."""
    scenario = Scenario(
        machine=SPMSM.changed(B=1e-4), control="direct", law="zero", speed=((0.0, 100.0), (0.05, 105.0)), load=0.2,
        torque="speed-loop", mechanics="free", omega_n=20.0, xi=0.8, current_bandwidth=5000.0, period=2e-5, duration=0.4,
    )  # fmt: skip
    run = simulate(scenario)
    transfer = control.speed_transfer_function(scenario.speed_gains, SPMSM.J, 1e-4)
    later = run.t >= 0.05
    _, expected = signal.step(transfer, T=run.t[later] - 0.05)
    assert run["omega_m"][later] - 100 == pytest.approx(5 * expected, abs=0.02 * 5)


def test_energy_is_conserved_over_a_transient():
    """Input = heat + stored + shaft work, and the shaft work of an unloaded machine is its kinetic energy."""
    scenario = Scenario(machine=IPMSM, speed=((0.0, 50.0), (0.01, 100.0)), torque="speed-loop", mechanics="free", duration=0.3)
    run = simulate(scenario)
    kinetic = 0.5 * IPMSM.J * (run["omega_m"] ** 2 - run["omega_m"][0] ** 2)
    assert run["omega_m"][-1] == pytest.approx(100, abs=1)
    assert run.energy_residual() == pytest.approx(0, abs=1e-6 * run["E_in"][-1])
    assert run["E_shaft"] == pytest.approx(kinetic, abs=1e-6 * run["E_in"][-1])


@pytest.mark.parametrize("model", pmsm.MODELS)
def test_a_settled_run_does_not_move(model):
    """Nothing steps, so nothing moves: a run begins in equilibrium, be the torque estimate right or not."""
    scenario = Scenario(machine=IPMSM.changed(B=1e-3), model=model, speed=80.0, load=1.0, torque="speed-loop", mechanics="free", duration=0.05)
    run = simulate(scenario)
    assert np.ptp(run["omega_m"]) < 1e-6 * 80
    assert np.ptp(run["i_od"]) < 1e-6 and np.ptp(run["i_oq"]) < 1e-6
    # At the samples the torque differs from its mean by the ripple of the held voltage, which falls with the period squared.
    assert run["T_e"][0] == pytest.approx(1.0 + 1e-3 * 80, rel=1e-5)


def test_free_speed_begins_where_the_profile_does():
    """Feed-forward alone holds no speed, so it is held until 0 s."""
    run = simulate(Scenario(machine=SPMSM, control="angle", mechanics="free", speed=100.0, load=0.3, duration=0.01))
    assert run["omega_m"][0] == 100.0 != run["omega_m"][-1]


@pytest.mark.parametrize("model", pmsm.MODELS)
def test_figure_11_holds_the_current_of_equation_16(model):
    """Whatever the load, the closed form asks for (16) mended, and the current follows; the law "zero" asks for none."""
    for law, expected in (("exact", float(pmsm_optimum.optimal_i_od_surface(SPMSM, 400.0, model=model))), ("zero", 0.0)):
        run = simulate(Scenario(machine=SPMSM, control="direct", law=law, model=model, speed=200.0, load=((0.0, 0.2), (0.01, 0.4)), duration=0.05))
        assert run["i_od_ref"] == pytest.approx(expected, rel=1e-12)
        assert run["i_od" if model == "full" else "i_d"][-1] == pytest.approx(expected, abs=1e-5)


def test_a_step_acts_at_the_first_sample_at_or_after_its_time():
    """Whether or not its time is a multiple of the period that rounding spoils."""
    for time, sample in ((0.0003, 3), (0.00031, 4), (0.0, 0)):
        speed = ((0.0, 50.0), (time, 60.0)) if time else 60.0
        assert np.argmax(sampled_profiles(Scenario(speed=speed, duration=0.002))[:, 0] == 60.0) == sample


def test_network_law_is_its_formula_in_the_loop():
    """What the loop feeds forward is W2 tanh(W1 x + B1) + B2 of the inputs it records."""
    for kind, outputs in (("torque-pi", ("i_od_ref",)), ("direct", ("i_oq_ref", "i_od_ref")), ("angle", ("phi",))):
        law = some_network(kind)
        run = simulate(Scenario(machine=SPMSM, control=kind, law=law, speed=((0.0, 100.0), (0.01, 150.0)), load=0.3, duration=0.02))
        x = np.stack([run["law_input_1"], run["law_input_2"]], axis=1)
        expected = np.tanh(x @ law.W1.T + law.B1) @ law.W2.T + law.B2
        assert expected.shape[1] == len(LAW_OUTPUTS[kind]) == len(outputs)
        for column, name in enumerate(outputs):
            assert run[name] == pytest.approx(expected[:, column], rel=1e-12)


@pytest.mark.parametrize("i_od, i_oq", [(-1.0, 9.0), (-1.0, -9.0), (2.0, 0.5), (-6.5, 3.0), (0.0, 7.0)])
def test_limited_i_oq_is_the_nearest_that_the_limit_allows(i_od, i_oq):
    """Against a search; where i_od leaves no room, the least current."""
    grid = np.linspace(-12, 12, 240001)
    for omega_e in (0.0, 500.0):
        current = np.hypot(*pmsm.terminal_currents(IPMSM, omega_e, i_od, grid))
        allowed = grid[current <= 6.0]
        best = allowed[np.argmin(np.abs(allowed - i_oq))] if allowed.size else grid[np.argmin(current)]
        assert limited_i_oq(i_od, i_oq, omega_e, 1 / IPMSM.R_c, 6.0, IPMSM) == pytest.approx(best, abs=1.1e-4)


def test_angle_scheme_at_phi_op_has_no_d_current_without_iron_loss():
    """Voltage-fed with (17)–(20): i_od vanishes and the torque is the load, as R_c grows beyond bounds."""
    for law, torque in (("exact", 0.4), ("zero", None)):
        run = simulate(Scenario(machine=SPMSM.changed(R_c=1e9), control="angle", law=law, speed=200.0, load=0.4, duration=0.01, period=2e-5))
        if law == "exact":
            assert run["i_od"][-1] == pytest.approx(0, abs=1e-3)
            assert run["T_e"][-1] == pytest.approx(torque, rel=1e-3)
        else:
            assert run["i_od"][-1] > 0.1 and math.isclose(run["v_d"][-1], 0, abs_tol=1e-12)


def test_least_loss_follows_the_operating_point():
    """Fig. 9(a): the loss computed from speed and torque steps with the imposed speed."""
    run = simulate(Scenario(machine=IPMSM, speed=((0.0, 100.0), (0.01, 150.0)), load=3.0, duration=0.1))
    for k, omega_m in ((0, 100.0), (-1, 150.0)):
        optimum = pmsm_optimum.optimum(IPMSM, 4 * omega_m, 3.0)
        assert run.least_loss()[k] == pytest.approx(float(optimum.loss), rel=1e-3)
        assert run.loss()[k] == pytest.approx(float(optimum.loss), rel=1e-3)
    assert np.all(run.loss() >= run.least_loss() * (1 - 1e-12))
