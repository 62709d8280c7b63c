"""Rows of the parts: fuzzy evaluator, Levenberg-Marquardt, operating maps, imports."""

import statistics
import subprocess
import sys
import time
import warnings

import numpy as np
from measure import Row, in_turn, pairs
from scipy.optimize import least_squares, minimize_scalar

from drivelib import environment, fuzzy, fuzzy_reference, networks, pmsm, pmsm_optimum
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
    schedule = Schedule("benchmark", epochs=30)
    children = np.random.SeedSequence(0).spawn(20)
    starts = [np.concatenate([v.ravel() for v in nguyen_widrow(2, 2, 1, np.random.default_rng(child))]) for child in children]
    epochs = [0, 0]

    def ours():
        epochs[0] = train(x, t, 2, starts=256, seed=0, schedule=schedule).epochs.sum()

    def scipy_():
        # An epoch of MINPACK: a successful step; it asks for the Jacobian once in each.
        epochs[1] = sum(least_squares(residual, w, jacobian, args=(x, t), method="lm").njev for w in starts)

    done = [0, 0]

    def numpy_():
        done[0] = sum(one_start(w, x, t, 30) for w in starts[:5])

    def vmap():
        done[1] = sum(one_start_vmap(w, x, t, 30) for w in starts[:3])

    a, b, c, d = in_turn([ours, scipy_, numpy_, vmap], repetitions)
    unit = {"unit": "ms", "scale": 1e3}
    rows = [
        Row("Levenberg–Marquardt, 256 starts, per start and epoch", "", pairs(a, [0.0] * len(a), epochs[0]), "value", 0.05, **unit),
        Row("the same", "SciPy lm", pairs(a, b, epochs[0], epochs[1]), "faster", **unit),
        Row("the same", "NumPy, one start", pairs(a, c, epochs[0], done[0]), "faster", **unit),
        Row("the same", "torch vmap, one start", pairs(a, d, epochs[0], done[1]), "faster", **unit),
        gpu_row(x, t, schedule, a, repetitions),
    ]
    fits = [least_squares(residual, w, jacobian, args=(x, t), method="lm") for w in starts]
    results = {"toolbox": train(x, t, 2, starts=20, seed=0, schedule=TOOLBOX), "Marquardt": train(x, t, 2, starts=20, seed=0, schedule=MARQUARDT)}
    best = min([2 * fit.cost for fit in fits] + [result.sse.min() for result in results.values()])

    def share(sse):
        return np.mean(np.asarray(sse) <= best * (1 + 1e-6))

    theirs = share([2 * fit.cost for fit in fits]), statistics.median(fit.njev for fit in fits)
    for name, result in results.items():
        found = share(result.sse), float(np.median(result.epochs))
        verdict = "met" if found[0] >= theirs[0] and found[1] <= theirs[1] else "not met"
        note = f"{found[0]:.0%} of 20 starts, {found[1]:.0f} epochs"
        rows.append(Row(f"LM quality, {name} schedule: {note}", f"SciPy lm: {theirs[0]:.0%}, {theirs[1]:.0f}", note=verdict if name != "toolbox" else f"kept for the papers ({verdict})"))
    return rows


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
    return [*fuzzy_rows(repetitions), *training_rows(repetitions), *map_rows(repetitions), *import_rows(repetitions)]
