"""Levenberg-Marquardt: minima against SciPy, determinism, stops, and what is refused."""

import inspect
import itertools
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.optimize import least_squares

from drivelib.levenberg import MARQUARDT, STOPS, TOOLBOX, Descent, Schedule
from drivelib.neural import Network, Range, nguyen_widrow
from drivelib.neural_batch import Batch
from drivelib.training import NotConverged, train


def machine_data(n=300, seed=0):
    """Loss-minimising d current of an interior machine: (i_q, electrical speed) -> i_d, Eskander's root."""
    R_s, L_d, L_q, psi, R_c = 4.3, 0.027, 0.067, 0.232, 200.0
    rng = np.random.default_rng(seed)
    i_q, omega = rng.uniform(0.2, 4, n), rng.uniform(40, 712, n)
    below = R_s * R_c + omega**2 * L_d**2
    b, k, dL = omega**2 * psi * L_d / below, (R_s * R_c + omega**2 * L_q**2) / below, L_d - L_q
    p = b * dL - psi
    x = (-p + np.sqrt(p**2 + 4 * dL**2 * k * i_q**2)) / 2
    return np.column_stack([i_q, omega]), -b + dL * k * i_q**2 / x


def machine_problem(starts):
    """The machine's data as a Batch for 2-2-1, and first weights."""
    x, t = machine_data()
    data = Batch(Range.of("x", x).to_unit(x), Range.of("t", t[:, None]).to_unit(t[:, None]), 2, "tanh")
    children = np.random.SeedSequence(4).spawn(starts)
    first = [nguyen_widrow(2, 2, 1, np.random.default_rng(child)) for child in children]
    return data, np.array([np.r_[np.c_[W1, B1].ravel(), np.c_[W2, B2].ravel()] for W1, B1, W2, B2 in first])


def scipy_lm(data, row, **options):
    """SciPy's Levenberg-Marquardt (MINPACK) from one row of weights."""

    def errors(w):
        return data.errors(torch.as_tensor(w)[None])[1].flatten().numpy()

    def jacobian(w):
        w = torch.as_tensor(w)[None]
        return data.jacobian(w, data.errors(w)[0])[0, 0].T.numpy()

    return least_squares(errors, row, jacobian, method="lm", **options)


@pytest.mark.parametrize("schedule", [TOOLBOX, MARQUARDT], ids=lambda s: s.name)
def test_same_minimum_as_scipy_from_the_same_starts(schedule):
    """Ours never ends in a point from which SciPy still finds a way down, and often they meet in one basin."""
    data, rows = machine_problem(12)
    descent = Descent(data, rows, replace(schedule, stall=0.0))
    descent.run()
    done = descent.stop.numpy() == STOPS.index("gradient")
    assert done.sum() >= 8

    def scipy_sse(row):
        return 2 * scipy_lm(data, row, xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=2000).cost

    ours = descent.sse.numpy()
    for k in np.flatnonzero(done):
        assert scipy_sse(descent.weights[k].numpy()) == pytest.approx(ours[k], rel=1e-8)
    theirs = np.array([scipy_sse(row) for row in rows])
    same = np.abs(theirs - ours) <= 1e-2 * theirs
    np.testing.assert_allclose(ours[same & done], theirs[same & done], rtol=1e-8)
    assert (same & done).sum() >= 3


def test_the_default_finds_the_best_minimum_as_often_as_scipy_in_no_more_epochs():
    """Of 40 starts on data that the schedule was not chosen on; an epoch of MINPACK asks for the Jacobian once."""
    data, rows = machine_problem(40)
    descent = Descent(data, rows, inspect.signature(train).parameters["schedule"].default)
    descent.run()
    theirs = [scipy_lm(data, row) for row in rows]
    ours, their_sse = descent.sse.numpy(), np.array([2 * fit.cost for fit in theirs])
    good = min(ours.min(), their_sse.min()) * (1 + 1e-5)
    assert np.mean(ours <= good) >= np.mean(their_sse <= good)
    assert descent.epoch.numpy().mean() <= np.mean([fit.njev for fit in theirs])


def test_the_first_epoch_of_the_default_is_that_of_its_references():
    """Step, refusal and damping from the papers' formulas, with differences of the errors along the step."""
    data, rows = machine_problem(40)
    descent = Descent(data, rows, replace(MARQUARDT, epochs=1))
    descent.run()
    errors = lambda w: data.errors(torch.as_tensor(w)[None])[1].flatten().numpy()  # noqa: E731
    seen = set()
    for k, w in enumerate(rows):
        weights = torch.as_tensor(w)[None]
        J = data.jacobian(weights, data.errors(weights)[0])[0, 0].numpy().T
        e, mu, up = errors(w), MARQUARDT.mu, MARQUARDT.up
        while True:
            damping = mu * np.diag(J.T @ J)
            v = -np.linalg.solve(J.T @ J + np.diag(damping), J.T @ e)
            h = 1e-3
            second = (errors(w + h * v) - 2 * e + errors(w - h * v)) / h**2
            a = -np.linalg.solve(J.T @ J + np.diag(damping), J.T @ second)
            found = errors(w + v + a / 2)
            bent_too_far = 2 * np.sqrt(a @ (damping * a)) > 0.75 * np.sqrt(v @ (damping * v))
            if not bent_too_far and found @ found < e @ e:
                break
            seen.add("too far" if bent_too_far else "too high")
            mu, up = mu * up, 2 * up
        np.testing.assert_allclose(descent.weights[k].numpy(), w + v + a / 2, rtol=1e-4, atol=1e-5)
        rho = (e @ e - found @ found) / (-(v @ (J.T @ e)) + v @ (damping * v))
        assert descent.mu[k].item() == pytest.approx(mu * max(MARQUARDT.down, 1 - (2 * rho - 1) ** 3), rel=1e-3)
        seen.add("accepted")
    assert seen >= {"accepted", "too far"}


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU that torch sees")
def test_the_same_minimum_on_a_gpu():
    x, t = machine_data()
    here, there = (train(x, t, 2, starts=40, schedule=replace(TOOLBOX, epochs=400), device=device) for device in ("cpu", "cuda"))
    assert there.sse.min() == pytest.approx(here.sse.min(), rel=1e-8)


@pytest.mark.parametrize("schedule", [TOOLBOX, MARQUARDT], ids=lambda s: s.name)
@pytest.mark.parametrize("activation", ["tanh", "logistic"])
def test_a_teacher_network_is_learnt_exactly(activation, schedule):
    rng = np.random.default_rng(3)
    teacher = Network(*nguyen_widrow(2, 2, 2, rng, activation), Range([0, 0], [4, 700]), Range([-3, 0], [0, 9]), activation)
    x = rng.uniform([0, 0], [4, 700], (200, 2))
    patient = replace(schedule, min_gradient=0.0)  # near the goal the gradient is small before the error is
    result = train(x, teacher.predict(x), 2, activation=activation, starts=12, goal=1e-18, schedule=patient)
    assert result.reached.any() and result.sse[result.best_start] <= 1e-18
    np.testing.assert_allclose(result.best().predict(x), teacher.predict(x), rtol=0, atol=1e-7)


def test_the_reported_sse_is_that_of_the_network():
    x, t = machine_data()
    result = train(x, t, 2, starts=3, seed=8)
    for net, sse in zip(result.networks, result.sse, strict=True):
        error = (net.predict(x)[:, 0] - t) / net.targets.half[0]
        assert error @ error == pytest.approx(sse, rel=1e-9)


def test_history_tells_each_start_apart():
    x, t = machine_data()
    result = train(x, t, 2, starts=20, schedule=replace(TOOLBOX, epochs=60))
    for k, last in enumerate(result.epochs):
        sse = result.history["sse"][k]
        assert np.all(np.diff(sse[: last + 1]) < 0) and np.all(np.isnan(sse[last + 1 :]))
        if result.stop[k] == "gradient":
            gradient = result.history["gradient"][k, : last + 1]
            assert gradient[-1] <= TOOLBOX.min_gradient < gradient[:-1].min()
    assert result.history["mu"][:, 0] == pytest.approx(1e-3)
    assert np.all(result.trials > result.epochs)


def test_same_seed_same_bits_and_another_seed_another_start():
    x, t = machine_data()
    one, two, other = (train(x, t, 2, starts=8, seed=seed, split=(0.7, 0.15, 0.15)) for seed in (1, 1, 2))
    assert one.history.keys() == two.history.keys()
    for name in one.history:
        assert one.history[name].tobytes() == two.history[name].tobytes()
    assert not np.array_equal(one.samples["train"], other.samples["train"])
    assert one.history["sse"][0, 0] != other.history["sse"][0, 0]


def alone_and_in_company(size, schedule=TOOLBOX):
    """Train 70 starts, the first 7, and the first alone, on rows that are not aligned in memory."""
    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (137, size[0]))
    t = np.column_stack([np.sin(3 * x.sum(1) + k) for k in range(size[2])])
    return [train(x, t, size[1], starts=n, seed=5, schedule=replace(schedule, epochs=40)) for n in (70, 7, 1)]


def test_a_start_does_not_depend_on_its_neighbours():
    for size in [(2, 2, 1), (2, 2, 2), (1, 15, 1)]:
        many, *fewer = alone_and_in_company(size)
        for less in fewer:
            # Without pinned dispatch the last bits depend on the alignment of each matrix in memory.
            ours, theirs = less.history["sse"][:, :9], many.history["sse"][: len(less.sse), :9]
            np.testing.assert_allclose(ours, theirs, rtol=1e-10)


def test_with_pinned_dispatch_not_one_bit_depends_on_the_neighbours():
    tests = Path(__file__).parent
    pins = {"MKL_CBWR": "COMPATIBLE", "ATEN_CPU_CAPABILITY": "avx2", "OMP_NUM_THREADS": "1"}
    paths = {"PYTHONPATH": os.pathsep.join([str(tests.parent), str(tests)])}
    call = "import test_training as tests; tests.compare_bits()"
    subprocess.run([sys.executable, "-c", call], check=True, env=os.environ | pins | paths)


def compare_bits():
    """Run in a process of its own: torch reads the pins when it starts."""
    for size, schedule in itertools.product([(2, 2, 1), (2, 2, 2), (1, 15, 1)], [TOOLBOX, MARQUARDT]):
        many, *fewer = alone_and_in_company(size, schedule)
        for less in fewer:
            for name, curve in less.history.items():
                assert curve.tobytes() == many.history[name][: len(curve), : curve.shape[1]].tobytes(), (size, schedule.name, name)
            for k, net in enumerate(less.networks):
                assert net.W1.tobytes() == many.networks[k].W1.tobytes()


def test_validation_stops_before_the_noise_is_learnt():
    rng = np.random.default_rng(1)
    x = rng.uniform(-1, 1, 60)
    t = np.sin(3 * x) + 0.3 * rng.normal(size=60)
    result = train(x, t, 15, activation="logistic", starts=10, schedule=TOOLBOX, split=(0.7, 0.15, 0.15))
    assert sorted(np.concatenate(list(result.samples.values()))) == list(range(60))
    assert [len(rows) for rows in result.samples.values()] == [42, 9, 9]
    stopped = np.flatnonzero(result.stop == "validation")
    assert len(stopped) >= 5 and result.reached[stopped].all()
    rows = result.samples["validation"]
    for k in stopped:
        curve = result.history["mse_validation"][k, : result.epochs[k] + 1]
        assert result.best_epoch[k] == np.argmin(curve) <= result.epochs[k] - TOOLBOX.patience
        error = (result.networks[k].predict(x[rows, None]) - t[rows, None]) / result.networks[k].targets.half
        assert np.mean(error**2) == pytest.approx(curve.min(), rel=1e-9)
        assert result.sse[k] > result.history["sse"][k, result.epochs[k]]
    assert result.best_start == np.argmin(np.nanmin(result.history["mse_validation"], axis=1))


def test_a_run_that_is_cut_off_does_not_pass_for_success():
    x, t = machine_data()
    result = train(x, t, 2, starts=4, schedule=replace(TOOLBOX, epochs=2))
    assert list(result.stop) == ["epochs"] * 4 and not result.reached.any()
    with pytest.raises(NotConverged, match=r"after 2 epochs, stopped by epochs.*0 of 4 starts did \(4 by epochs\)"):
        result.best()
    assert result.best(unfinished=True) is result.networks[int(np.argmin(result.sse))]


def test_a_minimum_above_the_goal_is_not_the_goal():
    x, t = machine_data()
    result = train(x, t, 1, starts=6, goal=1e-6, schedule=MARQUARDT)
    assert "stalled" in result.stop and not result.reached.any()
    with pytest.raises(NotConverged, match="goal or minimum not reached"):
        result.best()


def test_a_start_gives_up_when_no_step_helps():
    """With mu_max next to mu the first failed trial is the last, at the weights before it."""
    x, t = machine_data()
    result = train(x, t, 2, starts=20, schedule=Schedule("impatient", mu=1e-9, mu_max=1.1e-9, down=1.0))
    gave_up = result.stop == "mu"
    assert gave_up.any() and not result.reached[gave_up].any()
    assert np.array_equal(result.trials[gave_up], result.epochs[gave_up] + 2)


X, T = np.array([[0.0, 1.0], [1.0, 3.0], [2.0, 2.0], [4.0, 0.0]]), np.array([0.0, 1.0, 4.0, 2.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (dict(x=np.where(X == 3, np.nan, X)), "x row 1, column 1 is nan: must be finite"),
        (dict(t=[0, 1, np.inf, 2]), "t row 2, column 0 is inf: must be finite"),
        (dict(x=X * [1, 0] + [0, 5]), "x column 1 is constant at 5.0"),
        (dict(t=np.ones(4)), "t column 0 is constant at 1.0"),
        (dict(t=T[:3]), "x has 4 rows and t has 3"),
        (dict(x=np.zeros((0, 2))), r"x has shape \(0, 2\)"),
        (dict(x=np.zeros((2, 2, 2))), r"x has shape \(2, 2, 2\)"),
        (dict(n_hidden=0), "n_hidden = 0: .*at least 1"),
        (dict(n_hidden=1.5), "n_hidden = 1.5: .*whole"),
        (dict(starts=0), "starts = 0: .*at least 1"),
        (dict(seed=-1), "seed = -1: .*at least 0"),
        (dict(goal=np.nan), "goal = nan"),
        (dict(activation="relu"), "activation = 'relu': must be one of"),
        (dict(schedule="toolbox"), "schedule = 'toolbox': must be a Schedule"),
        (dict(device="abacus"), "device = 'abacus': must be one of 'cpu'"),
        (dict(device="meta"), "device = 'meta': must be one of 'cpu'"),
        (dict(device=f"cuda:{torch.cuda.device_count()}"), "device = 'cuda:.': must be one of 'cpu'"),
        (dict(split=(0.5, 0.5)), r"split = \(0.5, 0.5\): must be three shares"),
        (dict(split=(0.7, 0.2, 0.2)), "add up to 1"),
        (dict(split=(0.8, 0.1, 0.1)), "leaves an empty part of 4 samples"),
    ],
)
def test_bad_data_and_settings_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        train(**{"x": X, "t": T, "n_hidden": 2, "starts": 1, **arguments})


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (dict(mu=0.0), "mu = 0.0: .*above 0"),
        (dict(mu_max=1e-9), "mu_max = 1e-09: .*above 0.001"),
        (dict(down=1.5), "down = 1.5: .*at most 1"),
        (dict(up=1.0), "up = 1.0: .*above 1"),
        (dict(acceleration=-0.1), "acceleration = -0.1: .*at least 0"),
        (dict(epochs=0), "epochs = 0: .*at least 1"),
        (dict(patience=0), "patience = 0: .*at least 1"),
    ],
)
def test_bad_schedules_are_refused(setting, message):
    with pytest.raises(ValueError, match=message):
        replace(TOOLBOX, **setting)
