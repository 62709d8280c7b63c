"""Training data of Zidani's network: a PI's own input and output, and what one network makes of them."""

import numpy as np
import pytest

from drivelib import ann_data
from drivelib.dfim_drive import simulate
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.neural import Network, Range

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


def test_floor_is_the_variance_of_the_noise_and_share_follows():
    """Command 3 e plus noise of variance 4: classes of width w add the map's slope, (3 w)²/12."""
    rng = np.random.default_rng(1)
    error = rng.uniform(-10, 10, 200_000)
    command = 3.0 * error + rng.normal(0.0, 2.0, error.size)
    for width in (0.1, 1.0):
        expected = 4.0 + (3.0 * width) ** 2 / 12
        assert ann_data.conditional(error, command, width).floor == pytest.approx(expected, rel=0.02)
        assert ann_data.unexplained_share(error, command, width) == pytest.approx(expected / (9 * 400 / 12 + 4), rel=0.03)


def test_classes_by_hand():
    found = ann_data.conditional([0.1, -0.1, 1.0, 1.1], [2.0, 4.0, 5.0, 5.0], 1.0)
    assert found.error.tolist() == [0.0, 1.0]
    assert found.mean.tolist() == [3.0, 5.0]
    assert found.variance.tolist() == [1.0, 0.0]
    assert found.count.tolist() == [2, 2]
    assert found.floor == 1.0  # squares 2, four samples less two classes


def test_pi_answer_is_the_recorded_command():
    error, command = ann_data.pi_data(SHORT, speed_factors=(1.0,), load_factors=(1.0,), samples=SHORT.steps + 1)
    assert np.max(np.abs(ann_data.pi_answer(error, SHORT) - command)) < 1e-9


def test_mse_history_is_the_error_of_the_network_in_newton_metres():
    result = ann_data.trained_network(SHORT, starts=2, samples=300)
    error, command = ann_data.pi_data(SHORT, samples=300)
    for name, curves in ann_data.mse_history(result).items():
        rows = result.samples[name]
        for k, network in enumerate(result.networks):
            missed = network.predict(error[rows, None])[:, 0] - command[rows]
            assert curves[k, result.best_epoch[k]] == pytest.approx(np.mean(missed**2), rel=1e-9)


def straight(slope, activation, offset=0.0):
    """A network whose hidden neurons stay almost straight: u = slope e + offset to 1e-5 for |e| below 10."""
    small = {"logistic": 4e-4, "tanh": 1e-4}[activation]
    centre = {"logistic": 0.5, "tanh": 0.0}[activation]
    unit = Range(np.array([-1.0]), np.array([1.0]))
    W2 = slope / 1e-4 / 3 * np.ones((1, 3))
    return Network(small * np.ones((3, 1)), np.zeros(3), W2, np.array([offset - 3 * centre * W2[0, 0]]), unit, unit, activation)


@pytest.mark.parametrize("activation", ["tanh", "logistic"])
def test_slope_is_the_difference_quotient(activation):
    network = ann_data.trained_network(SHORT, starts=1, samples=300, activation=activation).networks[0]
    for e in (0.0, 3.0, -7.0):
        difference = (network.predict([e + 1e-5])[0] - network.predict([e - 1e-5])[0]) / 2e-5
        assert ann_data.map_slope(network, e) == pytest.approx(difference, rel=1e-5, abs=1e-6)
    assert ann_data.map_slope(straight(2.5, activation)) == pytest.approx(2.5, rel=1e-6)


@pytest.mark.parametrize("activation", ["tanh", "logistic"])
def test_holding_error_of_a_straight_map_is_load_over_slope(activation):
    network = straight(5.0, activation, offset=0.5)
    assert ann_data.holding_error(network, 3.0) == pytest.approx(0.5, abs=1e-5)
    with pytest.raises(ValueError, match="torque = 9.0 N m: no error of the training range"):
        ann_data.holding_error(network, 9.0)
    with pytest.raises(ValueError, match="no error of the training range"):
        ann_data.holding_error(straight(-5.0, activation), 1.0)


def test_drive_settles_where_the_map_holds_the_load():
    """What the map alone predicts is what the simulated drive does at rest: no integral action."""
    network = straight(4.0, "tanh")
    scenario = SHORT.changed(duration=3.0, load_torque=((0.0, 3.0),), speed_reference=((0.0, 0.0),))
    run = simulate(scenario, ann_data.network_speed(network))
    assert -run["omega_m"][-1] == pytest.approx(ann_data.holding_error(network, 3.0), abs=0.01)


def test_statements_see_a_wrong_network():
    network = ann_data.trained_network(SHORT, starts=1, samples=300).networks[0]
    assert all(ann_data.network_statements(network).values())
    broken = [text for text, holds in ann_data.network_statements(straight(1.0, "tanh")).items() if not holds]
    assert broken == ["15 hidden neurons, each with its bias", "one output"]


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda: ann_data.conditional([0.0, 1.0], [1.0], 1.0), "two lists of equal length"),
        (lambda: ann_data.conditional([0.0, 1.0], [1.0, 2.0], 0.1), "2 samples in 2 classes"),
        (lambda: ann_data.conditional([0.0, 1.0], [1.0, 2.0], 0.0), "resolution = 0.0 rad/s"),
        (lambda: ann_data.pi_answer([np.nan], SHORT), "error = nan rad/s"),
    ],
)
def test_bad_records_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
