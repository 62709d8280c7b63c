"""J^T J and J^T e of small networks, compiled: sums of products of a few features, without the Jacobian.

With d_j the slope of hidden neuron j and V the output weights, the error of output k has derivatives V_kj d_j (x, 1) to the
weights of neuron j, and (h, 1) to those of the output. So every entry is output weights times one of the products of the
features d_j (x, 1) and (h, 1), summed over the samples; between the weights of two outputs there is none.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from drivelib.compiled import OPTIONS

BLOCK = 512  # samples at a time: all features of 1-15-1 stay in the second cache


class Workspace(NamedTuple):
    """Where ``normal_one`` works: features of a block of samples, their products, their products with each output's errors, and a row."""

    features: np.ndarray
    products: np.ndarray
    moments: np.ndarray
    row: np.ndarray


@njit(**OPTIONS)
def workspace(n_in, n_hidden, n_out, n):
    """Return the Workspace for networks n_in - n_hidden - n_out and n samples."""
    wide, block = n_hidden * (n_in + 2) + 1, min(n, BLOCK)
    return Workspace(np.empty((wide, block)), np.empty((wide, wide)), np.empty((n_out, wide)), np.empty(block))


@njit(**OPTIONS, fastmath={"reassoc"})
def dot(a, b):
    """Return Σ a b in the order that suits the vector unit: the one liberty of the compiler here, fixed by the pinned processor."""
    total = 0.0
    for m in range(a.size):
        total += a[m] * b[m]
    return total


@njit(**OPTIONS)
def normal_one(x, counts, theta, n_hidden, logistic, hidden, errors, work, JtJ, Jte):
    """Fill the upper triangle of J^T J, and J^T e, of one network.

    Parameters
    ----------
    x : array, shape (n_in, n or more)
    counts : array, shape (n,)
        How often each sample counts.
    theta : array, shape (size,)
        Weights, in the order of ``neural_batch.Batch``.
    n_hidden : int
    logistic : bool
        Whether the hidden layer is logistic and not tanh.
    hidden, errors : arrays, shapes (n_hidden, n or more) and (n_out, n)
    work : Workspace
    JtJ, Jte : arrays, shapes (size, size) and (size,)
    """
    n_in, n, (n_out, wide), block = x.shape[0], counts.size, work.moments.shape, work.row.size
    work.products[:, :], work.moments[:, :] = 0.0, 0.0
    for begin in range(0, n, block):
        row = work.row[: min(block, n - begin)]
        _fill_features(x[:, begin:], hidden[:, begin:], logistic, row.size, work.features)
        for a in range(wide):
            _multiply(counts[begin:], work.features[a], row)
            for b in range(a, wide):
                work.products[a, b] += dot(row, work.features[b])
        for k in range(n_out):
            _multiply(counts[begin:], errors[k, begin:], row)
            for a in range(wide):
                work.moments[k, a] += dot(row, work.features[a])
    first = n_hidden * (n_in + 1)
    JtJ[:, :], Jte[:] = 0.0, 0.0
    V = np.empty(first)  # of one output, repeated for each weight of a neuron
    for k in range(n_out):
        begin = first + k * (n_hidden + 1)
        for j in range(n_hidden):
            V[j * (n_in + 1) : (j + 1) * (n_in + 1)] = theta[begin + j]
        for a in range(first):
            for b in range(a, first):
                JtJ[a, b] += V[a] * V[b] * work.products[a, b]
            for b in range(first, wide):
                JtJ[a, begin + b - first] = V[a] * work.products[a, b]
            Jte[a] += V[a] * work.moments[k, a]
        for a in range(first, wide):
            for b in range(a, wide):
                JtJ[begin + a - first, begin + b - first] = work.products[a, b]
            Jte[begin + a - first] = work.moments[k, a]


@njit(**OPTIONS)
def _fill_features(x, hidden, logistic, samples, features):
    # d_j (x, 1) of each hidden neuron, then all h and 1.
    n_in, n_hidden = x.shape[0], hidden.shape[0]
    for j in range(n_hidden):
        h, value, slope = hidden[j], features[n_hidden * (n_in + 1) + j], features[j * (n_in + 1) + n_in]
        for m in range(samples):
            value[m] = h[m]
            slope[m] = h[m] - h[m] * h[m] if logistic else 1.0 - h[m] * h[m]
        for i in range(n_in):
            _multiply(x[i], slope, features[j * (n_in + 1) + i, :samples])
    features[-1] = 1.0


@njit(**OPTIONS)
def _multiply(a, b, product):
    for m in range(product.size):
        product[m] = a[m] * b[m]


@njit(**OPTIONS)
def normal_many(x, weights, n_hidden, logistic, hidden, errors, which, JtJ, Jte):
    """Fill J^T J and J^T e, shapes (W, size, size) and (W, size), of the networks ``which`` of a batch.

    Parameters
    ----------
    x, n_hidden, logistic
        As for ``normal_one``.
    weights, hidden, errors : arrays, shapes (S, size), (S, n_hidden, n or more) and (S, n_out, n)
        Of all S networks.
    which : int array, shape (W,)
    """
    n_out, n = errors.shape[1:]
    once, work = np.ones(n), workspace(x.shape[0], n_hidden, n_out, n)
    for k in range(which.size):
        j = which[k]
        normal_one(x, once, weights[j], n_hidden, logistic, hidden[j], errors[j], work, JtJ[k], Jte[k])
        for a in range(weights.shape[1]):
            for b in range(a):
                JtJ[k, a, b] = JtJ[k, b, a]
