"""Counted algorithms against the vectorised library that they mirror, and against counts by hand."""

import math
from collections import Counter

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from drivelib import loss_map, map_rivals, networks, operations, pmsm
from drivelib.machines import IPMSM, SPMSM
from drivelib.neural import Network, Range, nguyen_widrow
from drivelib.operations import Counted, counted, cycles


def a_map(machine, I_max):
    speed, torque = np.linspace(0.1, 1.5, 15) * machine.omega_m_rated, np.linspace(0.1, 1.0, 10) * machine.T_rated
    return loss_map.loss_map(machine, speed, torque, V_max=pmsm.voltage_limit(machine), I_max=I_max)


MAPS = {"IPMSM": a_map(IPMSM, 6.0), "SPMSM": a_map(SPMSM, 8.0)}


DATA = {name: loss_map.training_data(found) for name, found in MAPS.items()}


def a_network(found, hidden=5):
    weights = nguyen_widrow(2, hidden, 2, np.random.default_rng(7))
    ends = (found.omega_m[[0, -1]], found.T_e[[0, -1]])
    return Network(*weights, Range(*np.transpose(ends)), Range(np.array([-4.0, 0.0]), np.array([0.0, 5.0])))


def rivals(found):
    data = loss_map.training_data(found, points=12)
    return (map_rivals.network(a_network(found)), map_rivals.table(found, data, 6), map_rivals.closed_form(found.machine), map_rivals.exact(found))


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("which", range(4))
def test_what_is_counted_computes_what_is_judged(name, which):
    """The scalar algorithm gives the vectorised form's currents wherever the map asks; Newton's to its stopping rule."""
    found = MAPS[name]
    rival = rivals(found)[which]
    limit = loss_map.torque_limit(found, found.omega_m, 0.95)
    for i, omega_m in enumerate(found.omega_m):
        for T_e in found.T_e[found.T_e <= limit[i]]:
            expected = np.ravel(rival.currents(np.array([[omega_m, T_e]])))
            assert counted(rival.algorithm, omega_m, T_e)[0] == pytest.approx(expected, abs=2e-5), (omega_m, T_e)


def test_the_exact_formula_loses_nothing_and_the_closed_form_nothing_where_no_limit_acts():
    found = MAPS["IPMSM"]
    exact = map_rivals.cost(found, map_rivals.exact(found), every=7)
    assert abs(exact.loss) < 1e-6 and exact.torque < 1e-6 and exact.voltage < 1e-6
    error = loss_map.network_error(found, map_rivals.closed_form(IPMSM, passes=40).currents)
    free = np.isfinite(error.excess) & ~found.best.limited
    assert free.any() and np.abs(error.excess[free]).max() < 1e-9 and np.abs(error.torque[free]).max() < 1e-9


def test_a_network_costs_what_its_layers_say():
    """Per neuron two products in, two out, a sum with each, one tanh; two clamps of two comparisons."""
    hidden = 5
    tally = counted(map_rivals.network(a_network(MAPS["IPMSM"], hidden)).algorithm, 100.0, 3.0)[1]
    by_hand = networks.operations(2, hidden, 2)
    assert tally["multiply"] == tally["add"] == by_hand["multiply-add"]
    assert tally["tanh"] == by_hand["tanh"] and tally["compare"] == 4
    assert tally["load"] == 4 + 5 * hidden + 2 and map_rivals.network(a_network(MAPS["IPMSM"], hidden)).memory == 4 * (5 * hidden + 2)


def test_a_table_costs_the_same_whatever_its_size():
    tallies = [counted(map_rivals.table(MAPS["IPMSM"], DATA["IPMSM"], n).algorithm, 111.0, 2.2)[1] for n in (4, 25)]
    assert tallies[0] == tallies[1]
    assert tallies[0]["convert"] == 2 and tallies[0]["load"] >= 8 and "divide" not in tallies[0]
    assert map_rivals.table(MAPS["IPMSM"], DATA["IPMSM"], 4).memory == 4 * 4 * 2 * 4


@pytest.mark.parametrize("memory, n", [(32, 2), (71, 2), (72, 3), (328, 6), (8 * 625, 25)])
def test_the_table_for_a_memory_is_the_largest_that_fits(memory, n):
    table = map_rivals.table_for(MAPS["IPMSM"], DATA["IPMSM"], memory)
    assert table.memory == 8 * n * n <= memory < 8 * (n + 1) ** 2


def test_a_table_is_the_best_of_its_kind_on_its_data():
    """No other nodes fit the data better: the residual is orthogonal to every bilinear hat, written here with SciPy's interpolator."""
    found, data = MAPS["IPMSM"], DATA["IPMSM"]
    fitted = map_rivals.table(found, data, 5).currents
    residual = data.t - fitted(data.x)
    scale = np.linalg.norm(data.t)
    for i in range(5):
        for j in range(5):
            unit = np.zeros((5, 5))
            unit[i, j] = 1.0
            hat = RegularGridInterpolator(fitted.grid, unit)(data.x)
            assert np.abs(hat @ residual).max() < 1e-8 * scale * max(np.linalg.norm(hat), 1e-3)


def test_a_finer_table_errs_less():
    costs = [map_rivals.cost(MAPS["IPMSM"], map_rivals.table(MAPS["IPMSM"], DATA["IPMSM"], n), every=7) for n in (2, 4, 8)]
    for what in ("loss", "torque", "voltage"):
        errors = [getattr(one, what) for one in costs]
        assert errors == sorted(errors, reverse=True) and errors[2] > 0
    assert costs[0].cycles == costs[2].cycles


def test_counted_numbers_are_numbers():
    """Every operation gives Python's own value and is tallied once; a bare constant is a load."""
    tally = Counter()
    a, b = Counted(3.0, tally), Counted(-0.5, tally)
    values = [a + b, 1 + a, a - b, 1 - a, a * b, 2 * a, a / b, 1 / a, -a, abs(b), a.sqrt(), b.tanh()]
    assert [v.value for v in values] == [2.5, 4, 3.5, -2, -1.5, 6, -6, 1 / 3, -3, 0.5, math.sqrt(3), math.tanh(-0.5)]
    assert (a > b) and not (a < 2) and a.whole(2) == 2 and b.fetched(9.0).value == 9.0
    assert tally == {"add": 6, "multiply": 2, "divide": 2, "square root": 1, "tanh": 1, "compare": 2, "convert": 1, "integer": 2, "load": 6}
    assert cycles(tally) == 6 + 2 + 28 + 14 + 60 + 8 + 1 + 2 + 12


def test_bad_input_is_refused():
    found = MAPS["IPMSM"]
    with pytest.raises(ValueError, match="points"):
        map_rivals.table(found, DATA["IPMSM"], 1)
    with pytest.raises(ValueError, match="memory"):
        map_rivals.table_for(found, DATA["IPMSM"], 31)
    with pytest.raises(ValueError, match="passes"):
        map_rivals.closed_form(IPMSM, passes=0)
    with pytest.raises(ValueError, match="every"):
        map_rivals.cost(found, map_rivals.exact(found), every=0)
    with pytest.raises(ValueError, match="'tanh'"):
        operations.cycles(Counter(tanh=1), {"add": 1})
    with pytest.raises(ValueError, match="input"):
        counted(lambda x: (x,), math.nan)
    hole = loss_map.loss_map(SPMSM, np.linspace(100, 1500, 20), np.linspace(0.1, 1.0, 10), V_max=57.7, I_max=3.0)
    with pytest.raises(ValueError, match="hole"):
        map_rivals.table(hole, DATA["SPMSM"], 5)
