"""The two neural speed controllers of the fair contest, both trained on a PI: the paper's, and one with the PI's inputs."""

import math

import numpy as np

from drivelib import ann_data
from drivelib.speed_law import NetworkSpeed
from drivelib.validation import number


def scaled(network, g_e, g_i, g_u):
    """Return a `NetworkSpeed` with factors on its inputs e and ∫e and on its output."""
    factors = np.array([g_e, 1.0, g_i])[: network.W1.shape[1]]
    return NetworkSpeed(network.W1 * factors, network.B1, network.W2 * g_u, network.B2 * g_u, network.activation, network.form)


def teacher(law, scenario):
    """Return the scenario with exact speed whose own PI has the gains of ``law`` (`PiSpeed`): what a network learns from."""
    machine = scenario.known_machine
    omega_n = math.sqrt(law.K_i / machine.J)
    return scenario.changed(encoder=None, omega_n=omega_n, xi=(law.K_p + machine.f) / (2.0 * omega_n * machine.J))


def error_network(law, scenario, *, speed_factors=(2.5, 1.0, 0.4), **training):
    """Return the paper's network, torque from the present error alone, trained on runs of the PI ``law``.

    ``training`` goes to `ann_data.trained_network`. The fastest runs reach 150 rad/s, so that the steps of figure 10 lie
    hardly outside what it has seen.
    """
    result = ann_data.trained_network(teacher(law, scenario), speed_factors=speed_factors, **training)
    return ann_data.network_speed(result.best(unfinished=True))


def fair_network(law, scenario, *, e_max=300.0, samples=2048, n_hidden=15, starts=4, seed=2020):
    """Return a network with the PI's inputs, e and ∫e, that has learned the limited command of the PI ``law``.

    It learns the PI's own answer on Sobol points of the plane, dense near zero, instead of on runs: where a run goes
    would only thin them out. Errors up to ``e_max`` (rad/s), integrals that hold up to the torque limit.
    """
    from scipy.stats import qmc

    from drivelib.levenberg import TOOLBOX
    from drivelib.training import train

    samples = number("samples", samples, at_least=64, whole=True)
    number("K_i of the teacher", law.K_i, "N m/rad", above=0)
    unit = 2.0 * qmc.Sobol(2, rng=np.random.default_rng(seed)).random_base2(math.ceil(math.log2(samples)))[:samples] - 1.0
    inputs = unit**3 * [number("e_max", e_max, "rad/s", above=0), scenario.T_limit / law.K_i]
    command = np.clip(inputs @ [law.K_p, law.K_i], -scenario.T_limit, scenario.T_limit)
    result = train(inputs, command, n_hidden, starts=starts, seed=seed, schedule=TOOLBOX, split=ann_data.SPLIT)
    W1, B1, W2, B2 = result.best(unfinished=True).folded()
    return NetworkSpeed(np.insert(W1, 1, 0.0, axis=1), B1, W2[0], float(B2[0]))
