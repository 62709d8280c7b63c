"""Parameter sets of doubly fed induction motors for Zidani's drive, each value with its origin."""

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar

from drivelib.machines import Origin, ParameterSet
from drivelib.validation import number

DFIM_UNITS = MappingProxyType(
    {
        "R_s": "ohm",
        "R_r": "ohm",
        "L_s": "H",
        "L_r": "H",
        "M": "H",
        "p": "",
        "J": "kg m²",
        "f": "N m s",
        "omega_m_rated": "rad/s",
        "T_rated": "N m",
    }
)


@dataclass(frozen=True)
class DfimParameters(ParameterSet):
    """Doubly fed induction motor, rotor quantities referred to the stator, amplitude-invariant.

    Parameters
    ----------
    R_s, R_r : float
        Stator and rotor resistance per phase (ohm).
    L_s, L_r : float
        Cyclic stator and rotor inductance (H).
    M : float
        Cyclic mutual inductance (H); the M and M_SR of Zidani. L_s L_r must exceed M².
    p : int
        Number of pole pairs.
    J, f : float
        Inertia (kg m²) and viscous friction (N m s).
    omega_m_rated : float
        Rated mechanical speed (rad/s).
    T_rated : float
        Rated torque (N m).
    name : str
        What figures and messages call the machine.
    origins : mapping of str to Origin
        Where each value comes from; values that are not listed count as given by the user.

    Raises
    ------
    ValueError
        If a value is not finite or outside its physical range, or if L_s L_r ≤ M².
    """

    UNITS: ClassVar = DFIM_UNITS
    KIND: ClassVar = "parameter of a DFIM"

    R_s: float
    R_r: float
    L_s: float
    L_r: float
    M: float
    p: int
    J: float
    f: float
    omega_m_rated: float
    T_rated: float
    name: str = "user's DFIM"
    origins: MappingProxyType = field(default_factory=dict, compare=False, repr=False)

    def __post_init__(self):
        for parameter, unit in DFIM_UNITS.items():
            value = getattr(self, parameter)
            if parameter == "p":
                checked = number("p", value, "pole pairs", at_least=1, whole=True)
            elif parameter in ("R_s", "R_r", "f"):
                checked = number(parameter, value, unit, at_least=0)
            else:
                checked = number(parameter, value, unit, above=0)
            object.__setattr__(self, parameter, checked)
        if self.L_s * self.L_r <= self.M**2:
            raise ValueError(
                f"M = {self.M} H: must be below sqrt(L_s L_r) = {(self.L_s * self.L_r) ** 0.5:.6g} H, "
                "or the leakage coefficient is not positive"
            )
        self._take_origins()

    @property
    def sigma(self):
        """Leakage coefficient 1 − M²/(L_s L_r)."""
        return 1.0 - self.M**2 / (self.L_s * self.L_r)


_PUBLIC = "github.com/yousfi26/Matlab-Simulink-codes at 3b73e12, script_param.m"
_GYM = "github.com/upb-lea/gym-electric-motor at 5555196, doubly_fed_induction_motor.py"
_RECALLED = Origin("assumed", "quoted from memory, as the literature on DFIM drives has it; no source was found to hold it against")
_SCRIPT = Origin("found", _PUBLIC)

DFIM_4KW = DfimParameters(
    name="DFIM 4 kW",
    R_s=1.2,
    R_r=1.8,
    L_s=0.1554,
    L_r=0.1568,
    M=0.15,
    p=2,
    J=0.2,
    f=0.001,
    omega_m_rated=157.0,
    T_rated=25.5,
    origins={
        "R_s": _SCRIPT,
        "R_r": _SCRIPT,
        "L_s": Origin("found", "0.1554 H in a second public file; the first prints 0.1568 H, taken for a slip", 0.1554, 0.1568),
        "L_r": _SCRIPT,
        "M": _SCRIPT,
        "p": _SCRIPT,
        "J": _SCRIPT,
        "f": _SCRIPT,
        "omega_m_rated": Origin("inferred", "50 Hz and two pole pairs: 2π 50 Hz / 2; the public model's set point is 156 rad/s"),
        "T_rated": Origin("inferred", "4000 W / 157 rad/s"),
    },
)

_SECOND = Origin("found", "a second public file of the same machine")

DFIM_SMALL_INERTIA = DfimParameters(
    name="DFIM 4 kW, small inertia",
    R_s=1.8,
    R_r=1.8,
    L_s=0.1554,
    L_r=0.1568,
    M=0.15,
    p=2,
    J=0.07,
    f=0.0,
    omega_m_rated=157.0,
    T_rated=25.5,
    origins={
        **dict.fromkeys(("R_s", "R_r", "L_s", "L_r", "M", "p", "J", "f"), _SECOND),
        "omega_m_rated": Origin("inferred", "50 Hz and two pole pairs: 2π 50 Hz / 2"),
        "T_rated": Origin("assumed", "as the 4 kW machine with the same inductances", 12.0, 25.5),
    },
)

_GYM_FILE = Origin("found", _GYM)

DFIM_GYM = DfimParameters(
    name="gym-electric-motor's DFIM",
    R_s=4.42,
    R_r=3.51,
    L_s=0.32321,
    L_r=0.32321,
    M=0.2975,
    p=2,
    J=0.013695,
    f=0.0,
    omega_m_rated=157.0,
    T_rated=10.0,
    origins={
        **dict.fromkeys(("R_s", "R_r", "M", "p", "J"), _GYM_FILE),
        "L_s": Origin("found", _GYM + ": M + 25.71 mH of leakage"),
        "L_r": Origin("found", _GYM + ": M + 25.71 mH of leakage"),
        "f": Origin("found", _GYM + ": friction belongs to its load, not to the motor", 0.0, 0.01),
        "omega_m_rated": Origin("assumed", "50 Hz and two pole pairs", 140.0, 190.0),
        "T_rated": Origin("assumed", "class of 1.5 kW", 5.0, 20.0),
    },
)

DFIM_1500W = DfimParameters(
    name="DFIM 1.5 kW",
    R_s=1.75,
    R_r=1.68,
    L_s=0.295,
    L_r=0.104,
    M=0.165,
    p=2,
    J=0.01,
    f=0.0027,
    omega_m_rated=157.0,
    T_rated=9.55,
    origins={
        **dict.fromkeys(("R_s", "R_r", "L_s", "L_r", "M", "p", "J", "f"), _RECALLED),
        "omega_m_rated": Origin("inferred", "50 Hz and two pole pairs: 2π 50 Hz / 2"),
        "T_rated": Origin("inferred", "1500 W / 157 rad/s"),
    },
)

DFIM_SETS = MappingProxyType(
    {"4 kW": DFIM_4KW, "small inertia": DFIM_SMALL_INERTIA, "gym": DFIM_GYM, "1.5 kW": DFIM_1500W}
)
