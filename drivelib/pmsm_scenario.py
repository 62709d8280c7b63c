"""What one run of Eskander's drives assumes: machine, control scheme, operating profile and tuning, in one place."""

import math
from dataclasses import dataclass, fields, replace
from types import MappingProxyType

import numpy as np

from drivelib import control, pmsm
from drivelib.machines import GIVEN, IPMSM, Origin, PmsmParameters
from drivelib.profiles import profile
from drivelib.pmsm_law import CONTROLS, LAW_OUTPUTS, LAWS, NetworkLaw
from drivelib.validation import choice, nearest, number

LARGEST_TURN = 0.5  # rad that the rotor may turn in a control period; the held voltage's mean is then within 1 %


@dataclass(frozen=True)
class Scenario:
    """One drive, its control and what is asked of it.

    Profiles (``speed``, ``torque``, ``load``) are a number, or pairs (time in s, value) from 0 s on, each
    value acting from the first control sample at or after its time.

    Parameters
    ----------
    machine : PmsmParameters
    control : {"torque-pi", "direct", "angle"}
        Fig. 4: a PI on the torque error gives i_q*, the law i_d* from i_q* and speed. Fig. 11: the law gives
        i_q* and i_d* from speed and torque. Section 6: the law gives φ from speed and torque, the amplitude follows
        (17)–(18), and currents are not controlled.
    law : NetworkLaw or {"exact", "zero"}
        Network, closed form ((11) at given i_q*, (16), (20)), or i_d* = 0 (φ = 0 with "angle").
    duration : float
        Length of the run (s).
    speed : profile
        Mechanical speed (rad/s): imposed, or the speed controller's command.
    load : profile
        Load torque (N m).
    torque : profile or {"load", "speed-loop"}
        Torque command (N m), or torque that a feed-forward law takes: as given, equal to the load, or
        from a PI speed controller.
    mechanics : {"imposed", "free"}
        Whether the speed is prescribed, steps included (as sec. 3.2 has it), or follows eq. (4).
    law_speed : {"measured", "command"}
        The speed that enters the law.
    model : {"full", "simplified"}
        Whether the controller tells branch from terminal currents (see `drivelib.pmsm_loop`) or takes one for
        the other, as the paper does. The plant always has the iron branch.
    torque_feedback : {"estimated", "actual"}
        What the torque controller of fig. 4 sees: (3) of the currents as ``model`` has them, or a torque sensor.
    controller_machine : PmsmParameters, optional
        What the controller takes the machine for; by default the machine.
    modulation : {"space-vector", "six-step"}
        Voltage limit, V_dc/√3 or 2 V_dc/π.
    I_max, T_max : float, optional
        Limit of the terminal current references (A, peak) and of the speed controller (N m); by default twice
        what the rated torque takes at i_d = 0, and twice the rated torque.
    current_bandwidth, torque_bandwidth : float
        Of the closed current loops and of the torque loop (rad/s).
    omega_n, xi : float
        Natural frequency (rad/s) and damping of the speed loop.
    period : float
        Control period (s).
    substeps : int
        Runge–Kutta steps per period; one is enough, a test shows it.
    settle : float
        The run begins where the first values of all profiles lead within this time (s).

    Raises
    ------
    ValueError
        If a value is out of range, naming it, its unit and range.
    """

    machine: PmsmParameters = IPMSM
    control: str = "torque-pi"
    law: NetworkLaw | str = "exact"
    duration: float = 0.2
    speed: tuple = ((0.0, 100.0),)
    load: tuple = ((0.0, 0.0),)
    torque: tuple | str = "load"
    mechanics: str = "imposed"
    law_speed: str = "measured"
    model: str = "full"
    torque_feedback: str = "estimated"
    controller_machine: PmsmParameters | None = None
    modulation: str = "space-vector"
    I_max: float | None = None
    T_max: float | None = None
    current_bandwidth: float = 1000.0
    torque_bandwidth: float = 200.0
    omega_n: float = 40.0
    xi: float = 1.0
    period: float = 1e-4
    substeps: int = 1
    settle: float = 1.0
    name: str = "user's scenario"

    def __post_init__(self):
        for name, allowed in _CHOICES.items():
            choice(name, getattr(self, name), allowed)
        for name, unit in _POSITIVE.items():
            object.__setattr__(self, name, number(name, getattr(self, name), unit, above=0))
        object.__setattr__(self, "settle", number("settle", self.settle, "s", at_least=0))
        object.__setattr__(self, "substeps", number("substeps", self.substeps, at_least=1, whole=True))
        number("duration", self.duration, "s", at_least=self.period)
        known = self.known_machine
        for machine in (self.machine, known):
            number("R_s", machine.R_s, "ohm", above=0)
        for name, unit in _OPTIONAL.items():
            if getattr(self, name) is not None:
                object.__setattr__(self, name, number(name, getattr(self, name), unit, above=0))
        for name, unit in _PROFILES.items():
            if not (name == "torque" and isinstance(self.torque, str)):
                object.__setattr__(self, name, profile(name, getattr(self, name), unit, self.duration))
        if isinstance(self.torque, str):
            choice("torque", self.torque, ("load", "speed-loop"))
        if self.torque == "speed-loop" and self.mechanics == "imposed":
            raise ValueError("torque = 'speed-loop': needs mechanics = 'free'; an imposed speed leaves nothing to control")
        self._check_law()
        self._check_sampling()

    @property
    def known_machine(self):
        """What the controller takes the machine for (PmsmParameters)."""
        return self.controller_machine or self.machine

    @property
    def V_max(self):
        """Largest phase voltage (V, peak)."""
        return float(pmsm.voltage_limit(self.machine, self.modulation))

    @property
    def I_limit(self):
        """Limit of the terminal current (A, peak): I_max or its default."""
        known = self.known_machine
        return 2 * known.T_rated / (1.5 * known.P * known.psi_f) if self.I_max is None else self.I_max

    @property
    def T_limit(self):
        """Limit of the speed controller's torque (N m): T_max or its default."""
        return 2 * self.known_machine.T_rated if self.T_max is None else self.T_max

    @property
    def steps(self):
        """Number of control periods."""
        return math.floor(self.duration / self.period + 1e-6)

    @property
    def current_gains(self):
        """PiGains (ohm, ohm/s) of the d- and the q-current loop, by cancelling the pole of L di/dt."""
        known = self.known_machine
        return tuple(control.current_gains(known.R_s, L, self.current_bandwidth) for L in (known.L_d, known.L_q))

    @property
    def torque_gains(self):
        """PiGains (A/(N m), A/(N m s)) of fig. 4's PI on the plant k_T α/(s + α), α the current bandwidth.

        Its zero cancels −α and leaves torque_bandwidth/s. k_T = 1.5 P λ is that of i_d = 0: the reluctance torque makes the
        loop faster, in the 900 W machine about twice at rated torque and speed.
        """
        known = self.known_machine
        K_i = self.torque_bandwidth / (1.5 * known.P * known.psi_f)
        return control.PiGains(K_i / self.current_bandwidth, K_i)

    @property
    def speed_gains(self):
        """PiGains (N m s/rad, N m/rad) of the speed loop."""
        return control.speed_gains(self.known_machine.J, self.known_machine.B, self.omega_n, self.xi)

    def first_samples(self, profile):
        """Return the sample from which each value of a profile acts, shape (m,)."""
        # A hair below, because 3 × 1e-4 is a little more than 0.0003.
        return np.array([math.ceil(time / self.period - 1e-6) for time, _ in profile])

    def changed(self, **values):
        """Return a copy with some values changed.

        Raises
        ------
        ValueError
            If a name is unknown (the nearest is suggested) or a value is out of range.
        """
        names = [item.name for item in fields(self)]
        for name in values:
            if name not in names:
                raise ValueError(f"{name!r} is no value of a scenario{nearest(name, names)}")
        return replace(self, **values)

    def assumptions(self):
        """Return one row per value that the paper leaves open: (name, value, unit, class of origin, note with range)."""
        rows = []
        for name, (origin, default) in TUNING.items():
            value = getattr(self, name)
            origin = origin if value == default else GIVEN
            value = {"I_max": self.I_limit, "T_max": self.T_limit}.get(name, value)
            span = f" (range {origin.low:g} to {origin.high:g})" if origin.low is not None else ""
            rows.append((name, value, {**_POSITIVE, **_OPTIONAL}.get(name, ""), origin.kind, origin.note + span))
        return rows

    def _check_law(self):
        if isinstance(self.law, NetworkLaw):
            expected = LAW_OUTPUTS[self.control]
            if self.law.B2.size != len(expected):
                raise ValueError(
                    f"law has {self.law.B2.size} outputs (B2 of shape {self.law.B2.shape}): control = {self.control!r} takes "
                    f"{len(expected)}, {' and '.join(expected)}"
                )
            return
        choice("law", self.law, LAWS[:2])
        if self.law == "exact" and self.control == "direct" and self.known_machine.delta_L != 0:
            raise ValueError(f"law = 'exact' with control = 'direct': eq. (16) needs L_d = L_q, not L_d − L_q = {self.known_machine.delta_L:g} H")

    def _check_sampling(self):
        known = self.known_machine
        for name in _PROFILES:
            profile = getattr(self, name)
            if not isinstance(profile, str) and np.any(np.diff(self.first_samples(profile)) < 1):
                late = profile[int(np.argmin(np.diff(self.first_samples(profile)))) + 1][0]
                raise ValueError(f"{name}'s time {late:g} s: begins in the same control period of {self.period:g} s as the value before")
        tau = min(machine_L / self.machine.R_s for machine_L in (self.machine.L_d, self.machine.L_q))
        if self.period > tau:
            raise ValueError(f"period = {self.period:g} s: must not exceed the electrical time constant min(L_d, L_q)/R_s = {tau:g} s")
        fastest = self.machine.P * max(abs(value) for _, value in self.speed)
        if fastest * self.period > LARGEST_TURN:
            raise ValueError(f"period = {self.period:g} s: at {fastest:g} rad/s (electrical) it must be at most {LARGEST_TURN / fastest:g} s")
        if self.current_bandwidth * self.period > 0.5:
            raise ValueError(f"current_bandwidth = {self.current_bandwidth:g} rad/s: must be at most 0.5/period = {0.5 / self.period:g} rad/s")
        outer = [("torque_bandwidth", "current_bandwidth")] if self.control == "torque-pi" else []
        if self.torque == "speed-loop":
            outer.append(("omega_n", "torque_bandwidth" if outer else "current_bandwidth"))
            self.speed_gains  # raises where the poles asked for are slower than friction alone
        for slow, fast in outer:
            number(slow, getattr(self, slow), "rad/s", at_most=getattr(self, fast))
        # The iron current v/(R_c + R_s) follows the voltage at once; fed back with K_p = α L it must not build up.
        if self.model == "simplified" and self.control != "angle":
            most = (self.machine.R_c + self.machine.R_s) / max(known.L_d, known.L_q)
            number("current_bandwidth", self.current_bandwidth, "rad/s, below (R_c + R_s)/L in the simplified model", at_most=0.9 * most)


_CHOICES = {
    "control": CONTROLS,
    "mechanics": ("imposed", "free"),
    "law_speed": ("measured", "command"),
    "model": pmsm.MODELS,
    "torque_feedback": ("estimated", "actual"),
    "modulation": tuple(pmsm.MODULATIONS),
}
_POSITIVE = {"duration": "s", "current_bandwidth": "rad/s", "torque_bandwidth": "rad/s", "omega_n": "rad/s", "xi": "", "period": "s"}
_OPTIONAL = {"I_max": "A", "T_max": "N m"}
_PROFILES = {"speed": "rad/s", "load": "N m", "torque": "N m"}

TUNING = MappingProxyType(
    {
        "current_bandwidth": (Origin("assumed", "a tenth per sample: slow enough to act as continuous", 300.0, 3000.0), 1000.0),
        "torque_bandwidth": (Origin("assumed", "a fifth of the current loops'", 50.0, 500.0), 200.0),
        "omega_n": (Origin("assumed", "a fifth of the torque loop's", 10.0, 100.0), 40.0),
        "xi": (Origin("assumed", "no oscillation", 0.7, 1.5), 1.0),
        "period": (Origin("assumed", "10 kHz", 5e-5, 2e-4), 1e-4),
        "I_max": (Origin("assumed", "twice what the rated torque takes at i_d = 0"), None),
        "T_max": (Origin("assumed", "twice the rated torque"), None),
    }
)
