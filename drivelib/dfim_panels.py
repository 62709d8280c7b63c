"""Panels with sliders for the doubly fed motor: its fuzzy speed control beside the PI, and a reader's own motor."""

import numpy as np

from drivelib import contest, control, dfim_map, dfim_optimum
from drivelib.dfim_drive import simulate
from drivelib.interactive import Panel, nice_limit, slider
from drivelib.plotting import COLOURS, GREY, figure
from drivelib.speed_law import FuzzySpeed

EVERY = 20  # samples between the points of the picture: 2 ms at 10 kHz
CYCLE = {"duration": 2.4, "speed_reference": ((0.0, 100.0),)}
LOADED = (1.2, 1.8)  # s


def fuzzy_loop(scenario, e_max=contest.E_MAX):
    """Speed and torque of the drive under fuzzy and PI control, with sliders for the fuzzy gains and the load.

    Parameters
    ----------
    scenario : Scenario
        Its cycle is replaced: a start to 100 rad/s, and a load from 1.2 to 1.8 s.
    e_max : float
        See `contest.fuzzy_like_pi`, which the sliders start from (rad/s).

    Returns
    -------
    Panel
    """
    start = contest.fuzzy_like_pi(scenario, e_max)
    fig, (speed, torque) = figure("Speed control of the DFIM, incremental fuzzy controller beside the PI", 2, height=5.2)
    fig.set_figwidth(9)
    styles = {"FLC": {"color": COLOURS[1], "linestyle": "-", "zorder": 3}, "PI": {"color": COLOURS[0], "linestyle": "--", "lw": 1.3}}
    curves = {(name, axis): axes.plot([], [], label=name, **style)[0] for name, style in styles.items() for axis, axes in (("speed", speed), ("torque", torque))}
    inset = speed.inset_axes((0.55, 0.12, 0.43, 0.55))
    curves |= {(name, "zoom"): inset.plot([], [], **style)[0] for name, style in styles.items()}
    reference = CYCLE["speed_reference"][0][1]
    for axis in (speed, inset):
        axis.axhline(reference, color=GREY, lw=0.8)
    speed.set(ylabel="speed (rad/s)", xlim=(0, CYCLE["duration"]), ylim=(0, 1.4 * reference))
    torque.set(xlabel="time (s)", ylabel="torque (N·m)", xlim=(0, CYCLE["duration"]), ylim=(-1.1 * scenario.T_limit, 1.1 * scenario.T_limit))
    inset.set(xlim=(LOADED[0] - 0.05, CYCLE["duration"]))
    inset.tick_params(labelsize=9)
    torque.legend(loc="lower left", ncols=2)

    def update(K_e, K_de, K_u, load):
        drive = scenario.changed(load_torque=((0.0, 0.0), (LOADED[0], load), (LOADED[1], 0.0)), **CYCLE)
        dips = {}
        for name, law in (("PI", None), ("FLC", FuzzySpeed(K_e, K_de, K_u, "incremental"))):
            run = simulate(drive, law, every=EVERY)
            curves[name, "speed"].set_data(run.t, run["omega_m"])
            curves[name, "zoom"].set_data(run.t, run["omega_m"])
            curves[name, "torque"].set_data(run.t, run["T_e"])
            loaded = (run.t >= LOADED[0]) & (run.t < LOADED[1])
            dips[name] = reference - run["omega_m"][loaded].min()
        height = nice_limit(1.2 * max(abs(dips["PI"]), abs(dips["FLC"]), 0.1))
        inset.set_ylim(reference - height, reference + height)
        return f"Load of {load:.1f} N·m: the speed falls {dips['FLC']:.2f} rad/s below the set point with the FLC, {dips['PI']:.2f} rad/s with the PI."

    rated = scenario.machine.T_rated
    sliders = {
        "K_e": slider("K_e", start.K_e, start.K_e / 10, start.K_e * 10, "s/rad", scale="logarithmic"),
        "K_de": slider("K_Δe", start.K_de, start.K_de / 10, start.K_de * 10, "s/rad", scale="logarithmic"),
        "K_u": slider("K_u", start.K_u, start.K_u / 10, start.K_u * 10, "N m", scale="logarithmic"),
        "load": slider("load", rated, 0.0, 1.5 * rated, "N m"),
    }
    return Panel(fig, curves, sliders, update)


def own_dfim(machine, limits):
    """Copper loss over rotor flux and voltages over speed, with sliders for a DFIM's parameters and its inverters.

    Parameters
    ----------
    machine : DfimParameters
    limits : DfimLimits

    Returns
    -------
    Panel
    """
    fig, (over_flux, over_speed) = figure(f"{machine.name}, parameters changed", 1, 2, height=4.0)
    fig.set_figwidth(10)
    curves = {
        "paper": over_flux.plot([], [], color=COLOURS[1], linestyle="--", label="stator magnetises")[0],
        "least": over_flux.plot([], [], color=COLOURS[0], linestyle="-", label="both do")[0],
        "chosen": over_flux.plot([], [], "o", color=COLOURS[0], markerfacecolor="white", zorder=5)[0],
        "V_s": over_speed.plot([], [], color=COLOURS[0], linestyle="-", label="stator")[0],
        "V_r": over_speed.plot([], [], color=COLOURS[1], linestyle="--", label="rotor")[0],
    }
    speed = np.linspace(0.02, 4.0, 80) * machine.omega_m_rated
    over_flux.set(xlabel="rotor flux (Wb)", ylabel="copper loss (W)", xlim=(0, 2.5 * limits.phi_r))
    over_speed.set(xlabel="mechanical speed (rad/s)", ylabel="phase voltage (V, peak)", xlim=(0, speed[-1]))
    over_flux.legend(loc="upper center"), over_speed.legend(loc="lower right")
    phi_r = np.linspace(0.02, 2.5, 200) * limits.phi_r

    def update(T_e, phi_max, V_dc_s, V_dc_r, **values):
        motor = machine.changed(**values)
        inside = dfim_optimum.DfimLimits(phi_max, control.linear_voltage_limit(V_dc_s), control.linear_voltage_limit(V_dc_r), limits.I_s, limits.I_r)
        i_rd = dfim_optimum.free_i_rd(motor, phi_r)
        curves["least"].set_data(phi_r, dfim_optimum.point(motor, 0.0, T_e, phi_r, i_rd, 0.0).loss)
        curves["paper"].set_data(phi_r, dfim_map.paper_loss(motor, T_e, phi_r))
        best = dfim_optimum.optimum(motor, speed, T_e, inside)
        curves["V_s"].set_data(speed, best.V_s)
        curves["V_r"].set_data(speed, best.V_r)
        slow = dfim_optimum.optimum(motor, 0.0, T_e, inside)
        curves["chosen"].set_data([slow.phi_r], [slow.loss])
        over_flux.set_ylim(0, nice_limit(3 * dfim_optimum.least_loss(motor, T_e)))
        over_speed.set_ylim(0, nice_limit(1.1 * max(inside.V_s, inside.V_r)))
        if not slow.feasible:
            raise ValueError(f"{T_e:.1f} N·m is out of reach of {limits.I_s:g} and {limits.I_r:g} A at {phi_max:.2f} Wb")
        saved = 100 * (1 - slow.loss / dfim_map.paper_loss(motor, T_e, phi_max))
        return (
            f"{T_e:.1f} N·m: {slow.loss:.1f} W at {slow.phi_r:.2f} Wb, {saved:.0f} % less than the paper's references at {phi_max:.2f} Wb; "
            f"in reach up to {speed[best.feasible][-1]:.0f} rad/s, limits act from {speed[best.limited | ~best.feasible][0] if np.any(best.limited | ~best.feasible) else speed[-1]:.0f} rad/s."
        )

    V_dc = {"V_dc_s": np.sqrt(3) * limits.V_s, "V_dc_r": np.sqrt(3) * limits.V_r}
    sliders = {name: slider(name, getattr(machine, name), getattr(machine, name) / 2, getattr(machine, name) * 2, "ohm") for name in ("R_s", "R_r")}
    sliders |= {name: slider(name, value, value / 4, value * 2, "V") for name, value in V_dc.items()}
    sliders["phi_max"] = slider("phi_max", limits.phi_r, limits.phi_r / 2, limits.phi_r * 2, "Wb")
    sliders["T_e"] = slider("torque", 0.5 * machine.T_rated, 0.05 * machine.T_rated, 1.5 * machine.T_rated, "N m")
    return Panel(fig, curves, sliders, update)
