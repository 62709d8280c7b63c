"""The exported network inside its range, compiled, float and Q15: every bound follows from the number format."""

import itertools

import numpy as np
import pytest

from drivelib import fixed_point
from exported_c import compiled, harsh, needs_gcc, points, quantised, within_full_scale


def q15_points(n=20_000):
    """Return int16 pairs: every pair of extremes, and many between."""
    edges = [-32768, -32767, -1, 0, 1, 32766, 32767]
    inner = np.random.default_rng(2).integers(-32768, 32768, (n, 2))
    return np.concatenate([np.array(list(itertools.product(edges, edges))), inner])


@needs_gcc
@pytest.mark.parametrize("checked", [True, False], ids=["sanitizer", "plain"])
def test_compiled_q15_is_the_python_integers_bit_for_bit(motor, tmp_path, checked):
    """Over the whole int16 plane, extremes included, with and without the sanitizer of undefined behaviour."""
    q = q15_points()
    got, status = compiled(tmp_path, motor, checked=checked).q15(q)
    q15 = quantised(motor)
    assert np.array_equal(got, q15.evaluate(q)) and np.array_equal(status, q15.status(q))
    assert {*np.unique(status)} == {0, 3, 4}


@needs_gcc
def test_compiled_q15_errs_within_its_stated_bound(motor, tmp_path):
    """Against the float64 network at the inputs that the integers stand for: half a step per rounding, carried to the output."""
    _, network = motor
    q15 = quantised(motor)
    q = q15.to_q15(points(network, 10_000))
    x = np.clip(q15.from_q15(q), network.inputs.low, network.inputs.high)
    got, status = compiled(tmp_path, motor).q15(q)
    assert np.all(status == 0)
    error = np.abs(got * q15.y_scale / 2**15 - within_full_scale(q15, network.predict(x)))
    assert np.all(error <= q15.bound)
    assert np.all(q15.bound <= 0.02 * q15.y_scale)  # a bound of 2 % of full scale or more would say nothing


@needs_gcc
@pytest.mark.parametrize("checked", [True, False], ids=["sanitizer", "plain"])
def test_compiled_float_network_errs_within_the_bound_of_single_precision(motor, tmp_path, checked):
    """γ_n on every sum, two units for tanhf."""
    _, network = motor
    x = points(network, 10_000)
    wanted = network.predict(x)
    out = compiled(tmp_path, motor, checked=checked).floats(x)
    assert np.all(out["status"] == 0)
    error, bound = np.abs(out["network"] - wanted), fixed_point.float32_bound(network)
    assert np.all(error <= bound)
    assert np.all(bound <= 1e-3 * np.max(np.abs(wanted), axis=0))


@needs_gcc
@pytest.mark.parametrize("seed", range(6))
def test_a_harsh_network_stays_exact_and_defined_too(some_map, tmp_path, seed):
    """Nothing overflows whatever the weights, and the stated bound still holds."""
    network = harsh(seed)
    q15, exported, q = quantised((some_map, network)), compiled(tmp_path, (some_map, network)), q15_points(5_000)
    got, status = exported.q15(q)
    assert np.array_equal(got, q15.evaluate(q))
    x, inside = np.clip(q15.from_q15(q), network.inputs.low, network.inputs.high), status == 0
    assert np.mean(inside) > 0.1
    assert np.all((np.abs(got * q15.y_scale / 2**15 - within_full_scale(q15, network.predict(x))) <= q15.bound)[inside])
    x = points(network, 5_000)
    assert np.all(np.abs(exported.floats(x)["network"] - network.predict(x)) <= fixed_point.float32_bound(network))


@pytest.mark.parametrize("seed", range(20))
def test_no_sum_of_the_q15_network_can_leave_32_bits(seed):
    q15 = fixed_point.quantised(harsh(seed))
    for W, B in ((q15.W1, q15.B1), (q15.W2, q15.B2)):
        assert np.all(np.abs(W) < 2**15)
        assert np.all(np.abs(W).sum(axis=1) * 2**15 + np.abs(B) + 2**14 < 2**31)


def test_the_tanh_table_interpolates_within_its_bound():
    """Largest |tanh''| is 4/(3√3); h²/8 of it, half a step for the entry (one where it saturates), half for the result."""
    bits = np.array([15 - 2])  # 28 fractional bits: 8 units of the argument fit
    z = np.random.default_rng(0).integers(-(9 << 27), 9 << 27, 100_000)
    z[:3] = 0, (8 << 28) - 1, -(8 << 28)
    error = np.abs(fixed_point._tanh(z, bits) / 2**15 - np.tanh(z / 2.0**28))
    assert np.max(error) <= 4 / (3 * np.sqrt(3)) / 64**2 / 8 + 2.0**-15 + 2.0**-16 + 2.0**-21
    assert np.all(fixed_point._tanh(-z, bits) == -fixed_point._tanh(z, bits))


def test_the_float_emulation_errs_within_the_bound(motor):
    """tanh correctly rounded here, so half a unit for it."""
    _, network = motor
    x = points(network, 5_000)
    assert np.all(np.abs(fixed_point.float32_predict(network, x) - network.predict(x)) <= fixed_point.float32_bound(network, tanh_ulps=0.5))
