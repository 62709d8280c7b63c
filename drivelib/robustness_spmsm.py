"""Eskander's comparative claims about NN_S and NN_A in one draw: figures 12 to 15 and 19."""

import numpy as np

from drivelib import networks, pmsm, pmsm_angle, pmsm_optimum
from drivelib.levenberg_one import fit
from drivelib.machines import SPMSM
from drivelib.pmsm_drive import SimulationDiverged, simulate
from drivelib.pmsm_scenario import Scenario
from drivelib.robustness import DIVERGED, NETWORK, REACH, Study
from drivelib.robustness_ipmsm import EPOCHS, GOALS, SETTLE, STEP, WATCHED, epochs_of, tuning
from drivelib.robustness_steady import ASSUMPTIONS, SHARES
from drivelib.space import Space, Span, open_values
from drivelib.transients import settling_time

SPEED_STEP, TORQUE_STEP = 30.0, 0.2  # rad/s and N m, printed
LATE = 1e6  # s, stands for: not within the time watched
MECHANICS = {
    "speed imposed": {},
    "rotor free and seen": {"mechanics": "free", "torque": "speed-loop"},
    "rotor free and command seen": {"mechanics": "free", "torque": "speed-loop", "law_speed": "command"},
}


def loops_fit(values):
    """Return whether gains, sample time, model and torque range go together."""
    fast = values["current_bandwidth"]
    most = 0.9 * (values["R_c_spmsm"] + SPMSM.R_s) / SPMSM.L_d if values["model"] == "simplified" else np.inf
    top = values["torque_top"] * 400.0 / values["omega_rated_spmsm"]
    return fast * values["period"] <= 0.5 and fast <= most and values["omega_n"] <= fast and top >= TORQUE_STEP + 0.06


SPACE = Space(
    {
        "R_c_spmsm": ASSUMPTIONS["R_c_spmsm"],
        "omega_rated_spmsm": ASSUMPTIONS["omega_rated_spmsm"],
        "points": (6, 8, 10),
        "goal": GOALS,
        "training_ends": ("at the goal", "after 100 epochs"),
        "torque_top": Span(0.25, 1.0),
        "load": Span(0.1, 1.0),
        "load_before": Span(0.1, 1.0),
        "speed": Span(0.1, 0.9),
        "step_from": Span(0.0, 1.0),
        "mechanics": tuple(MECHANICS),
        "J": Span(open_values(SPMSM, ["J"])["J"].low, open_values(SPMSM, ["J"])["J"].high, log=True),
        "omega_n": tuning("omega_n"),
        "xi": tuning("xi"),
        "current_bandwidth": tuning("current_bandwidth"),
        "period": tuning("period"),
        "model": pmsm.MODELS,
    },
    allowed=loops_fit,
)
LABELS = {
    "R_c_spmsm": "R_c [Ω]",
    "omega_rated_spmsm": "rated speed [rad/s]",
    "points": "training points per axis",
    "goal": "goal [% RMS]",
    "training_ends": "training ends",
    "torque_top": "trained up to / rated",
    "load": "load / rated",
    "load_before": "load before / rated",
    "speed": "speed / rated",
    "step_from": "starting torque",
    "mechanics": "mechanics",
    "J": "J [kg m²]",
    "omega_n": "ω_n [rad/s]",
    "xi": "ξ",
    "current_bandwidth": "current loops [rad/s]",
    "period": "sample time [s]",
    "model": "controller's model",
}
CLAIMS = tuple(f"eskander/{claim}" for claim in "fig12 fig13 fig14 fig14/movement fig15 fig19 fig19/epochs".split())


def measure(values, rng):
    """Return ({claim: measure}, flags) of a draw; see ``robustness.Study``."""
    rated = values["omega_rated_spmsm"]
    machine = SPMSM.changed(R_c=values["R_c_spmsm"], omega_m_rated=rated, T_rated=400.0 / rated, J=values["J"])
    speeds = machine.omega_m_rated * np.linspace(0.1, 1.0, values["points"])
    options = {"stop_at_goal": values["training_ends"] == "at the goal", "epochs": EPOCHS}
    found, flag = {}, 0

    data = networks.nn_s_data(machine, speeds, machine.T_rated * np.linspace(0.05, 1.0, values["points"]))
    nn_s = fit(data.x, data.t, 2, rng, goal=networks.sse_goal(data, values["goal"]), **options)
    found["eskander/fig12"] = epochs_of(nn_s)
    top = values["torque_top"] * machine.T_rated
    data = networks.nn_a_data(machine, speeds, np.linspace(0.05, top, values["points"]))
    nn_a = fit(data.x, data.t, 2, rng, goal=networks.sse_goal(data, values["goal"]), **options)
    found["eskander/fig19/epochs"] = epochs_of(nn_a)

    if nn_a.rms_percent > GOALS.high:
        flag |= NETWORK
    else:
        T = 0.05 + values["step_from"] * (top - TORQUE_STEP - 0.05) + np.array([0.0, TORQUE_STEP])
        speed = np.full(2, values["speed"] * machine.omega_m_rated)
        # The network has no memory, so through the step it answers with these two angles, as the loop of section 6 does.
        computed = pmsm_angle.inverter_angle(machine, machine.P * speed, T / (1.5 * machine.P * machine.psi_f))
        found["eskander/fig19"] = np.max(np.abs(np.degrees(nn_a.network.predict(np.column_stack([speed, T]))[:, 0] - computed)))
    if nn_s.rms_percent > GOALS.high:
        flag |= NETWORK
    else:
        T = np.full(SHARES.shape, values["load"] * machine.T_rated)
        theory = pmsm_optimum.optimal_i_od_surface(machine, SHARES * machine.omega_e_rated)
        output = nn_s.network.predict(np.column_stack([SHARES * machine.omega_m_rated, T]))[:, 1]
        found["eskander/fig13"] = 100 * np.max(np.abs(output - theory)) / np.max(np.abs(theory))
        try:
            steps = _steps(machine, networks.as_law(nn_s.network), values)
        except SimulationDiverged:
            flag |= DIVERGED
        else:
            found |= steps
            flag |= 0 if len(steps) == 3 else REACH
    return {claim: float(value) for claim, value in found.items()}, flag


def _steps(machine, law, values):
    """Steps of torque and of speed in the drive of fig. 11; nothing of a run that ends at a limit.

    What the network gives is held against the current that the controller steers by it: the branch current where the controller knows
    the iron branch, else the terminal current.
    """
    steered = "i_od" if values["model"] == "full" else "i_d"
    tuned = {name: values[name] for name in ("current_bandwidth", "period", "model", "omega_n", "xi")}
    base = {"machine": machine, "control": "direct", "law": law, "settle": SETTLE, "duration": STEP + WATCHED, **tuned}
    omega, T, T_0 = values["speed"] * machine.omega_m_rated, *(values[name] * machine.T_rated for name in ("load", "load_before"))
    found = {}
    run = simulate(Scenario(speed=omega, load=((0.0, T_0), (STEP, T)), **base))
    if not _at_limit(run):
        goal = float(pmsm_optimum.optimal_i_od_surface(machine, machine.P * omega))
        before = run["i_od_ref"][int(np.searchsorted(run.t, STEP - 1e-9)) - 1]
        found["eskander/fig14"] = _late(settling_time(run.t, run[steered], goal, 0.05 * abs(goal), STEP))
        found["eskander/fig14/movement"] = 100 * abs((run["i_od_ref"][-1] - before) / goal)
    run = simulate(Scenario(speed=((0.0, omega), (STEP, omega + SPEED_STEP)), load=T, **MECHANICS[values["mechanics"]], **base))
    if not _at_limit(run):
        goal = float(pmsm_optimum.optimal_i_od_surface(machine, machine.P * (omega + SPEED_STEP)))
        found["eskander/fig15"] = _late(settling_time(run.t, run[steered], goal, 0.05 * abs(goal), STEP))
    return found


def _late(time):
    return time if np.isfinite(time) else LATE


def _at_limit(run):
    return run.at_limit("voltage")[-1] or run.at_limit("current reference")[-1]


STUDY = Study("Eskander, NN_S and NN_A", SPACE, CLAIMS, measure, LABELS)
