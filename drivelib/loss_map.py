"""A motor's loss-minimising currents over speed and torque, and a network that gives them.

The map holds what an inverter may do: phase voltage and current are limited, the rest of the plane is
flagged as out of reach. The network learns (ω_m, T) → terminal (i_d, i_q) of the full model, as a
firmware would ask for them.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from drivelib import pmsm, pmsm_optimum
from drivelib.curves import last_below
from drivelib.machines import PmsmParameters
from drivelib.networks import TrainingData, sse_goal
from drivelib.pmsm_optimum import Optimum
from drivelib.validation import array, grid, number

FEWEST = 50  # points to learn from, below which a map of two inputs is no map


@dataclass(frozen=True)
class LossMap:
    """Least-loss operating points of one motor on a grid of speed and torque.

    Attributes
    ----------
    machine : PmsmParameters
    omega_m, T_e : ndarray, shapes (n,) and (m,)
        Mechanical speed (rad/s) and torque (N m).
    V_max, I_max : float
        Largest phase voltage (V, peak) and terminal current (A, peak).
    best : Optimum
        Arrays of shape (n, m); NaN and ``feasible`` false where the limits exclude the point.
    T_max : ndarray, shape (n,)
        Largest torque inside the limits, at most the end of the grid (N m); NaN where not even the first
        torque of the grid is.
    """

    machine: PmsmParameters
    omega_m: np.ndarray
    T_e: np.ndarray
    V_max: float
    I_max: float
    best: Optimum
    T_max: np.ndarray

    targets: ClassVar = {"i_d": "A", "i_q": "A"}  # what a network learns, with units

    @property
    def inverter(self):
        """The limits in words, for messages."""
        return f"{self.V_max:.4g} V and {self.I_max:.4g} A (peak)"

    @property
    def reachable(self):
        """Share of the grid that the limits allow (1)."""
        return float(np.mean(self.best.feasible))

    def optimum(self, omega_m, T_e):
        """Return the Optimum at other speeds (rad/s) and torques (N m), inside the map's limits."""
        return pmsm_optimum.optimum(self.machine, self.machine.P * omega_m, T_e, V_max=self.V_max, I_max=self.I_max)


def loss_map(machine, omega_m, T_e, *, V_max, I_max):
    """Return the `LossMap` of a motor: `pmsm_optimum.optimum` of the full model, consistent convention.

    Raises
    ------
    ValueError
        If a grid is not sorted, starts below zero (motoring only), a limit is not positive, or no point of
        the grid is inside the limits.
    """
    omega_m, T_e = grid("omega_m", omega_m, "rad/s"), grid("T_e", T_e, "N m")
    array("omega_m", omega_m, "rad/s", at_least=0)
    array("T_e", T_e, "N m", at_least=0)
    best = pmsm_optimum.optimum(machine, machine.P * omega_m[:, None], T_e[None, :], V_max=V_max, I_max=I_max)
    if not best.feasible.any():
        raise ValueError(
            f"{machine.name}: no point of {omega_m[0]:.4g} to {omega_m[-1]:.4g} rad/s and {T_e[0]:.4g} to {T_e[-1]:.4g} N m lies "
            f"inside {V_max:.4g} V and {I_max:.4g} A; check psi_f ω ({machine.psi_f * machine.P * omega_m[0]:.4g} V at the lowest speed), units, limits"
        )
    T_max = largest_torque(machine, omega_m, T_e[0], T_e[-1], V_max=V_max, I_max=I_max)
    return LossMap(machine, omega_m, T_e, V_max, I_max, best, T_max)


def largest_torque(machine, omega_m, T_low, T_high, *, V_max, I_max):
    """Return the largest torque in [T_low, T_high] (N m) that both limits allow, by bisection; NaN where none is."""

    def optimum(omega_m, T_e):
        return pmsm_optimum.optimum(machine, machine.P * omega_m, T_e, V_max=V_max, I_max=I_max)

    return reach(optimum, omega_m, T_low, T_high)


def reach(optimum, omega_m, T_low, T_high):
    """Return the largest torque in [T_low, T_high] (N m) at which ``optimum(omega_m, torque)`` is feasible; NaN where none is."""
    omega_m = array("omega_m", omega_m, "rad/s", at_least=0)

    def unreachable(T_e):
        return ~optimum(omega_m, T_e).feasible * 1.0

    return last_below(unreachable, 0.5, np.full(omega_m.shape, float(T_low)), float(T_high))


def rated_torque(found, needed=0.0):
    """Return the largest torque (N m) at rated speed inside the limits of a map, at most ten times the rated one.

    ``found`` is a `LossMap` or a `dfim_map.DfimMap`. Asked before a network is trained in vain.

    Raises
    ------
    ValueError
        If no current of the inverter makes any torque at rated speed, or not the torque ``needed`` (N m).
    """
    number("needed", needed, "N m", at_least=0)
    machine = found.machine
    torque = float(reach(found.optimum, machine.omega_m_rated, 0.0, 10 * machine.T_rated))
    if not torque > 0:
        raise ValueError(f"{machine.name}: at rated speed ({machine.omega_m_rated:.4g} rad/s) no current inside {found.inverter} makes torque; check V_dc, the speed and units")
    if torque < needed:
        raise ValueError(f"{machine.name}: at rated speed ({machine.omega_m_rated:.4g} rad/s) {found.inverter} make {torque:.4g} N m at most, not the {needed:.4g} N m asked for; check V_dc, T_rated and units")
    return torque


def percent_above(excess, least):
    """Return an excess of loss (W) as share of the least loss (W) in %; NaN where that is zero: at standstill without torque."""
    excess, least = np.asarray(excess, dtype=float), np.asarray(least, dtype=float)
    return 100 * excess / np.where(least > 0, least, np.nan)


def mirrored_excess(found):
    """Return what a mirrored point loses above the least loss of braking (%), at the speeds and minus the torques of a `LossMap`.

    Mirrored: the branch d current of motoring with minus its q current. Zero where no limit acts (`pmsm_optimum`: only c q
    is odd); where one does, braking needs less field weakening than motoring. NaN out of reach.
    """
    machine, best = found.machine, found.best
    omega_e = machine.P * found.omega_m[:, None]
    braking = pmsm_optimum.optimum(machine, omega_e, -found.T_e, V_max=found.V_max, I_max=found.I_max)
    i_od, i_oq = np.nan_to_num(best.i_od), np.nan_to_num(best.i_oq)
    loss = pmsm.total_loss(machine, omega_e, i_od, -i_oq)
    return percent_above(np.where(best.feasible, loss - braking.loss, np.nan), braking.loss)


def torque_limit(found, omega_m, headroom):
    """Return the torque (N m) up to which the network answers: ``headroom`` of the largest one, at most the map's end.

    At the very limit one current is left; towards it the optimum bends like a square root, which no network
    follows, and a drive needs voltage in reserve for its current controller. NaN where that is below the map.
    """
    headroom = number("headroom", headroom, "", above=0, at_most=1)
    low, high = found.T_e[0], found.T_e[-1]
    limit = headroom * reach(found.optimum, omega_m, low, high / headroom)
    return np.where(limit >= low, np.minimum(limit, high), np.nan)


def training_data(found, points=24, headroom=0.95):
    """Return what the network learns: (ω_m, T) → the map's ``targets`` on rays from the lowest torque to `torque_limit`.

    ``found`` is a `LossMap` or a `dfim_map.DfimMap`. At each of ``points`` speeds of the map's range lie as many torques, so that the border is learned too. Speeds
    at which nothing is reachable are left out.

    Raises
    ------
    ValueError
        If fewer points are left than a map needs.
    """
    points = number("points", points, at_least=2, whole=True)
    speed = np.linspace(found.omega_m[0], found.omega_m[-1], points)
    limit = torque_limit(found, speed, headroom)
    speed, limit = speed[np.isfinite(limit)], limit[np.isfinite(limit)]
    torque = found.T_e[0] + np.linspace(0, 1, points) * (limit - found.T_e[0])[:, None]
    speed = np.broadcast_to(speed[:, None], torque.shape)
    best = found.optimum(speed, torque)
    kept = best.feasible
    if np.sum(kept) < FEWEST:
        raise ValueError(f"{found.machine.name}: {np.sum(kept)} of {points**2} training points are inside the limits: must be at least {FEWEST}")
    x, t = np.column_stack([speed[kept], torque[kept]]), np.column_stack([getattr(best, name)[kept] for name in found.targets])
    return TrainingData(x, t, ("omega_m", "torque"), tuple(found.targets))


def trained(data, *, hidden=10, starts=8, seed=2002, rms_percent=0.3):
    """Return the network of the best start, trained until its RMS error is ``rms_percent`` of the targets' range.

    Raises
    ------
    drivelib.training.NotConverged
        If no start gets there; the message says how far the best one came. More hidden neurons or starts, or
        a larger ``rms_percent``, are the remedies. No unfinished network is returned.
    """
    from drivelib.training import train

    return train(data.x, data.t, hidden, starts=starts, seed=seed, goal=sse_goal(data, rms_percent)).best()


@dataclass(frozen=True)
class NetworkError:
    """What a network's currents cost on a map; arrays of the map's shape, NaN beyond `torque_limit`.

    Attributes
    ----------
    torque : ndarray
        Torque that the currents make, less the torque asked (N m).
    excess : ndarray
        Loss less the least loss (W), both at the torque asked: the outer loop corrects i_q, i_d stays the network's.
        Below zero only where the network trespasses a limit.
    voltage, current : ndarray
        Voltage and current over their limit, as a share of it; 0 inside.
    """

    torque: np.ndarray
    excess: np.ndarray
    voltage: np.ndarray
    current: np.ndarray


def network_error(found, currents, headroom=0.95):
    """Return the `NetworkError` of terminal currents on a map, up to `torque_limit`.

    Parameters
    ----------
    found : LossMap
    currents : callable
        (…, 2) speed and torque → (…, 2) i_d and i_q, such as `neural.Network.predict`.
    headroom : float
        See `torque_limit`.
    """
    machine, best = found.machine, found.best
    speed, torque = np.meshgrid(found.omega_m, found.T_e, indexing="ij")
    i_d, i_q = np.moveaxis(currents(np.stack([speed, torque], axis=-1)), -1, 0)
    omega_e = machine.P * speed
    i_od, i_oq = pmsm.branch_currents(machine, omega_e, i_d, i_q)
    made = pmsm.torque(machine, i_od, i_oq)
    loss = pmsm.total_loss(machine, omega_e, i_od, pmsm.i_oq_at_torque(machine, torque, i_od))
    voltage = pmsm.stator_voltage(machine, omega_e, i_od, i_oq) / found.V_max - 1
    current = np.hypot(i_d, i_q) / found.I_max - 1
    asked = best.feasible & (torque <= torque_limit(found, found.omega_m, headroom)[:, None])
    values = made - torque, loss - best.loss, np.maximum(voltage, 0), np.maximum(current, 0)
    return NetworkError(*(np.where(asked, value, np.nan) for value in values))
