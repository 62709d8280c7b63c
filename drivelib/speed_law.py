"""The plug of the speed controller: what turns the speed error into a torque reference, inside the drive loop.

Five kinds share one compiled function: PI, fuzzy in position and in incremental form (Zidani, eq. 21–24
and its prose), a static network as torque and as torque per sample. The fuzzy rule base is
``drivelib.fuzzy.fuzzy_output``, in this loop and in that of many drives. A sixth, the PI with set-point weight
and load observer, needs more than the error and has a function of its own.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numba import njit

from drivelib import control
from drivelib.compiled import OPTIONS
from drivelib.fuzzy import fuzzy_output
from drivelib.sigmoid import LOGISTIC, TANH, sigmoid
from drivelib.validation import array, choice, number

PI, FUZZY_POSITION, FUZZY_INCREMENTAL, NETWORK, NETWORK_INCREMENTAL, WEIGHTED = range(6)
ACTIVATIONS = {"tanh": TANH, "logistic": LOGISTIC}

_clip = njit(**OPTIONS)(control.clip)
_pi_output = njit(**OPTIONS)(control.pi_output)
_pi_integral = njit(**OPTIONS)(control.pi_integral)


class SpeedLaw(NamedTuple):
    """Every kind's parameters, as the loop takes them; those of other kinds are zero."""

    kind: int
    K_p: float
    K_i: float
    K_e: float
    K_de: float
    K_u: float
    W1: np.ndarray
    B1: np.ndarray
    W2: np.ndarray
    B2: float
    activation: float
    weight: float
    pole: float
    J: float


def _law(kind, K_p=0.0, K_i=0.0, K_e=0.0, K_de=0.0, K_u=0.0, W1=None, B1=None, W2=None, B2=0.0, activation=TANH, weight=1.0, pole=1.0, J=1.0):
    def vector(value):
        return np.zeros(0) if value is None else np.ascontiguousarray(value, dtype=float)

    matrix = np.zeros((0, 0)) if W1 is None else np.ascontiguousarray(W1, dtype=float)
    return SpeedLaw(
        kind, float(K_p), float(K_i), float(K_e), float(K_de), float(K_u), matrix, vector(B1), vector(W2), float(B2), activation,
        float(weight), float(pole), float(J),
    )  # fmt: skip


@njit(**OPTIONS)
def network_output(law, e, de, integral):
    """Return W2 · act(W1 x + B1) + B2 for the input x, the first columns of (e, Δe, ∫e dt) that W1 takes."""
    u, columns, hidden = law.B2, law.W1.shape[1], np.empty(law.B1.size)
    for j in range(hidden.size):  # apart from the sum, whose order stands: so the vector units take the sigmoids
        a = law.B1[j] + law.W1[j, 0] * e
        if columns > 1:
            a += law.W1[j, 1] * de
        if columns > 2:
            a += law.W1[j, 2] * integral
        hidden[j] = sigmoid(a, law.activation)
    for j in range(hidden.size):
        u += law.W2[j] * hidden[j]
    return u


@njit(**OPTIONS)
def _rule_or_network(law, e, e_previous, memory, T_previous, T_limit, period):
    de = e - e_previous
    if law.kind == FUZZY_POSITION or law.kind == FUZZY_INCREMENTAL:
        asked = law.K_u * fuzzy_output(law.K_e * e, law.K_de * de)
    else:
        asked = network_output(law, e, de, memory)
    return limited(law.kind, asked, e, memory, T_previous, T_limit, period)


@njit(**OPTIONS)
def limited(kind, asked, e, memory, T_previous, T_limit, period):
    """Return what ``speed_command`` does, of a fuzzy or neural controller whose output is ``asked``."""
    # The command itself is the integral of an incremental one, so limiting it is the whole anti-windup.
    asked += T_previous if kind == FUZZY_INCREMENTAL or kind == NETWORK_INCREMENTAL else 0.0
    torque = _clip(asked, T_limit)
    memory += period * e if torque == asked else 0.0  # ∫e waits while the torque is at its limit
    return torque, asked, memory


@njit(**OPTIONS)
def pi_command(K_p, K_i, e, memory, T_limit, period):
    """Return what ``speed_command`` does, of a PI controller."""
    asked = _pi_output(e, memory, K_p)
    torque = _clip(asked, T_limit)
    return torque, asked, _pi_integral(memory, e, asked, torque, K_i, K_i / K_p, period)


# Inlined, or passing the networks' arrays costs the PI loop a fifth of its time.
@njit(**OPTIONS, inline="always")
def speed_command(law, e, e_previous, memory, T_previous, T_limit, period):
    """Return the torque reference (N m) and the next memory for one sample.

    Parameters
    ----------
    law : SpeedLaw
    e, e_previous : float
        Speed error Ω* − Ω (rad/s) of this sample and the one before, eq. (23)–(24).
    memory : float
        PI: integral term (N m). Networks: ∫e dt (rad). Otherwise unused.
    T_previous : float
        Torque reference of the sample before, as limited (N m).
    T_limit, period : float
        Torque limit (N m) and sample time (s).

    Returns
    -------
    torque, asked, memory : float
        Limited reference and what the law asked for (N m), and the memory.
    """
    if law.kind == PI:
        return pi_command(law.K_p, law.K_i, e, memory, T_limit, period)
    return _rule_or_network(law, e, e_previous, memory, T_previous, T_limit, period)


@njit(**OPTIONS)
def weighted_command(law, omega_ref, omega, memory, T_previous, T_limit, period, state):
    """Return what ``speed_command`` does, of a PI controller with set-point weight and load-torque observer.

    Parameters
    ----------
    law : SpeedLaw
        ``weight`` b of the set point in the proportional part; ``pole``: both poles of the observer in the plane of z,
        1 for none; ``J`` (kg m²) the inertia that it knows.
    omega_ref, omega : float
        Set point and measured speed (rad/s).
    memory, T_previous, T_limit, period : float
        As for ``speed_command``.
    state : array
        The observer's speed (rad/s) in element 2 and the torque on the shaft besides the motor's (N m) in element 3.

    Notes
    -----
    T* = K_p (b Ω* − Ω̂) + ∫K_i (Ω* − Ω) dt − T̂. With the torque as realised, ω̂ = ω̂ + h/J (T + T̂) predicts;
    the prediction's error corrects ω̂ by 1 − z² and T̂ by J/h (1 − z)² of itself, which puts both poles at z.
    """
    load = 0.0
    seen = omega
    if law.pole < 1.0:
        predicted = state[2] + period / law.J * (T_previous + state[3])
        error = omega - predicted
        state[2] = predicted + (1.0 - law.pole * law.pole) * error
        state[3] += law.J / period * (1.0 - law.pole) ** 2 * error
        seen, load = state[2], state[3]
    asked = law.K_p * (law.weight * omega_ref - seen) + memory - load
    torque = _clip(asked, T_limit)
    return torque, asked, _pi_integral(memory, omega_ref - omega, asked, torque, law.K_i, law.K_i / law.K_p, period)


@dataclass(frozen=True)
class PiSpeed:
    """PI controller with torque output and back-calculation: gains in N m s/rad and N m/rad (``control.speed_gains``)."""

    K_p: float
    K_i: float

    def __post_init__(self):
        number("K_p", self.K_p, "N m s/rad", above=0)
        number("K_i", self.K_i, "N m/rad", at_least=0)

    def law(self):
        return _law(PI, K_p=self.K_p, K_i=self.K_i)


@dataclass(frozen=True)
class WeightedPiSpeed:
    """PI controller with set-point weight and load-torque observer.

    Parameters
    ----------
    K_p, K_i : float
        Gains (N m s/rad, N m/rad), as of ``PiSpeed``.
    weight : float
        Of the set point in the proportional part, 0 to 1; 0 is the IP controller.
    pole : float
        exp(−ω_o T_s) of the observer's double pole, above 0; 1 for no observer.
    J : float
        Inertia that the observer knows (kg m²).

    References
    ----------
    K. J. Åström and T. Hägglund, Advanced PID Control, ISA 2006, sec. 3.4 (set-point weighting).
    """

    K_p: float
    K_i: float
    weight: float = 1.0
    pole: float = 1.0
    J: float = 1.0

    def __post_init__(self):
        number("K_p", self.K_p, "N m s/rad", above=0)
        number("K_i", self.K_i, "N m/rad", at_least=0)
        number("weight", self.weight, at_least=0, at_most=1)
        number("pole", self.pole, above=0, at_most=1)
        number("J", self.J, "kg m²", above=0)

    def law(self):
        return _law(WEIGHTED, K_p=self.K_p, K_i=self.K_i, weight=self.weight, pole=self.pole, J=self.J)


@dataclass(frozen=True)
class FuzzySpeed:
    """Fuzzy controller: T* = K_u u, or T* += K_u u each sample, with u = rules(K_e e, K_de Δe).

    Parameters
    ----------
    K_e, K_de : float
        Scaling of error and of its variation per sample (s/rad).
    K_u : float
        Torque (N m), or torque per sample in the incremental form, at u = 1.
    form : {"position", "incremental"}
    """

    K_e: float
    K_de: float
    K_u: float
    form: str = "position"

    def __post_init__(self):
        number("K_e", self.K_e, "s/rad", above=0)
        number("K_de", self.K_de, "s/rad", at_least=0)
        number("K_u", self.K_u, "N m", above=0)
        choice("form", self.form, ("position", "incremental"))

    def law(self):
        kind = FUZZY_POSITION if self.form == "position" else FUZZY_INCREMENTAL
        return _law(kind, K_e=self.K_e, K_de=self.K_de, K_u=self.K_u)


@dataclass(frozen=True)
class NetworkSpeed:
    """Two-layer network in SI units: T* = W2 · act(W1 x + B1) + B2, scalings folded into the weights.

    Parameters
    ----------
    W1 : array, shape (n, inputs)
        Inputs 1, 2 or 3: e (rad/s), Δe per sample (rad/s), ∫e dt (rad). The paper's network has e alone.
    B1, W2 : array, shape (n,)
    B2 : float
        Output bias (N m).
    activation : {"tanh", "logistic"}
    form : {"position", "incremental"}
        Whether the output is the torque or its variation per sample.
    """

    W1: np.ndarray = field(compare=False)
    B1: np.ndarray = field(compare=False)
    W2: np.ndarray = field(compare=False)
    B2: float = 0.0
    activation: str = "tanh"
    form: str = "position"

    def __post_init__(self):
        W1, B1, W2 = (array(name, getattr(self, name)) for name in ("W1", "B1", "W2"))
        if W1.ndim != 2 or W1.shape[1] not in (1, 2, 3) or B1.shape != W1.shape[:1] or W2.shape != W1.shape[:1]:
            raise ValueError(
                f"W1, B1, W2 have shapes {W1.shape}, {B1.shape}, {W2.shape}: must be (n, 1 to 3), (n,), (n,)"
            )
        number("B2", self.B2, "N m")
        choice("activation", self.activation, ACTIVATIONS)
        choice("form", self.form, ("position", "incremental"))

    def law(self):
        kind = NETWORK if self.form == "position" else NETWORK_INCREMENTAL
        return _law(kind, W1=self.W1, B1=self.B1, W2=self.W2, B2=self.B2, activation=ACTIVATIONS[self.activation])
