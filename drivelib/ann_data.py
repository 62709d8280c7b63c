"""Zidani's training data: error and command of PI runs at several operating points, and the network they give.

    error, command = pi_data()                                # rad/s, N m
    result = trained_network()                                # 1-15-1, Levenberg-Marquardt, toolbox defaults
    run = simulate(DEFAULT_SCENARIO, network_speed(result.best()))

An operating point is one run of the scenario's own cycle with its set points and its loads scaled. The paper
(sec. IV.C) calls the two columns Err1 and Cmd1 and prints neither their length nor the operating points.
"""

import itertools
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from drivelib import control
from drivelib.dfim_drive import simulate
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.neural import ACTIVATIONS
from drivelib.speed_law import NetworkSpeed
from drivelib.validation import array, number

SPEED_FACTORS = (1.0, 0.6, 0.2)
LOAD_FACTORS = (-1.0, -0.5, 0.5, 1.0)
SAMPLES = 3000
N_HIDDEN = 15
SPLIT = (0.7, 0.15, 0.15)
STARTS = 32
SEED = 2020


def operating_points(scenario=DEFAULT_SCENARIO, speed_factors=SPEED_FACTORS, load_factors=LOAD_FACTORS):
    """Return the scenarios of the PI runs: every pair of factors on set points and on load torques.

    Parameters
    ----------
    scenario : Scenario
        Machine, gains, limits and cycle; its speed and load profiles are scaled, their instants stay.
    speed_factors, load_factors : sequence of float
        Factors on every set point and on every load. A load factor below 0 lets the load drive where it
        braked, so that the default set has as much load of either sign.

    Returns
    -------
    list of Scenario

    Raises
    ------
    ValueError
        If a list is empty or a factor is not finite.
    """
    lists = {"speed_factors": array("speed_factors", speed_factors), "load_factors": array("load_factors", load_factors)}
    for name, factors in lists.items():
        if factors.ndim != 1 or not factors.size:
            raise ValueError(f"{name} has shape {factors.shape}: must be a list of at least one factor")
    return [
        scenario.changed(
            speed_reference=tuple((time, speed * value) for time, value in scenario.speed_reference),
            load_torque=tuple((time, load * value) for time, value in scenario.load_torque),
        )
        for speed, load in itertools.product(*(factors.tolist() for factors in lists.values()))
    ]


def pi_data(scenario=DEFAULT_SCENARIO, *, speed_factors=SPEED_FACTORS, load_factors=LOAD_FACTORS, samples=SAMPLES):
    """Return speed error and torque command of PI runs, taken at equal intervals of time.

    Parameters
    ----------
    scenario, speed_factors, load_factors
        See `operating_points`; the PI has the scenario's own gains.
    samples : int
        Most samples in all. Each run gives the same number: its first sample and every k-th after it.

    Returns
    -------
    error, command : ndarray, shape (n,)
        Ω* − Ω (rad/s) of (23), and the torque reference after its limit (N m) of the same control sample;
        run after run, in the order of `operating_points`.

    Raises
    ------
    ValueError
        If there would be fewer than two samples per run, or an argument of `operating_points` is refused.
    """
    runs = operating_points(scenario, speed_factors, load_factors)
    samples = number("samples", samples, at_least=2 * len(runs), whole=True)
    every = -(-(scenario.steps + 1) // (samples // len(runs)))
    pairs = [_error_and_command(simulate(run, every=every)) for run in runs]
    return tuple(np.concatenate(column) for column in zip(*pairs, strict=True))


def _error_and_command(record):
    return record["omega_ref"] - record["omega_m"], record["T_ref"].copy()


def trained_network(
    scenario=DEFAULT_SCENARIO, *, activation="logistic", starts=STARTS, seed=SEED, n_hidden=N_HIDDEN, split=SPLIT, **data
):
    """Train the paper's network, error to command, on `pi_data`.

    Parameters
    ----------
    scenario : Scenario
    activation : {"logistic", "tanh"}
        Hidden-layer function. "Nonlinear sigmoid" may be either; the toolbox calls them logsig and tansig.
    starts, seed : int
        Random starts, and the seed of starts and split.
    n_hidden : int
        Hidden neurons.
    split : tuple of three floats
        Shares of training, validation and test samples.
    **data
        Passed to `pi_data`.

    Returns
    -------
    training.TrainingResult
        With ``best()`` the network of the start with the lowest validation error.
    """
    from drivelib.levenberg import TOOLBOX
    from drivelib.training import train

    error, command = pi_data(scenario, **data)
    return train(error, command, n_hidden, activation=activation, starts=starts, seed=seed, schedule=TOOLBOX, split=split)


def mse_history(result):
    """Return {"train", "validation", "test": mean squared error ((N m)²) per start and epoch} of a training.

    A start that has stopped is NaN from there on.
    """
    per_unit = float(result.networks[0].targets.half[0]) ** 2
    return {name: result.history[f"mse_{name}"] * per_unit for name in result.samples}


def network_speed(network, form="position"):
    """Return a trained network as the drive's speed controller (`speed_law.NetworkSpeed`)."""
    W1, B1, W2, B2 = network.folded()
    return NetworkSpeed(W1, B1, W2[0], float(B2[0]), activation=network.activation, form=form)


class Conditional(NamedTuple):
    """What the error alone says about the command, over classes of equal width around multiples of it."""

    error: np.ndarray
    """Middle of each class that holds samples (rad/s)."""
    mean: np.ndarray
    """Mean command (N m): the best output that a map of the present error can give there."""
    variance: np.ndarray
    """Variance of the command about that mean ((N m)²), for samples that exist; 0 for a single one."""
    count: np.ndarray
    """Number of samples."""

    @property
    def floor(self):
        """Mean squared error ((N m)²) of that best map; n samples in m classes are divided by n − m."""
        return float(self.count @ self.variance / (self.count.sum() - self.count.size))


def conditional(error, command, resolution):
    """Return the command's mean and variance for each error that can be told apart.

    Parameters
    ----------
    error, command : array_like, shape (n,)
        See `pi_data` (rad/s, N m).
    resolution : float
        Width of a class (rad/s). A finer one separates errors that no encoder does; a coarser one counts
        the map's own slope as variance, a twelfth of (slope × width)².

    Returns
    -------
    Conditional

    Raises
    ------
    ValueError
        If an array is not finite, shapes differ, or there are not more samples than classes.
    """
    error, command = array("error", error, "rad/s"), array("command", command, "N m")
    if error.ndim != 1 or error.shape != command.shape:
        raise ValueError(f"error and command have shapes {error.shape} and {command.shape}: must be two lists of equal length")
    classes, which, count = np.unique(np.round(error / number("resolution", resolution, "rad/s", above=0)), return_inverse=True, return_counts=True)
    if count.size >= error.size:
        raise ValueError(f"resolution = {resolution} rad/s: leaves {error.size} samples in {count.size} classes, must be fewer classes")
    mean = np.bincount(which, command) / count
    variance = np.bincount(which, (command - mean[which]) ** 2) / count
    return Conditional(classes * resolution, mean, variance, count)


def unexplained_share(error, command, resolution):
    """Return the share of the command's variance that no function of the present error explains; see `conditional`."""
    return conditional(error, command, resolution).floor / float(np.var(command))


def pi_answer(error, scenario=DEFAULT_SCENARIO):
    """Return the command (N m) of the scenario's PI to a record of errors (rad/s), one per control period."""
    gains, limit, integral = scenario.speed_gains, scenario.T_limit, 0.0
    answer = []
    for e in array("error", error, "rad/s").tolist():
        asked = control.pi_output(e, integral, gains.K_p)
        answer.append(control.clip(asked, limit))
        integral = control.pi_integral(integral, e, asked, answer[-1], gains.K_i, gains.K_i / gains.K_p, scenario.period)
    return np.array(answer)


def map_slope(network, error=0.0):
    """Return du/de (N m s/rad) of a one-input network at an error (rad/s), from the derivative of its sigmoid."""
    W1, B1, W2, _ = network.folded()
    hidden = ACTIVATIONS[network.activation].function(W1[:, 0] * number("error", error, "rad/s") + B1)
    bend = hidden * (1.0 - hidden) if network.activation == "logistic" else 1.0 - hidden**2
    return float(W2[0] @ (bend * W1[:, 0]))


def holding_error(network, torque, *, points=20001):
    """Return the error (rad/s) nearest to 0 at which the network holds a constant load, with rising output.

    A map of the present error has no memory, so at rest the load itself fixes the error: u(e) = T.

    Parameters
    ----------
    network : neural.Network
        One input (rad/s), one output (N m).
    torque : float
        Load (N m).
    points : int
        Errors of the training range that are tried before the root is refined.

    Raises
    ------
    ValueError
        If no error of the training range gives the torque.
    """
    torque = number("torque", torque, "N m")
    grid = np.linspace(network.inputs.low[0], network.inputs.high[0], number("points", points, at_least=3, whole=True))
    missing = network.predict(grid[:, None])[:, 0] - torque
    rises = np.flatnonzero((missing[:-1] < 0) & (missing[1:] >= 0))
    if not rises.size:
        raise ValueError(f"torque = {torque} N m: no error of the training range makes the network give it with rising output")
    roots = [brentq(lambda e: network.predict([e])[0] - torque, grid[k], grid[k + 1]) for k in rises]
    return float(min(roots, key=abs))


def network_statements(network, n_hidden=N_HIDDEN):
    """Return {statement of sec. IV.C: whether it holds} for a trained network, from its weights and outputs."""
    x = np.linspace(network.inputs.low[0], network.inputs.high[0], 401)[:, None]
    hidden = ACTIVATIONS[network.activation].function(network.inputs.to_unit(x) @ network.W1.T + network.B1)
    steps = np.diff(hidden, axis=0) * np.sign(network.W1[:, 0])
    output = network.targets.from_unit(np.column_stack([hidden, np.ones(len(x))]) @ np.append(network.W2[0], network.B2))
    return {
        "one input": network.W1.shape[1] == 1,
        f"{n_hidden} hidden neurons, each with its bias": network.W1.shape[0] == network.B1.size == n_hidden,
        "one output": network.W2.shape == (1, n_hidden) and network.B2.size == 1,
        "each hidden neuron rises or falls between two bounds": bool((steps >= 0).all() and np.abs(hidden).max() <= 1),
        "the output is linear in the hidden neurons": bool(np.allclose(output, network.predict(x)[:, 0], rtol=0, atol=1e-9)),
    }
