"""Bad input is refused by name, and what a drive cannot do is said, with the time."""

import math

import numpy as np
import pytest

from drivelib.machines import IPMSM, SPMSM
from drivelib.pmsm_drive import SimulationDiverged, simulate
from drivelib.pmsm_law import NetworkLaw
from drivelib.pmsm_scenario import TUNING, Scenario
from drivelib.transients import settling_time

NET = {"W1": [[0.4, 1e-3], [-0.2, 4e-3]], "B1": [-0.5, 0.1], "W2": [[-1.0, -1.2]], "B2": [-1.0]}

REFUSED = {
    "period beyond the electrical time constant": ({"period": 7e-3}, r"period = 0.007 s.*time constant.*0.00627907 s"),
    "period too long for the speed": ({"period": 4e-3, "speed": 170.0}, r"period = 0.004 s: at 680 rad/s"),
    "period too long for the current loop": ({"period": 1e-3}, r"current_bandwidth = 1000 rad/s.*0.5/period = 500 rad/s"),
    "torque loop faster than the currents": ({"torque_bandwidth": 1500.0}, r"torque_bandwidth = 1500.0 rad/s.*at most 1000 rad/s"),
    "speed loop faster than the torque loop": (
        {"omega_n": 300.0, "torque": "speed-loop", "mechanics": "free"},
        r"omega_n = 300.0 rad/s.*at most 200 rad/s",
    ),
    "iron current fed back too hard": ({"model": "simplified", "current_bandwidth": 3000.0}, r"current_bandwidth = 3000.0.*R_c"),
    "speed loop at imposed speed": ({"torque": "speed-loop"}, r"mechanics = 'free'"),
    "NaN in a profile": ({"speed": ((0.0, 100.0), (0.1, math.nan))}, r"speed at 0.1 s = nan rad/s"),
    "unsorted steps": ({"load": ((0.0, 1.0), (0.1, 2.0), (0.05, 3.0))}, r"load's time 0.05 s does not lie above 0.1 s"),
    "two steps in one period": (
        {"load": ((0.0, 1.0), (0.1, 2.0), (0.10005, 3.0), (0.10008, 4.0))},
        r"load's time 0.10008 s.*same control period of 0.0001 s",
    ),
    "step after the end": ({"load": ((0.0, 1.0), (9.0, 2.0))}, r"load's time = 9.0 s.*at most 0.2 s"),
    "no value at 0 s": ({"load": ((0.1, 1.0),)}, r"load = .*first value at 0 s"),
    "profile of the wrong kind": ({"load": (1.0, 2.0)}, r"load = .*sequence of \(time in s, value in N m\)"),
    "unknown control": ({"control": "torque_pi"}, r"control = 'torque_pi'.*Did you mean 'torque-pi'|control = 'torque_pi'.*mean torque-pi"),
    "unknown law": ({"law": "exct"}, r"law = 'exct'.*exact"),
    "negative limit": ({"I_max": -1.0}, r"I_max = -1.0 A.*above 0 A"),
    "infinite duration": ({"duration": math.inf}, r"duration = inf s"),
    "closed form of fig. 11 with saliency": ({"control": "direct"}, r"eq. \(16\) needs L_d = L_q"),
    "too few network outputs": ({"machine": SPMSM, "control": "direct", "law": NetworkLaw(**NET)}, r"law has 1 outputs.*takes 2, i_q\* and i_d\*"),
    "no stator resistance": ({"machine": IPMSM.changed(R_s=0.0)}, r"R_s = 0.0 ohm"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_scenario_refuses(case):
    values, message = REFUSED[case]
    with pytest.raises(ValueError, match=message):
        Scenario(**values)


@pytest.mark.parametrize(
    "values, message",
    [
        ({"W1": [[0.4, 1e-3]]}, r"W1 has shape \(1, 2\): must be \(2, 2\)"),
        ({"W1": [[0.4, 1e-3, 0.0], [0.1, 0.2, 0.3]]}, r"W1 has shape \(2, 3\)"),
        ({"W2": [[-1.0], [-1.2]]}, r"W2 has shape \(2, 1\): must be \(1, 2\)"),
        ({"B1": [[-0.5, 0.1]]}, r"B1 has shape \(1, 2\)"),
        ({"B2": [math.nan]}, r"B2 = nan at index 0"),
        ({"low": [0.0, 0.0]}, r"both ends"),
        ({"low": [0.0, 5.0], "high": [1.0, 5.0]}, r"low\[1\] = 5: must lie below"),
        ({"low": [0.0], "high": [1.0]}, r"low has shape \(1,\)"),
    ],
)
def test_network_law_refuses(values, message):
    with pytest.raises(ValueError, match=message):
        NetworkLaw(**{**NET, **values})


def test_unknown_names_suggest_the_nearest():
    with pytest.raises(ValueError, match="torque_bandwith.*torque_bandwidth"):
        Scenario().changed(torque_bandwith=1.0)
    with pytest.raises(ValueError, match="i_odd.*i_od"):
        simulate(Scenario(duration=1e-3))["i_odd"]
    with pytest.raises(ValueError, match="volt.*voltage"):
        simulate(Scenario(duration=1e-3)).at_limit("volts")


def test_start_is_checked():
    for start in ((1.0, 2.0), (1.0, math.nan, 0.0)):
        with pytest.raises(ValueError, match="i_od"):
            simulate(Scenario(duration=1e-3), start=start)


def test_voltage_limit_is_kept_and_reported_with_its_time():
    """At 300 rad/s the magnets' emf alone exceeds the inverter's voltage; before the step there is no limit in reach."""
    scenario = Scenario(machine=IPMSM, law="zero", speed=((0.0, 50.0), (0.0123, 300.0)), load=0.5, duration=0.05)
    assert 4 * 300 * IPMSM.psi_f > scenario.V_max == pytest.approx(250 / math.sqrt(3))
    run = simulate(scenario)
    assert run.first_hits["voltage"] == pytest.approx(0.0123, abs=1e-9)
    assert np.max(np.hypot(run["v_d"], run["v_q"])) <= scenario.V_max * (1 + 1e-12)
    assert "voltage limit first reached at 0.0123 s" in run.report()
    wider = simulate(scenario.changed(modulation="six-step", speed=50.0))
    assert wider.scenario.V_max == pytest.approx(2 * 250 / math.pi)
    assert wider.report() == []


def test_integrals_leave_the_voltage_limit_at_once():
    """Anti-windup: back from a limit held for 0.3 s, the torque is as soon in its band as after 0.05 s."""
    times = []
    for held in (0.05, 0.3):
        speed = ((0.0, 50.0), (0.01, 300.0), (0.01 + held, 50.0))
        run = simulate(Scenario(machine=IPMSM, law="zero", speed=speed, load=1.0, duration=0.2 + held))
        assert np.all(run.at_limit("voltage")[120:400])
        times.append(settling_time(run.t, run["T_e"], 1.0, 0.02, 0.01 + held))
    assert times[1] == pytest.approx(times[0], abs=1e-3)


def test_current_limit_is_kept_and_reported_with_its_time():
    """A torque command that takes more than I_max: the terminal current stops there, in the full model too."""
    run = simulate(Scenario(machine=IPMSM, speed=50.0, load=((0.0, 1.0), (0.01, 9.0)), I_max=4.0, duration=0.3))
    assert run.first_hits["current reference"] > 0.01
    assert math.hypot(run["i_d"][-1], run["i_q"][-1]) == pytest.approx(4.0, rel=1e-3)
    assert run["T_e"][-1] < 9.0
    fed = simulate(Scenario(machine=SPMSM, control="angle", speed=200.0, load=((0.0, 0.2), (0.01, 1.2)), I_max=3.0, duration=0.1))
    over = np.hypot(fed["i_d"], fed["i_q"]) > 3.0 * 1.001
    assert fed.first_hits == {"current": fed.t[np.argmax(over)]}


def test_speed_step_that_the_torque_limit_cannot_follow_is_flagged():
    """0.5 N m above the load turn 1.79e-4 kg m² by 100 rad/s in 36 ms: possible in 0.4 s, not in 30 ms."""
    common = {"machine": IPMSM, "load": 0.5, "torque": "speed-loop", "mechanics": "free", "T_max": 1.0, "duration": 0.5}
    slow = simulate(Scenario(speed=((0.0, 50.0), (0.02, 150.0)), **common)).speed_steps()[0]
    assert slow.least == pytest.approx(1.79e-4 * 100 / 0.5)
    assert slow.followed and slow.settling >= slow.least and "torque" in slow.limits
    run = simulate(Scenario(speed=((0.0, 50.0), (0.02, 150.0), (0.05, 50.0)), **common))
    missed, back = run.speed_steps()
    assert not missed.followed and back.least == pytest.approx(1.79e-4 * 100 / 1.5)
    assert any("from 50 to 150 rad/s at 0.02 s was not followed; at the torque limit 1 N m it takes 0.0358 s" in line for line in run.report())
    hopeless = simulate(Scenario(speed=((0.0, 50.0), (0.02, 60.0)), **{**common, "T_max": 0.501, "load": ((0.0, 0.5), (0.02, 0.6))}))
    assert math.isinf(hopeless.speed_steps()[0].least) and not hopeless.speed_steps()[0].followed
    assert simulate(Scenario(speed=((0.0, 50.0), (0.02, 150.0)), duration=0.03)).speed_steps() == []


def test_excursions_from_the_training_range_say_by_how_much():
    law = NetworkLaw(**NET, low=[0.0, 20.0], high=[10.0, 120.0])
    run = simulate(Scenario(law=law, speed=((0.0, 100.0), (0.01, 150.0), (0.02, 10.0), (0.03, 60.0)), load=1.0, duration=0.04))
    (item,) = run.outside()
    assert (item.name, item.worst, item.excess) == ("omega_m", 150.0, 30.0)
    assert item.share == pytest.approx(0.3)
    assert (item.first, item.time) == (pytest.approx(0.01), pytest.approx(0.01))
    assert run.first_hits["training range"] == pytest.approx(0.01)
    assert "omega_m = 150 rad/s at 0.01 s lies 30 rad/s (30 % of its range) outside 20 to 120 rad/s" in run.report()[-1]
    assert simulate(Scenario(law=NetworkLaw(**NET), speed=150.0, duration=0.01)).outside() == []


def test_divergence_raises_with_time_and_state():
    """A load that drives an almost massless rotor beyond what the limits can brake."""
    scenario = Scenario(machine=IPMSM.changed(J=1e-5), mechanics="free", load=((0.0, 0.0), (0.01, -60.0)), torque=0.0, duration=0.2, name="runaway")
    with pytest.raises(SimulationDiverged, match=r"runaway: diverged at t = 0.0\d+ s with i_od = .* A, i_oq = .* A, omega_m = .* rad/s") as caught:
        simulate(scenario)
    assert 0.01 < caught.value.time < 0.2
    assert caught.value.state["omega_m"] >= 1e5 or not np.isfinite(caught.value.state["omega_m"])


def test_limits_left_open_follow_the_machine():
    """Twice the rated torque and what it takes at i_d = 0, after a change of machine too."""
    scenario = Scenario(machine=IPMSM).changed(machine=SPMSM)
    assert scenario.T_limit == 2 * SPMSM.T_rated
    assert scenario.I_limit == pytest.approx(2 * SPMSM.T_rated / (1.5 * 2 * 0.083))
    rows = {row[0]: row for row in scenario.changed(T_max=1.5).assumptions()}
    assert rows["I_max"][1:4] == (scenario.I_limit, "A", "assumed") and rows["T_max"][1:4] == (1.5, "N m", "given")


def test_assumptions_state_range_and_whose_value_it_is():
    """What the paper leaves open is listed with its class; a changed value counts as the user's."""
    rows = {row[0]: row for row in Scenario(torque_bandwidth=150.0).assumptions()}
    assert set(rows) == set(TUNING)
    assert rows["torque_bandwidth"][1:4] == (150.0, "rad/s", "given")
    assert rows["current_bandwidth"][3] == "assumed" and "range 300 to 3000" in rows["current_bandwidth"][4]
    for name, (origin, default) in TUNING.items():
        if default is not None:
            assert getattr(Scenario(), name) == default and origin.low <= default <= origin.high
