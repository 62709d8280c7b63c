"""Training data of Zidani's network: a PI's own input and output, and what one network makes of them."""

import numpy as np
import pytest

from drivelib import ann_data
from drivelib.dfim_drive import simulate
from drivelib.dfim_scenario import DEFAULT_SCENARIO

SHORT = DEFAULT_SCENARIO.changed(
    duration=1.0, speed_reference=((0.0, 20.0),), load_torque=((0.0, 0.0), (0.6, 10.0))
)


def test_points_scale_set_points_and_loads_and_leave_the_instants():
    points = ann_data.operating_points(SHORT, (1.0, 0.5), (-1.0, 1.0))
    assert [point.speed_reference for point in points] == [((0.0, 20.0),)] * 2 + [((0.0, 10.0),)] * 2
    assert [point.load_torque for point in points] == [((0.0, 0.0), (0.6, -10.0)), ((0.0, 0.0), (0.6, 10.0))] * 2
    assert all(point.changed(speed_reference=SHORT.speed_reference, load_torque=SHORT.load_torque) == SHORT for point in points)


def test_command_is_the_pi_of_the_error_written_out():
    """A PI with back-calculation, summed here in a plain loop from the error alone, gives the recorded command."""
    error, command = ann_data.pi_data(SHORT, speed_factors=(1.0,), load_factors=(1.0,), samples=SHORT.steps + 1)
    assert len(error) == SHORT.steps + 1
    K_p, K_i = 2 * 0.7 * 20 * 0.2 - 0.001, 0.2 * 20**2
    integral, expected = 0.0, []
    for e in error:
        asked = K_p * e + integral
        given = min(max(asked, -51.0), 51.0)
        integral += 1e-4 * (K_i * e + K_i / K_p * (given - asked))
        expected.append(given)
    assert np.max(np.abs(np.array(expected) - command)) < 1e-9
    assert np.ptp(command) > 10


def test_mirrored_operating_points_give_mirrored_data():
    """Turning every sign turns the data's signs: the drive has no preferred direction."""
    error, command = ann_data.pi_data(SHORT, speed_factors=(1.0,), load_factors=(1.0,))
    mirrored = ann_data.pi_data(SHORT, speed_factors=(-1.0,), load_factors=(-1.0,))
    assert np.allclose(mirrored, (-error, -command), rtol=0, atol=1e-7)


def test_decimation_takes_equal_steps_of_the_full_record_and_keeps_its_bound():
    full = ann_data.pi_data(SHORT, speed_factors=(1.0,), load_factors=(1.0,), samples=SHORT.steps + 1)
    few = ann_data.pi_data(SHORT, speed_factors=(1.0,), load_factors=(1.0,), samples=300)
    every = -(-(SHORT.steps + 1) // 300)
    assert len(few[0]) <= 300
    assert all(np.array_equal(a, b[::every]) for a, b in zip(few, full, strict=True))


def test_network_in_the_loop_is_the_network_that_was_trained():
    """At the first sample of a run the drive's torque reference is the network's answer to the set point."""
    result = ann_data.trained_network(SHORT, starts=2, samples=300)
    network = result.best(unfinished=True)
    assert (network.W1.shape, network.W2.shape, network.activation) == ((15, 1), (1, 15), "logistic")
    size = len(ann_data.pi_data(SHORT, samples=300)[0])
    assert [len(result.samples[name]) for name in ("validation", "test")] == [round(0.15 * size)] * 2
    run = simulate(SHORT.changed(T_limit=200.0), ann_data.network_speed(network))
    assert run["T_ref"][0] == pytest.approx(network.predict([[20.0]])[0, 0], abs=1e-9)


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"speed_factors": ()}, r"speed_factors has shape \(0,\)"),
        ({"load_factors": (1.0, np.nan)}, "load_factors = nan at index 1"),
        ({"samples": 3}, "samples = 3: .* at least 24"),
    ],
)
def test_bad_input_is_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        ann_data.pi_data(SHORT, **arguments)
