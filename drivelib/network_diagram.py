"""A network with one input and one output, drawn from its weights."""

import numpy as np
from matplotlib.lines import Line2D

from drivelib.plotting import COLOURS

POSITIVE, NEGATIVE = (COLOURS[2], "-"), (COLOURS[1], (0, (3, 1.2)))
NODE = {"boxstyle": "round,pad=0.25", "facecolor": "white", "edgecolor": COLOURS[0], "linewidth": 1.2}


def bends(network):
    """Return where each hidden neuron bends: the input (in its unit) at which its sum W1 x + B1 is zero."""
    W1, B1, _, _ = network.folded()
    return -B1 / W1[:, 0]


def draw_network(axis, network, *, input_label, output_label, unit=""):
    """Draw a 1-n-1 network: a line per weight, its width by size, its colour and dash by sign.

    Parameters
    ----------
    axis : matplotlib Axes
    network : neural.Network
        Its weights act on values mapped to [−1, 1]. Neurons stand in the order of their `bends`, from the
        top, and carry them.
    input_label, output_label, unit : str
        Names of input and output, and the input's unit.

    Returns
    -------
    list of int
        The hidden neurons from top to bottom.

    Raises
    ------
    ValueError
        If the network has more than one input or output.
    """
    if network.W1.shape[1] != 1 or network.W2.shape[0] != 1:
        raise ValueError(f"the network has {network.W1.shape[1]} inputs and {network.W2.shape[0]} outputs: must be one each")
    at = bends(network)
    order = np.argsort(at, kind="stable")[::-1].tolist()
    heights = np.linspace(1.0, -1.0, len(order)) if len(order) > 1 else np.zeros(1)
    for height, k in zip(heights, order, strict=True):
        _weight(axis, (0.0, 0.0), (1.0, height), network.W1[k, 0], np.abs(network.W1).max())
        _weight(axis, (1.0, height), (2.0, 0.0), network.W2[0, k], np.abs(network.W2).max())
        axis.text(1.0, height, f"{at[k]:.3g}".replace("-", "−"), ha="center", va="center", fontsize=9.5, zorder=4, bbox=NODE)
    axis.plot([0, 2], [0, 0], "o", color=COLOURS[0], markersize=13, markerfacecolor="white", zorder=3)
    axis.text(0.0, 0.12, input_label, ha="center", va="bottom", fontsize=11)
    axis.text(2.0, 0.12, output_label, ha="center", va="bottom", fontsize=11)
    axis.text(1.0, 1.16, f"bends at{f' ({unit})' if unit else ''}", ha="center", va="bottom", fontsize=10)
    keys = [Line2D([], [], color=colour, linestyle=dash, lw=2, label=text) for (colour, dash), text in ((POSITIVE, "weight > 0"), (NEGATIVE, "weight < 0"))]
    axis.legend(handles=keys, loc="lower center", bbox_to_anchor=(0.5, -0.16), ncols=2, fontsize=10)
    axis.set(xlim=(-0.35, 2.35), ylim=(-1.1, 1.25))
    axis.axis("off")
    return order


def _weight(axis, start, end, weight, largest):
    colour, dash = POSITIVE if weight > 0 else NEGATIVE
    width = 0.4 + 3.6 * abs(weight) / largest
    axis.plot(*zip(start, end, strict=True), color=colour, linestyle=dash, lw=width, zorder=1)
