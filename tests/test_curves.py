"""Counting minima and crossing limits, on curves whose answer is known beforehand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivelib.curves import interior_minima, last_below, least_between


@pytest.mark.parametrize(
    ("values", "count"),
    [
        ([2, 1, 2], 1),
        ([1, 2, 3], 0),
        ([3, 2, 1], 0),
        ([1, 2, 1], 0),
        ([2, 1, 1, 1, 2], 1),
        ([1, 1, 2], 0),
        ([2, 1, 1], 0),
        ([1, 1, 1], 0),
        ([3, 2, 2, 1], 0),
        ([3, 1, 2, 2, 1, 3], 2),
        ([3, 1, 2, 0, 3, 1, 1, 2], 3),
        ([1, 2, 2, 1, 1, 5], 1),
    ],
)
def test_a_minimum_is_a_fall_followed_by_a_rise(values, count):
    """Ends do not count, a flat bottom counts once, a ledge on the way down does not count."""
    assert interior_minima(values) == count
    assert interior_minima(values[::-1]) == count


@settings(derandomize=True, deadline=None, max_examples=200)
@given(st.lists(st.integers(-3, 3), min_size=3, max_size=12))
def test_runs_of_equal_values_count_as_one_point(values):
    """Squeeze out repetitions: what is left below both its neighbours is a minimum."""
    squeezed = [v for k, v in enumerate(values) if k == 0 or v != values[k - 1]]
    expected = sum(a > b < c for a, b, c in zip(squeezed, squeezed[1:], squeezed[2:], strict=False))
    assert interior_minima(values) == expected


def test_curves_are_counted_along_the_last_axis():
    """A cosine over two periods has two interior minima; a family of curves gives one count each."""
    x = np.linspace(0, 4 * np.pi, 400)
    assert interior_minima(np.cos(x)) == 2
    counts = interior_minima(np.cos(x * np.array([[0.2], [1.0], [1.5]])))
    assert counts.tolist() == [0, 2, 3]
    assert interior_minima(np.cos(x).reshape(1, 1, -1)).shape == (1, 1)


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 2.0], [1.0, np.nan, 2.0], [1.0, np.inf, 2.0], 3.0])
def test_too_few_or_wild_points_are_refused(values):
    """Three finite points are the least that can have a minimum inside."""
    with pytest.raises(ValueError, match="values"):
        interior_minima(values)


def test_a_rising_function_crosses_its_limit_where_its_inverse_says():
    """x³ ≤ c up to the cube root of c, for an array of limits at once."""
    limits = np.array([1.0, 8.0, 26.9])
    found = last_below(lambda x: x**3, limits, 0.0, 3.0)
    np.testing.assert_allclose(found, np.cbrt(limits), rtol=1e-12)
    assert np.all(found**3 <= limits), "the last point below, not the first above"


def test_ends_of_the_range_are_told_apart():
    """NaN where the limit is exceeded from the start, the upper end where it never is."""
    found = last_below(lambda x: x, np.array([-1.0, 0.0, 5.0, 2.0, np.nextafter(2.0, 0)]), 0.0, 2.0)
    assert np.isnan(found[0])
    np.testing.assert_allclose(found[1:], [0.0, 2.0, 2.0, 2.0], atol=1e-15)


def test_limits_of_the_range_may_differ_from_element_to_element():
    """Low, high and limit broadcast against each other; a limit that is NaN has no answer, an infinite one no bound."""
    found = last_below(lambda x: 2 * x, 3.0, np.array([0.0, 2.0]), np.array([[2.5], [4.0]]))
    assert found.shape == (2, 2)
    np.testing.assert_array_equal(found[:, 1], [np.nan, np.nan])
    np.testing.assert_allclose(found[:, 0], [1.5, 1.5])
    np.testing.assert_array_equal(last_below(lambda x: x, np.array([np.nan, np.inf]), 0.0, 2.0), [np.nan, 2.0])


def test_a_range_must_have_its_ends_in_order():
    """A lower end above the upper one, or an end at infinity, is refused by name."""
    with pytest.raises(ValueError, match="low = 3 lies above high = 2"):
        last_below(lambda x: x, 1.0, 3.0, 2.0)
    with pytest.raises(ValueError, match="high = inf: must be finite"):
        last_below(lambda x: x, 1.0, 0.0, np.inf)
    with pytest.raises(ValueError, match="steps = 0: must be a finite whole number at least 1"):
        last_below(lambda x: x, 1.0, 0.0, 2.0, steps=0)


def test_the_least_of_a_convex_function_is_found_inside_and_at_the_ends():
    centre = np.array([-3.0, 0.25, 0.7, 9.0])
    x = least_between(lambda x: (x - centre) ** 4 + abs(x - centre), np.zeros(4), 1.0)
    np.testing.assert_allclose(x, [0.0, 0.25, 0.7, 1.0], atol=1e-9)
    assert least_between(lambda x: x, 2.0, 2.0) == 2.0
    with pytest.raises(ValueError, match="low = 2 lies above high = 1"):
        least_between(lambda x: x, 2.0, 1.0)
    with pytest.raises(ValueError, match="low = nan"):
        least_between(lambda x: x, np.nan, 1.0)
