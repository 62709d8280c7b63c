"""Errors, Jacobians and normal equations of many networks on the same data, on torch in float64."""

from functools import cached_property

import numpy as np
import torch


class Batch:
    """Data, and the errors, Jacobians and normal equations of many networks on them.

    Parameters
    ----------
    x, t : ndarray, shapes (n_samples, n_in) and (n_samples, n_out)
        Mapped inputs and targets.
    n_hidden : int
        Hidden neurons.
    activation : {"tanh", "logistic"}
        Hidden-layer function.
    device : str
        Where to compute.

    Notes
    -----
    One network is a row of weights: for each hidden neuron its weights and bias, then for each output
    neuron its weights and bias; ``size`` numbers in all.
    """

    def __init__(self, x, t, n_hidden, activation, device="cpu"):
        x, self.t = (torch.as_tensor(rows.T.copy(), dtype=torch.float64, device=device) for rows in (x, t))
        # torch computes the last few elements of a tensor by other code with other last bits; rows of whole
        # vectors keep those away from the samples, and so a start's bits from its place in the batch.
        self.n = x.shape[1]
        self.n_padded = -(-self.n // 16) * 16
        self.x1 = x.new_zeros(len(x) + 1, self.n_padded)
        self.x1[:-1, : self.n], self.x1[-1] = x, 1.0
        self.n_hidden, self.activation = n_hidden, activation
        self.n_first = n_hidden * len(self.x1)
        self.size = self.n_first + len(self.t) * (n_hidden + 1)
        # Pieces of 4 MB: smaller ones pay for calls, larger ones for memory.
        doubles = self.t.numel() * (self.size + 1)
        self.piece = max(1, (2**19 if self.t.device.type == "cpu" else 2**25) // doubles)

    def errors(self, weights):
        """Return hidden values and errors output - target, shapes (S, n_hidden, N) and (S, n_out, N)."""
        W1, W2 = self._layers(weights)
        hidden = self._hidden(W1)
        return hidden, torch.baddbmm(W2[:, :, -1:] - self.t, W2[:, :, :-1], hidden)

    def jacobian(self, weights, hidden):
        """Return d error / d weights, shape (S, n_out, size, N), S at most ``piece``; the next call overwrites it."""
        _, W2 = self._layers(weights)
        slope = self._slope(hidden)
        J = self._rows[: len(weights), :, :-1]
        for output, own in enumerate(self._own()):
            first = J[:, output, : self.n_first].unflatten(1, (self.n_hidden, -1))
            back = slope * W2[:, output, :-1, None]
            torch.mul(back[:, :, None, :], self.x1[:, : self.n], out=first)
            J[:, output, own.start : own.stop - 1] = hidden
        return J

    def normal(self, weights, hidden, errors):
        """Return J^T J and J^T e, shapes (S, size, size) and (S, size), S at most ``piece``."""
        self.jacobian(weights, hidden)
        rows = self._rows[: len(weights)]
        rows[:, :, -1] = errors  # both products are blocks of one
        product = _times_transpose(rows.flatten(0, 1)).unflatten(0, (len(weights), len(self.t))).sum(1)
        return product[:, :-1, :-1], product[:, :-1, -1]

    def bending(self, weights, step):
        """Return J^T e'', where e'' is the second derivative of the errors along ``step``, shape (S, size)."""
        W1, W2 = self._layers(weights)
        V1, V2 = self._layers(step)
        hidden = self._hidden(W1)
        slope, turn = self._slope(hidden), torch.matmul(V1, self.x1)[..., : self.n]
        change = slope * turn
        bend = change * turn * ((1.0 if self.activation == "logistic" else 0.0) - 2.0 * hidden)
        second = torch.baddbmm(torch.bmm(W2[:, :, :-1], bend), V2[:, :, :-1], change, alpha=2.0)
        back = slope * torch.bmm(W2[:, :, :-1].transpose(1, 2), second)
        first = torch.bmm(back, self.x1[:, : self.n].T.expand(len(weights), -1, -1))
        own = torch.cat([torch.bmm(second, hidden.transpose(1, 2)), second.sum(2, keepdim=True)], dim=2)
        return torch.cat([first.flatten(1), own.flatten(1)], dim=1)

    def _hidden(self, W1):
        z = torch.matmul(W1, self.x1)
        # tanh z = 2 / (1 + exp(-2 z)) - 1 to 4e-16, in a third of the time of torch.tanh
        hidden = z.mul_(2.0).sigmoid_().mul_(2.0).sub_(1.0) if self.activation == "tanh" else z.sigmoid_()
        return hidden[..., : self.n]

    def _slope(self, hidden):
        return hidden - hidden * hidden if self.activation == "logistic" else 1.0 - hidden * hidden

    @cached_property
    def _rows(self):
        # Fresh memory for every Jacobian would cost more than filling it: zeros and ones are written once.
        rows = self.t.new_zeros(self.piece, len(self.t), self.size + 1, self.n_padded)[..., : self.n]
        for output, own in enumerate(self._own()):
            rows[:, output, own.stop - 1] = 1.0
        return rows

    def _own(self):
        # Where each output neuron's weights and bias stand in a row of weights.
        width = self.n_hidden + 1
        return [slice(self.n_first + k * width, self.n_first + (k + 1) * width) for k in range(len(self.t))]

    def _layers(self, weights):
        W1 = weights[:, : self.n_first].unflatten(1, (self.n_hidden, -1))
        return W1, weights[:, self.n_first :].unflatten(1, (len(self.t), -1))


def _times_transpose(rows):
    """Return ``rows @ rows^T`` of each matrix."""
    if rows.device.type != "cpu":
        return torch.bmm(rows, rows.transpose(1, 2))
    # Half of the work, and four numbers at a time where torch's MKL, pinned to equal bits everywhere, takes two.
    matrices = rows.numpy()
    return torch.from_numpy(np.matmul(matrices, matrices.transpose(0, 2, 1)))
