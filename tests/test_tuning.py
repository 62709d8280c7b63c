"""Search against a function whose minimum is known; Pareto fronts and coverage against brute force."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivelib.tuning import Range, coverage, pareto_front, search

RANGES = (Range("a", 0.1, 10.0), Range("b", -2.0, 2.0, linear=True))


def bowl(a, b):
    return (np.log(a / 3.0) ** 2, (b - 0.5) ** 2)


def dominates(p, q):
    return all(x <= y for x, y in zip(p, q, strict=True)) and any(x < y for x, y in zip(p, q, strict=True))


points = st.lists(st.tuples(*[st.integers(0, 5)] * 3), min_size=1, max_size=25)


@given(points)
def test_the_front_is_what_pairwise_comparison_leaves(rows):
    expected = [not any(dominates(q, p) for q in rows) for p in rows]
    assert pareto_front(rows).tolist() == expected


@given(points, points)
def test_coverage_counts_pairwise(ours, theirs):
    expected = np.mean([any(dominates(p, q) for p in ours) for q in theirs])
    assert coverage(ours, theirs) == pytest.approx(expected)
    assert coverage(ours, ours) == pytest.approx(np.mean(~pareto_front(ours)))


def test_a_failed_candidate_is_on_no_front():
    assert pareto_front([[1.0, 2.0], [0.0, np.inf], [np.nan, 0.0]]).tolist() == [True, False, False]
    assert coverage([[1.0, 1.0]], [[2.0, 2.0], [np.inf, 0.0]]) == 1.0


@pytest.mark.parametrize("budget", [64, 96, 256])
def test_the_budget_is_spent_to_the_last_evaluation_and_no_further(budget):
    calls = []
    found = search(lambda **values: calls.append(values) or bowl(**values), sum, RANGES, budget=budget, seed=3)
    assert len(calls) == budget == len(found.scores) == len(found.results)
    assert found.values.tolist() == [list(values.values()) for values in calls]
    assert all(0.1 <= a <= 10 and -2 <= b <= 2 for a, b in found.values)


def test_the_minimum_is_found_and_repeats_with_its_seed():
    first, again, other = (search(bowl, sum, RANGES, budget=512, seed=seed) for seed in (1, 1, 2))
    assert first.best == pytest.approx({"a": 3.0, "b": 0.5}, abs=0.02)
    assert np.array_equal(first.values, again.values) and not np.array_equal(first.values, other.values)


def test_candidates_that_fail_are_kept_and_not_chosen():
    """Half of the plane diverges, the half that holds the minimum: the best sound point is at the border."""
    found = search(lambda a, b: bowl(a, b) if b > 1 else (np.inf, np.inf), sum, RANGES, budget=256, seed=4)
    assert 0.2 < np.mean(np.isinf(found.scores)) < 0.9 and np.array_equal(np.isinf(found.scores), found.values[:, 1] <= 1)
    assert found.best["b"] == pytest.approx(1.0, abs=0.05)


def test_a_population_in_one_point_still_spends_its_budget():
    assert len(search(lambda a: (1.0,), sum, RANGES[:1], budget=128, seed=5).scores) == 128


@pytest.mark.parametrize("budget", [0, -64, 32, 100, 64.5, np.inf])
def test_a_budget_that_is_none_is_refused(budget):
    with pytest.raises(ValueError, match="budget"):
        search(bowl, sum, RANGES, budget=budget, seed=1)


def test_bad_input_is_refused():
    with pytest.raises(ValueError, match="ranges"):
        search(bowl, sum, (), budget=64, seed=1)
    with pytest.raises(ValueError, match="score is NaN"):
        search(bowl, lambda _: np.nan, RANGES, budget=64, seed=1)
    with pytest.raises(ValueError, match="low end of a"):
        Range("a", 0.0, 1.0)
    with pytest.raises(ValueError, match="high end of a"):
        Range("a", 2.0, 1.0)
    with pytest.raises(ValueError, match="points"):
        pareto_front([])
    with pytest.raises(ValueError, match="ours and theirs"):
        coverage([[1.0, 1.0]], [[1.0]])
    with pytest.raises(ValueError, match="ours and theirs"):
        coverage([[np.inf, 1.0]], [[1.0, 1.0]])
