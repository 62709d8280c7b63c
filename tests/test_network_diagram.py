"""The drawing of a network says what its weights say."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from drivelib.network_diagram import NEGATIVE, POSITIVE, bends, draw_network
from drivelib.neural import Network, Range

INPUTS, TARGETS = Range(np.array([-10.0]), np.array([30.0])), Range(np.array([-5.0]), np.array([5.0]))
NETWORK = Network([[2.0], [-1.0], [4.0]], [1.0, 0.5, -4.0], [[1.0, -3.0, 0.5]], [0.2], INPUTS, TARGETS)


def test_a_neuron_bends_where_its_sum_is_zero():
    """Mapped inputs −1/2, 1/2, 1 are 0, 20 and 30: middle 10, half span 20."""
    assert bends(NETWORK) == pytest.approx([0.0, 20.0, 30.0])


def test_lines_show_sign_and_size():
    _, axis = plt.subplots()
    order = draw_network(axis, NETWORK, input_label="e", output_label="u")
    assert order == [2, 1, 0]
    lines = [line for line in axis.lines if len(line.get_xdata()) == 2 and line.get_linestyle() != "None"]
    assert len(lines) == 6
    first = [line for line in lines if list(line.get_xdata()) == [0.0, 1.0]]
    second = [line for line in lines if list(line.get_xdata()) == [1.0, 2.0]]
    assert [line.get_color() for line in first] == [POSITIVE[0], NEGATIVE[0], POSITIVE[0]]
    assert [line.get_color() for line in second] == [POSITIVE[0], NEGATIVE[0], POSITIVE[0]]
    assert np.argsort([line.get_linewidth() for line in first]).tolist() == [1, 2, 0]
    assert np.argmax([line.get_linewidth() for line in second]) == 1
    plt.close("all")


def test_two_inputs_are_refused():
    wide = Range(np.array([-1.0, -1.0]), np.array([1.0, 1.0]))
    with pytest.raises(ValueError, match="2 inputs and 1 outputs"):
        draw_network(None, Network([[1.0, 1.0]], [0.0], [[1.0]], [0.0], wide, TARGETS), input_label="e", output_label="u")
