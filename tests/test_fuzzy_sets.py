"""Figure 5's sets against scikit-fuzzy's and against geometry; the sampled rules against the exact ones."""

import numpy as np
import pytest
import skfuzzy

from drivelib.fuzzy import LABELS, PEAKS, fuzzy_surface
from drivelib.fuzzy_sets import memberships, sampled_output, triangles

X = np.linspace(-1, 1, 601)


@pytest.mark.parametrize("reach", [0.8, 1.0, 1.5])
def test_sets_are_those_of_scikit_fuzzy(reach):
    for k, peak in enumerate(PEAKS):
        theirs = skfuzzy.trimf(X, [peak - reach / 3, peak, peak + reach / 3])
        assert np.allclose(memberships(X, reach=reach)[k], theirs, rtol=0, atol=1e-12)


def test_neighbours_share_every_value_and_cross_at_a_half():
    values = memberships(X)
    assert values.shape == (len(LABELS), X.size)
    assert np.allclose(values.sum(axis=0), 1.0, rtol=0, atol=1e-12)
    assert values.max(axis=0).min() == pytest.approx(0.5, abs=1e-12)
    assert (np.count_nonzero(values > 1e-12, axis=0) <= 2).all()


def test_narrower_sets_cross_lower():
    """Feet at a share r of the distance: neighbours meet halfway, at 1 − 0.5/r."""
    assert memberships(X, reach=0.8).max(axis=0).min() == pytest.approx(1 - 0.5 / 0.8, abs=1e-12)


def test_triangles_are_told_from_other_shapes():
    assert triangles(memberships(X)) == 7
    x = np.linspace(-1, 1, 201)
    bell, trapezoid, low = np.exp(-(x**2) * 10), np.clip(2 - 2 * np.abs(x), 0, 1), 0.5 * (1 - np.abs(x))
    two = np.maximum(1 - 10 * np.abs(x - 0.5), 0) + np.maximum(1 - 10 * np.abs(x + 0.5), 0)
    assert [triangles(shape) for shape in (bell, trapezoid, low, two, 1 - np.abs(x))] == [0, 0, 0, 0, 1]


def test_sampled_rules_are_the_exact_ones():
    rng = np.random.default_rng(5)
    e, de = rng.uniform(-1.2, 1.2, (2, 200))
    assert np.max(np.abs(sampled_output(e, de, samples=12001) - fuzzy_surface(e, de))) < 1e-6


def test_full_outermost_triangles_reach_one():
    """The centroid of a whole triangle is its peak; of the half from 2/3 to 1 it is 8/9."""
    assert sampled_output(1.0, 1.0, outer="full") == pytest.approx(1.0, abs=1e-9)
    assert sampled_output(1.0, 1.0, samples=12001) == pytest.approx(8 / 9, abs=1e-7)


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: memberships([np.nan]), "x = nan at index 0"),
        (lambda: memberships([0.0], reach=0.0), "reach = 0.0"),
        (lambda: sampled_output(0.0, 0.0, outer="hlaf"), "Did you mean half"),
        (lambda: sampled_output(np.inf, 0.0), "e = inf"),
        (lambda: sampled_output(0.0, 0.0, samples=3), "samples = 3 points"),
    ],
)
def test_bad_input_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
