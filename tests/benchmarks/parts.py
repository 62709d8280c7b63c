"""Rows of the parts: fuzzy evaluator, Levenberg-Marquardt, operating maps, imports."""

import itertools
import subprocess
import sys
import time
import warnings

import numpy as np
from measure import Row, in_turn, pairs
from scipy.optimize import least_squares, minimize_scalar

from drivelib import dfim_panels, environment, fuzzy, fuzzy_reference, networks, pmsm, pmsm_optimum, pmsm_panels
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.machines import IPMSM
from drivelib.neural import Range, nguyen_widrow


def fuzzy_rows(repetitions):
    """Return the rows of the exact centroid against scikit-fuzzy."""
    rng = np.random.default_rng(0)
    e, de = rng.uniform(-1, 1, (2, 1_000_000))
    controller = fuzzy_reference.control_system()
    points = iter(rng.uniform(-1, 1, (10_000, 2)))

    def peer():
        for x, y in (next(points) for _ in range(5)):
            controller.input["e"], controller.input["de"] = x, y
            controller.compute()

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ours, theirs = in_turn([lambda: fuzzy.fuzzy_surface(e, de), peer], repetitions, inner=2)
    return [
        Row("fuzzy controller, 49 rules, per input", "", pairs(ours, [0.0] * len(ours), e.size), "value", 100, "ns", 1e9),
        Row("fuzzy surface of 10⁶ points", "", pairs(ours, [0.0] * len(ours)), "value", 0.1),
        Row("fuzzy controller, per new input", "scikit-fuzzy", pairs(ours, theirs, e.size, 5), "faster", 1e5, "µs", 1e6),
    ]


def problem():
    """Return what NN_I learns, 1000 samples, two inputs, one output, mapped to [-1, 1]."""
    data = networks.nn_i_data(IPMSM, np.linspace(0.2, 4.0, 25), np.linspace(10.0, 178.0, 40))
    return Range.of("x", data.x).to_unit(data.x), Range.of("t", data.t).to_unit(data.t)[:, 0]


def residual(w, x, t):
    """Errors of a 2-2-1 network with weights W1 (2, 2), B1, W2, B2 in a row."""
    return np.tanh(x @ w[:4].reshape(2, 2).T + w[4:6]) @ w[6:8] + w[8] - t


def jacobian(w, x, t):
    """Its derivatives, shape (n, 9)."""
    hidden = np.tanh(x @ w[:4].reshape(2, 2).T + w[4:6])
    back = (1 - hidden**2) * w[6:8]
    return np.column_stack([back[:, :1] * x, back[:, 1:] * x, back, hidden, np.ones(len(x))])


def one_start(w, x, t, epochs):
    """The toolbox's schedule for one start in NumPy; return the epochs done."""
    mu, e = 1e-3, residual(w, x, t)
    for epoch in range(epochs):
        J = jacobian(w, x, t)
        H, g = J.T @ J, J.T @ e
        while mu <= 1e10:
            trial = w - np.linalg.solve(H + mu * np.eye(len(w)), g)
            e_trial = residual(trial, x, t)
            if e_trial @ e_trial < e @ e:
                w, e, mu = trial, e_trial, mu * 0.1
                break
            mu *= 10
        else:
            return epoch
    return epochs


def one_start_vmap(w, x, t, epochs):
    """The same in torch with an automatic Jacobian, ``vmap`` over the samples; return the epochs done."""
    import torch

    def output(w, row):
        return torch.tanh(w[:4].reshape(2, 2) @ row + w[4:6]) @ w[6:8] + w[8]

    slopes = torch.func.vmap(torch.func.grad(output), (None, 0))
    values = torch.func.vmap(output, (None, 0))
    w, x, t = (torch.as_tensor(value) for value in (w, x, t))
    mu, e = 1e-3, values(w, x) - t
    for epoch in range(epochs):
        J = slopes(w, x)
        H, g = J.T @ J, J.T @ e
        while mu <= 1e10:
            trial = w - torch.linalg.solve(H + mu * torch.eye(len(w), dtype=torch.float64), g)
            e_trial = values(trial, x) - t
            if e_trial @ e_trial < e @ e:
                w, e, mu = trial, e_trial, mu * 0.1
                break
            mu *= 10
        else:
            return epoch
    return epochs


def training_rows(repetitions):
    """Return the rows of Levenberg-Marquardt: time per start and epoch, and quality from the same starts."""
    from drivelib.levenberg import MARQUARDT, TOOLBOX, Schedule
    from drivelib.training import train

    x, t = problem()
    schedules = [Schedule("toolbox, 30 epochs", epochs=30), MARQUARDT]
    children = np.random.SeedSequence(0).spawn(40)
    starts = [np.concatenate([v.ravel() for v in nguyen_widrow(2, 2, 1, np.random.default_rng(child))]) for child in children]
    epochs = {}

    def ours(schedule):
        epochs[schedule.name] = train(x, t, 2, starts=256, seed=0, schedule=schedule).epochs.sum()

    def scipy_():
        # An epoch of MINPACK: a successful step; it asks for the Jacobian once in each.
        epochs["SciPy lm"] = sum(least_squares(residual, w, jacobian, args=(x, t), method="lm").njev for w in starts[:20])

    def numpy_():
        epochs["NumPy, one start"] = sum(one_start(w, x, t, 30) for w in starts[:5])

    def vmap():
        epochs["torch vmap, one start"] = sum(one_start_vmap(w, x, t, 30) for w in starts[:3])

    functions = [*(lambda schedule=schedule: ours(schedule) for schedule in schedules), scipy_, numpy_, vmap]
    times = in_turn(functions, repetitions)
    names = [*(schedule.name for schedule in schedules), "SciPy lm", "NumPy, one start", "torch vmap, one start"]
    each = {name: [seconds / epochs[name] for seconds in column] for name, column in zip(names, times, strict=True)}
    unit, own = {"unit": "ms", "scale": 1e3}, each[schedules[0].name]
    return [
        Row("Levenberg–Marquardt, 256 starts, per start and epoch", "", pairs(own, [0.0] * len(own)), "value", 0.05, **unit),
        *(Row("the same", name, pairs(own, each[name]), "faster", **unit) for name in names[2:]),
        Row("the same, default schedule to its end", "", pairs(each[MARQUARDT.name], [0.0] * len(own)), "value", **unit),
        gpu_row(x, t, schedules[0], times[0], repetitions),
        *quality_rows(x, t, starts, [TOOLBOX, MARQUARDT]),
    ]


def quality_rows(x, t, starts, schedules):
    """Return how many starts reach the best minimum that anyone found, and in how many epochs: ours, and SciPy's from the same."""
    from drivelib.training import train

    fits = [least_squares(residual, w, jacobian, args=(x, t), method="lm") for w in starts]
    found = {"SciPy lm": (np.array([2 * fit.cost for fit in fits]), np.array([fit.njev for fit in fits]))}
    for schedule in schedules:
        result = train(x, t, 2, starts=len(starts), seed=0, schedule=schedule)
        found[schedule.name] = result.sse, result.epochs
    best = min(sse.min() for sse, _ in found.values()) * (1 + 1e-5)

    def told(name):
        sse, epochs = found[name]
        return f"{np.mean(sse <= best):.0%} of {len(starts)} starts, {epochs.mean():.0f} epochs on average, median {np.median(epochs):.0f}"

    def met(name):
        (sse, epochs), (their_sse, theirs) = found[name], found["SciPy lm"]
        share, few = np.sum(sse <= best) >= np.sum(their_sse <= best), epochs.mean() <= theirs.mean()
        return f"share {'met' if share else 'not met'}, epochs {'met' if few else 'not met'}"

    return [
        Row(f"LM quality, {schedule.name}: {told(schedule.name)}", f"SciPy lm: {told('SciPy lm')}", note=met(schedule.name))
        for schedule in schedules
    ]


def gpu_row(x, t, schedule, processor, repetitions):
    """Return the row of the same training on a GPU, against the times on one core."""
    import torch

    from drivelib.training import train

    what, against = "training 256 starts on a GPU", "one core"
    if not torch.cuda.is_available():
        return Row(what, against, note="not measured: torch sees no GPU")
    own = in_turn([lambda: train(x, t, 2, starts=256, seed=0, schedule=schedule, device="cuda")], repetitions, clock=time.perf_counter)[0]
    return Row(what, against, pairs(own, processor), "faster")


def map_rows(repetitions):
    """Return the rows of 10⁶ operating points: i_d, loss, voltage, angle, feasibility, inside both limits."""
    omega_e, T_e = np.meshgrid(np.linspace(1.0, 1000.0, 1000), np.linspace(0.0, 6.0, 1000))
    limits = {"V_max": pmsm.voltage_limit(IPMSM), "I_max": 8.0}

    def ours():
        best = pmsm_optimum.optimum(IPMSM, omega_e, T_e, **limits)
        i_od, i_oq = (np.where(best.feasible, values, 0.0) for values in (best.i_od, best.i_oq))
        V_d, V_q = pmsm.stator_voltages(IPMSM, omega_e, i_od, i_oq)
        np.arctan2(-V_d, V_q)

    def peer():
        for w, T in zip(omega_e.flat[::200_000], T_e.flat[::200_000], strict=True):
            minimize_scalar(lambda i, w=w, T=T: float(pmsm.total_loss(IPMSM, w, i, pmsm.i_oq_at_torque(IPMSM, T, i))), bounds=(-10, 0), method="bounded")

    a, b = in_turn([ours, peer], repetitions)
    return [
        Row("PMSM map of 10⁶ points, one core", "", pairs(a, [0.0] * len(a)), "value", 0.5),
        Row("per operating point", "scipy.optimize, without limits", pairs(a, b, omega_e.size, 5), "faster", scale=1e6, unit="µs"),
    ]


def panel_rows(repetitions):
    """Return the rows of the sliders: one move, from the value to the finished picture."""
    panels = {
        "loss curves": pmsm_panels.loss_curves(IPMSM), "your motor": pmsm_panels.own_motor(IPMSM, 6.0), "fuzzy drive of 2.4 s": dfim_panels.fuzzy_loop(DEFAULT_SCENARIO)
    }  # fmt: skip

    def mover(panel):
        widget = next(iter(panel.sliders.values()))
        places = itertools.cycle((widget.value, 1.02 * widget.value))
        next(places)

        def move():
            widget.value = next(places)

        return move

    times = in_turn([mover(panel) for panel in panels.values()], repetitions, inner=5)
    return [Row(f"sliders, {name}, per move", "", pairs(own, [0.0] * len(own)), "value", 50, "ms", 1e3) for name, own in zip(panels, times, strict=True)]


def import_rows(repetitions):
    """Return the rows of imports, each in a fresh interpreter, its start subtracted."""

    def start(code):
        return lambda: subprocess.run([sys.executable, "-c", code], check=True, env=environment.pinned())

    codes = ("pass", "import drivelib", "from drivelib import pmsm_optimum", "from drivelib import dfim_drive", "from drivelib import training")
    times = in_turn([start(code) for code in codes], repetitions, clock=time.perf_counter)
    return [
        Row(code, "", [(max(t - empty, 0.0), 0.0) for t, empty in zip(own, times[0], strict=True)], "value", 0.3 if code == "import drivelib" else None)
        for code, own in zip(codes[1:], times[1:], strict=True)
    ]


def rows(repetitions):
    """Return all rows of this file."""
    return [*fuzzy_rows(repetitions), *training_rows(repetitions), *map_rows(repetitions), *panel_rows(repetitions), *import_rows(repetitions)]
