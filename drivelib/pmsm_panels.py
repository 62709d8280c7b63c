"""Panels with sliders for permanent-magnet motors: loss over current and voltage, and a reader's own motor."""

import numpy as np

from drivelib import pmsm, pmsm_optimum
from drivelib.curves import last_below
from drivelib.interactive import Panel, nice_limit, slider
from drivelib.plotting import COLOURS, GREY, figure

FIELDS = ("R_s", "L_d", "L_q", "psi_f", "R_c", "V_dc")  # of a motor, each with a slider of its own


def loss_curves(machine, *, model="full", convention="consistent"):
    """Loss over d current and stator voltage, with sliders for R_c, torque and speed.

    Parameters
    ----------
    machine : PmsmParameters
    model, convention : str
        See `drivelib.pmsm`.

    Returns
    -------
    Panel
    """
    fig, (over_current, over_voltage) = figure(f"{machine.name}: loss at constant torque", 1, 2, height=4.0)
    fig.set_figwidth(10)
    curves = {
        "copper": over_current.plot([], [], color=COLOURS[1], linestyle="--", label="copper")[0],
        "iron": over_current.plot([], [], color=COLOURS[2], linestyle=":", label="iron")[0],
        "total": over_current.plot([], [], color=COLOURS[0], linestyle="-", label="sum")[0],
        "voltage": over_voltage.plot([], [], color=COLOURS[0], linestyle="-")[0],
    }
    for name, axis in (("least, over current", over_current), ("least, over voltage", over_voltage)):
        curves[name] = axis.plot([], [], "o", color=COLOURS[0], markerfacecolor="white", zorder=5)[0]
    V_max = pmsm.voltage_limit(machine)
    over_voltage.axvline(V_max, color=GREY, lw=1)
    over_voltage.annotate(f"limit of {machine.V_dc:g} V dc", (V_max, 0.97), xycoords=("data", "axes fraction"), rotation=90, ha="right", va="top", fontsize=9)
    over_current.set(xlabel="d-axis branch current $i_{od}$ (A)", ylabel="loss (W)")
    over_voltage.set(xlabel="stator voltage (V, phase peak)", xlim=(0, 2 * V_max))
    over_current.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2)
    i_od = _currents(machine)
    over_current.set_xlim(i_od[0], i_od[-1])

    def update(R_c, T_e, speed):
        motor, omega_e = machine.changed(R_c=R_c), machine.P * speed
        i_oq = pmsm.i_oq_at_torque(motor, T_e, i_od)
        iron = pmsm.iron_loss(motor, omega_e, i_od, i_oq, convention=convention)
        total = pmsm.total_loss(motor, omega_e, i_od, i_oq, model=model, convention=convention)
        best = pmsm_optimum.optimum(motor, omega_e, T_e, model=model, convention=convention)
        for name, values in (("copper", total - iron), ("iron", iron), ("total", total)):
            curves[name].set_data(i_od, values)
        curves["voltage"].set_data(pmsm.stator_voltage(motor, omega_e, i_od, i_oq, model=model), total)
        curves["least, over current"].set_data([best.i_od], [best.loss])
        curves["least, over voltage"].set_data([best.V_s], [best.loss])
        for axis in (over_current, over_voltage):
            axis.set_ylim(0, nice_limit(2.2 * best.loss + 1))
        without = pmsm.total_loss(motor, omega_e, 0.0, pmsm.i_oq_at_torque(motor, T_e, 0.0), model=model, convention=convention)
        reach = "" if best.V_s <= V_max else f", more than the {V_max:.0f} V that there are"
        return f"Least loss {best.loss:.1f} W at i_od = {best.i_od:.2f} A and {best.V_s:.0f} V{reach}; {without:.1f} W with i_od = 0."

    sliders = {
        "R_c": slider("R_c", machine.R_c, machine.R_c / 10, machine.R_c * 10, "ohm", scale="logarithmic"),
        "T_e": slider("torque", 0.6 * machine.T_rated, 0.0, 1.5 * machine.T_rated, "N m"),
        "speed": slider("speed", 0.6 * machine.omega_m_rated, 0.0, 2 * machine.omega_m_rated, "rad/s"),
    }
    return Panel(fig, curves, sliders, update)


def own_motor(machine, I_max):
    """Largest torque and loss over speed, with sliders for the motor's parameters and the inverter's limits.

    Parameters
    ----------
    machine : PmsmParameters
    I_max : float
        Largest current (A, peak).

    Returns
    -------
    Panel
    """
    fig, (reach, loss) = figure(f"{machine.name}, parameters changed", 1, 2, height=4.0)
    fig.set_figwidth(10)
    before = reach.plot([], [], color=GREY, linestyle="--", lw=1.2, label="as given")[0]
    curves = {
        "reach": reach.plot([], [], color=COLOURS[0], linestyle="-", label="with the sliders")[0],
        "least": loss.plot([], [], color=COLOURS[0], linestyle="-", label="least")[0],
        "without": loss.plot([], [], color=COLOURS[1], linestyle="--", label="with $i_{od}$ = 0")[0],
    }
    speed = np.linspace(0.02, 2.0, 60) * machine.omega_m_rated
    reach.set(xlabel="mechanical speed (rad/s)", ylabel="largest torque (N·m)", xlim=(0, speed[-1]))
    loss.set(xlabel="mechanical speed (rad/s)", ylabel="loss at that torque (W)", xlim=(0, speed[-1]))
    before.set_data(speed, np.nan_to_num(_reach(machine, speed, I_max)))
    reach.legend(loc="upper right"), loss.legend(loc="upper left")

    def update(T_e, I_max, **values):
        motor = machine.changed(**values)
        largest = np.nan_to_num(_reach(motor, speed, I_max))
        best = pmsm_optimum.optimum(motor, motor.P * speed, T_e, V_max=pmsm.voltage_limit(motor), I_max=I_max)
        i_oq = pmsm.i_oq_at_torque(motor, T_e, 0.0)
        allowed = pmsm.stator_voltage(motor, motor.P * speed, 0.0, i_oq) <= pmsm.voltage_limit(motor)
        allowed &= np.hypot(*pmsm.terminal_currents(motor, motor.P * speed, 0.0, i_oq)) <= I_max
        curves["reach"].set_data(speed, largest)
        curves["least"].set_data(speed, best.loss)
        curves["without"].set_data(speed, np.where(allowed, pmsm.total_loss(motor, motor.P * speed, 0.0, i_oq), np.nan))
        reach.set_ylim(0, nice_limit(1.05 * max(largest.max(), before.get_ydata().max())))
        loss.set_ylim(0, nice_limit(1.2 * np.nanmax(best.loss, initial=1.0)))
        at = np.interp(machine.omega_m_rated, speed, largest)
        ends = speed[best.feasible][-1] if best.feasible.any() else 0.0
        return f"{at:.2f} N·m at rated speed inside {pmsm.voltage_limit(motor):.0f} V and {I_max:.1f} A; {T_e:.2f} N·m up to {ends:.0f} rad/s."

    units = machine.UNITS
    sliders = {name: slider(name, getattr(machine, name), getattr(machine, name) / 2, getattr(machine, name) * 2, units[name]) for name in FIELDS}
    sliders["I_max"] = slider("I_max", I_max, I_max / 2, I_max * 2, "A")
    sliders["T_e"] = slider("torque", 0.5 * machine.T_rated, 0.0, 1.5 * machine.T_rated, "N m")
    return Panel(fig, curves, sliders, update)


def _currents(machine):
    """Return branch currents (A) about the range in which a loss can have its minimum: short circuit to some above zero."""
    low = -machine.psi_f / machine.L_d
    if machine.delta_L > 0:  # there the torque's flux must stay positive
        low = max(low, -0.9 * machine.psi_f / machine.delta_L)
    return np.linspace(low, -0.3 * low, 300)


def _reach(machine, speed, I_max):
    """Return the largest torque (N m) over speed; fewer steps of bisection than a map takes, enough for a picture."""

    def unreachable(T_e):
        return ~pmsm_optimum.optimum(machine, machine.P * speed, T_e, V_max=pmsm.voltage_limit(machine), I_max=I_max).feasible * 1.0

    return last_below(unreachable, 0.5, np.zeros(speed.shape), 5 * machine.T_rated, steps=12)
