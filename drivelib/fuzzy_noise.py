"""What an encoder's noise makes of the fuzzy controller: its mean answer to an error while Δe is mostly noise.

The rules' surface has a kink at the origin: 1.5 (e + Δe) where the signs differ, 1.5 times the larger where they agree.
A linear controller passes the mean of a noisy input; this one does not.
"""

import numpy as np

from drivelib.encoder import encoder_speed, sensor
from drivelib.fuzzy import fuzzy_surface
from drivelib.fuzzy_facts import ORIGIN_SLOPE
from drivelib.validation import array, number


def mean_answer(law, encoder, error, *, speed=60.0, period=1e-4, samples=20_000):
    """Return the mean output over what the same small-signal gain would give without noise.

    Parameters
    ----------
    law : FuzzySpeed
    encoder : Encoder
    error : array_like, shape (n,)
        True errors (rad/s), held while the shaft turns steadily; not 0.
    speed, period : float
        Of the shaft (rad/s), and between readings (s).
    samples : int
        Readings that the mean is taken over.

    Returns
    -------
    ndarray, shape (n,)
        1: as without noise, 0: no answer, below 0: away from the set point.

    Raises
    ------
    ValueError
        If an error is 0 or a number is out of range.
    """
    error = array("error", error, "rad/s")
    if np.any(error == 0):
        raise ValueError("error = 0 rad/s: must differ from 0, there is no answer to be in proportion to")
    period, speed = number("period", period, "s", above=0), number("speed", speed, "rad/s")
    samples = number("samples", samples, at_least=100, whole=True)
    settle = int(10 / (encoder.corner * period)) + 1
    eye = sensor(encoder, samples + settle, period)
    seen = np.array([encoder_speed(eye, speed * period * k, k, period) for k in range(samples + settle)])[settle:]
    noise, change = speed - seen[1:], -np.diff(seen)
    mean = np.array([fuzzy_surface(law.K_e * (one + noise), law.K_de * change).mean() for one in error])
    return mean / (ORIGIN_SLOPE * law.K_e * error)
