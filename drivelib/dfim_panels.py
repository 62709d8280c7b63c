"""Panels with sliders for the doubly fed drive: its fuzzy speed controller beside the PI."""

from drivelib import contest
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
    inset.tick_params(labelsize=8)
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
