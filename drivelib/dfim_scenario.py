"""What one run of the doubly fed drive assumes: everything that Zidani's paper does not print, in one place."""

import math
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar

from drivelib import control
from drivelib.dfim_machines import DFIM_4KW, DfimParameters
from drivelib.encoder import Encoder
from drivelib.machines import Origin, ParameterSet
from drivelib.profiles import profile
from drivelib.validation import choice, number

FLUX_ESTIMATORS = ("current model", "rotor voltage model")
STARTS = ("magnetised", "at rest")
INVERTERS = ("averaged", "switching")

SCENARIO_UNITS = MappingProxyType(
    {
        "omega_n": "rad/s",
        "xi": "",
        "current_bandwidth": "rad/s",
        "orientation_bandwidth": "rad/s",
        "phi_r_ref": "Wb",
        "T_limit": "N m",
        "i_s_limit": "A",
        "i_r_limit": "A",
        "V_dc_s": "V",
        "V_dc_r": "V",
        "omega_r_constant": "rad/s",
        "estimator_corner": "rad/s",
        "period": "s",
        "duration": "s",
        "carrier_frequency": "Hz",
    }
)
_MAY_VANISH = ("orientation_bandwidth", "estimator_corner")
_CHOICES = {
    "frequency_law": tuple(control.FREQUENCY_LAWS),
    "flux_estimator": FLUX_ESTIMATORS,
    "inverter": INVERTERS,
    "start": STARTS,
}
_PROFILES = {"speed_reference": "rad/s", "load_torque": "N m", "rotor_resistance": "1"}
_UNITS = MappingProxyType({"machine": "", "encoder": "", **SCENARIO_UNITS, **dict.fromkeys(_CHOICES, ""), **_PROFILES})


@dataclass(frozen=True)
class Scenario(ParameterSet):
    """One drive, its settings and its load cycle.

    Parameters
    ----------
    machine : DfimParameters
        The motor.
    controller_machine : DfimParameters, optional
        What the controller takes the motor for; by default the motor.
    omega_n, xi : float
        Natural frequency (rad/s) and damping of the PI speed loop.
    current_bandwidth, orientation_bandwidth : float
        Of the four current loops, and of the frame's correction towards the estimated flux (rad/s).
    phi_r_ref : float
        Rotor flux reference (Wb).
    T_limit, i_s_limit, i_r_limit : float
        Torque limit (N m), kept; current limits (A), watched and reported.
    V_dc_s, V_dc_r : float
        dc voltage of stator and rotor inverter (V); each gives at most V_dc/√3 per phase.
    frequency_law : {"equal split", "constant rotor frequency"}
        How the electrical rotor speed is shared.
    omega_r_constant : float
        Rotor frequency of the second law (rad/s).
    flux_estimator : {"current model", "rotor voltage model"}
        L_r i_r + M i_s, in which no R_r stands; or the integral of v_r − R_r i_r in the rotor frame, tied
        to the current model below ``estimator_corner`` (rad/s).
    inverter : {"averaged", "switching"}
    carrier_frequency : float
        Of both carriers (Hz), for the switching inverters.
    period, duration : float
        Control period and length of the run (s).
    substeps : int
        Runge–Kutta steps per period of the averaged inverter; one is enough, a test shows it.
    speed_reference, load_torque, rotor_resistance : tuple of (time, value)
        From each time (s) on: reference (rad/s), load torque (N m), factor on the motor's R_r, which the
        controller does not learn. Each starts at 0 s and takes effect at the first sample at or after its time.
    start : {"magnetised", "at rest"}
        Standing still with the rotor flux at its reference, or with no current at all.
    encoder : Encoder, optional
        What the controller measures the speed with; by default it knows the speed exactly.
    origins : mapping of str to Origin
        Where each value comes from.

    Raises
    ------
    ValueError
        If a value is out of range, naming it, its unit and range.
    """

    UNITS: ClassVar = _UNITS
    KIND: ClassVar = "value of a scenario"

    name: str = "user's scenario"
    machine: DfimParameters = DFIM_4KW
    controller_machine: DfimParameters | None = None
    omega_n: float = 20.0
    xi: float = 0.7
    current_bandwidth: float = 1000.0
    orientation_bandwidth: float = 100.0
    phi_r_ref: float = 0.85
    T_limit: float = 51.0
    i_s_limit: float = 30.0
    i_r_limit: float = 30.0
    V_dc_s: float = 560.0
    V_dc_r: float = 560.0
    frequency_law: str = "equal split"
    omega_r_constant: float = 12.6
    flux_estimator: str = "current model"
    estimator_corner: float = 5.0
    inverter: str = "averaged"
    carrier_frequency: float = 5000.0
    period: float = 1e-4
    duration: float = 8.0
    substeps: int = 1
    speed_reference: tuple = ((0.0, 150.0), (2.5, -150.0), (5.5, 30.0))
    load_torque: tuple = ((0.0, 0.0), (1.5, 25.0), (2.0, 0.0), (4.5, 25.0), (5.0, 0.0), (7.0, 25.0), (7.5, 0.0))
    rotor_resistance: tuple = ((0.0, 1.0),)
    start: str = "magnetised"
    encoder: Encoder | None = None
    origins: MappingProxyType = field(default_factory=dict, compare=False, repr=False)

    def __post_init__(self):
        for parameter, unit in SCENARIO_UNITS.items():
            bound = {} if parameter == "omega_r_constant" else {"at_least": 0} if parameter in _MAY_VANISH else {"above": 0}
            object.__setattr__(self, parameter, number(parameter, getattr(self, parameter), unit, **bound))
        object.__setattr__(self, "substeps", number("substeps", self.substeps, at_least=1, whole=True))
        if not isinstance(self.encoder, Encoder | None):
            raise ValueError(f"encoder = {self.encoder!r}: must be an Encoder or None")
        for parameter, allowed in _CHOICES.items():
            choice(parameter, getattr(self, parameter), allowed)
        for machine in (self.machine, self.known_machine):
            number("R_s", machine.R_s, "ohm", above=0), number("R_r", machine.R_r, "ohm", above=0)
        number("duration", self.duration, "s", at_least=self.period)
        for parameter, unit in _PROFILES.items():
            object.__setattr__(self, parameter, profile(parameter, getattr(self, parameter), unit, self.duration))
        for time, factor in self.rotor_resistance:
            number(f"rotor_resistance at {time:g} s", factor, above=0)
        fast = self.current_bandwidth + self.orientation_bandwidth
        if fast * self.period > 0.5:
            raise ValueError(
                f"current_bandwidth + orientation_bandwidth = {fast:g} rad/s: must be at most 0.5/period = {0.5 / self.period:g} rad/s, "
                "or the sampled loops ring"
            )
        self._take_origins()

    @property
    def known_machine(self):
        """What the controller takes the motor for (DfimParameters)."""
        return self.controller_machine or self.machine

    @property
    def steps(self):
        """Number of control periods."""
        return math.floor(self.duration / self.period + 1e-6)

    @property
    def events(self):
        """Times (s) at which speed reference or load torque change, in order, 0 s included."""
        return sorted({time for profile in (self.speed_reference, self.load_torque) for time, _ in profile})

    @property
    def speed_gains(self):
        """PiGains of the speed loop by pole placement, with the inertia and friction that the controller knows."""
        return control.speed_gains(self.known_machine.J, self.known_machine.f, self.omega_n, self.xi)


_PUBLIC = "the public model of the 4 kW set"
DEFAULT_SCENARIO = Scenario(
    name="figures 10 to 12",
    origins={
        "machine": Origin("found", "the 4 kW set, see its own origins"),
        "omega_n": Origin("assumed", "the PI row of table II alone suggests 18 rad/s at this damping", 5.0, 60.0),
        "xi": Origin("found", _PUBLIC, 0.5, 1.0),
        "current_bandwidth": Origin("assumed", "fifty times ω_n, and a tenth per sample: slow enough to act as continuous", 300.0, 3000.0),
        "orientation_bandwidth": Origin("assumed", "idle unless currents and references part", 0.0, 300.0),
        "phi_r_ref": Origin("found", _PUBLIC, 0.6, 1.0),
        "T_limit": Origin("assumed", "twice the rated torque", 30.0, 65.0),
        "i_s_limit": Origin("assumed", "watched only: flux and twice the rated torque take 22 A", 20.0, 40.0),
        "i_r_limit": Origin("assumed", "watched only: twice the rated torque takes 20 A", 20.0, 40.0),
        "V_dc_s": Origin("assumed", "a 400 V network, rectified", 400.0, 700.0),
        "V_dc_r": Origin("assumed", "as the stator's", 400.0, 700.0),
        "frequency_law": Origin("assumed", "torque and speed do not depend on it"),
        "omega_r_constant": Origin("assumed", "2 Hz, for the other law; 5 Hz takes the stator to its voltage limit at 150 rad/s", -31.4, 31.4),
        "flux_estimator": Origin("assumed", "both currents of this motor are measured"),
        "estimator_corner": Origin("assumed", "for the other estimator", 0.0, 50.0),
        "inverter": Origin("assumed", "the paper names pulse width modulation; its mean is what controls speed"),
        "carrier_frequency": Origin("assumed", "an edge per sample; the public model has 1000 Hz", 1000.0, 10000.0),
        "period": Origin("assumed", "10 kHz", 5e-5, 5e-4),
        "duration": Origin("assumed", "long enough for both reversals and three load steps"),
        "encoder": Origin("assumed", "none: the paper's measured speed is called that and no more"),
        "start": Origin("assumed", "the paper's figures start the speed at once"),
        "speed_reference": Origin("printed", "150, −150, 30 rad/s; the instants are assumed"),
        "load_torque": Origin("assumed", "rated torque on and off at each speed: the paper says cyclic"),
        "rotor_resistance": Origin("assumed", "nominal; figure 11 takes 1.5"),
    },
)
