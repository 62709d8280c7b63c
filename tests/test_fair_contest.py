"""The fair contest's measures against runs whose answer is known, its contenders against what they claim to be."""

import math

import numpy as np
import pytest

from drivelib import fair_contest as fair
from drivelib import fair_networks, fuzzy_noise
from drivelib.dfim_drive import simulate
from drivelib.encoder import Encoder
from drivelib.speed_law import FuzzySpeed, NetworkSpeed, PiSpeed

CLEAN = fair.TUNING.changed(encoder=None)


def test_all_meet_the_same_conditions():
    """Torque limit, sample time and encoder are one set of numbers; only the noise's seed differs between cycles."""
    scenarios = [fair.TUNING, *fair.conditions().values()]
    assert {(s.T_limit, s.period, s.encoder.counts, s.encoder.noise, s.encoder.corner, s.current_bandwidth) for s in scenarios} == {
        (51.0, 1e-4, 10_000, 0.25, 600.0, 1000.0)
    }
    assert len({s.encoder.seed for s in [fair.TUNING, *fair.CYCLES.values()]}) == 4
    assert {s.known_machine for s in scenarios} == {fair.TUNING.machine}
    assert {round(s.machine.J, 9) for s in scenarios} == {0.1, 0.2, 0.3}


def test_every_motor_has_arrived_before_its_rest_is_measured():
    """At the torque limit the heaviest motor covers each step of the set point 0.2 s before the last fifth of its time."""
    for scenario in fair.conditions().values():
        ends = [*scenario.events[1:], scenario.duration]
        before = 0.0
        for time, value in scenario.speed_reference:
            end = next(end for end in ends if end > time)
            load = next(T for t, T in reversed(scenario.load_torque) if t <= time)
            least = abs(value - before) * scenario.machine.J / (scenario.T_limit - abs(load))
            assert least + 0.2 < (1 - fair.TAIL) * (end - time), (scenario.name, time)
            before = value


def test_a_proportional_controller_is_measured_as_its_algebra_says():
    """Dip and steady error T/K (with friction), command at rest constant, no change of load ever settled."""
    K, f = 10.0, fair.TUNING.machine.f
    found = fair.measure(CLEAN, PiSpeed(K, 0.0))
    assert found.steady == pytest.approx((20 + 60 * f) / (K + f), rel=1e-3)
    assert found.dip == pytest.approx(found.steady, rel=1e-2)
    assert found.ripple < 1e-3 and found.unsettled == 1 and not found.diverged


def test_measures_are_those_of_the_record():
    run = simulate(fair.TUNING, fair.reference_law())
    found = fair.measure(fair.TUNING, fair.reference_law())
    events = run.events(band=fair.BAND, tail=fair.TAIL)
    assert found.dip == max(abs(event.peak) for event in events if event.time in (0.7, 1.2))
    assert found.settling == pytest.approx(np.mean([event.recovery_time for event in events]), abs=1e-4)
    assert found.steady == pytest.approx(max(abs(event.steady_error) for event in events), rel=1e-6)
    assert found.effort == pytest.approx(np.sqrt(np.mean(run["T_ref"] ** 2)))
    assert found.variation == pytest.approx(np.abs(np.diff(run["T_ref"])).sum() / 2.4)
    assert found.IAE == pytest.approx(run.error_indices(0.7, 1.6).IAE, rel=1e-3)  # load on at 0.7 s, off at 1.2 s
    rest = (run.t >= 1.5) & (run.t < 1.6)
    line = np.polyval(np.polyfit(run.t[rest] - 1.5, run["T_ref"][rest], 1), run.t[rest] - 1.5)
    own = np.sqrt(np.mean((run["T_ref"][rest] - line) ** 2))
    assert 0.5 * own < found.ripple <= 2 * own and found.ripple >= 0.999 * own


def test_a_drive_that_diverges_is_flagged_and_scores_infinity():
    wild = fair.TUNING.changed(load_torque=((0.0, 0.0), (0.7, 1e9)))
    found = fair.measure(wild, fair.reference_law())
    assert found.diverged and fair.score(found, fair.measure(fair.TUNING, fair.reference_law())) == math.inf


def test_score_is_one_for_the_reference_and_weights_pick():
    unit = fair.measure(fair.TUNING, fair.reference_law())
    twice = unit._replace(dip=2 * unit.dip)
    assert fair.score(unit, unit) == pytest.approx(1.0) and fair.score(twice, unit) == pytest.approx(1.25)
    assert fair.score(twice, unit, (0, 1, 1, 1)) == pytest.approx(1.0)
    assert fair.score(unit._replace(ripple=0.0), unit._replace(ripple=0.0), (1, 1, 1, 0)) == pytest.approx(1.0)


def test_contenders_are_what_they_are_called():
    made = {name: make(**{entry.name: entry.at(0.5) for entry in ranges}) for name, (ranges, make) in fair.contenders().items()}
    assert made["PI"].K_p == made["IP"].K_p == made["PI + observer"].K_p == pytest.approx(10.0)
    assert made["PI"].K_i == made["IP"].K_i == pytest.approx(10.0 / math.sqrt(0.1))
    assert made["IP"].weight == 0 and made["IP"].pole == 1 and made["PI + observer"].pole == pytest.approx(math.exp(-100 * 1e-4))
    assert fair.stiffness(made["FLC position"]) == pytest.approx(10.0)
    small = simulate(CLEAN.changed(speed_reference=((0.0, 0.01),), load_torque=((0.0, 0.0),), duration=0.3), made["FLC position"])
    P = simulate(small.scenario, PiSpeed(10.0, 0.0))
    assert np.abs(small["omega_m"] - P["omega_m"]).max() < 0.1 * 0.01


def test_the_trained_networks_are_maps_of_their_teacher():
    """With e and ∫e: the PI's limited command all over the plane. With e alone: nothing else goes in."""
    pi = PiSpeed(6.0, 100.0)
    network = fair_networks.fair_network(pi, fair.TUNING, samples=512, starts=1)
    rng = np.random.default_rng(0)
    e, x = rng.uniform(-100, 100, 500), rng.uniform(-0.5, 0.5, 500)
    hidden = np.tanh(np.column_stack([e, 0 * e, x]) @ network.W1.T + network.B1)
    apart = hidden @ network.W2 + network.B2 - np.clip(6.0 * e + 100.0 * x, -51, 51)
    assert np.sqrt(np.mean(apart**2)) < 1.5
    taught = fair_networks.teacher(pi, fair.TUNING)
    assert taught.speed_gains == pytest.approx((6.0, 100.0)) and taught.encoder is None
    alone = fair_networks.error_network(pi, fair.TUNING, samples=300, starts=1)
    assert alone.W1.shape == (15, 1)


def test_factors_scale_inputs_and_output():
    network = NetworkSpeed(np.array([[0.1, 0.0, 2.0]]), np.array([0.3]), np.array([4.0]), 1.0)
    changed = fair_networks.scaled(network, 2.0, 3.0, 5.0)
    assert changed.W1.tolist() == [[0.2, 0.0, 6.0]] and changed.W2.tolist() == [20.0] and changed.B2 == 5.0


def test_a_round_tunes_scores_and_compares():
    """Two contenders, the smallest budget: same evaluations, the P of the same stiffness beside them, sound numbers."""
    cycles = {"slow": fair.CYCLES["slow"]}
    contenders = {name: fair.contenders()[name] for name in ("PI", "FLC position")}
    played = fair.play(contenders, cycles=cycles, budget=64, seed=1)
    assert {len(found.scores) for found in played.found.values()} == {64}
    assert set(played.laws) == {"untuned PI", "PI", "FLC position", "P"}
    assert played.score("untuned PI") == pytest.approx(1.0)
    assert played.mean("PI").dip <= played.worst("PI").dip
    assert played.front("PI").shape[1] == 4 and played.sensitivity("PI") > 0
    again = fair.chosen(played.found, contenders, scenario=fair.TUNING, cycles=cycles)
    assert again.laws["PI"] == played.laws["PI"] and again.scores["PI"] == played.scores["PI"]
    only = fair.chosen(played.found, contenders, scenario=fair.TUNING, cycles=cycles, weights=(1, 0, 0, 0))
    assert only.laws["PI"].K_p >= played.laws["PI"].K_p


def test_who_is_missing_is_named():
    with pytest.raises(ValueError, match="'FLC'"):
        fair.scored({"PI": fair.reference_law(), "FLC": None}, fair.conditions())
    with pytest.raises(ValueError, match="nothing to score"):
        fair.scored({}, fair.conditions())
    with pytest.raises(ValueError, match="nobody"):
        fair.play({}, budget=64, seed=1)
    with pytest.raises(ValueError, match="contender"):
        fair.tune(None, budget=64, seed=1)
    with pytest.raises(ValueError, match="budget"):
        fair.tune(fair.contenders()["PI"], budget=0, seed=1)


def test_without_noise_the_fuzzy_controller_answers_to_the_error_that_there_is():
    """Δe = 0: slope 1.5 exactly for small e."""
    law, errors = FuzzySpeed(1e-4, 0.0, 1.0, "incremental"), [0.1, -0.2, 0.0, 1.0]
    answered = fuzzy_noise.answered_error(law, Encoder(counts=2**40, noise=0.0), errors, samples=2000)
    assert answered == pytest.approx(errors, abs=2e-3)


def test_noise_in_the_change_leaves_half_of_the_error_and_turns_with_the_shaft():
    """One count per period up, one down: where e and Δe agree only Δe counts, where not both, so half of e is left. All signs turn."""
    law = FuzzySpeed(1e-6, 1e-4, 1.0, "incremental")  # far inside the first set
    coarse = Encoder(counts=500, noise=0.0)
    count = 2 * np.pi / 500 / 1e-4  # rad/s: filtered to 7.3 rad/s in Δe, which weighs 100 times as much as e
    answered = fuzzy_noise.answered_error(law, coarse, [-100.0, 100.0], speed=5.5 * count, samples=4000)
    assert np.diff(answered)[0] / 200 == pytest.approx(0.5, abs=0.02)
    there, back = (fuzzy_noise.answered_error(law, Encoder(noise=0.0), [sign * 2.0], speed=sign * 60.1) for sign in (1, -1))
    assert there == pytest.approx(-back, abs=0.05)
    with pytest.raises(ValueError, match="samples"):
        fuzzy_noise.answered_error(law, coarse, [1.0], samples=10)
