"""Networks: the mapping to [-1, 1], first weights, and the forms in which a trained network is used."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivelib.neural import ACTIVATIONS, Network, Range, nguyen_widrow

activations = st.sampled_from(sorted(ACTIVATIONS))
sizes = st.tuples(st.integers(1, 4), st.integers(1, 15), st.integers(1, 3))
seeds = st.integers(0, 2**32)
relaxed = settings(derandomize=True, deadline=None, max_examples=60)


def network(size, seed, activation="tanh"):
    """A network with random weights and ranges of very different size, such as ampere beside rad/s."""
    rng = np.random.default_rng(seed)
    low_in, low_out = (rng.normal(size=n) * 10.0 ** rng.integers(-2, 4, n) for n in (size[0], size[2]))
    spans = (10.0 ** rng.uniform(-2, 3, n) for n in (size[0], size[2]))
    inputs, targets = (Range(low, low + span) for low, span in zip((low_in, low_out), spans, strict=True))
    return Network(*nguyen_widrow(*size, rng, activation), inputs, targets, activation), rng


@relaxed
@given(sizes, seeds, activations)
def test_folded_formula_is_the_network(size, seed, activation):
    net, rng = network(size, seed, activation)
    x = rng.uniform(net.inputs.low, net.inputs.high, (7, size[0]))
    W1, B1, W2, B2 = net.folded()
    act = {"tanh": np.tanh, "logistic": lambda z: 1 / (1 + np.exp(-z))}[activation]
    plain = np.array([W2 @ act(W1 @ point + B1) + B2 for point in x])
    scale = np.abs(net.targets.low) + np.abs(net.targets.high)
    assert np.all(np.abs(plain - net.predict(x)) <= 1e-9 * scale)


@relaxed
@given(sizes, seeds)
def test_mapping_sends_the_range_to_plus_minus_one_and_back(size, seed):
    net, rng = network(size, seed)
    ends = np.array([net.inputs.low, net.inputs.high])
    np.testing.assert_allclose(net.inputs.to_unit(ends), [[-1.0] * size[0], [1.0] * size[0]], rtol=1e-9)
    x = rng.uniform(*ends, (5, size[0]))
    np.testing.assert_allclose(net.inputs.from_unit(net.inputs.to_unit(x)), x, rtol=1e-12, atol=1e-12)


def test_the_forward_pass_is_the_papers_formula():
    """Eskander, section 3.2, by hand: one neuron, inputs 0..4 and 0..2, target 10..30."""
    net = Network([[0.5, -1.0]], [0.25], [[2.0]], [-0.5], Range([0, 0], [4, 2]), Range([10], [30]))
    z = 0.5 * (3 - 2) / 2 - 1.0 * (0.5 - 1) / 1 + 0.25
    expected = 20 + 10 * (2 * (1 - np.exp(-2 * z)) / (1 + np.exp(-2 * z)) - 0.5)
    assert net.predict([3.0, 0.5]) == pytest.approx([expected], rel=1e-14)


def test_predict_keeps_leading_axes():
    net, rng = network((2, 3, 2), 0)
    x = rng.uniform(net.inputs.low, net.inputs.high, (4, 5, 2))
    assert net.predict(x).shape == (4, 5, 2)
    np.testing.assert_allclose(net.predict(x)[2, 3], net.predict(x[2, 3]), rtol=1e-13)


def test_outside_reports_the_fraction_of_the_range():
    net = Network(np.ones((1, 2)), [0.0], [[1.0]], [0.0], Range([0.2, 40], [4.2, 240]), Range([0], [1]))
    found = net.outside([[4.6, 140], [0.2, 20], [4.2, 240]])
    np.testing.assert_allclose(found, [[0.1, 0.0], [0.0, -0.1], [0.0, 0.0]], atol=1e-15)


@relaxed
@given(sizes, seeds, activations)
def test_nguyen_widrow_spreads_the_neurons_over_the_cube(size, seed, activation):
    n_in, n_hidden, n_out = size
    W1, B1, W2, B2 = nguyen_widrow(*size, np.random.default_rng(seed), activation)
    reach = {"tanh": 2.0, "logistic": 4.0}[activation]
    length = reach * 0.7 * n_hidden ** (1 / n_in)
    np.testing.assert_allclose(np.linalg.norm(W1, axis=1), length, rtol=1e-12)
    # The middle of a neuron's bend is the plane W1 x + B1 = 0; its point nearest to 0 lies in the cube.
    nearest = -W1 * (B1 / length**2)[:, None]
    assert np.all(np.abs(nearest) <= 1 + 1e-12)
    assert np.all(np.abs(W2) <= 1) and np.all(np.abs(B2) <= 1)
    # Evenly spread in one dimension: the neurons stand at equal distances.
    if n_in == 1 and n_hidden > 1:
        np.testing.assert_allclose(np.diff(np.sort(-B1 / W1[:, 0])), 2 / (n_hidden - 1), rtol=1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Range([0, 1], [1, 1]), r"high\[1\] = 1.0: must be above low\[1\]"),
        (lambda: Range([0], [np.nan]), "high = nan at index 0: must be finite"),
        (lambda: Range([0, 0], [1]), r"shapes \(2,\) and \(1,\)"),
        (lambda: nguyen_widrow(0, 2, 1, np.random.default_rng()), "n_in = 0: must be .* at least 1"),
        (lambda: nguyen_widrow(1, 2, 1, np.random.default_rng(), "tan"), "activation = 'tan'.*Did you mean 'tanh'|tanh"),
        (lambda: Network([[1.0]], [0, 0], [[1]], [0], Range([0], [1]), Range([0], [1])), r"W1 has shape \(1, 1\): must be \(2, 1\)"),
        (lambda: network((2, 2, 1), 0)[0].predict([1.0]), r"x has shape \(1,\): its last axis must hold the 2 inputs"),
        (lambda: network((2, 2, 1), 0)[0].outside([1.0, np.inf]), "x = inf at index 1"),
    ],
)
def test_bad_input_is_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_network_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        network((2, 2, 1), 0)[0].W1[0, 0] = 1.0
