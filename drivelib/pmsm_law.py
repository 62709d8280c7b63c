"""The laws in Eskander's control schemes that minimise loss: a network, its closed form, or none.

Three schemes ask a law for different things; `LAW_INPUTS` and `LAW_OUTPUTS` say which. Speed is
mechanical, the angle in rad.
"""

from dataclasses import dataclass

import numpy as np

from drivelib.validation import array

CONTROLS = ("torque-pi", "direct", "angle")
LAWS = ("exact", "zero", "network")
LAW_INPUTS = {
    "torque-pi": (("i_q*", "A"), ("omega_m", "rad/s")),
    "direct": (("omega_m", "rad/s"), ("torque", "N m")),
    "angle": (("omega_m", "rad/s"), ("torque", "N m")),
}
LAW_OUTPUTS = {"torque-pi": ("i_d*",), "direct": ("i_q*", "i_d*"), "angle": ("phi",)}
EXACT, ZERO, NETWORK = range(3)


@dataclass(frozen=True, eq=False)
class NetworkLaw:
    """A trained network as bare arrays, scaling folded in: y = W2 tanh(W1 x + B1) + B2 (sec. 3.2).

    Parameters
    ----------
    W1, B1 : array_like, shapes (hidden, 2) and (hidden,)
        Input to hidden layer. Inputs are in SI units and ordered as in ``LAW_INPUTS``; speed is mechanical.
    W2, B2 : array_like, shapes (outputs, hidden) and (outputs,)
        Hidden layer to output, in A, or rad for the angle.
    low, high : array_like, shape (2,), optional
        Training range of the inputs; runs report where they left it. By default unknown, and nothing is reported.

    Raises
    ------
    ValueError
        If a value is not finite, the shapes do not fit, or ``low`` does not lie below ``high``.
    """

    W1: np.ndarray
    B1: np.ndarray
    W2: np.ndarray
    B2: np.ndarray
    low: np.ndarray | None = None
    high: np.ndarray | None = None

    def __post_init__(self):
        checked = {name: array(name, getattr(self, name)) for name in ("W1", "B1", "W2", "B2")}
        hidden, outputs = checked["B1"].size, checked["B2"].size
        for name, shape in {"W1": (hidden, 2), "B1": (hidden,), "W2": (outputs, hidden), "B2": (outputs,)}.items():
            if checked[name].shape != shape or not checked[name].size:
                raise ValueError(f"{name} has shape {checked[name].shape}: must be {shape}, with (hidden,) = B1 and (outputs,) = B2")
        if (self.low is None) != (self.high is None):
            raise ValueError("low and high: give both ends of the training range, or neither")
        for name, unknown in (("low", -np.inf), ("high", np.inf)):
            ends = getattr(self, name)
            checked[name] = np.full(2, unknown) if ends is None else array(name, ends)
            if checked[name].shape != (2,):
                raise ValueError(f"{name} has shape {checked[name].shape}: must be (2,), one end per input")
        for i in np.flatnonzero(checked["low"] >= checked["high"]):
            raise ValueError(f"low[{i}] = {checked['low'][i]:g}: must lie below high[{i}] = {checked['high'][i]:g}")
        for name, values in checked.items():
            values = np.array(values, dtype=float, order="C")
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def __call__(self, x):
        """Return the outputs, shape (..., outputs), at inputs of shape (..., 2)."""
        return np.tanh(array("x", x) @ self.W1.T + self.B1) @ self.W2.T + self.B2


def network_output(W1, B1, W2, B2, first, second, output):
    """Return one output of W2 tanh(W1 x + B1) + B2 at x = (first, second); compiled in the drive loop, unchecked."""
    y = B2[output]
    for i in range(B1.size):
        y += W2[output, i] * np.tanh(W1[i, 0] * first + W1[i, 1] * second + B1[i])
    return y
