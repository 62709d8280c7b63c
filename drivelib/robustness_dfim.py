"""Zidani's comparative claims in one draw: PI, fuzzy and neural control of one drawn drive, with R_r and R_r + 50 %.

The worst event of figure 10 is the load at its lowest set point, 30 rad/s, so this is what is simulated: the drive stands
settled there and the load comes. In one branch it is held; in the other it leaves after a fifth of a second, as the set point is
reversed. What the ledger's measures mean is unchanged (``contest``, ``metrics``); only their events are these.
"""

from typing import NamedTuple

import numpy as np

from drivelib import ann_data, contest, control, robustness_ann, robustness_contest, table2
from drivelib.dfim_drive import SimulationDiverged, initial_state
from drivelib.dfim_loop import NEVER, STATES
from drivelib.dfim_machines import DFIM_SETS
from drivelib.dfim_pieces import Drive, Piece, alone, joined, together
from drivelib.dfim_scenario import DEFAULT_SCENARIO, FLUX_ESTIMATORS
from drivelib.robustness import DIVERGED, NETWORK, Study
from drivelib.space import Space, Span, open_values
from drivelib.speed_law import PiSpeed
from drivelib.table2_fit import swings

SET_POINT = 30.0  # rad/s, the lowest of figure 10
ONSET = 0.2  # s, from the load's coming to the reversal, in the branch that has one
ARRIVAL = 0.4  # s, for which the reversal is watched
AFTER = 0.2  # s, the same with R_r increased: the torque has reversed by then
NOISE_STEP = 0.01  # s, for which the load's fluctuation holds one value
RIPPLE = 0.04  # s, with switching inverters
R_R_FACTOR = 1.5
OPEN = open_values(DEFAULT_SCENARIO, ["xi", "phi_r_ref", "V_dc_s"])


def loops_do_not_ring(values):
    """Return whether current loops and sample time go together (``dfim_scenario``), and the teacher is within its range."""
    fast = values["current_bandwidth"] + DEFAULT_SCENARIO.orientation_bandwidth
    return fast * values["period"] <= 0.5 and values["omega_n"] * values["teacher"] <= 60.0


SPACE = Space(
    {
        "machine": tuple(DFIM_SETS),
        "omega_n": Span(5.0, 60.0, log=True),
        "xi": OPEN["xi"],
        "current_bandwidth": Span(300.0, 3000.0, log=True),
        "period": Span(1e-4, 5e-4, log=True),
        "phi_r_ref": OPEN["phi_r_ref"],
        "V_dc": OPEN["V_dc_s"],
        "T_limit": Span(1.2, 2.5),
        "load": Span(0.25, 1.0),
        "hold": Span(0.25, 2.0, log=True),
        "load_noise": Span(0.0, 0.02),
        "frequency_law": tuple(control.FREQUENCY_LAWS),
        "flux_estimator": FLUX_ESTIMATORS,
        "r_r_instant": ("from the start", "under load"),
        "carrier_frequency": Span(1000.0, 10000.0, log=True),
        "flc_form": ("incremental", "position"),
        "flc_gain": Span(1.0, 300.0, log=True),
        "e_max": Span(15.0, 300.0, log=True),
        "activation": ("logistic", "tanh"),
        "training_load": tuple(robustness_ann.LOADS),
        "teacher": Span(1.0, 3.0, log=True),
        "data_noise": Span(0.0, 0.5),
        "resolution": Span(0.1, 2.0, log=True),
    },
    allowed=loops_do_not_ring,
)
LABELS = {
    "machine": "motor",
    "omega_n": "ω_n [rad/s]",
    "xi": "ξ",
    "current_bandwidth": "current loops [rad/s]",
    "period": "sample time [s]",
    "phi_r_ref": "flux reference [Wb]",
    "V_dc": "dc voltage [V]",
    "T_limit": "torque limit / rated",
    "load": "load / rated",
    "hold": "load held [s]",
    "load_noise": "load noise / rated",
    "frequency_law": "frequency law",
    "flux_estimator": "flux estimate",
    "r_r_instant": "R_r changes",
    "carrier_frequency": "carrier [Hz]",
    "flc_form": "FLC form",
    "flc_gain": "FLC gain / PI's",
    "e_max": "FLC range [rad/s]",
    "activation": "sigmoid",
    "training_load": "training loads",
    "teacher": "teacher's ω_n / PI's",
    "data_noise": "noise in data [rad/s]",
    "resolution": "errors told apart [rad/s]",
}
CLAIMS = tuple(
    f"zidani/{claim}"
    for claim in (
        "eq21/x fig06/function fig08 fig10/pi fig10/pi/dip fig10/pi/overshoot fig10/flc fig10/flc/dip fig10/flc/overshoot fig10/ann "
        "fig10/ann/overshoot fig10/ripple fig11 fig11/pi fig11/contrast fig12 fig12/nominal tab02/static tab02/static/trained "
        "end-1 end-2 end-3 end-4 end-5/dynamics end-5/dynamics/load end-5/load end-5/flux end-5/stability end-5/precision"
    ).split()
)


def scenario_of(values):
    """Return the Scenario of a draw; loads and set points come with ``profiles_of``."""
    machine = DFIM_SETS[values["machine"]]
    taken = {name: values[name] for name in ("omega_n", "xi", "current_bandwidth", "period", "phi_r_ref", "frequency_law", "flux_estimator", "carrier_frequency")}
    return DEFAULT_SCENARIO.changed(machine=machine, T_limit=values["T_limit"] * machine.T_rated, V_dc_s=values["V_dc"], V_dc_r=values["V_dc"], **taken)


def settled_state(scenario):
    """Return the state of the magnetised drive that runs idle at the set point."""
    x = initial_state(scenario)
    x[STATES.index("omega_m")], x[STATES.index("e_previous")] = SET_POINT, 0.0
    x[STATES.index("memory")] = x[STATES.index("T_previous")] = scenario.machine.f * SET_POINT
    return x


def laws_of(values, scenario, network):
    """Return {"PI", "FLC", "ANN": speed_law.SpeedLaw} of a draw."""
    gains = scenario.speed_gains
    if values["flc_form"] == "incremental":
        flc = contest.fuzzy_like_pi(scenario, values["e_max"], gains=control.PiGains(*(values["flc_gain"] * gain for gain in gains)))
    else:
        flc = contest.fuzzy_position(scenario, values["flc_gain"] * gains.K_p)
    return {"PI": PiSpeed(*gains).law(), "FLC": flc.law(), "ANN": ann_data.network_speed(network).law()}


def profiles_of(values, scenario, rng):
    """Return the profiles of the load's first fifth of a second, of the rest of its hold, and of the reversal.

    The first and the last also with R_r increased, under the same noise: keys (part, "nominal" or "increased").
    """
    machine, every = scenario.machine, max(1, round(NOISE_STEP / scenario.period))
    result = {}
    for part, length in (("onset", ONSET), ("hold", values["hold"] - ONSET), ("reversal", ARRIVAL)):
        steps = round(length / scenario.period)
        changes = np.arange(0, steps, every)
        noise = values["load_noise"] * machine.T_rated * rng.uniform(-1, 1, changes.size)
        load = noise + (0.0 if part == "reversal" else values["load"] * machine.T_rated)
        late = part == "onset" and values["r_r_instant"] == "under load"
        nominal = np.ones((changes.size, 3))
        nominal[:, 0], nominal[:, 1] = -SET_POINT if part == "reversal" else SET_POINT, load
        increased = nominal.copy()
        increased[changes >= (0.5 * steps if late else 0), 2] = R_R_FACTOR
        changes = np.append(changes, NEVER)
        result[part, "nominal"] = (changes, nominal, steps)
        result[part, "increased"] = (changes, increased, round(AFTER / scenario.period) if part == "reversal" else steps)
    return result


def study(pi_row, ann_row):
    """Return the `Study` of Zidani's comparative claims.

    Parameters
    ----------
    pi_row, ann_row : table2.Printed
        Rows of table II, which say how stiff a static map would have to be.
    """
    return Study("Zidani", SPACE, CLAIMS, Measure(pi_row, ann_row), LABELS, together)


class Measure(NamedTuple):
    """``measure(values, rng)`` of the study, a generator that asks for runs of drives in pieces; see ``study``."""

    pi_row: table2.Printed
    ann_row: table2.Printed

    def __call__(self, values, rng):
        scenario = scenario_of(values)
        gains = control.speed_gains(scenario.machine.J, scenario.machine.f, values["omega_n"] * values["teacher"], values["xi"])
        error, command = robustness_ann.teacher_data(scenario, gains, values["training_load"])
        fitted = robustness_ann.trained(error, command, rng, activation=values["activation"], noise=values["data_noise"])
        some = slice(rng.integers(4), None, 4)  # a quarter of the record is enough for a share of variance
        found = {"zidani/fig06/function": 100 * ann_data.unexplained_share(error[some], command[some], values["resolution"])}
        flag, laws = 0, laws_of(values, scenario, fitted.network)
        if fitted.stop not in ("validation", "gradient"):
            flag |= NETWORK
            del laws["ANN"]
        else:
            found["zidani/fig08"] = fitted.fall
        one, start, profiles = Drive.of(scenario), settled_state(scenario), profiles_of(values, scenario, rng)
        a = table2.member(*(value for value, _ in self.pi_row[:2]), scenario.xi).a
        needed = table2.stiffness(self.ann_row, a) * scenario.machine.J

        onset = {(name, kind): Piece(one, law, start, profiles["onset", kind]) for name, law in laws.items() for kind in ("nominal", "increased")}
        *answers, stiff = yield [*onset.values(), _stiff(one, needed, start)]
        onset = {key: part for key, part in zip(onset, answers, strict=True) if part is not None}
        later = {(name, kind): Piece(one, laws[name], part.x, profiles["reversal", kind]) for (name, kind), part in onset.items()}
        later |= {(name, "held"): Piece(one, laws[name], part.x, profiles["hold", kind]) for (name, kind), part in onset.items() if kind == "nominal"}
        later = dict(zip(later, (yield list(later.values())), strict=True))
        runs = {}
        for name, law in laws.items():
            if any(later.get((name, kind)) is None for kind in ("nominal", "increased", "held")):
                flag |= DIVERGED
                continue
            for kind in ("nominal", "increased"):
                runs[name, kind] = onset[name, kind], later[name, kind]
            runs[name, "held"] = joined(onset[name, "nominal"], later[name, "held"])
            if name == "ANN":
                short = (*profiles["hold", "nominal"][:2], round(RIPPLE / scenario.period))
                try:
                    runs["switching"] = [alone(Piece(one, law, later[name, "held"].x, short), inverter=kind) for kind in ("averaged", "switching")]
                except SimulationDiverged:
                    flag |= DIVERGED
        found |= robustness_contest.measures(scenario, runs)
        # Bisection would cost ten runs for a number of which only the side of one is used.
        found["zidani/tab02/static"] = 2.0 if stiff is None or swings(stiff.error) else 0.5
        if ("ANN", "held") in runs:
            left = runs["ANN", "held"].error[-1]
            found["zidani/tab02/static/trained"] = values["load"] * scenario.machine.T_rated / max(left, 1e-6) / needed
        return found, flag


def _stiff(drive, K_p, start):
    """Return the `Piece` by which ``table2_fit.rings`` would ask whether a static map of this stiffness keeps oscillating."""
    load = np.array([[SET_POINT, 0.1 * drive.scenario.T_limit, 1.0]])
    return Piece(drive, PiSpeed(K_p, 0.0).law(), start, (np.array([0, NEVER]), load, round(0.5 / drive.scenario.period)))
