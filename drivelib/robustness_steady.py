"""Eskander's comparative claims about the steady state, in one draw: figures 2, 3 and 16 to 18, and the conclusions.

Everything follows from ``pmsm`` and ``pmsm_optimum``; no network and no time is in it. A torque that no current gives inside
the inverter's voltage is out of reach, and the claims that ask for it are flagged.
"""

import numpy as np

from drivelib import pmsm, pmsm_angle, pmsm_optimum
from drivelib.machines import IPMSM, SPMSM
from drivelib.robustness import REACH, Study
from drivelib.space import Space, Span, open_values

SHARES = np.linspace(0.1, 1.0, 10)  # of rated speed: the operating range
RPM = np.pi / 30
FIG02_SPEEDS = RPM * np.array([500.0, 1000.0, 1500.0])  # rad/s
FIG03_TORQUES = np.arange(1.0, 6.0)  # N m
REACHES = np.geomspace(0.1, 20.0, 60)  # of rated speed, where the highest one is sought
CLOCK = Span(5e6, 80e6, log=True)  # Hz, processors of 2002

# What public files of the same machine have beside the printed appendix.
IPMSM_SETS = {
    "as printed": IPMSM,
    "0.272 Wb 4 poles": IPMSM.changed(psi_f=0.272, P=2),
    "0.279 Wb 4 poles": IPMSM.changed(psi_f=0.279, P=2),
}
ASSUMPTIONS = {
    "ipmsm": tuple(IPMSM_SETS),
    "R_c_ipmsm": open_values(IPMSM, ["R_c"])["R_c"],
    "R_c_spmsm": open_values(SPMSM, ["R_c"])["R_c"],
    "omega_rated_spmsm": open_values(SPMSM, ["omega_m_rated"])["omega_m_rated"],
}
SPACE = Space(
    {
        **ASSUMPTIONS,
        "machine": ("SPMSM", "IPMSM"),
        "load": Span(0.1, 1.0),
        "small_load": Span(0.01, 1.0, log=True),
        "speed": Span(0.1, 1.0),
        "lowest_speed": Span(1.0, 30.0, log=True),
        "constraint": ("equal voltage", "equal current", "equal load"),
        "weakening": ("by (16)", "up to the limit"),
        "model": pmsm.MODELS,
        "convention": pmsm.CONVENTIONS,
        "modulation": tuple(pmsm.MODULATIONS),
        "clock": CLOCK,
        "tanh_cycles": Span(20.0, 100.0),
        "period": Span(5e-5, 2e-4, log=True),
    }
)
LABELS = {
    "ipmsm": "IPMSM set",
    "R_c_ipmsm": "R_c of IPMSM [Ω]",
    "R_c_spmsm": "R_c of SPMSM [Ω]",
    "omega_rated_spmsm": "rated speed of SPMSM [rad/s]",
    "machine": "machine",
    "load": "load / rated",
    "small_load": "load / rated",
    "speed": "speed / rated",
    "lowest_speed": "lowest speed [rad/s]",
    "constraint": "kept equal",
    "weakening": "weakening",
    "model": "loss model",
    "convention": "loss convention",
    "modulation": "modulation",
    "clock": "clock [Hz]",
    "tanh_cycles": "cycles per tanh",
    "period": "sample time [s]",
}
CLAIMS = tuple(
    f"eskander/{claim}"
    for claim in (
        "fig02/voltage fig03/voltage eq05/08 net/time fig16 eq20/x fig17/torque fig17/efficiency fig18/efficiency fig18/torque "
        "end-1 end-2 end-3 fig19/range"
    ).split()
)


def machines_of(values):
    """Return (IPMSM, SPMSM) of a draw."""
    ipmsm = IPMSM_SETS[values["ipmsm"]].changed(R_c=values["R_c_ipmsm"])
    rated = values["omega_rated_spmsm"]
    return ipmsm, SPMSM.changed(R_c=values["R_c_spmsm"], omega_m_rated=rated, T_rated=400.0 / rated)


def measure(values, _rng):
    """Return ({claim: measure}, flags) of a draw; see ``robustness.Study``."""
    ipmsm, spmsm = machines_of(values)
    named = spmsm if values["machine"] == "SPMSM" else ipmsm
    found = {**_voltages(ipmsm, values), **_schemes(ipmsm, spmsm, values), **_benefit(named, values)}
    found["end-2"] = _highest_speed(named, values)
    found["fig18/torque"] = _torque_ratio(spmsm, values)
    w, T = values["speed"] * named.omega_e_rated, values["load"] * named.T_rated
    if _reachable(named, w, T, values, "simplified"):
        best = pmsm_optimum.optimum(named, w, T, model="simplified")
        op = pmsm_angle.inverter_angle(named, w, _torque_current(named, T))
        found["eq20/x"] = float(np.degrees(abs(pmsm_angle.angle_of(named, w, best.i_od, best.i_oq)[0] - op)))
    phi = np.degrees(pmsm_angle.inverter_angle(named, SHARES * named.omega_e_rated, _torque_current(named, values["small_load"] * named.T_rated)))
    found["fig16"] = 100 * np.mean((phi >= 0.5) & (phi <= 2.5))
    # (20) rises with speed, so the least angle is that of the lowest speed.
    found["fig19/range"] = float(np.degrees(pmsm_angle.inverter_angle(spmsm, spmsm.P * values["lowest_speed"], _torque_current(spmsm, 0.2))))
    cycles = 6 + 2 * values["tanh_cycles"]  # ``networks.operations`` of 2-2-1
    found["net/time"] = 100 * cycles / values["clock"] / values["period"]
    found = {f"eskander/{claim}": float(value) for claim, value in found.items()}
    missing = any(np.isnan(found.get(claim, np.nan)) for claim in CLAIMS)
    return found, REACH if missing else 0


def _torque_current(machine, T_e):
    return T_e / (1.5 * machine.P * machine.psi_f)


def _reachable(machine, omega_e, T_e, values, model):
    limit = pmsm.voltage_limit(machine, values["modulation"])
    return np.all(pmsm_optimum.least_voltage(machine, omega_e, T_e, model=model)[0] <= limit)


def _voltages(machine, values):
    """Voltages of least loss over speed and over torque, and what terminal currents add to the loss."""
    load, speed = values["load"] * machine.T_rated, values["speed"] * machine.omega_m_rated
    w = machine.P * np.concatenate([FIG02_SPEEDS, np.full(5, speed), [speed]])
    T = np.concatenate([np.full(3, load), FIG03_TORQUES, [load]])
    best = {model: pmsm_optimum.optimum(machine, w, T, model=model, convention=values["convention"]) for model in pmsm.MODELS}
    reach = pmsm_optimum.least_voltage(machine, w, T, model=values["model"])[0] <= pmsm.voltage_limit(machine, values["modulation"])
    V_s, found = best[values["model"]].V_s, {}
    if reach[:3].all():
        found["fig02/voltage"] = np.min(np.abs(np.diff(V_s[:3])))
    if reach[3:8].all():
        found["fig03/voltage"] = np.min(np.diff(V_s[3:8]))
    if reach[8]:
        found["eq05/08"] = 100 * (best["full"].loss[8] / best["simplified"].loss[8] - 1)
    return found


def _efficiencies(machine, values):
    """Optimum, i_oq of i_d = 0, and efficiency (%) of both over the operating range; NaN where i_d = 0 needs too much voltage."""
    w, T = SHARES * machine.omega_e_rated, values["load"] * machine.T_rated
    options = {"model": "simplified", "convention": values["convention"]}
    best = pmsm_optimum.optimum(machine, w, T, **options)
    i_oq = np.full(w.shape, _torque_current(machine, T))
    eta = [100 * pmsm.efficiency(machine, w, *currents, **options) for currents in ((best.i_od, best.i_oq), (0.0, i_oq))]
    inside = pmsm.stator_voltage(machine, w, 0.0, i_oq, model="simplified") <= pmsm.voltage_limit(machine, values["modulation"])
    return w, best, i_oq, eta[0], np.where(inside, eta[1], np.nan)


def _schemes(ipmsm, spmsm, values):
    """Efficiency that i_d = 0 gives away in both machines, and the angles' distance where it gives away little."""
    found, lost = {}, []
    for machine in (spmsm, ipmsm):
        w, best, i_oq, eta_best, eta_zero = _efficiencies(machine, values)
        gap = eta_best - eta_zero
        if np.isnan(gap).all():
            continue
        lost.append(np.nanmax(gap))
        if machine is spmsm:
            found["fig18/efficiency"] = lost[0]
            equal = gap <= 1.0
            if equal.any():
                best_angle = pmsm_angle.angle_of(machine, w, best.i_od, best.i_oq)[0]
                found["end-3"] = np.degrees(np.median(np.abs(best_angle - pmsm_angle.inverter_angle(machine, w, i_oq))[equal]))
    if len(lost) == 2:
        found["end-1"] = max(lost)
    return found


def _benefit(machine, values):
    """Torque and efficiency at φ_op against φ = 0, medians over the operating range, with what is kept equal."""
    w, T = SHARES * machine.omega_e_rated, values["load"] * machine.T_rated
    i_oq = np.full(w.shape, _torque_current(machine, T))
    V_s = pmsm.stator_voltage(machine, w, 0.0, i_oq, model="simplified")
    if not np.any(V_s <= pmsm.voltage_limit(machine, values["modulation"])):
        return {}
    given = {"equal voltage": {"V_s": V_s}, "equal current": {"current": i_oq}, "equal load": {"T_e": T}}[values["constraint"]]
    i_od_0, i_oq_0 = pmsm_angle.zero_angle(machine, w, **given)
    there = np.isfinite(i_oq_0)
    i_od_0, i_oq_0 = np.where(there, i_od_0, 0.0), np.where(there, i_oq_0, 0.0)
    options = {"model": "simplified", "convention": values["convention"]}
    T_op, T_0 = pmsm.torque(machine, 0.0, i_oq), np.where(there, pmsm.torque(machine, i_od_0, i_oq_0), 0.0)
    eta_op = pmsm.efficiency(machine, w, np.zeros_like(i_oq), i_oq, **options)
    eta_0 = np.where(T_0 > 0, pmsm.efficiency(machine, w, i_od_0, i_oq_0, **options), 0.0)
    # No driving torque at all counts as a factor of 1000, as in the notebook of the figure.
    gains = T_op / np.where(T_0 > 0, T_0, 1e-3 * T_op)
    return {"fig17/torque": np.median(gains), "fig17/efficiency": 100 * np.median(eta_op - eta_0)}


def _torque_ratio(machine, values):
    """Torque with i_d = 0 over torque with (16), median over the operating range; NaN where the constraint leaves no current for (16)."""
    w, T = SHARES * machine.omega_e_rated, values["load"] * machine.T_rated
    i_oq = np.full(w.shape, _torque_current(machine, T))
    if values["constraint"] == "equal load":
        return 1.0
    i_d = pmsm_optimum.optimal_i_od_surface(machine, w)
    if values["constraint"] == "equal current":
        left = i_oq**2 - i_d**2
        i_best = np.sqrt(left, where=left > 0, out=np.full(w.shape, np.nan))
    else:
        i_best = pmsm.i_oq_at_voltage(machine, w, pmsm.stator_voltage(machine, w, 0.0, i_oq, model="simplified"), i_d)
    ratios = (i_oq / i_best)[i_best > 0]
    return np.median(ratios) if ratios.size else np.nan


def _highest_speed(machine, values):
    """Highest speed inside the voltage limit with weakened flux over that with i_d = 0; NaN where i_d = 0 needs too much at any speed."""
    w, T = REACHES * machine.omega_e_rated, values["load"] * machine.T_rated
    limit = pmsm.voltage_limit(machine, values["modulation"])
    zero = pmsm.stator_voltage(machine, w, 0.0, _torque_current(machine, T), model="simplified")
    if values["weakening"] == "by (16)":
        weak = pmsm_optimum.optimum(machine, w, T, model="simplified").V_s
    else:
        weak = pmsm_optimum.least_voltage(machine, w, T, model="simplified")[0]
    if zero[0] > limit or weak[0] > limit:
        return np.nan
    return _crossing(w, weak, limit) / _crossing(w, zero, limit)


def _crossing(x, rising, limit):
    above = np.flatnonzero(rising > limit)
    if not above.size:
        return x[-1]
    k = above[0]
    return x[k - 1] + (x[k] - x[k - 1]) * (limit - rising[k - 1]) / (rising[k] - rising[k - 1])


STUDY = Study("Eskander, steady state", SPACE, CLAIMS, measure, LABELS)
