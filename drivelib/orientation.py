"""Figure 1 of Zidani as arrows: stator axis, rotor axis and the d-q frame on the rotor flux, with the vectors of one operating point."""

import cmath
import math
from typing import NamedTuple

import numpy as np
from matplotlib.patches import Arc, FancyArrowPatch

from drivelib import dfim, dfim_decoupling
from drivelib.plotting import BEHIND_TEXT, COLOURS, GREY
from drivelib.validation import number


class Orientation(NamedTuple):
    """Angles (rad, seen from the stator axis) and vectors in stator coordinates (A, Wb); see ``oriented_vectors``."""

    theta_s: float
    theta_m: float
    theta_r: float
    i_s: complex
    i_r: complex
    phi_s: complex
    phi_r: complex

    @property
    def misalignment(self):
        """Angle of the rotor flux against the d axis (rad)."""
        return cmath.phase(self.phi_r * cmath.exp(-1j * self.theta_s))


def oriented_vectors(machine, omega_m, T_e, phi_r, omega_s, theta_s, theta_m):
    """Return the Orientation of the steady point with that speed, torque and flux.

    The point's voltages go to the machine's impedances (`dfim.open_loop_steady_state`), which know nothing of the
    orientation; the currents they answer with give the flux.

    Parameters
    ----------
    machine : DfimParameters
    omega_m, T_e, phi_r, omega_s : float
        Speed (rad/s), torque (N m), rotor flux reference (Wb), stator frequency (rad/s).
    theta_s, theta_m : float
        Angle of the d axis and electrical angle of the rotor axis (rad).

    Raises
    ------
    ValueError
        If an input is not finite or the flux is not positive.
    """
    theta_s, theta_m = number("theta_s", theta_s, "rad"), number("theta_m", theta_m, "rad")
    point = dfim_decoupling.oriented_steady_state(omega_m, T_e, phi_r, omega_s, machine)
    i_s, i_r = dfim.open_loop_steady_state(omega_m, point.v_s, point.v_r, omega_s, machine)
    flux_s, flux_r = dfim.flux_linkages(i_s, i_r, machine)
    turn = cmath.exp(1j * theta_s)
    return Orientation(theta_s, theta_m, theta_s - theta_m, i_s * turn, i_r * turn, flux_s * turn, flux_r * turn)


def free_currents(machine, phi_r, T_e):
    """Return in how many ways the four currents can still change with φ_rq = 0, φ_rd and torque kept: 4 less the conditions' rank.

    Raises
    ------
    ValueError
        If the flux is not positive or the torque not finite.
    """
    i_sd, i_sq, i_rd, i_rq = (float(value) for value in dfim_decoupling.current_references(number("T_e", T_e, "N m"), phi_r, machine))
    phi_rd, phi_rq = machine.L_r * i_rd + machine.M * i_sd, machine.L_r * i_rq + machine.M * i_sq
    conditions = [
        [0.0, machine.M, 0.0, machine.L_r],
        [machine.M, 0.0, machine.L_r, 0.0],
        [machine.M * i_sq - phi_rq, phi_rd - machine.M * i_sd, machine.L_r * i_sq, -machine.L_r * i_sd],  # of φ_rd i_sq − φ_rq i_sd
    ]
    return 4 - int(np.linalg.matrix_rank(np.array(conditions)))


def draw(axes, found, *, ampere=0.13, weber=1.7):
    """Draw an Orientation on Matplotlib ``axes``, to scale: ``ampere`` and ``weber`` are lengths per ampere and per weber."""
    for angle, name, dashes, length in (
        (0.0, "stator axis", (0, (6, 2, 1, 2)), 1.95),
        (found.theta_m, "rotor axis", (0, (6, 2, 1, 2)), 1.95),
        (found.theta_s, "d", "-", 2.0),
        (found.theta_s + math.pi / 2, "q", "-", 1.75),
    ):
        end = length * cmath.exp(1j * angle)
        axes.add_patch(FancyArrowPatch((0, 0), (end.real, end.imag), arrowstyle="->", mutation_scale=12, lw=1.0, color=GREY, linestyle=dashes, shrinkA=0))
        tip = (length + 0.09) * cmath.exp(1j * angle)
        axes.text(tip.real, tip.imag, name, color=GREY, ha="left" if tip.real > 0 else "right", va="center", fontsize=11)
    for k, (radius, start, end, name) in enumerate((
        (0.72, 0.0, found.theta_m, r"$p\,\theta$"), (0.42, found.theta_m, found.theta_s, r"$\theta_r$"), (1.05, 0.0, found.theta_s, r"$\theta_s$"),
    )):  # fmt: skip
        axes.add_patch(Arc((0, 0), 2 * radius, 2 * radius, theta1=math.degrees(start), theta2=math.degrees(end), lw=1.1, color="black"))
        middle = (radius + 0.1) * cmath.exp(1j * (start + (0.5, 0.5, 0.2)[k] * (end - start)))
        axes.text(middle.real, middle.imag, name, ha="center", va="center", fontsize=11)
    turn = cmath.exp(1j * found.theta_s)
    part_d, part_q = (found.i_s / turn).real * turn, 1j * (found.i_s / turn).imag * turn
    for part, name, shift in ((part_d, "$i_{sd}$", -0.14j), (part_q, "$i_{sq}$", -0.14)):
        foot, tip = ampere * part, ampere * found.i_s
        axes.plot([foot.real, tip.real], [foot.imag, tip.imag], color=COLOURS[1], lw=0.9, linestyle=(0, (2, 2)))
        at = foot + shift * turn
        axes.text(at.real, at.imag, name, color=COLOURS[1], ha="center", va="center", fontsize=11, bbox=BEHIND_TEXT)
    for vector, scale, name, colour, width, shift in (
        (found.phi_r, weber, r"$\varphi_r$", COLOURS[2], 3.2, -0.12j), (found.phi_s, weber, r"$\varphi_s$", COLOURS[4], 2.0, 0.12j),
        (found.i_s, ampere, r"$i_s$", COLOURS[1], 2.0, 0.1), (found.i_r, ampere, r"$i_r$", COLOURS[0], 2.0, 0.14),
    ):  # fmt: skip
        end = scale * vector
        axes.add_patch(FancyArrowPatch((0, 0), (end.real, end.imag), arrowstyle="-|>", mutation_scale=15, lw=width, color=colour, shrinkA=0, shrinkB=0))
        at = end + shift * vector / abs(vector)
        axes.text(at.real, at.imag, name, color=colour, ha="center", va="center", fontsize=13)
    for height, length, name in ((-0.7, 5 * ampere, "5 A"), (-0.9, 0.5 * weber, "0.5 Wb")):
        axes.plot([-1.7, -1.7 + length], [height, height], color="black", lw=1.5, marker="|", linestyle="-")
        axes.text(-1.6 + length, height, name, ha="left", va="center", fontsize=10)
    axes.set_aspect("equal")
    axes.set(xlim=(-1.75, 2.75), ylim=(-1.0, 1.85))
    axes.axis("off")
