"""Levenberg-Marquardt for one small network on data of its own, compiled; no torch.

``levenberg`` trains many starts on shared data. A robustness study needs the other case: thousands of small
networks, each with its own data, its own start, and bits that depend on neither neighbours nor threads.
The schedule is the toolbox's (``levenberg.TOOLBOX``), step for step; a test holds the two against each other.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from drivelib.compiled import OPTIONS
from drivelib.neural import Network, Range, nguyen_widrow
from drivelib.normal_equations import dot, normal_one, workspace
from drivelib.sigmoid import LOGISTIC, TANH, sigmoid
from drivelib.validation import array, choice, number

STOPS = ("goal", "gradient", "validation", "epochs", "mu")
MU, MU_MAX, DOWN, UP, MIN_GRADIENT, PATIENCE = 1e-3, 1e10, 0.1, 10.0, 1e-7, 6


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
        parts += [np.ascontiguousarray(inputs.to_unit(rows).T), np.ascontiguousarray(targets.to_unit(wanted).T), np.asarray(each, dtype=float)]
    done, met, stop, first, last, v_first, v_last = _descend(*parts, theta, n_hidden, activation == "logistic", goal, stop_at_goal, epochs)
    split = n_hidden * (x.shape[1] + 1)
    hidden, output = theta[:split].reshape(n_hidden, -1), theta[split:].reshape(t.shape[1], -1)
    network = Network(hidden[:, :-1], hidden[:, -1], output[:, :-1], output[:, -1], inputs, targets, activation)
    rms = 50.0 * math.sqrt(last / (parts[2].sum() * t.shape[1]))
    return Fit(network, int(done), int(met), STOPS[stop], rms, max(last / first, v_last / v_first if validation is not None else 0.0))


# The inner loops run over samples or over weights that lie side by side, so that the compiler takes several at once.


@njit(**OPTIONS)
def _errors(x, t, counts, theta, n_hidden, logistic, hidden, errors):
    """Fill hidden values (n_hidden, n) and errors (n_out, n); return the sum of squares."""
    n_in, n = x.shape
    first, total, slope = n_hidden * (n_in + 1), 0.0, LOGISTIC if logistic else TANH
    for j in range(n_hidden):
        row, h = j * (n_in + 1), hidden[j]
        for m in range(n):
            h[m] = theta[row + n_in]
        for i in range(n_in):
            for m in range(n):
                h[m] += theta[row + i] * x[i, m]
        for m in range(n):
            h[m] = sigmoid(h[m], slope)
    for k in range(t.shape[0]):
        row, e = first + k * (n_hidden + 1), errors[k]
        for m in range(n):
            e[m] = theta[row + n_hidden] - t[k, m]
        for j in range(n_hidden):
            for m in range(n):
                e[m] += theta[row + j] * hidden[j, m]
        for m in range(n):
            total += counts[m] * e[m] * e[m]
    return total


@njit(**OPTIONS)
def _solved(JtJ, mu, Jte, U, step):
    """Solve (J^T J + mu) step = J^T e by Cholesky, U^T U, row by row; return whether the matrix was positive."""
    size = Jte.size
    for a in range(size):
        row, given = U[a, a:], JtJ[a, a:]
        for b in range(row.size):
            row[b] = given[b]
        row[0] += mu
        for c in range(a):
            above = U[c, a:]
            for b in range(row.size):
                row[b] -= above[0] * above[b]
        if not row[0] > 0.0:
            return False
        scale = 1.0 / math.sqrt(row[0])
        for b in range(row.size):
            row[b] *= scale
    step[:] = Jte
    for a in range(size):
        step[a] /= U[a, a]
        row, later = U[a, a + 1 :], step[a + 1 :]
        for b in range(row.size):
            later[b] -= step[a] * row[b]
    for a in range(size - 1, -1, -1):
        step[a] = (step[a] - dot(U[a, a + 1 :], step[a + 1 :])) / U[a, a]
    return True


@njit(**OPTIONS)
def _descend(x, t, counts, xv, tv, cv, theta, n_hidden, logistic, goal, stop_at_goal, epochs):
    """Move theta to where the training ends; return epochs, goal epoch, stop, first and last errors of both sets. Samples in columns."""
    size, n, nv, n_out = theta.size, x.shape[1], xv.shape[1], t.shape[0]
    hidden, errors = np.empty((n_hidden, n)), np.empty((n_out, n))
    hidden_v, errors_v = np.empty((n_hidden, nv)), np.empty((n_out, nv))
    work = workspace(x.shape[0], n_hidden, n_out, n)
    JtJ, factor = np.empty((size, size)), np.zeros((size, size))
    Jte, step, trial, best = np.empty(size), np.zeros(size), np.empty(size), theta.copy()
    mu, epoch, goal_epoch, fails, stop = MU, 0, -1, 0, -1
    sse = _errors(x, t, counts, theta, n_hidden, logistic, hidden, errors)
    first = best_sse = sse
    first_v = best_v = np.inf
    arrived = True
    while stop < 0:
        if arrived:
            normal_one(x, counts, theta, n_hidden, logistic, hidden, errors, work, JtJ, Jte)
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
