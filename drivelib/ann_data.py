"""Zidani's training data: error and command of PI runs at several operating points, and the network they give.

    error, command = pi_data()                                # rad/s, N m
    result = trained_network()                                # 1-15-1, Levenberg-Marquardt, toolbox defaults
    run = simulate(DEFAULT_SCENARIO, network_speed(result.best()))

An operating point is one run of the scenario's own cycle with its set points and its loads scaled. The paper
(sec. IV.C) calls the two columns Err1 and Cmd1 and prints neither their length nor the operating points.
"""

import itertools

import numpy as np

from drivelib.dfim_drive import simulate
from drivelib.dfim_scenario import DEFAULT_SCENARIO
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


def network_speed(network, form="position"):
    """Return a trained network as the drive's speed controller (`speed_law.NetworkSpeed`)."""
    W1, B1, W2, B2 = network.folded()
    return NetworkSpeed(W1, B1, W2[0], float(B2[0]), activation=network.activation, form=form)
