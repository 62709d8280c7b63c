"""What an encoder's noise makes of the fuzzy controller: the error that its mean output answers to while Δe is mostly noise.

A linear controller passes the mean of a noisy input on; this one does not. Its surface has a kink at the origin, 1.5 (e + Δe)
where the signs differ and 1.5 times the larger where they agree, so of an e that is small beside Δe half is lost. And noise
that is not symmetric, such as that of whole counts, leaves a mean, in units of e K_de/K_e times as large.
"""

import numpy as np

from drivelib.encoder import encoder_speed, sensor
from drivelib.fuzzy import fuzzy_surface
from drivelib.fuzzy_facts import ORIGIN_SLOPE
from drivelib.validation import array, number


def answered_error(law, encoder, error, *, speed=60.0, period=1e-4, samples=20_000):
    """Return the error (rad/s) without noise to which the mean output in noise would be the small-signal answer.

    Parameters
    ----------
    law : FuzzySpeed
    encoder : Encoder
    error : array_like, shape (n,)
        True errors (rad/s), held while the shaft turns steadily.
    speed, period : float
        Of the shaft (rad/s), and between readings (s).
    samples : int
        Readings that the mean is taken over.

    Returns
    -------
    ndarray, shape (n,)
        Mean output over 1.5 K_e (rad/s); ``error`` itself for a linear controller. Where it is 0 the controller stands.

    Raises
    ------
    ValueError
        If a number is out of range.
    """
    error = array("error", error, "rad/s")
    period, speed = number("period", period, "s", above=0), number("speed", speed, "rad/s")
    samples = number("samples", samples, at_least=100, whole=True)
    settle = int(10 / (encoder.corner * period)) + 1
    eye = sensor(encoder, samples + settle, period)
    seen = np.array([encoder_speed(eye, speed * period * k, k, period) for k in range(samples + settle)])[settle:]
    noise, change = speed - seen[1:], -np.diff(seen)
    mean = np.array([fuzzy_surface(law.K_e * (one + noise), law.K_de * change).mean() for one in error])
    return mean / (ORIGIN_SLOPE * law.K_e)
