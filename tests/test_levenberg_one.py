"""One compiled training does what the torch batch does, from the same start."""

import numpy as np
import pytest

from drivelib import levenberg, levenberg_one
from drivelib.levenberg_one import fit
from drivelib.training import train


def first_child(seed):
    """The generator that ``training.train`` gives its first start."""
    return np.random.default_rng(np.random.SeedSequence(seed).spawn(1)[0])


def surface(points=9, outputs=1):
    a, b = (axis.ravel() for axis in np.meshgrid(np.linspace(0.5, 4.0, points), np.linspace(20.0, 180.0, points)))
    return np.column_stack([a, b]), np.column_stack([a * b / 100 - 0.1 * a**2, b**2 / 1e4])[:, :outputs]


@pytest.mark.parametrize("outputs", [1, 2])
@pytest.mark.parametrize("activation", ["tanh", "logistic"])
def test_it_takes_the_steps_of_the_batch(activation, outputs):
    x, t = surface(outputs=outputs)
    one = fit(x, t, 3, first_child(5), activation=activation, epochs=15)
    batch = train(x, t, 3, activation=activation, starts=1, seed=5, schedule=levenberg.Schedule("short", epochs=15))
    assert one.epochs == batch.epochs[0] == 15 and one.stop == batch.stop[0] == "epochs"
    for name in ("W1", "B1", "W2", "B2"):
        np.testing.assert_allclose(getattr(one.network, name), getattr(batch.networks[0], name), rtol=1e-6, atol=1e-7)
    assert one.rms_percent == pytest.approx(50 * np.sqrt(batch.sse[0] / t.size), rel=1e-6)
    assert one.fall == pytest.approx(batch.sse[0] / batch.history["sse"][0, 0], rel=1e-6)


def test_the_goal_is_met_at_the_same_epoch_whether_or_not_it_ends_the_training():
    x, t = surface()
    goal = t.size * (2 * 0.02) ** 2
    batch = train(x, t, 2, starts=1, seed=3, schedule=levenberg.TOOLBOX_2002, goal=goal)
    stopped, watched = (fit(x, t, 2, first_child(3), goal=goal, stop_at_goal=stop, epochs=100) for stop in (True, False))
    assert stopped.stop == batch.stop[0] == "goal" and stopped.epochs == batch.epochs[0] == stopped.goal_epoch == watched.goal_epoch
    assert watched.epochs > stopped.epochs and watched.rms_percent < stopped.rms_percent <= 2.0
    assert fit(x, t, 2, first_child(3), goal=1e-9, epochs=5).goal_epoch == -1


def test_counts_stand_for_repeated_samples_and_validation_stops_it():
    rng = np.random.default_rng(0)
    x = np.linspace(-1, 1, 30)[:, None]
    t = np.sin(3 * x) + 0.3 * rng.normal(size=x.shape)
    counts = rng.integers(1, 4, 30)
    repeated = [np.repeat(rows, counts, axis=0) for rows in (x, t)]
    other = np.linspace(-0.97, 0.93, 17)[:, None]
    validation = other, np.sin(3 * other) + 0.3 * rng.normal(size=other.shape), np.ones(17)
    weighed = fit(x, t, 15, first_child(1), counts=counts, validation=validation, epochs=200)
    plain = fit(*repeated, 15, first_child(1), validation=validation, epochs=200)
    np.testing.assert_allclose(weighed.network.predict(other), plain.network.predict(other), rtol=1e-5, atol=1e-6)
    assert weighed.stop == plain.stop == "validation" and weighed.epochs == plain.epochs
    error = np.mean((weighed.network.predict(other) - validation[1]) ** 2)
    assert error < np.mean((fit(x, t, 15, first_child(1), counts=counts, epochs=200).network.predict(other) - validation[1]) ** 2)


def test_the_schedule_is_the_toolboxs():
    toolbox = levenberg.TOOLBOX
    ours = (levenberg_one.MU, levenberg_one.MU_MAX, levenberg_one.DOWN, levenberg_one.UP, levenberg_one.MIN_GRADIENT, levenberg_one.PATIENCE)
    assert ours == (toolbox.mu, toolbox.mu_max, toolbox.down, toolbox.up, toolbox.min_gradient, toolbox.patience) and not toolbox.scaled


@pytest.mark.parametrize(
    "change, message",
    [({"x": [[0.0], [np.nan]]}, "x = nan"), ({"t": [[1.0], [1.0]]}, "column 0 is constant"), ({"n_hidden": 0}, "n_hidden = 0"), ({"epochs": 0}, "epochs = 0"), ({"t": [1.0, 2.0]}, "must be")],
)
def test_bad_data_are_refused(change, message):
    given = {"x": [[0.0], [1.0]], "t": [[0.0], [1.0]], "n_hidden": 2} | change
    with pytest.raises(ValueError, match=message):
        fit(given.pop("x"), given.pop("t"), given.pop("n_hidden"), np.random.default_rng(0), **given)
