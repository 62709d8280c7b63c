"""A DFIM's references of least copper loss over speed and torque, and what a network that gives them costs.

The network learns (ω_m, T) → (φ_r, i_rd): rotor flux and the rotor's share in magnetising. The torque then
follows exactly from `dfim_optimum.currents`, so that a network's error costs loss and reserve, never torque.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from drivelib import dfim_optimum, loss_map
from drivelib.dfim_decoupling import current_references
from drivelib.dfim_machines import DfimParameters
from drivelib.dfim_optimum import DfimLimits, DfimPoint
from drivelib.validation import array, grid, number


@dataclass(frozen=True)
class DfimMap:
    """Least-loss operating points of one DFIM on a grid of speed and torque.

    Attributes
    ----------
    machine : DfimParameters
    omega_m, T_e : ndarray, shapes (n,) and (m,)
        Speed (rad/s) and torque (N m).
    limits : DfimLimits
    best : DfimPoint
        Arrays of shape (n, m); NaN and ``feasible`` false where the limits exclude the point.
    T_max : ndarray, shape (n,)
        Largest torque inside the limits, at most the end of the grid (N m); NaN where not even the first
        torque of the grid is.
    """

    machine: DfimParameters
    omega_m: np.ndarray
    T_e: np.ndarray
    limits: DfimLimits
    best: DfimPoint
    T_max: np.ndarray

    targets: ClassVar = {"phi_r": "Wb", "i_rd": "A"}  # what a network learns, with units

    @property
    def inverter(self):
        """The limits in words, for messages."""
        inside = self.limits
        return f"{inside.phi_r:.4g} Wb, {inside.V_s:.4g} and {inside.V_r:.4g} V, {inside.I_s:.4g} and {inside.I_r:.4g} A (peak)"

    @property
    def reachable(self):
        """Share of the grid that the limits allow (1)."""
        return float(np.mean(self.best.feasible))

    def optimum(self, omega_m, T_e):
        """Return the DfimPoint at other speeds (rad/s) and torques (N m), inside the map's limits."""
        return dfim_optimum.optimum(self.machine, omega_m, T_e, self.limits)


def dfim_map(machine, omega_m, T_e, limits):
    """Return the `DfimMap` of a motor inside `DfimLimits`.

    Raises
    ------
    ValueError
        If a grid is not sorted, the speed starts below zero (motoring only) or the torque at or below it (at no torque the
        least loss is no flux, from which no torque can come), a resistance is zero, or no point of the grid is
        inside the limits.
    """
    omega_m, T_e = grid("omega_m", omega_m, "rad/s"), grid("T_e", T_e, "N m")
    array("omega_m", omega_m, "rad/s", at_least=0)
    array("T_e (torque_range)", T_e, "N m", above=0)
    best = dfim_optimum.optimum(machine, omega_m[:, None], T_e[None, :], limits)
    if not best.feasible.any():
        raise ValueError(
            f"{machine.name}: no point of {omega_m[0]:.4g} to {omega_m[-1]:.4g} rad/s and {T_e[0]:.4g} to {T_e[-1]:.4g} N m lies inside "
            f"{limits.phi_r:.4g} Wb, {limits.V_s:.4g} and {limits.V_r:.4g} V, {limits.I_s:.4g} and {limits.I_r:.4g} A; "
            f"check units and limits: {T_e[0]:.4g} N m at {limits.phi_r:.4g} Wb takes {machine.L_r * T_e[0] / (1.5 * machine.p * machine.M * limits.phi_r):.4g} A in the stator's q axis"
        )
    found = DfimMap(machine, omega_m, T_e, limits, best, np.array([]))
    return DfimMap(machine, omega_m, T_e, limits, best, loss_map.reach(found.optimum, omega_m, T_e[0], T_e[-1]))


@dataclass(frozen=True)
class DfimError:
    """What a network's references cost on a map; arrays of the map's shape, NaN beyond `loss_map.torque_limit`.

    Attributes
    ----------
    excess : ndarray
        Loss less the least loss (W). Below zero only where the network trespasses a limit.
    beyond : ndarray
        Largest of flux, voltages and currents over its limit, as a share of it; 0 inside.
    """

    excess: np.ndarray
    beyond: np.ndarray


def network_error(found, references, headroom=0.95):
    """Return the `DfimError` of references on a map, up to `loss_map.torque_limit`.

    Parameters
    ----------
    found : DfimMap
    references : callable
        (…, 2) speed and torque → (…, 2) φ_r and i_rd, such as `neural.Network.predict`.
    headroom : float
        See `loss_map.torque_limit`.
    """
    speed, torque = np.meshgrid(found.omega_m, found.T_e, indexing="ij")
    phi_r, i_rd = np.moveaxis(references(np.stack([speed, torque], axis=-1)), -1, 0)
    made = dfim_optimum.point(found.machine, speed, torque, phi_r, i_rd, dfim_optimum.stator_frequency(found.machine, speed, torque, found.limits))
    asked = found.best.feasible & (torque <= loss_map.torque_limit(found, found.omega_m, headroom)[:, None])
    values = made.loss - found.best.loss, dfim_optimum.excess(made, found.limits)
    return DfimError(*(np.where(asked, value, np.nan) for value in values))


def paper_loss(machine, T_e, phi_r):
    """Return the copper loss (W) of the paper's references (16), mended, at a torque (N m): constant flux (Wb), no rotor d current."""
    i_sd, i_sq, i_rd, i_rq = current_references(T_e, phi_r, machine)
    return dfim_optimum.copper_loss(machine, i_sd + 1j * i_sq, i_rd + 1j * i_rq)


def best_split(found, steps=21):
    """Return the least loss (W) on a map when each point may share its speed otherwise too; shape of the map, NaN out of reach.

    The stator then takes 0 to 100 % of the speed in ``steps`` equal steps, besides `dfim_optimum.stator_frequency`.
    """
    steps = number("steps", steps, "", at_least=2, whole=True)
    omega_s = np.linspace(0, 1, steps)[:, None, None] * found.machine.p * found.omega_m[:, None]
    best = dfim_optimum.optimum(found.machine, found.omega_m[:, None], found.T_e[None, :], found.limits, omega_s=omega_s)
    every = np.concatenate([found.best.loss[None], best.loss])
    least = np.min(np.where(np.isfinite(every), every, np.inf), axis=0)
    return np.where(np.isfinite(least), least, np.nan)
