"""Errors, Jacobians and normal equations of many networks on the same data, on torch in float64.

On the CPU the normal equations are compiled (``normal_equations``); elsewhere they are products of torch's Jacobians.
"""

import torch

from drivelib.normal_equations import normal_many


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
        # On the CPU hidden values and errors of 1.2 MB: smaller pieces pay for calls, larger ones for memory. Elsewhere Jacobians of 256 MB.
        cpu, rows = self.t.device.type == "cpu", self.n_hidden + len(self.t)
        self.piece = max(1, 150_000 // (rows * self.n) if cpu else 2**25 // (len(self.t) * self.size * self.n))

    def errors(self, weights):
        """Return hidden values, with those of the padding, and errors output - target, shapes (S, n_hidden, N padded) and (S, n_out, N)."""
        W1, W2 = self._layers(weights)
        hidden = self._hidden(W1)
        return hidden, torch.baddbmm(W2[:, :, -1:] - self.t, W2[:, :, :-1], hidden[..., : self.n])

    def jacobian(self, weights, hidden):
        """Return d error / d weights, shape (S, n_out, size, N)."""
        _, W2 = self._layers(weights)
        hidden = hidden[..., : self.n]
        slope = self._slope(hidden)
        J = hidden.new_zeros(len(weights), len(self.t), self.size, self.n)
        for output in range(len(self.t)):
            back = slope * W2[:, output, :-1, None]
            J[:, output, : self.n_first] = (back[:, :, None] * self.x1[:, : self.n]).flatten(1, 2)
            bias = self.n_first + (output + 1) * (self.n_hidden + 1) - 1
            J[:, output, bias - self.n_hidden : bias] = hidden
            J[:, output, bias] = 1.0
        return J

    def normal(self, weights, hidden, errors, which):
        """Return J^T J and J^T e of the networks ``which``, shapes (W, size, size) and (W, size)."""
        if self.t.device.type != "cpu":
            return self.normal_by_jacobian(*(values.index_select(0, which) for values in (weights, hidden, errors)))
        # In half the time of Jacobians, which do not stay in the cache between their filling and their product.
        JtJ, Jte = weights.new_empty(len(which), self.size, self.size), weights.new_empty(len(which), self.size)
        arrays = [values.numpy() for values in (hidden, errors, which, JtJ, Jte)]
        normal_many(self.x1[:-1].numpy(), weights.numpy(), self.n_hidden, self.activation == "logistic", *arrays)
        return JtJ, Jte

    def normal_by_jacobian(self, weights, hidden, errors):
        """Return J^T J and J^T e of all these networks, on any device."""
        J = self.jacobian(weights, hidden)
        return torch.matmul(J, J.transpose(2, 3)).sum(1), torch.matmul(J, errors[..., None]).squeeze(3).sum(1)

    def bending(self, weights, step):
        """Return J^T e'', where e'' is the second derivative of the errors along ``step``, shape (S, size)."""
        W1, W2 = self._layers(weights)
        V1, V2 = self._layers(step)
        hidden = self._hidden(W1)[..., : self.n]
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
        return z.mul_(2.0).sigmoid_().mul_(2.0).sub_(1.0) if self.activation == "tanh" else z.sigmoid_()

    def _slope(self, hidden):
        return hidden - hidden * hidden if self.activation == "logistic" else 1.0 - hidden * hidden

    def _layers(self, weights):
        W1 = weights[:, : self.n_first].unflatten(1, (self.n_hidden, -1))
        return W1, weights[:, self.n_first :].unflatten(1, (len(self.t), -1))
