"""Train a network from many random starts, and keep what each start did.

The spread over starts belongs to the answer: "after few epochs" is a statement about a distribution.
"""

from collections import Counter
from dataclasses import dataclass

import numpy as np
import torch

from drivelib.levenberg import MARQUARDT, STOPS, Descent, Schedule
from drivelib.neural import ACTIVATIONS, Network, Range, nguyen_widrow
from drivelib.neural_batch import Batch
from drivelib.validation import choice, number

FINISHED = ("gradient", "stalled", "validation")


class NotConverged(RuntimeError):
    """The best start did not reach its goal, or was cut off before it finished."""


@dataclass(frozen=True)
class TrainingResult:
    """What every start did.

    Parameters
    ----------
    networks : tuple of Network
        One per start; with a validation set, at its best validation epoch.
    sse : ndarray, shape (S,)
        Sum of squared errors of each network on its training samples, targets mapped to [-1, 1].
    score : ndarray, shape (S,)
        What the best start is chosen by: ``sse``, or the validation MSE where there is a validation set.
    stop : ndarray of str, shape (S,)
        Why each start stopped: goal, gradient, stalled, validation, epochs (ran out) or mu (no step helps).
    reached : ndarray of bool, shape (S,)
        With a goal: it was met. Without: the start stopped because it was done, not because it ran out.
    epochs, best_epoch, trials : ndarray of int, shape (S,)
        Successful steps, the epoch that the network is taken from, evaluations of the network.
    history : dict of str to ndarray, shape (S, largest epoch + 1)
        "sse", "gradient" (|J^T e|), "mu", "mse_train", and with a split "mse_validation", "mse_test";
        mapped targets, NaN after a start's stop. Times ``networks[0].targets.half ** 2`` the MSE of a single
        output is in the target's units.
    samples : dict of str to ndarray of int
        Which rows were "train", "validation", "test".
    """

    networks: tuple
    sse: np.ndarray
    score: np.ndarray
    stop: np.ndarray
    reached: np.ndarray
    epochs: np.ndarray
    best_epoch: np.ndarray
    trials: np.ndarray
    history: dict
    samples: dict

    @property
    def best_start(self):
        """Index of the start with the lowest score."""
        return int(np.argmin(self.score))

    def best(self, unfinished=False):
        """Return the network of the best start.

        Parameters
        ----------
        unfinished : bool
            Accept it even if it did not reach the goal or was cut off.

        Raises
        ------
        NotConverged
            If it did not, unless ``unfinished``.
        """
        k = self.best_start
        if not (unfinished or self.reached[k]):
            stops = ", ".join(f"{n} by {reason}" for reason, n in Counter(self.stop.tolist()).most_common())
            raise NotConverged(
                f"best start {k}: SSE {self.sse[k]:.6g} after {self.epochs[k]} epochs, stopped by {self.stop[k]}, goal or "
                f"minimum not reached; {self.reached.sum()} of {len(self.reached)} starts did ({stops})"
            )
        return self.networks[k]


def train(
    x, t, n_hidden, *, activation="tanh", starts=256, seed=0, schedule=MARQUARDT, goal=0.0, split=None, device="cpu"
):
    """Train networks n_in - n_hidden - n_out by Levenberg-Marquardt from random starts.

    Parameters
    ----------
    x, t : array_like, shapes (n_samples, n_in) and (n_samples, n_out)
        Inputs and targets in their own units; one-dimensional data is one column.
    n_hidden : int
        Hidden neurons.
    activation : {"tanh", "logistic"}
        Hidden-layer function.
    starts : int
        Random starts S. Start k is the same however many there are.
    seed : int
        Seed of starts and split.
    schedule : Schedule
        ``MARQUARDT``, which finds the best minimum oftener, ``TOOLBOX`` or ``TOOLBOX_2002``, which the papers will
        have used, or one's own.
    goal : float
        Sum of squared errors at which a start is done, targets mapped to [-1, 1]; 0 sets none. An MSE goal
        is this over n_samples n_out.
    split : tuple of three floats, optional
        Shares of training, validation and test samples, drawn at random without replacement, validation and
        test rounded to whole samples, the same for all starts. Without it every sample trains.
    device : str
        Where torch computes: "cpu", or with a build of torch for GPUs "cuda" or "cuda:0" and so on.

    Returns
    -------
    TrainingResult

    Raises
    ------
    ValueError
        If data is not finite (naming row and column), has a constant column (naming it), rows of x and t do
        not pair, or a parameter is out of range.

    References
    ----------
    M. T. Hagan and M. B. Menhaj, "Training feedforward networks with the Marquardt algorithm", IEEE Trans.
    Neural Networks 5(6), 1994, doi:10.1109/72.329697.
    """
    x, t = _table("x", x), _table("t", t)
    if len(x) != len(t):
        raise ValueError(f"x has {len(x)} rows and t has {len(t)}: each input needs its target")
    n_hidden = number("n_hidden", n_hidden, at_least=1, whole=True)
    starts = number("starts", starts, at_least=1, whole=True)
    seed = number("seed", seed, at_least=0, whole=True)
    goal = number("goal", goal, at_least=0)
    choice("activation", activation, tuple(ACTIVATIONS))
    if not isinstance(schedule, Schedule):
        raise ValueError(f"schedule = {schedule!r}: must be a Schedule, such as MARQUARDT")
    _check_device(device)
    inputs, targets = Range.of("x", x), Range.of("t", t)
    root = np.random.SeedSequence(seed)
    samples = _split(len(x), split, np.random.default_rng(root))
    sizes = (x.shape[1], n_hidden, t.shape[1])
    first = [nguyen_widrow(*sizes, np.random.default_rng(child), activation) for child in root.spawn(starts)]
    parts = {
        name: Batch(inputs.to_unit(x[rows]), targets.to_unit(t[rows]), n_hidden, activation, device)
        for name, rows in samples.items()
    }
    descent = Descent(
        parts["train"], np.array([_row(*w) for w in first]), schedule, goal, parts.get("validation"), parts.get("test")
    )
    descent.run()
    networks = tuple(Network(*_layers(row, *sizes), inputs, targets, activation) for row in descent.weights.cpu().numpy())
    return _result(descent, networks, samples, goal, t.shape[1])


def _result(descent, networks, samples, goal, n_out):
    epochs, best_epoch, trials, stop = (
        value.cpu().numpy() for value in (descent.epoch, descent.best_epoch, descent.trials, descent.stop)
    )
    history = {name: curve[:, : epochs.max() + 1].cpu().numpy() for name, curve in descent.history.items()}
    for name, sums in (("train", history["sse"]), ("validation", None), ("test", None)):
        if name in samples:
            sums = history.pop(name) if sums is None else sums
            history[f"mse_{name}"] = sums / (len(samples[name]) * n_out)
    final = np.arange(len(epochs)), best_epoch
    sse = history["sse"][final]
    stop = np.array(STOPS)[stop]
    return TrainingResult(
        networks=networks,
        sse=sse,
        score=history["mse_validation"][final] if "validation" in samples else sse,
        stop=stop,
        reached=sse <= goal if goal > 0 else np.isin(stop, ("goal", *FINISHED)),
        epochs=epochs,
        best_epoch=best_epoch,
        trials=trials,
        history=history,
        samples=samples,
    )


def _table(name, values):
    table = np.asarray(values, dtype=float)
    table = table[:, None] if table.ndim == 1 else table
    if table.ndim != 2 or table.size == 0:
        raise ValueError(f"{name} has shape {table.shape}: must be (n_samples, n_columns), neither of them 0")
    for row, column in np.argwhere(~np.isfinite(table)):
        raise ValueError(f"{name} row {row}, column {column} is {table[row, column]}: must be finite")
    return table


def _split(n, shares, rng):
    if shares is None:
        return {"train": np.arange(n)}
    if len(shares) != 3 or not all(0 < share < 1 for share in shares) or abs(sum(shares) - 1) > 1e-9:
        raise ValueError(f"split = {shares!r}: must be three shares above 0 that add up to 1, such as (0.7, 0.15, 0.15)")
    n_validation, n_test = round(shares[1] * n), round(shares[2] * n)
    if min(n - n_validation - n_test, n_validation, n_test) < 1:
        raise ValueError(f"split = {shares!r} leaves an empty part of {n} samples: each needs at least 1")
    order = rng.permutation(n)
    ends = n - n_validation - n_test, n - n_test
    return dict(zip(("train", "validation", "test"), map(np.sort, np.split(order, ends)), strict=True))


def _check_device(device):
    gpus = [f"cuda:{k}" for k in range(torch.cuda.device_count())]
    choice("device", str(device), ["cpu", "cuda", *gpus] if gpus else ["cpu"])


def _row(W1, B1, W2, B2):
    return np.concatenate([np.column_stack([W1, B1]).ravel(), np.column_stack([W2, B2]).ravel()])


def _layers(row, n_in, n_hidden, n_out):
    first, second = np.split(row, [n_hidden * (n_in + 1)])
    first, second = first.reshape(n_hidden, n_in + 1), second.reshape(n_out, n_hidden + 1)
    return first[:, :-1], first[:, -1], second[:, :-1], second[:, -1]
