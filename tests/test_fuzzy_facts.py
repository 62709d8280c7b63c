"""What is said about table I and its surface, and what the controller refuses."""

import numpy as np
import pytest
from scipy.optimize import linprog

from drivelib import fuzzy_facts
from drivelib.fuzzy import LABELS, RULES, FuzzyGains, fuzzy_output, fuzzy_surface
from drivelib.fuzzy_reference import control_system


def test_evaluator_may_rely_on_the_table():
    """The closed form needs an odd table that depends on the sum alone and moves by one set at most."""
    facts = fuzzy_facts.rule_facts()
    assert facts.odd and facts.symmetric and facts.monotone and not facts.off_diagonal
    steps = np.diff([LABELS.index(facts.by_sum[s]) for s in range(-6, 7)])
    assert set(steps) == {0, 1}


def test_facts_see_a_changed_cell():
    """One wrong cell breaks each regularity, and is named."""
    rules = RULES.copy()
    rules[1, 4] = 2  # (NM, PP): NP -> PM
    facts = fuzzy_facts.rule_facts(rules)
    assert not facts.odd and not facts.symmetric and not facts.monotone
    assert facts.off_diagonal == [("NM", "PP", "PM")]


def test_table_is_not_the_saturated_sum():
    """The saturated sum has no cell unlike itself; table I differs where the sum is ±2 or ±3, one set too low."""
    k = np.arange(-3, 4)
    total = k[:, None] + k
    assert not fuzzy_facts.rule_facts(np.clip(total, -3, 3)).unlike_saturated_sum
    cells = fuzzy_facts.rule_facts().unlike_saturated_sum
    sums = [LABELS.index(e) + LABELS.index(de) - 6 for e, de, _ in cells]
    assert {abs(s) for s in sums} == {2, 3}
    assert len(cells) == np.isin(abs(total), (2, 3)).sum()
    for s, (_, _, u) in zip(sums, cells):
        assert LABELS.index(u) - 3 == s - np.sign(s)


def test_surface_falls_although_the_table_does_not():
    """At Δe = 1 only PG is fired: halfway between two rules it is clipped at 1/2, and its centroid moves
    from 8/9 to 47/54 (trapezoid on [2/3, 1]: ramp of width 1/6, then plateau)."""
    assert fuzzy_output(5 / 6, 1.0) == pytest.approx(47 / 54, abs=1e-15)
    falls = fuzzy_facts.falls(301)
    assert falls.largest >= 8 / 9 - 47 / 54 - 1e-12
    fall = fuzzy_output(falls.e_from, falls.de) - fuzzy_output(falls.e_to, falls.de)
    assert falls.e_from < falls.e_to and fall == pytest.approx(falls.largest, abs=1e-12)


def test_fall_is_counted_by_hand():
    """Share of falling steps on a grid small enough to count pair by pair."""
    axis = np.linspace(-1, 1, 13)
    pairs = [(a, b, de) for a, b in zip(axis, axis[1:]) for de in axis]
    down = sum(fuzzy_output(b, de) - fuzzy_output(a, de) < -1e-9 for a, b, de in pairs)
    assert fuzzy_facts.falls(13).share == pytest.approx(down / len(pairs))


def test_no_linear_law_is_the_surface():
    """Two general gains, found by least squares and by linear programming, do no better than the two laws
    reported; rules (PM, PM) and (PG, PG) alone, sums 4/3 and 2 with output 8/9, forbid less than 8/45."""
    fit = fuzzy_facts.linear_fit(61)
    axis = np.linspace(-1, 1, 61)
    e, de = (m.ravel() for m in np.meshgrid(axis, axis, indexing="ij"))
    u = fuzzy_surface(e, de)
    A = np.column_stack([e, de])
    gains, squares, *_ = np.linalg.lstsq(A, u)
    assert gains == pytest.approx([fit.K_least_squares] * 2, abs=1e-12)
    assert fit.rms == pytest.approx(np.sqrt(squares[0] / u.size), abs=1e-12)
    one = np.ones((u.size, 1))
    within = np.block([[A, -one], [-A, -one]])
    best = linprog([0, 0, 1], within, np.concatenate([u, -u]), bounds=[(None, None), (None, None), (0, None)])
    assert fit.worst == pytest.approx(best.fun, abs=1e-9)
    assert fit.worst >= 8 / 45 - 1e-12


@pytest.mark.parametrize(
    "change, message",
    [
        ({"K_e": 0.0}, "K_e = 0.0 s/rad: must be a finite number above 0 s/rad"),
        ({"K_de": -1.0}, "K_de = -1.0 s/rad: .* above 0 s/rad"),
        ({"K_u": float("nan")}, "K_u = nan N m: .* above 0 N m"),
        ({"K_u": "40"}, "K_u = '40': must be a real number"),
        ({"form": "incremntal"}, "must be one of 'position', 'incremental'. Did you mean incremental"),
    ],
)
def test_gains_refuse(change, message):
    """Gains are finite and positive, the form is one of two."""
    with pytest.raises(ValueError, match=message):
        FuzzyGains(**{"K_e": 0.02, "K_de": 1.0, "K_u": 40.0, **change})


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: fuzzy_surface([0.0, np.nan], 0.0), r"e = nan at index 1: must be finite"),
        (lambda: fuzzy_surface(0.0, np.inf), "de = inf: must be finite"),
        (lambda: fuzzy_surface(np.zeros(2), np.zeros(3)), "mismatch"),
        (lambda: control_system(100), "samples = 100 points: must be one more than a multiple of 12"),
        (lambda: fuzzy_facts.rule_facts(np.full((7, 7), 4)), "whole entries from −3"),
        (lambda: fuzzy_facts.rule_facts(RULES[:6]), r"shape \(6, 7\)"),
        (lambda: fuzzy_facts.origin_slope(np.nan, 0.0), "e = nan"),
        (lambda: fuzzy_facts.linear_fit(60), "points = 60: must be one more than a multiple of 6"),
        (lambda: fuzzy_facts.falls(5), "points = 5: must be a finite whole number at least 7"),
        (lambda: fuzzy_facts.gains_like_pi(4.0, 40.0, 1e-3, e_max=-1.0), "e_max = -1.0 rad/s: .* above 0 rad/s"),
        (lambda: fuzzy_facts.equivalent_gains(FuzzyGains(0.02, 1.0, 40.0), 0.0), "T_s = 0.0 s: .* above 0 s"),
    ],
)
def test_functions_refuse(call, message):
    """Each names the parameter, its value and what is allowed."""
    with pytest.raises(ValueError, match=message):
        call()
