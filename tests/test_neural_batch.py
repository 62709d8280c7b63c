"""Errors, their derivatives and the normal equations of a batch, against automatic differentiation and differences."""

import numpy as np
import pytest
import torch

from drivelib.neural_batch import Batch
from drivelib.normal_equations import BLOCK

SIZES = [(2, 2, 1), (2, 2, 2), (1, 15, 1), (3, 4, 2)]


def batch(size, activation="tanh", n=40, seed=0):
    """Random data for a network of this size, and three rows of random weights."""
    rng = np.random.default_rng(seed)
    x, t = rng.uniform(-1, 1, (n, size[0])), rng.uniform(-1, 1, (n, size[2]))
    made = Batch(x, t, size[1], activation)
    return made, torch.as_tensor(rng.normal(size=(3, made.size))), x, t


def written_out(row, size, activation, x, t):
    """The errors of one network, from the formula and nothing else; shape (n_out, N)."""
    n_in, n_hidden, n_out = size
    first, second = row[: n_hidden * (n_in + 1)], row[n_hidden * (n_in + 1) :]
    first, second = first.reshape(n_hidden, n_in + 1), second.reshape(n_out, n_hidden + 1)
    act = {"tanh": torch.tanh, "logistic": torch.sigmoid}[activation]
    hidden = act(first[:, :-1] @ torch.as_tensor(x).T + first[:, -1:])
    return second[:, :-1] @ hidden + second[:, -1:] - torch.as_tensor(t).T


@pytest.mark.parametrize("activation", ["tanh", "logistic"])
@pytest.mark.parametrize("size", SIZES)
def test_jacobian_is_the_derivative_of_the_errors(size, activation):
    data, weights, x, t = batch(size, activation)
    hidden, errors = data.errors(weights)
    J = data.jacobian(weights, hidden)
    which = torch.tensor([2, 0])
    compiled, by_torch = data.normal(weights, hidden, errors, which), data.normal_by_jacobian(weights, hidden, errors)
    for ours, theirs in zip(compiled, by_torch, strict=True):
        torch.testing.assert_close(ours, theirs[which], rtol=0, atol=1e-11)
    JtJ, Jte = by_torch
    for k, row in enumerate(weights):
        formula = lambda w: written_out(w, size, activation, x, t)  # noqa: E731
        torch.testing.assert_close(errors[k], formula(row), rtol=0, atol=1e-13)
        automatic = torch.func.jacrev(formula)(row).transpose(1, 2)
        torch.testing.assert_close(J[k], automatic, rtol=0, atol=1e-12)
        shifts = 1e-6 * torch.eye(data.size, dtype=torch.float64)
        central = torch.stack([(formula(row + d) - formula(row - d)) / 2e-6 for d in shifts], dim=1)
        torch.testing.assert_close(J[k], central, rtol=0, atol=1e-8)
        flat = automatic.transpose(0, 1).flatten(1)
        torch.testing.assert_close(JtJ[k], flat @ flat.T, rtol=0, atol=1e-11)
        torch.testing.assert_close(Jte[k], flat @ errors[k].flatten(), rtol=0, atol=1e-11)


@pytest.mark.parametrize("n", [BLOCK - 1, BLOCK, BLOCK + 1, 3 * BLOCK + 100])
def test_normal_equations_of_more_samples_than_a_block(n):
    data, weights, _, _ = batch((2, 3, 2), n=n)
    hidden, errors = data.errors(weights)
    compiled, by_torch = data.normal(weights, hidden, errors, torch.arange(3)), data.normal_by_jacobian(weights, hidden, errors)
    for ours, theirs in zip(compiled, by_torch, strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-12, atol=1e-10)


@pytest.mark.parametrize("activation", ["tanh", "logistic"])
@pytest.mark.parametrize("size", SIZES)
def test_bending_is_the_second_derivative_along_the_step(size, activation):
    data, weights, x, t = batch(size, activation)
    steps = weights.flip(0) - 0.3
    for row, step, bending in zip(weights, steps, data.bending(weights, steps), strict=True):
        along = lambda way, row=row, step=step: written_out(row + way * step, size, activation, x, t)  # noqa: E731
        second = torch.func.jacrev(torch.func.jacrev(along))(torch.zeros((), dtype=torch.float64))
        J = torch.func.jacrev(lambda w: written_out(w, size, activation, x, t))(row)
        torch.testing.assert_close(bending, torch.einsum("kn,knw->w", second, J), rtol=0, atol=1e-10)
