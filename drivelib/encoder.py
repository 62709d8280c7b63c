"""What a drive's controller sees of its speed: the position in whole counts, differentiated and low-pass filtered."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit

from drivelib.compiled import OPTIONS
from drivelib.validation import number


class Sensor(NamedTuple):
    """An encoder as the drive loop takes it. ``counts`` 0: the speed is known exactly.

    ``noise``: error of each sample's position (counts). ``state``: last whole count, filtered speed (rad/s), and
    what a load observer holds (speed in rad/s, torque in N m), see ``speed_law.weighted_command``.
    """

    counts: float
    blend: float
    noise: np.ndarray
    state: np.ndarray


@dataclass(frozen=True)
class Encoder:
    """Incremental encoder, read once per control period.

    Parameters
    ----------
    counts : int
        Edges per turn, four per line.
    noise : float
        Standard deviation of the position's error, independent from sample to sample (counts).
    corner : float
        Of the first-order low pass behind the difference quotient (rad/s).
    seed : int
        Of the noise.

    Raises
    ------
    ValueError
        If a value is out of range.
    """

    counts: int = 10_000
    noise: float = 0.25
    corner: float = 600.0
    seed: int = 0

    def __post_init__(self):
        number("counts", self.counts, "per turn", at_least=4, whole=True)
        number("noise", self.noise, "counts", at_least=0)
        number("corner", self.corner, "rad/s", above=0)
        number("seed", self.seed, at_least=0, whole=True)


@lru_cache(maxsize=8)
def _noise(seed, samples):
    drawn = np.random.default_rng(seed).standard_normal(samples)
    drawn.flags.writeable = False
    return drawn


def sensor(encoder, samples, period):
    """Return the Sensor of an Encoder, or of None, for ``samples`` readings at a distance of ``period`` (s)."""
    if encoder is None:
        return Sensor(0.0, 0.0, _noise(0, 0), np.zeros(4))
    blend = -math.expm1(-encoder.corner * period)
    return Sensor(float(encoder.counts), blend, encoder.noise * _noise(encoder.seed, samples), np.zeros(4))


@njit(**OPTIONS)
def encoder_speed(sensor, theta_m, sample, period):
    """Return the speed (rad/s) that the controller sees at the angle theta_m (rad), and keep what the next reading needs.

    The position is rounded to whole counts; its difference over the period passes the low pass, exact at its samples.
    """
    place = math.floor(theta_m * sensor.counts / (2.0 * math.pi) + sensor.noise[sample] + 0.5)
    raw = (place - sensor.state[0]) * 2.0 * math.pi / (sensor.counts * period)
    sensor.state[0] = place
    sensor.state[1] += sensor.blend * (raw - sensor.state[1])
    return sensor.state[1]
