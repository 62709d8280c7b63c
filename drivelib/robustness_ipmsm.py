"""Eskander's comparative claims about NN_I in one draw: figures 5 to 10.

One network is trained from one start on data of the draw, as in figure 5, and put into the drive of figure 4. A network that misses
even the loosest goal counts as one that did not converge; a drive that ends at its voltage or current limit as a point out of reach.
"""

import numpy as np

from drivelib import networks, pmsm, pmsm_optimum
from drivelib.levenberg_one import fit
from drivelib.machines import IPMSM
from drivelib.pmsm_drive import SimulationDiverged, simulate
from drivelib.pmsm_scenario import TUNING, Scenario
from drivelib.robustness import DIVERGED, NETWORK, REACH, Study
from drivelib.robustness_steady import ASSUMPTIONS, IPMSM_SETS, SHARES
from drivelib.space import Space, Span
from drivelib.transients import settling_time

GOALS = Span(0.3, 3.0, log=True)  # %, RMS error as share of the target's range (assumption "goal")
EPOCHS = 100  # the toolbox's limit in 2002
NEVER = EPOCHS + 1
PRINTED_LOSS = 118.9  # W
STEP, WATCHED, SETTLE = 0.005, 0.12, 0.06  # s: instant of a step, time after it, and lead before the record
BAND = 1.2  # W, of the ledger's fig10
EVERY = 10  # samples between those at which the least loss is worked out


def tuning(name):
    """Return the span of a tuning assumption of ``pmsm_scenario``, drawn in the logarithm."""
    origin = TUNING[name][0]
    return Span(origin.low, origin.high, log=True)


def loops_fit(values):
    """Return whether gains, sample time and model go together, as ``pmsm_scenario.Scenario`` asks it."""
    most = 0.9 * (values["R_c_ipmsm"] + IPMSM.R_s) / IPMSM.L_q if values["model"] == "simplified" else np.inf
    fast = values["current_bandwidth"]
    return fast * values["period"] <= 0.5 and fast <= most and values["torque_bandwidth"] <= fast


SPACE = Space(
    {
        "ipmsm": ASSUMPTIONS["ipmsm"],
        "R_c_ipmsm": ASSUMPTIONS["R_c_ipmsm"],
        "points": (6, 8, 10),
        "goal": GOALS,
        "training_ends": ("at the goal", "after 100 epochs"),
        "load": Span(0.1, 1.0),
        "load_before": Span(0.1, 1.0),
        "speed": Span(0.1, 1.0),
        "speed_before": Span(0.1, 1.0),
        "current_bandwidth": tuning("current_bandwidth"),
        "torque_bandwidth": tuning("torque_bandwidth"),
        "period": tuning("period"),
        "torque_feedback": ("estimated", "actual"),
        "model": pmsm.MODELS,
    },
    allowed=loops_fit,
)
LABELS = {
    "ipmsm": "IPMSM set",
    "R_c_ipmsm": "R_c [Ω]",
    "points": "training points per axis",
    "goal": "goal [% RMS]",
    "training_ends": "training ends",
    "load": "load / rated",
    "load_before": "load before / rated",
    "speed": "speed / rated",
    "speed_before": "speed before / rated",
    "current_bandwidth": "current loops [rad/s]",
    "torque_bandwidth": "torque loop [rad/s]",
    "period": "sample time [s]",
    "torque_feedback": "torque seen",
    "model": "controller's model",
}
CLAIMS = tuple(f"eskander/{claim}" for claim in "fig05 fig06 fig07 fig08/difference fig09 fig09/minimum fig10 fig10/time".split())


def epochs_of(fitted):
    """Return the epoch at which the goal was met, 101 standing for: not in 100."""
    return fitted.goal_epoch if fitted.goal_epoch >= 0 else NEVER


def measure(values, rng):
    """Return ({claim: measure}, flags) of a draw; see ``robustness.Study``."""
    machine = IPMSM_SETS[values["ipmsm"]].changed(R_c=values["R_c_ipmsm"])
    rated = machine.T_rated / (1.5 * machine.P * machine.psi_f)
    data = networks.nn_i_data(machine, rated * np.linspace(0.05, 1.1, values["points"]), machine.omega_m_rated * np.linspace(0.1, 1.0, values["points"]))
    goal = networks.sse_goal(data, values["goal"])
    fitted = fit(data.x, data.t, 2, rng, goal=goal, stop_at_goal=values["training_ends"] == "at the goal", epochs=EPOCHS)
    found, flag = {"eskander/fig05": epochs_of(fitted)}, 0
    if fitted.rms_percent > GOALS.high:
        return found, NETWORK
    found |= _steady(machine, fitted.network, values)
    try:
        found |= _drives(machine, fitted.network, values)
    except SimulationDiverged:
        flag = DIVERGED
    missing = any(np.isnan(found.get(claim, np.nan)) for claim in CLAIMS)
    return {claim: float(value) for claim, value in found.items()}, flag or (REACH if missing else 0)


def _currents(machine, law, omega_m, T_e, i_q):
    """Return (i_d, i_q) at which network and torque agree: what the settled PI controller finds."""
    for _ in range(25):
        before = i_q
        i_d = law(np.array([i_q, omega_m]))[0]
        i_q = float(pmsm.i_oq_at_torque(machine, T_e, i_d))
        if i_q == before:
            break
    return i_d, i_q


def _steady(machine, network, values):
    """Deviation of the network from the optimum over speed, and its loss where the least loss is 118.9 W."""
    T, speed, options = values["load"] * machine.T_rated, SHARES * machine.omega_m_rated, {"model": "simplified", "convention": "paper"}
    best = pmsm_optimum.optimum(machine, machine.P * speed, T, **options)
    output = network.predict(np.column_stack([best.i_oq, speed]))[:, 0]
    found = {"eskander/fig06": 100 * np.max(np.abs(output - best.i_od)) / np.max(np.abs(best.i_od))}
    if best.loss[0] <= PRINTED_LOSS <= best.loss[-1]:
        omega_m = float(np.interp(PRINTED_LOSS, best.loss, speed))
        at = pmsm_optimum.optimum(machine, machine.P * omega_m, T, **options)
        i_d, i_q = _currents(machine, networks.as_law(network), omega_m, T, float(at.i_oq))
        found["eskander/fig08/difference"] = float(pmsm.total_loss(machine, machine.P * omega_m, i_d, i_q, **options) - at.loss)
    return found


def _drives(machine, network, values):
    """Steps of speed and of torque in the drive of fig. 4; nothing of a run that ends at a limit."""
    law, options = networks.as_law(network), {"model": "simplified", "convention": "paper"}
    tuned = {name: values[name] for name in ("current_bandwidth", "torque_bandwidth", "period", "torque_feedback", "model")}
    omega, omega_0 = (values[name] * machine.omega_m_rated for name in ("speed", "speed_before"))
    T, T_0 = (values[name] * machine.T_rated for name in ("load", "load_before"))
    base = {"machine": machine, "law": law, "duration": STEP + WATCHED, "settle": SETTLE, **tuned}
    found = {}
    run = simulate(Scenario(load=T, speed=((0.0, omega_0), (STEP, omega)), **base))
    if not _at_limit(run):
        loss = run.loss(**options)
        least = float(pmsm_optimum.optimum(machine, machine.P * omega, run["T_e"][-1], **options).loss)
        found["eskander/fig09"] = settling_time(run.t, loss, loss[-1], 0.02 * loss[-1], STEP)
        found["eskander/fig09/minimum"] = 100 * (loss[-1] / least - 1)
        settled = float(run["i_q_ref"][-1])
        found["eskander/fig07"] = abs(settled - _currents(machine, law, omega, T, settled)[1])
    run = simulate(Scenario(load=((0.0, T_0), (STEP, T)), speed=omega, **base))
    if not _at_limit(run):
        t, T_e = run.t[::-EVERY][::-1], run["T_e"][::-EVERY][::-1]
        excess = run.loss(**options)[::-EVERY][::-1] - pmsm_optimum.optimum(machine, machine.P * omega, T_e, **options).loss
        found["eskander/fig10"] = abs(excess[-1])
        found["eskander/fig10/time"] = settling_time(t, excess, excess[-1], BAND, STEP)
    return found


def _at_limit(run):
    return run.at_limit("voltage")[-1] or run.at_limit("current reference")[-1]


STUDY = Study("Eskander, NN_I", SPACE, CLAIMS, measure, LABELS)
