"""Levenberg-Marquardt for many networks at once, on torch in float64.

All starts share the data and differ in their weights. Each keeps its own damping mu, and a start that has
stopped is never touched again, so its result does not depend on its neighbours in the batch.
"""

from dataclasses import dataclass

import torch

from drivelib.validation import number

RUNNING = 0
STOPS = ("running", "goal", "gradient", "stalled", "validation", "epochs", "mu")


@dataclass(frozen=True)
class Schedule:
    """How mu moves and when training stops.

    Parameters
    ----------
    name : str
        What figures and tables call it.
    mu, mu_max : float
        First damping, and the damping at which a start gives up.
    down, up : float
        Factor on mu after a step that lowered the sum of squares, and after one that did not.
    min_gradient : float
        Stop where ``|J^T e|`` falls to it.
    scaled : bool
        Damp each weight in proportion to the largest ``diag(J^T J)`` it has met (Marquardt, as MINPACK does)
        instead of all alike (Levenberg, as the toolbox does).
    gain : bool
        Damp by how well the linear model foretold (Nielsen): after a step that found the share rho of the decrease
        predicted, mu is multiplied by ``1 - (2 rho - 1)^3``, at least ``down``; ``up`` doubles with each failure in a row.
    acceleration : float
        Bend each step by half the geodesic acceleration (Transtrum and Sethna), and refuse a step whose acceleration
        is longer than this times half the step; 0 keeps steps straight.
    stall : float
        Stop where the relative decrease of the sum of squares, both that found and that predicted by the
        linear model, falls to it; 0 never does.
    epochs : int
        Most epochs. An epoch is one successful step with all the trials that it needed, as in the toolbox.
    patience : int
        Stop after so many epochs without a lower validation error.

    Raises
    ------
    ValueError
        If a value is outside its range.

    References
    ----------
    H. B. Nielsen, "Damping parameter in Marquardt's method", report IMM-REP-1999-05, DTU, 1999.
    M. K. Transtrum and J. P. Sethna, "Improvements to the Levenberg-Marquardt algorithm for nonlinear
    least-squares minimization", arXiv:1201.5885, 2012.
    """

    name: str
    mu: float = 1e-3
    mu_max: float = 1e10
    down: float = 0.1
    up: float = 10.0
    scaled: bool = False
    gain: bool = False
    acceleration: float = 0.0
    min_gradient: float = 1e-7
    stall: float = 0.0
    epochs: int = 1000
    patience: int = 6

    def __post_init__(self):
        number("mu", self.mu, above=0)
        number("mu_max", self.mu_max, above=self.mu)
        number("down", self.down, above=0, at_most=1)
        number("up", self.up, above=1)
        number("min_gradient", self.min_gradient, at_least=0)
        number("acceleration", self.acceleration, at_least=0)
        number("stall", self.stall, at_least=0)
        number("epochs", self.epochs, at_least=1, whole=True)
        number("patience", self.patience, at_least=1, whole=True)


# The toolbox's defaults. The epoch limit of 2002 was 100.
TOOLBOX = Schedule("toolbox")
TOOLBOX_2002 = Schedule("toolbox 2002", epochs=100)
# The default: damping in proportion lets weights that do not matter yet move far, and so finds the best minimum
# oftener; the gain ratio and the bent step save epochs. Its first damping, "down" and "up" were chosen on four
# maps of least loss, 2-2-1, 1000 samples; tests/benchmarks/RESULTS.md tells how it did there and on maps kept aside.
# The bound 0.75 is the reference's; it stops as MINPACK by its ftol.
MARQUARDT = Schedule("Marquardt", mu=10.0, down=0.1, up=2.0, scaled=True, gain=True, acceleration=0.75, stall=1e-8)


class Descent:
    """Many starts on their way down; :meth:`run` takes each to its stop.

    Parameters
    ----------
    batch : Batch
        Training data.
    weights : ndarray, shape (S, batch.size)
        Where each start begins.
    schedule : Schedule
        Damping and stops.
    goal : float
        Sum of squared errors, mapped units, at which a start stops.
    validation, test : Batch, optional
        Data that is watched: rising validation error stops a start and gives back its best weights.

    Attributes
    ----------
    weights : Tensor, shape (S, size)
        Final weights; with validation those of the best validation epoch.
    stop, epoch, best_epoch, trials : Tensor, shape (S,)
        Index into ``STOPS``, epochs done, epoch of ``weights``, evaluations of the network.
    history : dict of str to Tensor, shape (S, epochs + 1)
        "sse", "gradient", "mu", "validation", "test" at each epoch, NaN after the stop.
    """

    def __init__(self, batch, weights, schedule, goal=0.0, validation=None, test=None):
        self.batch, self.schedule, self.goal = batch, schedule, goal
        self.watched = {"validation": validation, "test": test}
        self.weights = torch.as_tensor(weights, dtype=torch.float64, device=batch.t.device).clone()
        n = len(self.weights)
        self.sse, self.best_validation = self.weights.new_full((2, n), torch.inf)
        self.mu, self.up = (self.weights.new_full((n,), value) for value in (schedule.mu, schedule.up))
        self.JtJ = self.weights.new_zeros(n, batch.size, batch.size)
        self.Jte = self.weights.new_zeros(n, batch.size)
        self.scale = torch.zeros_like(self.Jte) if schedule.scaled else None
        self.epoch, self.stop, self.best_epoch, self.fails, self.trials = self.weights.new_zeros(5, n, dtype=torch.long)
        self.best_weights = self.weights.clone()
        curves = ["sse", "gradient", "mu"] + [name for name, data in self.watched.items() if data is not None]
        self.history = {name: self.weights.new_full((n, schedule.epochs + 1), torch.nan) for name in curves}

    def run(self):
        """Take every start to its stop."""
        everyone = torch.arange(len(self.weights), device=self.weights.device)
        self._try(everyone, self.weights.clone())
        self._arrive(everyone)
        while len(active := torch.nonzero(self.stop == RUNNING).squeeze(1)):
            step, predicted = self._step(active)
            before = self.sse[active]
            better = self._try(active, self.weights[active] - step)
            won, lost = active[better], active[~better]
            decrease, predicted = before[better] - self.sse[won], predicted[better]
            self._damp(won, lost, decrease / predicted)
            self.epoch[won] += 1
            self._arrive(won)
            if self.schedule.stall:
                self._end(won, torch.maximum(decrease, predicted) <= self.schedule.stall * before[better], "stalled")
        if self.watched["validation"] is not None:
            self.weights = self.best_weights
        else:
            self.best_epoch = self.epoch

    def _step(self, which):
        JtJ, Jte, damping = self.JtJ[which], self.Jte[which], self.mu[which][:, None]
        if self.scale is not None:
            scale = torch.maximum(self.scale[which], JtJ.diagonal(dim1=1, dim2=2))
            self.scale[which] = scale
            damping = damping * torch.where(scale > 0, scale, 1.0)
        JtJ.diagonal(dim1=1, dim2=2).add_(damping)
        factor, failed = torch.linalg.cholesky_ex(JtJ)
        step = torch.cholesky_solve(Jte[:, :, None], factor).squeeze(-1)
        predicted = (step * (Jte + damping * step)).sum(1)
        refused = failed > 0
        if self.schedule.acceleration:
            parts = (value.split(self.batch.piece) for value in (self.weights[which], step))
            bending = torch.cat([self.batch.bending(*part) for part in zip(*parts, strict=True)])
            half = 0.5 * torch.cholesky_solve(bending[:, :, None], factor).squeeze(-1)
            longest = (0.25 * self.schedule.acceleration) ** 2
            refused |= (damping * half * half).sum(1) > longest * (damping * step * step).sum(1)
            step = step + half
        # No step, also where the matrix is singular to working precision, counts as a failed trial.
        step[refused] = 0.0
        return step, predicted

    def _damp(self, won, lost, rho):
        self.mu[lost] *= self.up[lost]
        self._end(lost, self.mu[lost] > self.schedule.mu_max, "mu")
        down = torch.full_like(rho, self.schedule.down)
        if self.schedule.gain:
            down = torch.maximum(down, 1.0 - (2.0 * rho - 1.0) ** 3)
            self.up[lost] *= 2.0
            self.up[won] = self.schedule.up
        self.mu[won] = torch.clamp(self.mu[won] * down, min=1e-20)

    def _try(self, which, weights):
        # Return which of the trial weights lower the sum of squares; those are taken over.
        better = []
        for part, trial in zip(which.split(self.batch.piece), weights.split(self.batch.piece), strict=True):
            hidden, errors = self.batch.errors(trial)
            sse = errors.square().flatten(1).sum(1)
            good = sse < self.sse[part]
            better.append(good)
            keep = torch.nonzero(good).squeeze(1)
            won = part[keep]
            self.weights[won], self.sse[won] = trial[keep], sse[keep]
            self.JtJ[won], self.Jte[won] = self.batch.normal(trial, hidden, errors, keep)
        self.trials[which] += 1
        return torch.cat(better)

    def _arrive(self, which):
        # Record the epoch that these starts have reached, and stop those that are done.
        gradient = self.Jte[which].norm(dim=1)
        values = {"sse": self.sse[which], "gradient": gradient, "mu": self.mu[which]}
        for name, data in self.watched.items():
            if data is not None:
                _, errors = data.errors(self.weights[which])
                values[name] = errors.square().flatten(1).sum(1)
        epoch = self.epoch[which]
        for name, value in values.items():
            self.history[name][which, epoch] = value
        self._end(which, values["sse"] <= self.goal, "goal")
        self._end(which, gradient <= self.schedule.min_gradient, "gradient")
        if "validation" in values:
            self._watch(which, values["validation"])
        self._end(which, epoch >= self.schedule.epochs, "epochs")

    def _watch(self, which, value):
        best = self.best_validation[which]
        lower, higher = which[value < best], which[value > best]
        self.best_validation[lower] = value[value < best]
        self.best_weights[lower] = self.weights[lower]
        self.best_epoch[lower] = self.epoch[lower]
        self.fails[lower] = 0
        self.fails[higher] += 1
        self._end(which, self.fails[which] >= self.schedule.patience, "validation")

    def _end(self, which, reached, reason):
        ending = which[reached & (self.stop[which] == RUNNING)]
        self.stop[ending] = STOPS.index(reason)
