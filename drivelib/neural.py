"""Feed-forward networks with one hidden layer, evaluated in NumPy.

``y = W2 act(W1 x + B1) + B2`` (Eskander 2002, section 3.2; Zidani, section IV.C), with inputs and targets
mapped to [-1, 1] as part of the network. Training is in :mod:`drivelib.training`; running a trained network
needs no torch.
"""

from dataclasses import dataclass

import numpy as np

from drivelib.validation import array, choice, number


@dataclass(frozen=True)
class Activation:
    """A hidden-layer function.

    Parameters
    ----------
    function : callable
        Elementwise value.
    reach : float
        The function bends between -reach and reach and is flat outside; used to place the first weights.
    """

    function: callable
    reach: float


# The toolbox writes tanh as 2 / (1 + exp(-2 n)) - 1 and calls it tansig: the same function.
ACTIVATIONS = {
    "tanh": Activation(np.tanh, 2.0),
    "logistic": Activation(lambda z: 0.5 * (1.0 + np.tanh(0.5 * z)), 4.0),
}


@dataclass(frozen=True)
class Range:
    """The span of each column of some data, and the affine map from it to [-1, 1].

    Parameters
    ----------
    low, high : ndarray, shape (n,)
        Smallest and largest value of each column, in the units of the data.
    """

    low: np.ndarray
    high: np.ndarray

    def __post_init__(self):
        low, high = (array(name, np.atleast_1d(getattr(self, name))) for name in ("low", "high"))
        if low.ndim != 1 or low.shape != high.shape:
            raise ValueError(f"low and high have shapes {low.shape} and {high.shape}: must be two vectors of equal length")
        for column in np.flatnonzero(~(high > low)):
            raise ValueError(f"high[{column}] = {high[column]}: must be above low[{column}] = {low[column]}")
        _freeze(self, low=low, high=high)

    @classmethod
    def of(cls, name, rows):
        """Return the range of ``rows``, shape (n_samples, n).

        Raises
        ------
        ValueError
            Naming the first column that is constant: it cannot be mapped to [-1, 1].
        """
        low, high = rows.min(axis=0), rows.max(axis=0)
        for column in np.flatnonzero(~(high > low)):
            raise ValueError(f"{name} column {column} is constant at {low[column]}: must vary, to be mapped to [-1, 1]")
        return cls(low, high)

    @property
    def centre(self):
        """Middle of each column, shape (n,)."""
        return 0.5 * self.low + 0.5 * self.high

    @property
    def half(self):
        """Half the span of each column, shape (n,)."""
        return 0.5 * self.high - 0.5 * self.low

    def to_unit(self, values):
        """Map data, shape (..., n), to [-1, 1]."""
        return (values - self.centre) / self.half

    def from_unit(self, values):
        """Map [-1, 1], shape (..., n), back to the units of the data."""
        return values * self.half + self.centre


@dataclass(frozen=True)
class Network:
    """A network n_in - n_hidden - n_out with its mapping; weights act on mapped inputs and give mapped outputs.

    Parameters
    ----------
    W1, B1 : ndarray, shapes (n_hidden, n_in) and (n_hidden,)
        Input-to-hidden weights and biases.
    W2, B2 : ndarray, shapes (n_out, n_hidden) and (n_out,)
        Hidden-to-output weights and biases.
    inputs, targets : Range
        What the training data spanned.
    activation : {"tanh", "logistic"}
        Hidden-layer function.

    Raises
    ------
    ValueError
        If a weight is not finite or the shapes do not fit.
    """

    W1: np.ndarray
    B1: np.ndarray
    W2: np.ndarray
    B2: np.ndarray
    inputs: Range
    targets: Range
    activation: str = "tanh"

    def __post_init__(self):
        choice("activation", self.activation, tuple(ACTIVATIONS))
        weights = {name: array(name, getattr(self, name)) for name in ("W1", "B1", "W2", "B2")}
        n_in, n_out, n_hidden = self.inputs.low.size, self.targets.low.size, weights["B1"].size
        shapes = {"W1": (n_hidden, n_in), "B1": (n_hidden,), "W2": (n_out, n_hidden), "B2": (n_out,)}
        for name, shape in shapes.items():
            if weights[name].shape != shape:
                raise ValueError(f"{name} has shape {weights[name].shape}: must be {shape}")
        _freeze(self, **weights)

    def predict(self, x):
        """Return the outputs at ``x``.

        Parameters
        ----------
        x : array_like, shape (..., n_in)
            Inputs in the units of the training data. Points outside its range are computed, not refused:
            ask :meth:`outside`.

        Returns
        -------
        ndarray, shape (..., n_out)
            Outputs in the units of the targets.

        Raises
        ------
        ValueError
            If the last axis has not n_in elements, or an element is not finite.
        """
        unit = self.inputs.to_unit(self._checked(x))
        hidden = ACTIVATIONS[self.activation].function(unit @ self.W1.T + self.B1)
        return self.targets.from_unit(hidden @ self.W2.T + self.B2)

    def outside(self, x):
        """Say by how much ``x`` lies outside the training range.

        Parameters
        ----------
        x : array_like, shape (..., n_in)
            Inputs in the units of the training data.

        Returns
        -------
        ndarray, shape (..., n_in)
            Fraction of the range: 0 inside, 0.1 for 10 % of the range above it, -0.1 for 10 % below.

        Raises
        ------
        ValueError
            As :meth:`predict`.
        """
        x = self._checked(x)
        span = self.inputs.high - self.inputs.low
        return (np.maximum(x - self.inputs.high, 0.0) + np.minimum(x - self.inputs.low, 0.0)) / span

    def folded(self):
        """Return ``(W1, B1, W2, B2)`` with the mapping folded in, for compiled loops.

        ``W2 @ act(W1 @ x + B1) + B2`` is then the whole network, in the units of the data.

        Returns
        -------
        tuple of ndarray, shapes (n_hidden, n_in), (n_hidden,), (n_out, n_hidden), (n_out,)
        """
        W1 = self.W1 / self.inputs.half
        W2 = self.W2 * self.targets.half[:, None]
        return W1, self.B1 - W1 @ self.inputs.centre, W2, self.targets.from_unit(self.B2)

    def _checked(self, x):
        x = array("x", x)
        if x.ndim == 0 or x.shape[-1] != self.inputs.low.size:
            raise ValueError(f"x has shape {x.shape}: its last axis must hold the {self.inputs.low.size} inputs")
        return x


def nguyen_widrow(n_in, n_hidden, n_out, rng, activation="tanh"):
    """Draw first weights that spread the bends of the hidden neurons over the input cube [-1, 1]^n_in.

    Parameters
    ----------
    n_in, n_hidden, n_out : int
        Layer sizes.
    rng : numpy.random.Generator
        Source of chance.
    activation : {"tanh", "logistic"}
        Hidden-layer function.

    Returns
    -------
    W1, B1, W2, B2 : ndarray, shapes (n_hidden, n_in), (n_hidden,), (n_out, n_hidden), (n_out,)

    Raises
    ------
    ValueError
        If a size is not a positive whole number or the activation is unknown.

    Notes
    -----
    Rows of W1 point in random directions with length ``reach 0.7 n_hidden^(1/n_in)``; the biases are spaced
    evenly so that the neurons' centres stand at -1 … 1 along their directions; a single neuron sits at 0.
    This is the toolbox's variant. The 1990 paper has reach 1 and random biases. The linear layer starts
    uniformly in [-1, 1].

    References
    ----------
    D. Nguyen and B. Widrow, "Improving the learning speed of 2-layer neural networks by choosing initial
    values of the adaptive weights", IJCNN 1990, doi:10.1109/IJCNN.1990.137819.
    """
    sizes = {"n_in": n_in, "n_hidden": n_hidden, "n_out": n_out}
    n_in, n_hidden, n_out = (number(name, value, at_least=1, whole=True) for name, value in sizes.items())
    choice("activation", activation, tuple(ACTIVATIONS))
    length = ACTIVATIONS[activation].reach * 0.7 * n_hidden ** (1.0 / n_in)
    direction = rng.uniform(-1.0, 1.0, (n_hidden, n_in))
    W1 = length * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    places = np.linspace(-1.0, 1.0, n_hidden) if n_hidden > 1 else np.zeros(1)
    B1 = length * places * np.sign(W1[:, 0])
    return W1, B1, rng.uniform(-1.0, 1.0, (n_out, n_hidden)), rng.uniform(-1.0, 1.0, n_out)


def _freeze(frozen, **arrays):
    for name, values in arrays.items():
        copy = np.array(values)
        copy.flags.writeable = False
        object.__setattr__(frozen, name, copy)
