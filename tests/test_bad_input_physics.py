"""What makes no sense is refused with parameter, value, unit and allowed range in the message."""

import numpy as np
import pytest

from drivelib import circuits, derivations, identification, pmsm, pmsm_angle, pmsm_optimum, validation
from drivelib.machines import IPMSM, SPMSM, Origin, PmsmParameters

NO_RESISTANCE = IPMSM.changed(R_s=0)
TOO_FAR = "λ + (L_d − L_q) i_od must be positive"


def refusal(call):
    with pytest.raises(ValueError) as caught:
        call()
    return str(caught.value)


MACHINE = [
    ({"R_s": -4.3}, ["R_s", "-4.3 ohm", "at least 0 ohm"]),
    ({"R_s": float("nan")}, ["R_s", "nan ohm", "finite", "at least 0 ohm"]),
    ({"R_c": 0.0}, ["R_c", "0.0 ohm", "above 0 ohm"]),
    ({"R_c": float("inf")}, ["R_c", "inf ohm", "finite", "above 0 ohm"]),
    ({"L_d": -0.027}, ["L_d", "-0.027 H", "above 0 H"]),
    ({"L_q": 0}, ["L_q", "0 H", "above 0 H"]),
    ({"psi_f": 0.0}, ["psi_f", "0.0 Wb", "above 0 Wb"]),
    ({"P": 0}, ["P = 0 pole pairs", "whole", "at least 1 pole pairs"]),
    ({"P": 2.5}, ["P = 2.5 pole pairs", "whole", "at least 1 pole pairs"]),
    ({"P": True}, ["P = True", "number", "pole pairs"]),
    ({"V_dc": "250"}, ["V_dc = '250'", "real number", "above 0 V"]),
    ({"V_dc": 1j}, ["V_dc = 1j", "real number", "above 0 V"]),
    ({"J": None}, ["J = None", "real number", "above 0 kg m²"]),
    ({"B": -1e-3}, ["B = -0.001 N m s", "at least 0 N m s"]),
    ({"T_rated": [1.0, 2.0]}, ["T_rated", "real number", "N m"]),
    ({"omega_m_rated": np.bool_(True)}, ["omega_m_rated", "real number", "rad/s"]),
    ({"R_S": 3.0}, ["'R_S'", "Did you mean R_s"]),
    ({"lambda_f": 0.1}, ["'lambda_f'", "no parameter"]),
    ({"psi": 0.1}, ["'psi'", "Did you mean psi_f"]),
    ({"origins": {"R_k": Origin("given")}}, ["'R_k'", "Did you mean", "R_c"]),
    ({"origins": {"R_c": "printed"}}, ["origins['R_c'] = 'printed'", "printed, found, inferred"]),
]


@pytest.mark.parametrize(("values", "parts"), MACHINE, ids=[str(values) for values, _ in MACHINE])
def test_an_impossible_machine_is_refused(values, parts):
    """A machine with such a value cannot exist, or the name is a typing error."""
    message = refusal(lambda: IPMSM.changed(**values))
    assert all(part in message for part in parts), message


@pytest.mark.parametrize("name", ["R_s", "L_d", "L_q", "psi_f", "P", "V_dc", "R_c", "J", "B", "omega_m_rated", "T_rated"])
@pytest.mark.parametrize("value", [float("nan"), float("-inf"), -1])
def test_no_parameter_may_be_nan_infinite_or_negative(name, value):
    """Also when the set is built directly; the message begins with the parameter and its value."""
    values = {item: getattr(IPMSM, item) for item in ("R_s", "L_d", "L_q", "psi_f", "P", "V_dc", "R_c", "J", "B", "omega_m_rated", "T_rated")}
    assert refusal(lambda: PmsmParameters(**{**values, name: value})).startswith(f"{name} = {value}")


@pytest.mark.parametrize(
    ("origin", "parts"),
    [
        (("guessed",), ["kind = 'guessed'", "'printed'", "'identified'"]),
        (("Found",), ["Did you mean found"]),
        (("assumed", "x", 2.0, 1.0), ["high = 1.0", "at least 2"]),
        (("assumed", "x", 2.0), ["both ends"]),
        (("assumed", "x", float("nan"), 1.0), ["low = nan", "finite"]),
    ],
)
def test_an_origin_has_a_known_class_and_an_ordered_range(origin, parts):
    """The classes are six; a range has two ends, the lower one first."""
    message = refusal(lambda: Origin(*origin))
    assert all(part in message for part in parts), message


NAN, INF = float("nan"), float("inf")
POINTS = {
    "current": (lambda: pmsm.torque(IPMSM, [0.0, NAN], 1.0), ["i_od = nan A at index 1", "finite"]),
    "currents": (lambda: pmsm.iron_loss(IPMSM, 1.0, 0.0, [[1.0, INF]]), ["i_oq = inf A at index (0, 1)", "finite"]),
    "no number": (lambda: pmsm.torque(IPMSM, "x", 1.0), ["i_od = 'x'", "real number", "in A"]),
    "complex": (lambda: pmsm.torque(IPMSM, 1j, 1.0), ["i_od = 1j", "real number", "in A"]),
    "ragged": (lambda: pmsm.torque(IPMSM, 1.0, [1, [2, 3]]), ["i_oq = [1, [2, 3]]", "array", "in A"]),
    "speed": (lambda: pmsm.energy_balance(IPMSM, "fast", 0.0, 1.0), ["omega_e = 'fast'", "in rad/s"]),
    "speed, efficiency": (lambda: pmsm.efficiency(IPMSM, INF, 0.0, 1.0), ["omega_e = inf rad/s"]),
    "torque": (lambda: pmsm.acceleration(IPMSM, 1.0, NAN, 0.0), ["T_L = nan N m"]),
    "voltage": (lambda: pmsm.branch_currents_at_voltage(IPMSM, 1.0, -5.0, 0.0), ["V_s = -5.0 V", "at least 0 V"]),
    "short circuit": (lambda: pmsm.branch_currents_at_voltage(NO_RESISTANCE, 0.0, 5.0, 0.0), ["R_s = 0 ohm", "omega_e = 0 rad/s"]),
    "demagnetised": (lambda: pmsm.i_oq_at_torque(IPMSM, 1.0, [-20.0, 7.0]), ["i_od = 7 A", TOO_FAR, "below 5.8 A"]),
    "inverse": (lambda: pmsm.di_oq_di_od(IPMSM.changed(L_d=0.067, L_q=0.027), 1.0, [20.0, -7.0]), ["i_od = -7 A", TOO_FAR, "above -5.8 A"]),
    "model": (lambda: pmsm.total_loss(IPMSM, 1.0, 0.0, 1.0, model="simple"), ["model = 'simple'", "'full', 'simplified'", "Did you mean simplified"]),
    "convention": (lambda: pmsm.copper_loss(IPMSM, 0.0, 1.0, convention="Paper"), ["'consistent', 'paper'", "Did you mean paper"]),
    "modulation": (lambda: pmsm.voltage_limit(IPMSM, "sixstep"), ["modulation = 'sixstep'", "Did you mean six-step"]),
    "voltage limit": (lambda: pmsm_optimum.optimum(IPMSM, 1.0, 1.0, V_max=0), ["V_max = 0 V", "above 0 V"]),
    "current limit": (lambda: pmsm_optimum.optimum(IPMSM, 1.0, 1.0, I_max=NAN), ["I_max = nan A", "above 0 A"]),
    "optimum": (lambda: pmsm_optimum.optimum(IPMSM, 1.0, [1.0, NAN]), ["T_e = nan N m at index 1"]),
    "no optimum": (lambda: pmsm_optimum.optimal_i_od(NO_RESISTANCE, 0.0, 1.0), ["R_s = 0 ohm", "omega_e = 0 rad/s"]),
    "salient": (lambda: pmsm_optimum.optimal_i_od_surface(IPMSM, 1.0), ["-0.04 H", "L_d = L_q"]),
    "bound": (lambda: pmsm_optimum.largest_torque(IPMSM, 1.0, 100.0, T_max=-1.0), ["T_max = -1.0 N m", "above 0 N m"]),
    "reverse": (lambda: pmsm_optimum.largest_torque(IPMSM, -1.0, 100.0), ["omega_e = -1.0 rad/s", "at least 0 rad/s"]),
    "loss": (lambda: pmsm_optimum.speed_at_loss(IPMSM, 1.0, -118.9), ["loss = -118.9 W", "above 0 W"]),
    "speed bound": (lambda: pmsm_optimum.speed_at_loss(IPMSM, 1.0, 118.9, omega_max=0.0), ["omega_max = 0.0 rad/s", "above"]),
    "R_c": (lambda: identification.loss_curve(IPMSM, 118.9, [200.0, 0.0], 1.0), ["R_c = 0.0 ohm at index 1", "above 0 ohm"]),
    "one torque": (lambda: identification.largest_iron_resistance(IPMSM, 118.9, [3.0, 5.0], 144.0), ["T_e = [3.0, 5.0]", "real number in N m"]),
    "R_c range": (lambda: identification.largest_iron_resistance(IPMSM, 118.9, 3.0, 144.0, R_c_range=(500.0, 20.0)), ["R_c_range", "500.0 ohm", "increasing"]),
    "R_c range from 0": (lambda: identification.largest_iron_resistance(IPMSM, 118.9, 3.0, 144.0, R_c_range=(0.0, 20.0)), ["R_c_range", "0.0 ohm", "above 0 ohm"]),
    "angle": (lambda: pmsm_angle.i_oq_at_angle(IPMSM, 100.0, 1.6), ["phi = 1.6 rad", "at most 1.5 rad"]),
    "angle at rest": (lambda: pmsm_angle.i_oq_at_angle(IPMSM, 0.0, 0.1), ["omega_e = 0.0 rad/s", "above 0 rad/s"]),
    "braking": (lambda: pmsm_angle.inverter_angle(IPMSM, 100.0, -1.0), ["i_oq = -1.0 A", "at least 0 A"]),
    "backwards": (lambda: pmsm_angle.zero_angle(IPMSM, -100.0, T_e=1.0), ["omega_e = -100.0 rad/s", "at least 0 rad/s"]),
    "two at once": (lambda: pmsm_angle.zero_angle(IPMSM, 1.0, V_s=1.0, T_e=1.0), ["exactly one", "V_s, T_e"]),
    "none": (lambda: pmsm_angle.zero_angle(IPMSM, 1.0), ["exactly one", "none"]),
    "no voltage drop": (lambda: pmsm_angle.zero_angle(NO_RESISTANCE, 1.0, T_e=1.0), ["R_s = 0.0 ohm", "above 0 ohm"]),
    "circuit": (lambda: circuits.solve(SPMSM, 1.0, NAN, 1.0), ["V_d = nan V"]),
    "circuit speed": (lambda: circuits.solve(SPMSM, [1.0, 2.0], 1.0, 1.0), ["omega_e = [1.0, 2.0]", "real number in rad/s"]),
    "circuit resistance": (lambda: circuits.solve(NO_RESISTANCE, 1.0, 1.0, 1.0), ["R_s = 0.0 ohm", "above 0 ohm"]),
    "axis": (lambda: circuits.pmsm_circuit("x"), ["axis = 'x'", "'d', 'q'"]),
    "equation": (lambda: derivations.equation("eq1l"), ["'eq1l'", "Did you mean", "eq1"]),
}  # fmt: skip


@pytest.mark.parametrize("case", POINTS)
def test_an_impossible_operating_point_is_refused(case):
    """No number, no direction of rotation or no such mode: the message says which argument, and what is allowed."""
    call, parts = POINTS[case]
    message = refusal(call)
    assert all(part in message for part in parts), message


@pytest.mark.parametrize(
    ("values", "parts"),
    [
        ([], ["t has shape (0,)", "at least two values in s"]),
        ([1.0], ["t has shape (1,)", "at least two"]),
        (3.0, ["t has shape ()", "one-dimensional"]),
        ([[0.0, 1.0], [2.0, 3.0]], ["t has shape (2, 2)", "one-dimensional"]),
        ([0.0, NAN, 2.0], ["t = nan s at index 1", "finite"]),
        ([0.0, 1.0, INF], ["t = inf s at index 2", "finite"]),
        ([0.0, 2.0, 1.0], ["t[2] = 1.0 s", "t[1] = 2.0 s", "increasing"]),
        ([0.0, 1.0, 1.0], ["t[2] = 1.0 s", "t[1] = 1.0 s", "strictly"]),
        ("abc", ["t = 'abc'", "real number", "in s"]),
        ([0.0, 1j], ["t = [0.0, 1j]", "real number", "in s"]),
    ],
)
def test_a_time_grid_must_run_forward(values, parts):
    """A time grid has two or more finite instants, each later than the one before."""
    message = refusal(lambda: validation.grid("t", values))
    assert all(part in message for part in parts), message


def test_good_input_passes_unchanged():
    """The checks return what they got, as floats; limits belong to the allowed range where the words say so."""
    assert validation.grid("t", (0, 1, 3)).tolist() == [0.0, 1.0, 3.0]
    assert validation.array("x", [0, 2], at_least=0, at_most=2).tolist() == [0.0, 2.0]
    assert validation.number("x", np.float32(0.5), above=0, at_most=0.5) == 0.5
    assert validation.number("n", 3.0, whole=True) == 3
    assert validation.choice("model", "full", pmsm.MODELS) == "full"
    assert validation.nearest("zzz", ["full"]) == ""
    assert "above 0 A and at most 2 A" in refusal(lambda: validation.number("x", 3, "A", above=0, at_most=2))
