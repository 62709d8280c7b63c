"""The circuits of fig. 1, solved by nodes, against Kirchhoff's laws written by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from drivelib import circuits, pmsm
from drivelib.machines import IPMSM
from pmsm_by_hand import machines, speeds, state

SETTINGS = settings(derandomize=True, deadline=None, max_examples=60)
VOLTAGE = st.floats(-300, 300).map(lambda value: round(value, 4))


@SETTINGS
@given(machines(), speeds(), VOLTAGE, VOLTAGE)
def test_loops_and_nodes_balance(m, w, V_d, V_q):
    """Each loop: V = R_s i + v_o. Each node: i = i_o + v_o/R_c. Each branch: v_od = −ωL_q i_oq, v_oq = ω(λ + L_d i_od)."""
    x = circuits.solve(m, w, V_d, V_q)
    size = 1e-9 * (1 + abs(V_d) + abs(V_q) + abs(w) * m.psi_f)
    amps = size / min(m.R_s, 1)
    assert_allclose(m.R_s * x["i_d"] + x["v_od"], V_d, rtol=0, atol=size)
    assert_allclose(m.R_s * x["i_q"] + x["v_oq"], V_q, rtol=0, atol=size)
    assert_allclose(x["i_d"], x["i_od"] + x["v_od"] / m.R_c, rtol=0, atol=amps)
    assert_allclose(x["i_q"], x["i_oq"] + x["v_oq"] / m.R_c, rtol=0, atol=amps)
    assert_allclose(x["v_od"], -w * m.L_q * x["i_oq"], rtol=0, atol=size)
    assert_allclose(x["v_oq"], w * (m.psi_f + m.L_d * x["i_od"]), rtol=0, atol=size)


@SETTINGS
@given(machines(), speeds(), st.floats(-10, 10), st.floats(-10, 10))
def test_the_circuit_returns_the_currents_that_made_its_voltage(m, w, i_od, i_oq):
    """The voltage of a known state, put to the netlist, drives that state; so do (1) and (2)."""
    i_od, i_oq = round(i_od, 4), round(i_oq, 4)
    point = state(m, w, i_od, i_oq)
    x = circuits.solve(m, w, point.u.real, point.u.imag)
    atol = 1e-9 * (1 + abs(point.u) / m.R_s)
    assert_allclose((x["i_od"], x["i_oq"]), (i_od, i_oq), rtol=0, atol=atol)
    assert_allclose((x["i_d"], x["i_q"]), (point.i.real, point.i.imag), rtol=0, atol=atol)
    angle = np.arctan2(-point.u.real, point.u.imag)
    assert_allclose(pmsm.branch_currents_at_voltage(m, w, abs(point.u), angle), (x["i_od"], x["i_oq"]), rtol=0, atol=atol)


def test_at_standstill_only_the_stator_resistance_is_left():
    """Without speed there is no emf, which shorts R_c: i = V/R_s in each axis."""
    x = circuits.solve(IPMSM, 0.0, 4.3, -8.6)
    assert_allclose((x["i_d"], x["i_q"], x["i_od"], x["i_oq"], x["v_od"], x["v_oq"]), (1, -2, 1, -2, 0, 0), atol=1e-12)


@pytest.mark.parametrize("axis", "dq")
def test_the_netlist_is_that_of_figure_1(axis):
    """Source and R_s in series feed R_c and the emf branch in parallel; no node hangs loose."""
    elements = {element.name: element for element in circuits.pmsm_circuit(axis)}
    assert {name: element.kind for name, element in elements.items()} == {
        "V": "source", "R_s": "resistor", "R_c": "resistor", "E": "emf",
    }  # fmt: skip
    ends = {name: {element.start, element.end} for name, element in elements.items()}
    assert ends["R_c"] == ends["E"] and ends["V"] != ends["E"]
    assert ends["V"] & ends["E"] == {circuits.GROUND}
    assert ends["R_s"] == ends["V"] ^ ends["E"]
