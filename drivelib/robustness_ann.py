"""The network that a drawn PI teaches: data from a mechanical loop, one start, one short training.

``ann_data`` runs the whole drive for its data and trains from many starts, right for one network and too much
for ten thousand. The current loops are far faster than the speed loop, so the teacher here is the PI on (5) with its torque
limit; and since one input leaves a curve, samples of nearly equal error are averaged before the training.
"""

from functools import cache

import numpy as np
from numba import njit

from drivelib import control
from drivelib.ann_data import SPLIT
from drivelib.compiled import OPTIONS
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.levenberg_one import fit
from drivelib.validation import array, choice, number

STEP = 2e-3  # s, of the teacher's loop
LOADS = {"both signs": (-1.0, -0.5, 0.5, 1.0), "one sign": (0.5, 1.0)}
FINE, PER_TURN = 0.5, 4.0  # rad/s and 1: classes of equal width below the first, of 25 % above
SPEEDS = (1.0, 0.2)  # on the set points: the cycle, and the same at low speed
EPOCHS = 100

_pi_output, _pi_integral, _clip = (njit(**OPTIONS)(function) for function in (control.pi_output, control.pi_integral, control.clip))


@njit(**OPTIONS)
def _teacher(K_p, K_i, J, f, T_limit, h, reference, loaded, speeds, loads, error, command):
    """Run the PI on J dΩ/dt + f Ω = C − C_r from standstill; fill error (rad/s) and command (N m), shape (runs, steps).

    All runs go abreast: each waits for its own last division, and meanwhile the processor takes the others'.
    """
    omega, integral = np.zeros(speeds.size), np.zeros(speeds.size)
    for k in range(reference.size):
        for run in range(speeds.size):
            C_r = loads[run] * loaded[k]
            e = speeds[run] * reference[k] - omega[run]
            asked = _pi_output(e, integral[run], K_p)
            torque = _clip(asked, T_limit)
            integral[run] = _pi_integral(integral[run], e, asked, torque, K_i, K_i / K_p, h)
            error[run, k], command[run, k] = e, torque
            slope = (torque - C_r - f * omega[run]) / J
            middle = omega[run] + 0.5 * h * slope
            omega[run] += h * (torque - C_r - f * middle) / J


@cache
def _cycle():
    """Return set point (rad/s) and whether there is load, at each step of the default scenario's cycle."""
    cycle = DEFAULT_SCENARIO
    t = STEP * np.arange(round(cycle.duration / STEP))
    reference, load = (
        np.array([value for _, value in profile])[np.searchsorted([time for time, _ in profile], t + 1e-9, side="right") - 1]
        for profile in (cycle.speed_reference, cycle.load_torque)
    )
    return reference, load > 0


def teacher_data(scenario, gains, loads="both signs"):
    """Return (error in rad/s, command in N m) of PI runs at several operating points, one value per 2 ms.

    Instants of the default scenario's cycle; loads are shares of the rated torque.

    Parameters
    ----------
    scenario : Scenario
        Machine and torque limit.
    gains : control.PiGains
        Of the teacher.
    loads : {"both signs", "one sign"}
    """
    factors = LOADS[choice("loads", loads, tuple(LOADS))]
    machine, (reference, loaded) = scenario.machine, _cycle()
    on = machine.T_rated * loaded
    speeds, shares = np.repeat(SPEEDS, len(factors)), np.tile(factors, len(SPEEDS))
    error, command = np.empty((2, speeds.size, reference.size))
    _teacher(*gains, machine.J, machine.f, scenario.T_limit, STEP, reference, on, speeds, shares, error, command)
    return error.ravel(), command.ravel()


def classes(error, command):
    """Return mean error, mean command and number of the samples of each class of nearly equal errors.

    Least squares on these means, weighted by the numbers, is least squares on the samples, but for the curve's bend within a class.
    """
    error, command = array("error", error, "rad/s"), array("command", command, "N m")
    _, which, count = np.unique(np.rint(PER_TURN * np.arcsinh(error / FINE)), return_inverse=True, return_counts=True)
    return np.bincount(which, error) / count, np.bincount(which, command) / count, count.astype(float)


def trained(error, command, rng, *, activation="logistic", samples=3000, noise=0.0, hidden=15):
    """Train the paper's 1-15-1 network on samples drawn at random instants; return its ``levenberg_one.Fit``.

    Parameters
    ----------
    error, command : ndarray
        From ``teacher_data``.
    rng : numpy.random.Generator
        Draws instants, noise, split and start.
    activation : {"logistic", "tanh"}
    samples : int
        Split 70/15/15; the test share is not used.
    noise : float
        Standard deviation of noise on the recorded error (rad/s).
    """
    samples = number("samples", samples, at_least=100, whole=True)
    at = rng.integers(len(error), size=samples)
    e = error[at] + number("noise", noise, "rad/s", at_least=0) * rng.normal(size=samples)
    ends = np.cumsum([round(share * samples) for share in SPLIT[:2]])
    (x, t, counts), (xv, tv, cv), _ = (classes(*part) if k < 2 else part for k, part in enumerate(zip(np.split(e, ends), np.split(command[at], ends), strict=True)))
    validation = xv[:, None], tv[:, None], cv
    return fit(x[:, None], t[:, None], hidden, rng, activation=activation, epochs=EPOCHS, counts=counts, validation=validation)
