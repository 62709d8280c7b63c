"""What the ledger measures of the contest, taken from the runs of one draw (``robustness_dfim``)."""

import numpy as np

from drivelib import metrics
from drivelib.contest import CONTROLLERS

RECOVERY = 0.005  # of the set point
TAIL = 0.2  # of the held load, over which steady error and swing are taken
LEAST = 1e-9  # keeps a quotient of two vanishing changes finite


def measures(scenario, runs):
    """Return {claim: measure} of Zidani's claims, as far as the runs are there.

    Parameters
    ----------
    scenario : Scenario
    runs : dict
        (controller, "nominal" or "increased") to the pair (load's coming, reversal) of ``dfim_pieces.Part``; (controller, "held") to
        the whole hold; "switching" to the loaded ANN's pair of runs with averaged and switching inverters.
    """
    held = {name: _under_load(scenario, runs[name, "held"]) for name in CONTROLLERS if (name, "held") in runs}
    arrival = {name: _arrival(scenario, runs[name, "nominal"][1]) for name in held}
    both = [name for name in held if (name, "increased") in runs]
    change = {name: _change(runs[name, "nominal"], runs[name, "increased"]) for name in both}
    index = {name: 100 * abs(runs[name, "increased"][0].indices.IAE / runs[name, "nominal"][0].indices.IAE - 1) for name in both}
    flux = {(name, kind): _flux(scenario, runs[name, kind]) for name in both for kind in ("nominal", "increased")}
    found = {}
    if "PI" in held:
        found |= {"fig10/pi": held["PI"]["steady"], "fig10/pi/dip": held["PI"]["dip"], "fig10/pi/overshoot": held["PI"]["overshoot"]}
    if "FLC" in held:
        flc = held["FLC"]
        found |= {"fig10/flc": flc["steady"], "end-3": flc["steady"], "fig10/flc/dip": flc["dip"], "fig10/flc/overshoot": flc["overshoot"]}
        found["eq21/x"] = flc["steady"] / 100 * _set_point(runs["FLC", "held"])
    if "ANN" in held:
        found |= {"fig10/ann": held["ANN"]["dip"], "fig10/ann/overshoot": held["ANN"]["overshoot"], "end-2": held["ANN"]["steady"]}
    if "switching" in runs:
        averaged, switching = (part["omega_m"] for part in runs["switching"])
        found["fig10/ripple"] = 100 * np.ptp(switching - averaged) / _set_point(runs["switching"][0])
    if {"FLC", "ANN"} <= set(held):
        two = [held["FLC"], held["ANN"]]
        found |= {"end-5/load": max(one["dip"] for one in two), "end-5/precision": max(one["steady"] for one in two)}
    if "PI" in change:
        found["fig11/pi"] = change["PI"]
    if {"FLC", "ANN"} <= set(change):
        found |= {"fig11": max(change["FLC"], change["ANN"]), "end-4": max(index["FLC"], index["ANN"])}
    if len(both) == len(CONTROLLERS):
        found["fig11/contrast"] = change["PI"] / max(change["FLC"], change["ANN"], LEAST)
        found |= {f"fig12{tail}": max(flux[name, kind] for name in CONTROLLERS) for tail, kind in (("", "increased"), ("/nominal", "nominal"))}
        found["end-5/flux"] = max(flux["FLC", "increased"], flux["ANN", "increased"]) / max(flux["PI", "increased"], LEAST)
        found["end-5/stability"] = max(one["ripple"] for one in held.values())
        found["end-1"] = _worst_ratio({name: runs[name, "held"].indices for name in CONTROLLERS})
        found["end-5/dynamics"] = arrival["ANN"] / min(arrival["PI"], arrival["FLC"])
        recovery = {name: max(held[name]["recovery"], scenario.period) for name in CONTROLLERS}
        found["end-5/dynamics/load"] = recovery["ANN"] / min(recovery["PI"], recovery["FLC"])
    return {f"zidani/{claim}": float(value) for claim, value in found.items()}


def _set_point(part):
    return abs(part["omega_ref"][0])


def _under_load(scenario, part):
    """Dip, overshoot, steady error and swing in % of the set point, recovery in s, as ``contest.Response``."""
    share, error = 100 / _set_point(part), part.error
    t = scenario.period * np.arange(error.size)
    event = metrics.response_metrics(t, error, band=RECOVERY * _set_point(part), tail=TAIL)
    return {
        "dip": share * abs(event.peak),
        "overshoot": share * event.overshoot,
        "steady": share * abs(event.steady_error),
        "ripple": share * event.ripple,
        "recovery": min(event.recovery_time, float(t[-1])),
    }


def _arrival(scenario, part):
    """Time (s) after which the reversed drive stays within the band; the whole time watched where it does not arrive."""
    outside = np.flatnonzero(np.abs(part.error) > RECOVERY * _set_point(part))
    return scenario.period * (outside[-1] + 1 if outside.size else 1)


def _change(nominal, increased):
    """Largest change of speed that R_r makes, in % of the set point."""
    pairs = zip(nominal, increased, strict=True)
    return max(100 * np.abs(a["omega_m"][: b["omega_m"].size] - b["omega_m"]).max() / _set_point(a) for a, b in pairs)


def _flux(scenario, parts):
    """Largest deviation of the rotor flux, either axis, in % of the reference."""
    reference = scenario.phi_r_ref
    return max(100 * max(np.abs(part["phi_rd"] - reference).max(), np.abs(part["phi_rq"]).max()) / reference for part in parts)


def _worst_ratio(indices):
    pairs = (("ANN", "FLC"), ("FLC", "PI"))
    return max(small / large for a, b in pairs for small, large in zip(indices[a][:3], indices[b][:3], strict=True))
