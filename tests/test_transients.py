"""When a signal has settled."""

import math

import numpy as np
import pytest

from drivelib.transients import settling_time


def test_settling_time_of_an_exponential():
    """A first-order rise enters its band of share b after ln(1/b) time constants."""
    t = np.linspace(0, 1, 10001)
    y = np.where(t >= 0.2, -np.expm1(-(t - 0.2) / 0.05), 0.0)
    assert settling_time(t, y, 1.0, 0.02, 0.2) == pytest.approx(0.05 * math.log(50), abs=1.01e-4)
    assert settling_time(t, y, y, 0.02, 0.2) == 0
    assert math.isnan(settling_time(t, y, 1.0, 0.02, 0.2, t_end=0.3))
    assert settling_time([0, 1, 2, 3, 4], [9, 0, 9, 1, 0], 0.0, 1.0, 1.0) == 2  # back in the band, its edge included, at 3 s
    assert settling_time(t, 1 - y, 0.0, 0.02, 0.2) == settling_time(t, y, 1.0, 0.02, 0.2)


def test_settling_time_refuses():
    t = np.linspace(0, 1, 11)
    for values, message in (
        ((t, t[:-1], 0.0, 0.1, 0.2), "y has shape"),
        ((t[::-1], t, 0.0, 0.1, 0.2), "sorted"),
        ((t, t, 0.0, 0.0, 0.2), "band = 0"),
        ((t, t, 0.0, 0.1, 1.5), "t_step = 1.5 s"),
        ((t, np.full(11, np.nan), 0.0, 0.1, 0.2), "y = nan"),
        ((t, t, 0.0, 0.1, 0.21, 0.25), "no sample"),
    ):
        with pytest.raises(ValueError, match=message):
            settling_time(*values)
