"""The contest's measures against runs whose answer is known beforehand, and thinning against brute force."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivelib import contest, fuzzy_facts
from drivelib.decimation import keep_extremes
from drivelib.dfim_drive import simulate
from drivelib.dfim_machines import DFIM_SETS
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.speed_law import PiSpeed


@given(st.integers(2, 400), st.integers(1, 50), st.integers(0, 2**32 - 1))
def test_thinning_keeps_ends_and_extremes(n, buckets, seed):
    """Largest and smallest value of every bucket survive, found here sample by sample."""
    rng = np.random.default_rng(seed)
    t, series = np.cumsum(rng.uniform(0.1, 1.0, n)), rng.normal(size=(2, n))
    kept = keep_extremes(t, series, buckets)
    assert kept[0] == 0 and kept[-1] == n - 1 and np.all(np.diff(kept) > 0)
    assert kept.size <= 2 + 4 * buckets
    edges = np.linspace(t[0], t[-1], buckets + 1)
    for values in series:
        for low, high in zip(edges[:-1], edges[1:], strict=True):
            inside = [k for k in range(n) if low <= t[k] < high]
            if inside:
                chosen = values[[k for k in kept if low <= t[k] < high]]
                assert chosen.max() == max(values[k] for k in inside) and chosen.min() == min(values[k] for k in inside)


def test_thinning_is_finer_in_a_zoom_and_refuses_unlike_lengths():
    t = np.linspace(0, 10, 10_001)
    zoomed = keep_extremes(t, [np.sin(50 * t)], 10, zooms=[(4.0, 5.0, 100)])
    assert np.count_nonzero((t[zoomed] >= 4) & (t[zoomed] < 5)) >= 150
    with pytest.raises(ValueError, match="series has shape"):
        keep_extremes(t, [t[1:]], 10)


def test_a_proportional_controller_stands_where_load_over_gain_says():
    """At rest K e = T_load + f Ω: the steady error in % of the set point is known beforehand."""
    K, f = 10.0, DEFAULT_SCENARIO.machine.f
    standing = contest.study(DEFAULT_SCENARIO, {"P": PiSpeed(K, 0.0)})["P"]
    at_30 = (25 + f * 30) / (K + f)
    assert standing.held.steady == pytest.approx(100 * at_30 / 30, rel=1e-3)
    assert standing.load.recovery == pytest.approx(0.5, abs=2e-4)  # never back in the band: all of the time counts
    assert standing.held.ripple < 1e-6


def test_the_fuzzy_controllers_hold_the_load_that_their_surface_says():
    """Incremental: none is left. Position: the error whose surface value is the load, from the rule table alone."""
    position = contest.fuzzy_position(DEFAULT_SCENARIO)
    standing = contest.study(DEFAULT_SCENARIO, {"FLC": contest.fuzzy_like_pi(DEFAULT_SCENARIO), "position": position})
    assert standing["FLC"].held.steady < 1e-4
    expected = fuzzy_facts.holding_input((25 + 0.001 * 30) / position.K_u) / position.K_e
    assert standing["position"].held.steady == pytest.approx(100 * expected / 30, rel=5e-3)


def test_stretching_moves_instants_only():
    longer = contest.stretched(DEFAULT_SCENARIO, 4)
    assert longer.duration == 32 and longer.period == DEFAULT_SCENARIO.period
    assert [v for _, v in longer.load_torque] == [v for _, v in DEFAULT_SCENARIO.load_torque]
    assert longer.events == [4 * t for t in DEFAULT_SCENARIO.events]


@pytest.mark.parametrize("name", DFIM_SETS)
def test_every_motor_meets_its_rated_torque(name):
    scenario = contest.with_machine(DEFAULT_SCENARIO, DFIM_SETS[name])
    share = DFIM_SETS[name].T_rated / 25.5
    assert max(v for _, v in scenario.load_torque) == pytest.approx(25 * share)
    assert scenario.T_limit == pytest.approx(51 * share)
    assert contest.flux_deviation(simulate(scenario))[0] < 1.0


def test_a_change_of_rotor_resistance_shows_as_difference_of_runs():
    """No load, no rotor current: R_r then cannot matter at all; with load it must."""
    changed = ((0.0, 1.0), (1.0, 1.5))
    idle = DEFAULT_SCENARIO.changed(load_torque=((0.0, 0.0),), speed_reference=((0.0, 30.0),), duration=2.0)
    loaded = idle.changed(load_torque=((0.0, 10.0),))
    differences = [contest.largest_change(simulate(s), simulate(s.changed(rotor_resistance=changed)))[0] for s in (idle, loaded)]
    assert differences[0] < 1e-4 < differences[1]
