"""Simulate Eskander's drives in time: from a scenario to a record, its losses, and the limits it hit.

    run = simulate(Scenario(machine=IPMSM, law=network, speed=((0, 100), (0.05, 150)), load=3.0))
    run.t, run["i_od"], run.loss(), run.first_hits, run.report()
"""

from dataclasses import dataclass

import numpy as np

from drivelib import pmsm, pmsm_dynamics, pmsm_loop, pmsm_optimum
from drivelib.pmsm_law import CONTROLS, LAW_INPUTS, LAWS, NetworkLaw
from drivelib.pmsm_loop import CHANNELS, LIMITS, STATES
from drivelib.pmsm_scenario import Scenario
from drivelib.transients import settling_time
from drivelib.validation import nearest

SPEED_BAND = 0.02  # of a speed step: within it the speed counts as reached


class SimulationDiverged(ArithmeticError):
    """The drive's state left all bounds; ``time`` (s) and ``state`` (dict by name, SI units) say where."""

    def __init__(self, scenario, time, state):
        self.time, self.state = time, state
        values = ", ".join(f"{name} = {state[name]:.6g} {unit}" for name, unit in (("i_od", "A"), ("i_oq", "A"), ("omega_m", "rad/s")))
        super().__init__(f"{scenario.name}: diverged at t = {time:.6g} s with {values}")


@dataclass(frozen=True)
class SpeedStep:
    """What became of one step of the speed command; times in s, speeds in rad/s.

    ``settling``: until the speed stays within 2 % of the step, NaN where it does not before the next step.
    ``least``: what the step takes at the torque limit, friction apart; infinite where that cannot carry the load.
    ``limits``: which limits were hit before it had settled.
    """

    time: float
    start: float
    goal: float
    settling: float
    least: float
    limits: tuple

    @property
    def followed(self):
        """Whether the speed arrived before the next step, or the end."""
        return bool(np.isfinite(self.settling))


@dataclass(frozen=True)
class Excursion:
    """How far one input of a network left its training range: worst value and range in ``unit``, times in s."""

    name: str
    unit: str
    low: float
    high: float
    worst: float
    time: float
    first: float

    @property
    def excess(self):
        """Distance from the range (in ``unit``)."""
        return max(self.low - self.worst, self.worst - self.high)

    @property
    def share(self):
        """Distance from the range over its width (1)."""
        return self.excess / (self.high - self.low)


@dataclass(frozen=True)
class DriveRun:
    """What a simulation returns; ``run["i_od"]`` gives a channel, shape (n,), and ``channels`` names them all.

    Channels are sampled at the control instants ``t`` (s); currents and speed there, voltage (mean, in the
    rotor frame), references and φ for the period that begins. ``i_d``, ``i_q``: terminal currents as measured, with
    the voltage of the period that ends. φ is atan2(−v_d, v_q); in the angle scheme, what the law gave.
    ``E_in``, ``E_heat``, ``E_shaft``: electrical input, heat and shaft work since 0 s (J). ``flags``: limits hit,
    one bit each in the order of ``LIMITS``.
    """

    scenario: Scenario
    t: np.ndarray
    data: np.ndarray
    flags: np.ndarray

    channels = CHANNELS

    def __getitem__(self, channel):
        if channel not in CHANNELS:
            raise ValueError(f"{channel!r} is no channel of a run{nearest(channel, CHANNELS)}")
        return self.data[:, CHANNELS.index(channel)]

    @property
    def omega_e(self):
        """Electrical speed (rad/s)."""
        return self.scenario.machine.P * self["omega_m"]

    def loss(self, *, model="full", convention="consistent"):
        """Return copper plus iron loss at the currents of each sample (W), see `pmsm.total_loss`."""
        return pmsm.total_loss(self.scenario.machine, self.omega_e, self["i_od"], self["i_oq"], model=model, convention=convention)

    def least_loss(self, *, model="full", convention="consistent"):
        """Return the least loss (W) at each sample's speed and actual torque, limits apart: what a perfect law would leave."""
        return pmsm_optimum.optimum(self.scenario.machine, self.omega_e, self["T_e"], model=model, convention=convention).loss

    def energy_residual(self):
        """Return input − heat − shaft work − change of magnetic energy since 0 s (J): the integrator's error."""
        stored = pmsm_dynamics.magnetic_energy(self["i_od"], self["i_oq"], pmsm_dynamics.coefficients(self.scenario.machine))
        return self["E_in"] - self["E_heat"] - self["E_shaft"] - (stored - stored[0])

    def at_limit(self, limit):
        """Return where one of ``LIMITS`` was hit, shape (n,) of bool."""
        if limit not in LIMITS:
            raise ValueError(f"{limit!r} is no limit of a run{nearest(limit, LIMITS)}")
        return (self.flags >> LIMITS.index(limit)) & 1 == 1

    @property
    def first_hits(self):
        """Time (s) of the first sample at which each limit was hit, limits never hit left out."""
        return {limit: float(self.t[np.argmax(hit)]) for limit in LIMITS if np.any(hit := self.at_limit(limit))}

    def outside(self):
        """Return one Excursion per network input that left its training range."""
        law, found = self.scenario.law, []
        if not isinstance(law, NetworkLaw):
            return found
        for i, (name, unit) in enumerate(LAW_INPUTS[self.scenario.control]):
            values = self[f"law_input_{i + 1}"]
            excess = np.maximum(law.low[i] - values, values - law.high[i])
            if np.any(excess > 0):
                worst = int(np.argmax(excess))
                first = float(self.t[np.argmax(excess > 0)])
                found.append(Excursion(name, unit, float(law.low[i]), float(law.high[i]), float(values[worst]), float(self.t[worst]), first))
        return found

    def speed_steps(self):
        """Return one SpeedStep per step of the speed command; none where the speed is imposed."""
        scenario = self.scenario
        if scenario.mechanics == "imposed":
            return []
        ends = [time for time, _ in scenario.speed[1:]] + [np.inf]
        rows = []
        for (_, start), (time, goal), end in zip(scenario.speed, scenario.speed[1:], ends[1:], strict=False):
            if goal == start or time > self.t[-1]:
                continue
            band = SPEED_BAND * abs(goal - start)
            window = (self.t >= time - 1e-9) & (self.t < end)
            settling = settling_time(self.t, self["omega_m"], goal, band, time, None if end == np.inf else end)
            until = window & (self.t <= time + settling) if np.isfinite(settling) else window
            hit = tuple(limit for limit in LIMITS if np.any(self.at_limit(limit) & until))
            spare = scenario.T_limit - np.max(np.sign(goal - start) * self["T_L"][window])
            least = scenario.machine.J * abs(goal - start) / spare if spare > 0 else np.inf
            rows.append(SpeedStep(time, start, goal, settling, float(least), hit))
        return rows

    def report(self):
        """Return, as lines of text, what a reader of the figures should know: limits, excursions, steps not followed."""
        lines = [f"{limit} limit first reached at {time:.4g} s" for limit, time in self.first_hits.items() if limit != "training range"]
        for item in self.outside():
            lines.append(
                f"network input {item.name} = {item.worst:.4g} {item.unit} at {item.time:.4g} s lies {item.excess:.3g} {item.unit} "
                f"({100 * item.share:.3g} % of its range) outside {item.low:.4g} to {item.high:.4g} {item.unit}, first at {item.first:.4g} s"
            )
        for step in self.speed_steps():
            if not step.followed:
                lines.append(
                    f"speed step from {step.start:g} to {step.goal:g} rad/s at {step.time:g} s was not followed; at the torque limit "
                    f"{self.scenario.T_limit:.3g} N m it takes {step.least:.3g} s (limits hit: {', '.join(step.limits) or 'none'})"
                )
        return lines


def loop_settings(scenario):
    """Return the LoopSettings of a scenario; gains come from the machine that the controller knows."""
    d_gains, q_gains = scenario.current_gains
    torque = {"load": pmsm_loop.FROM_LOAD, "speed-loop": pmsm_loop.FROM_SPEED_LOOP}
    speed_loop = scenario.torque == "speed-loop"
    return pmsm_loop.LoopSettings(
        control=CONTROLS.index(scenario.control),
        law=LAWS.index("network" if isinstance(scenario.law, NetworkLaw) else scenario.law),
        torque=torque[scenario.torque] if isinstance(scenario.torque, str) else pmsm_loop.FROM_PROFILE,
        imposed=scenario.mechanics == "imposed",
        law_takes_command=scenario.law_speed == "command",
        torque_sensor=scenario.torque_feedback == "actual",
        conductance=float(pmsm.terminal_conductance(scenario.known_machine, scenario.model)),
        V_max=scenario.V_max,
        I_max=scenario.I_limit,
        T_max=scenario.T_limit,
        K_pd=d_gains.K_p,
        K_id=d_gains.K_i,
        K_pq=q_gains.K_p,
        K_iq=q_gains.K_i,
        K_pt=scenario.torque_gains.K_p,
        K_it=scenario.torque_gains.K_i,
        K_pw=scenario.speed_gains.K_p if speed_loop else 1.0,
        K_iw=scenario.speed_gains.K_i if speed_loop else 0.0,
        period=scenario.period,
        substeps=scenario.substeps,
    )


def sampled_profiles(scenario):
    """Return speed (rad/s), torque and load (N m) at each sample, shape (steps + 1, 3); NaN where torque is not given."""
    k = np.arange(scenario.steps + 1)
    values = np.full((k.size, 3), np.nan)
    for column, profile in enumerate((scenario.speed, scenario.torque, scenario.load)):
        if not isinstance(profile, str):
            current = np.searchsorted(scenario.first_samples(profile), k, side="right") - 1
            values[:, column] = np.array([value for _, value in profile])[current]
    return values


def simulate(scenario, *, start=None):
    """Simulate the drive.

    Parameters
    ----------
    scenario : Scenario
    start : tuple of three floats, optional
        Branch currents (A) and mechanical speed (rad/s) at 0 s, with controllers and inverter at zero. By default the run
        begins settled: the loop runs ``scenario.settle`` on the first values of all profiles, at imposed speed,
        and as long again with a speed controller, if there is one.

    Returns
    -------
    DriveRun
        Limits that were hit do not raise: see ``first_hits``, ``outside``, ``speed_steps`` and ``report``.

    Raises
    ------
    ValueError
        If ``start`` is not three finite numbers.
    SimulationDiverged
        If the state leaves all bounds (10⁵ rad/s, a thousand times the current limit, or not a number).
    """
    x = np.zeros(len(STATES))
    lead = round(scenario.settle / scenario.period)
    imposed_lead = lead
    if start is None:
        x[2] = scenario.speed[0][1]
        if scenario.torque == "speed-loop":
            lead *= 2
            x[STATES.index("u_speed")] = scenario.load[0][1] + scenario.known_machine.B * x[2]
    else:
        start = np.asarray(start, dtype=float)
        if start.shape != (3,) or not np.all(np.isfinite(start)):
            raise ValueError(f"start = {start}: must be i_od (A), i_oq (A) and omega_m (rad/s), all finite")
        x[:3], lead, imposed_lead = start, 0, 0
    profiles = sampled_profiles(scenario)
    n = profiles.shape[0]
    record, flags = np.empty((n, len(CHANNELS))), np.zeros(n, dtype=np.int64)
    law = scenario.law if isinstance(scenario.law, NetworkLaw) else _NO_NETWORK
    reached = pmsm_loop.run_drive(
        profiles, lead, imposed_lead, x,
        pmsm_dynamics.coefficients(scenario.machine), pmsm_dynamics.coefficients(scenario.known_machine), loop_settings(scenario),
        law.W1, law.B1, law.W2, law.B2, law.low, law.high, record, flags,
    )  # fmt: skip
    if reached < n:
        raise SimulationDiverged(scenario, reached * scenario.period, dict(zip(STATES, x.tolist(), strict=True)))
    return DriveRun(scenario, np.arange(n) * scenario.period, record, flags)


_NO_NETWORK = NetworkLaw(np.zeros((1, 2)), np.zeros(1), np.zeros((1, 1)), np.zeros(1))
