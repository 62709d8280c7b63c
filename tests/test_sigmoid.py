"""The compiled loops' own exponential, logistic function and tanh against arithmetic of 40 digits."""

import mpmath
import numpy as np
import pytest

from drivelib.sigmoid import LOGISTIC, TANH, exponential, sigmoid

X = np.concatenate([np.linspace(-40, 40, 401), np.geomspace(1e-300, 700, 300), -np.geomspace(1e-300, 700, 300), [0.0, -0.0]])


@pytest.fixture(autouse=True)
def digits():
    with mpmath.workdps(40):
        yield


def test_the_exponential_is_exact_to_two_units_in_the_last_place():
    exact = [mpmath.exp(mpmath.mpf(float(x))) for x in X]
    assert max(abs(mpmath.mpf(float(exponential(x))) / e - 1) for x, e in zip(X, exact, strict=True)) < 4e-16


@pytest.mark.parametrize("slope, function", [(TANH, mpmath.tanh), (LOGISTIC, lambda x: 1 / (1 + mpmath.exp(-x)))])
def test_both_sigmoids_are_exact_to_two_bits_of_one(slope, function):
    assert max(abs(sigmoid(x, slope) - function(mpmath.mpf(float(x)))) for x in X) < 4e-16


@pytest.mark.parametrize("slope, low", [(TANH, -1.0), (LOGISTIC, 0.0)])
def test_beyond_all_bounds_they_hold_their_ends_and_nan_shows(slope, low):
    assert sigmoid(np.inf, slope) == 1.0 and sigmoid(1e6, slope) == 1.0
    assert sigmoid(-np.inf, slope) == pytest.approx(low, abs=1e-300) and sigmoid(-1e6, slope) == pytest.approx(low, abs=1e-300)
    assert np.isnan(sigmoid(np.nan, slope))
