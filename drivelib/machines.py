"""Machine parameter sets: frozen, validated, and each value with where it comes from.

The classes of origin: printed (in the paper), found (in a named public source), inferred (arithmetic
on printed numbers, shown), assumed (with the range a study should cover), identified (fitted: objective
and free parameters stated), given (by the user).
"""

from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import ClassVar

from drivelib.validation import choice, nearest, number

ORIGINS = ("printed", "found", "inferred", "assumed", "identified", "given")


@dataclass(frozen=True)
class Origin:
    """Where one value comes from: its class, a note, and for open values the range to study.

    Raises
    ------
    ValueError
        If the class is unknown, or the range has one end only or its ends in the wrong order.
    """

    kind: str
    note: str = ""
    low: float | None = None
    high: float | None = None

    def __post_init__(self):
        choice("kind", self.kind, ORIGINS)
        if (self.low is None) != (self.high is None):
            raise ValueError(f"low = {self.low}, high = {self.high}: a range needs both ends, or none")
        if self.low is not None:
            number("high", self.high, at_least=number("low", self.low))


GIVEN = Origin("given", "by the user")


class ParameterSet:
    """Base of the frozen parameter sets: origins, changed copies, table rows, and travel to another process.

    A subclass is a frozen dataclass with a field ``origins``; ``UNITS`` maps its values to their units and
    ``KIND`` says in messages what a value is.
    """

    UNITS: ClassVar[dict] = {}
    KIND: ClassVar[str] = "parameter"

    def _take_origins(self):
        """Check the origins and complete them: a value without one was given by the user."""
        for name, origin in self.origins.items():
            if name not in self.UNITS:
                raise ValueError(f"origins names {name!r}, which is no {self.KIND}{nearest(name, self.UNITS)}")
            if not isinstance(origin, Origin):
                raise ValueError(f"origins[{name!r}] = {origin!r}: must be an Origin, of a class among {', '.join(ORIGINS)}")
        origins = {name: self.origins.get(name, GIVEN) for name in self.UNITS}
        object.__setattr__(self, "origins", MappingProxyType(origins))

    def __reduce__(self):
        values = {item.name: getattr(self, item.name) for item in fields(self)}  # a mappingproxy cannot be pickled
        return type(self), tuple({**values, "origins": dict(self.origins)}.values())

    def changed(self, **values):
        """Return a copy with some values changed; the origin of what really changes becomes "given".

        ``origins`` names other origins.

        Raises
        ------
        ValueError
            If a name is unknown (the nearest is suggested) or a value is out of range.

        Examples
        --------
        >>> from drivelib.machines import IPMSM
        >>> IPMSM.changed(R_c=400.0).R_c
        400.0
        >>> IPMSM.changed(L_d=-0.01)
        Traceback (most recent call last):
        ValueError: L_d = -0.01 H: must be a finite number above 0 H
        """
        known = [item.name for item in fields(self)]
        for name in values:
            if name not in known:
                raise ValueError(f"{name!r} is no {self.KIND}{nearest(name, known)}")
        kept = {name: origin for name, origin in self.origins.items() if values.get(name, getattr(self, name)) == getattr(self, name)}
        return replace(self, **{**values, "origins": {**kept, **values.get("origins", {})}})

    def own(self, **values):
        """Return a reader's machine: as `changed`, but once a number differs none of those named keeps its origin.

        What then agrees with this machine does so by chance.
        """
        found = self.changed(**values)
        if all(getattr(found, name) == getattr(self, name) for name in self.UNITS):
            return found
        return found.changed(origins={name: GIVEN for name in values if name in self.UNITS})

    def rows(self):
        """Return one row per value: (name, value, unit, class of origin, note with range)."""
        rows = []
        for name, unit in self.UNITS.items():
            origin = self.origins[name]
            span = f" (range {origin.low:g} to {origin.high:g})" if origin.low is not None else ""
            value = getattr(self, name)
            rows.append((name, getattr(value, "name", value), unit, origin.kind, origin.note + span))
        return rows


PMSM_UNITS = MappingProxyType(
    {
        "R_s": "ohm",
        "L_d": "H",
        "L_q": "H",
        "psi_f": "Wb",
        "P": "",
        "V_dc": "V",
        "R_c": "ohm",
        "J": "kg m²",
        "B": "N m s",
        "omega_m_rated": "rad/s",
        "T_rated": "N m",
    }
)


@dataclass(frozen=True)
class PmsmParameters(ParameterSet):
    """Permanent-magnet synchronous machine in the rotor frame, amplitude-invariant.

    Parameters
    ----------
    R_s : float
        Stator resistance per phase (ohm).
    L_d, L_q : float
        d- and q-axis inductance (H).
    psi_f : float
        Permanent-magnet flux linkage, peak (Wb); the λ of Eskander.
    P : int
        Number of pole pairs.
    V_dc : float
        Inverter's dc voltage (V).
    R_c : float
        Iron-loss resistance, parallel to the rotational emf (ohm).
    J, B : float
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
        If a value is not finite or outside its physical range.
    """

    UNITS: ClassVar = PMSM_UNITS
    KIND: ClassVar = "parameter of a PMSM"

    R_s: float
    L_d: float
    L_q: float
    psi_f: float
    P: int
    V_dc: float
    R_c: float
    J: float
    B: float
    omega_m_rated: float
    T_rated: float
    name: str = "user's PMSM"
    origins: MappingProxyType = field(default_factory=dict, compare=False, repr=False)

    def __post_init__(self):
        for parameter, unit in PMSM_UNITS.items():
            value = getattr(self, parameter)
            if parameter == "P":
                checked = number("P", value, "pole pairs", at_least=1, whole=True)
            elif parameter in ("R_s", "B"):
                checked = number(parameter, value, unit, at_least=0)
            else:
                checked = number(parameter, value, unit, above=0)
            object.__setattr__(self, parameter, checked)
        self._take_origins()

    @property
    def delta_L(self):
        """L_d − L_q (H); negative in an interior machine, zero in a surface machine."""
        return self.L_d - self.L_q

    @property
    def omega_e_rated(self):
        """Rated electrical speed P ω_m (rad/s)."""
        return self.P * self.omega_m_rated


_APPENDIX = Origin("printed", "Eskander 2002, appendix")
_POLES = Origin("printed", "Eskander 2002, appendix, as 2P poles")

IPMSM = PmsmParameters(
    name="IPMSM 900 W",
    R_s=4.3,
    L_d=0.027,
    L_q=0.067,
    psi_f=0.232,
    P=4,
    V_dc=250.0,
    R_c=200.0,
    J=1.79e-4,
    B=0.0,
    omega_m_rated=178.0,
    T_rated=5.06,
    origins={
        "R_s": _APPENDIX,
        "L_d": _APPENDIX,
        "L_q": _APPENDIX,
        "psi_f": _APPENDIX,
        "P": _POLES,
        "V_dc": _APPENDIX,
        "R_c": Origin("identified", "so that the printed 118.9 W is a feasible loss; 1 free, 1 matched", 200.0, 1000.0),
        "J": Origin("found", "public files of the same machine, recalled", 1e-4, 4e-4),
        "B": Origin("assumed", "friction is printed nowhere", 0.0, 1e-3),
        "omega_m_rated": Origin("found", "1700 rpm in public files of the same machine, recalled"),
        "T_rated": Origin("inferred", "900 W / 178 rad/s"),
    },
)

SPMSM = PmsmParameters(
    name="SPMSM 400 W",
    R_s=3.0,
    L_d=0.0121,
    L_q=0.0121,
    psi_f=0.083,
    P=2,
    V_dc=100.0,
    R_c=200.0,
    J=5e-4,
    B=0.0,
    omega_m_rated=300.0,
    T_rated=400.0 / 300.0,
    origins={
        "R_s": _APPENDIX,
        "L_d": Origin("printed", "Eskander 2002, appendix, as L_s"),
        "L_q": Origin("printed", "Eskander 2002, appendix, as L_s"),
        "psi_f": _APPENDIX,
        "P": _POLES,
        "V_dc": _APPENDIX,
        "R_c": Origin("assumed", "iron loss is printed nowhere", 100.0, 700.0),
        "J": Origin("assumed", "inertia is printed nowhere", 1e-4, 1e-3),
        "B": Origin("assumed", "friction is printed nowhere", 0.0, 1e-3),
        "omega_m_rated": Origin("assumed", "the emf alone takes 49.8 V of the 57.7 V there", 200.0, 340.0),
        "T_rated": Origin("inferred", "400 W / 300 rad/s"),
    },
)

_MOTULATOR = Origin("found", "motulator (Aalto University), example of a 2.2 kW PMSM, github.com/Aalto-Electric-Drives/motulator at 26c023e")

IPMSM_2200W = PmsmParameters(
    name="IPMSM 2.2 kW",
    R_s=3.6,
    L_d=0.036,
    L_q=0.051,
    psi_f=0.545,
    P=3,
    V_dc=540.0,
    R_c=1000.0,
    J=0.015,
    B=0.0,
    omega_m_rated=157.08,
    T_rated=14.0,
    origins={
        **dict.fromkeys(("R_s", "L_d", "L_q", "psi_f", "P", "V_dc", "J", "T_rated"), _MOTULATOR),
        "R_c": Origin("assumed", "the source has no iron loss; 1000 ohm puts 99 W there at rated speed without load", 500.0, 3000.0),
        "B": Origin("assumed", "the source has no friction", 0.0, 1e-2),
        "omega_m_rated": Origin("inferred", "2π · 75 Hz / 3, rated frequency of the same source"),
    },
)
