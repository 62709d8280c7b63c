"""Levenberg-Marquardt for one small network on data of its own, compiled; no torch.

``levenberg`` trains many starts on shared data. A robustness study needs the other case: thousands of small
networks, each with its own data, its own start, and bits that depend on neither neighbours nor threads.
The schedule is the toolbox's (``levenberg.TOOLBOX``), step for step; a test holds the two against each other.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from drivelib.neural import Network, Range, nguyen_widrow
from drivelib.validation import array, choice, number

STOPS = ("goal", "gradient", "validation", "epochs", "mu")
MU, MU_MAX, DOWN, UP, MIN_GRADIENT, PATIENCE = 1e-3, 1e10, 0.1, 10.0, 1e-7, 6
_options = {"cache": True, "nogil": True, "error_model": "numpy"}


class Fit(NamedTuple):
    """What became of one training.

    ``goal_epoch``: epoch at which the error first met the goal, −1 for never. ``rms_percent``: RMS error of the network on its
    training data as a share of the targets' range (%). ``fall``: mean squared error of the network over that of the
    start, the larger of training and validation data.
    """

    network: Network
    epochs: int
    goal_epoch: int
    stop: str
    rms_percent: float
    fall: float


def fit(x, t, n_hidden, rng, *, activation="tanh", goal=0.0, stop_at_goal=True, epochs=1000, counts=None, validation=None):
    """Train one network n_in - n_hidden - n_out from one Nguyen-Widrow start.

    Parameters
    ----------
    x, t : array_like, shapes (n, n_in) and (n, n_out)
        Inputs and targets in their own units.
    n_hidden : int
        Hidden neurons.
    rng : numpy.random.Generator
        Gives the start.
    activation : {"tanh", "logistic"}
    goal : float
        Sum of squared errors, targets mapped to [−1, 1]; 0 sets none.
    stop_at_goal : bool
        Whether the training ends there, or only notes the epoch.
    epochs : int
        Most epochs (successful steps).
    counts : array_like, shape (n,), optional
        How often each sample counts; by default once.
    validation : tuple (x, t, counts), optional
        Data whose error stops the training when it has not fallen for six epochs; the network is then that of its lowest error.

    Returns
    -------
    Fit

    Raises
    ------
    ValueError
        If data is not finite, a column is constant, or a parameter is out of range.
    """
    x, t = array("x", x), array("t", t)
    if x.ndim != 2 or t.ndim != 2 or len(x) != len(t):
        raise ValueError(f"x and t have shapes {x.shape} and {t.shape}: must be (n, n_in) and (n, n_out)")
    n_hidden = number("n_hidden", n_hidden, at_least=1, whole=True)
    epochs = number("epochs", epochs, at_least=1, whole=True)
    goal = number("goal", goal, at_least=0)
    choice("activation", activation, ("tanh", "logistic"))
    inputs, targets = Range.of("x", x), Range.of("t", t)
    W1, B1, W2, B2 = nguyen_widrow(x.shape[1], n_hidden, t.shape[1], rng, activation)
    theta = np.concatenate([np.column_stack([W1, B1]).ravel(), np.column_stack([W2, B2]).ravel()])
    watched = (np.zeros((0, x.shape[1])), np.zeros((0, t.shape[1])), np.zeros(0)) if validation is None else validation
    parts = []
    for rows, wanted, each in ((x, t, np.ones(len(x)) if counts is None else counts), watched):
        parts += [np.ascontiguousarray(inputs.to_unit(rows)), np.ascontiguousarray(targets.to_unit(wanted)), np.asarray(each, dtype=float)]
    done, met, stop, first, last, v_first, v_last = _descend(*parts, theta, n_hidden, activation == "logistic", goal, stop_at_goal, epochs)
    split = n_hidden * (x.shape[1] + 1)
    hidden, output = theta[:split].reshape(n_hidden, -1), theta[split:].reshape(t.shape[1], -1)
    network = Network(hidden[:, :-1], hidden[:, -1], output[:, :-1], output[:, -1], inputs, targets, activation)
    rms = 50.0 * math.sqrt(last / (parts[2].sum() * t.shape[1]))
    return Fit(network, int(done), int(met), STOPS[stop], rms, max(last / first, v_last / v_first if validation is not None else 0.0))


@njit(**_options)
def _errors(x, t, counts, theta, n_hidden, logistic, hidden, errors):
    """Fill hidden values (n, n_hidden) and errors (n, n_out); return the sum of squares."""
    n_in, n_out = x.shape[1], t.shape[1]
    first = n_hidden * (n_in + 1)
    total = 0.0
    for n in range(x.shape[0]):
        for j in range(n_hidden):
            row = j * (n_in + 1)
            z = theta[row + n_in]
            for i in range(n_in):
                z += theta[row + i] * x[n, i]
            hidden[n, j] = 1.0 / (1.0 + math.exp(-z)) if logistic else math.tanh(z)
        for k in range(n_out):
            row = first + k * (n_hidden + 1)
            e = theta[row + n_hidden] - t[n, k]
            for j in range(n_hidden):
                e += theta[row + j] * hidden[n, j]
            errors[n, k] = e
            total += counts[n] * e * e
    return total


@njit(**_options)
def _normal(x, counts, theta, n_hidden, logistic, hidden, errors, JtJ, Jte, row):
    """Fill the lower triangle of J^T J, and J^T e."""
    n_in, n_out = x.shape[1], errors.shape[1]
    first, width, size = n_hidden * (n_in + 1), n_hidden + 1, theta.size
    JtJ[:, :] = 0.0
    Jte[:] = 0.0
    for n in range(x.shape[0]):
        for k in range(n_out):
            row[first:] = 0.0
            for j in range(n_hidden):
                h = hidden[n, j]
                back = theta[first + k * width + j] * (h - h * h if logistic else 1.0 - h * h)
                for i in range(n_in):
                    row[j * (n_in + 1) + i] = back * x[n, i]
                row[j * (n_in + 1) + n_in] = back
                row[first + k * width + j] = h
            row[first + k * width + n_hidden] = 1.0
            for a in range(size):
                scaled = counts[n] * row[a]
                Jte[a] += scaled * errors[n, k]
                for b in range(a + 1):
                    JtJ[a, b] += scaled * row[b]


@njit(**_options)
def _solved(JtJ, mu, Jte, factor, step):
    """Solve (J^T J + mu) step = J^T e by Cholesky; return whether the matrix was positive."""
    size = Jte.size
    for a in range(size):
        for b in range(a + 1):
            s = JtJ[a, b] + (mu if a == b else 0.0)
            for c in range(b):
                s -= factor[a, c] * factor[b, c]
            if a == b:
                if not s > 0.0:
                    return False
                factor[a, a] = math.sqrt(s)
            else:
                factor[a, b] = s / factor[b, b]
    for a in range(size):
        s = Jte[a]
        for c in range(a):
            s -= factor[a, c] * step[c]
        step[a] = s / factor[a, a]
    for a in range(size - 1, -1, -1):
        s = step[a]
        for c in range(a + 1, size):
            s -= factor[c, a] * step[c]
        step[a] = s / factor[a, a]
    return True


@njit(**_options)
def _descend(x, t, counts, xv, tv, cv, theta, n_hidden, logistic, goal, stop_at_goal, epochs):
    """Move theta to where the training ends; return epochs, goal epoch, stop, first and last errors of both sets."""
    size, n, nv = theta.size, x.shape[0], xv.shape[0]
    hidden, errors = np.empty((n, n_hidden)), np.empty((n, t.shape[1]))
    hidden_v, errors_v = np.empty((nv, n_hidden)), np.empty((nv, t.shape[1]))
    JtJ, factor = np.empty((size, size)), np.zeros((size, size))
    Jte, step, row, trial, best = np.empty(size), np.zeros(size), np.empty(size), np.empty(size), theta.copy()
    mu, epoch, goal_epoch, fails, stop = MU, 0, -1, 0, -1
    sse = _errors(x, t, counts, theta, n_hidden, logistic, hidden, errors)
    first = best_sse = sse
    first_v = best_v = np.inf
    arrived = True
    while stop < 0:
        if arrived:
            _normal(x, counts, theta, n_hidden, logistic, hidden, errors, JtJ, Jte, row)
            if sse <= goal and goal_epoch < 0:
                goal_epoch = epoch
                if stop_at_goal:
                    stop = 0
            if stop < 0 and math.sqrt((Jte * Jte).sum()) <= MIN_GRADIENT:
                stop = 1
            if nv > 0:
                value = _errors(xv, tv, cv, theta, n_hidden, logistic, hidden_v, errors_v)
                first_v = value if epoch == 0 else first_v
                if value < best_v:
                    best_v, best_sse, fails = value, sse, 0
                    best[:] = theta
                elif value > best_v:
                    fails += 1
                if stop < 0 and fails >= PATIENCE:
                    stop = 2
            if stop < 0 and epoch >= epochs:
                stop = 3
            if stop >= 0:
                break
        solved = _solved(JtJ, mu, Jte, factor, step)
        new = np.inf
        if solved:
            trial[:] = theta - step
            new = _errors(x, t, counts, trial, n_hidden, logistic, hidden, errors)
        arrived = new < sse
        if arrived:
            theta[:] = trial
            sse = new
            mu = max(mu * DOWN, 1e-20)
            epoch += 1
        else:
            mu *= UP
            if mu > MU_MAX:
                stop = 4
    if nv > 0:
        theta[:] = best
        return epoch, goal_epoch, stop, first, best_sse, first_v, best_v
    return epoch, goal_epoch, stop, first, sse, 1.0, 0.0
