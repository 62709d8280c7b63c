"""Parameter sets: the appendix' numbers, where each comes from, and copies that stay honest."""

import copy
import math
import pickle
from dataclasses import FrozenInstanceError

import pytest

from drivelib import machines
from drivelib.machines import IPMSM, SPMSM, Origin, PmsmParameters

USER = dict(R_s=1.0, L_d=0.01, L_q=0.02, psi_f=0.1, P=3, V_dc=300.0, R_c=500.0, J=1e-3, B=0.0, omega_m_rated=100.0, T_rated=2.0)


def test_printed_values_are_those_of_the_appendix():
    """Eskander's appendix, read a second time; 2P = 8 and 4 poles are 4 and 2 pole pairs."""
    printed = {
        IPMSM: dict(R_s=4.3, L_d=0.027, L_q=0.067, V_dc=250, P=4, psi_f=0.232),
        SPMSM: dict(R_s=3, L_d=0.0121, L_q=0.0121, V_dc=100, P=2, psi_f=0.083),
    }
    for machine, values in printed.items():
        assert {name for name, origin in machine.origins.items() if origin.kind == "printed"} == set(values)
        for name, value in values.items():
            assert getattr(machine, name) == value


def test_what_is_not_printed_has_the_known_class_and_value():
    """1700 rpm was found, 5.06 N m is 900 W over that speed, R_c = 200 Ω is identified, J found, B and the rest open."""
    assert abs(IPMSM.omega_m_rated - 1700 * math.pi / 30) < 0.05
    assert abs(IPMSM.T_rated - 900 / IPMSM.omega_m_rated) < 0.005
    assert abs(SPMSM.T_rated * SPMSM.omega_m_rated - 400) < 1
    assert (IPMSM.R_c, SPMSM.R_c, IPMSM.J, SPMSM.J, IPMSM.B, SPMSM.B) == (200, 200, 1.79e-4, 5e-4, 0, 0)
    kinds = {name: IPMSM.origins[name].kind for name in ("R_c", "J", "B", "omega_m_rated", "T_rated")}
    assert kinds == {"R_c": "identified", "J": "found", "B": "assumed", "omega_m_rated": "found", "T_rated": "inferred"}


@pytest.mark.parametrize("machine", [IPMSM, SPMSM])
def test_every_value_says_where_it_comes_from(machine):
    """A row per value; what is not printed has a reason, what is assumed or identified also a range that contains it."""
    rows = {row[0]: row for row in machine.rows()}
    assert list(rows) == list(machines.PMSM_UNITS)
    for name, value, unit, kind, note in rows.values():
        assert value == getattr(machine, name) and unit == machines.PMSM_UNITS[name]
        assert kind in machines.ORIGINS and kind != "given" and note
        origin = machine.origins[name]
        if kind in ("assumed", "identified"):
            assert origin.low <= value <= origin.high
            assert f"{origin.low:g} to {origin.high:g}" in note


def test_saliency_and_electrical_speed_are_definitions():
    """ΔL = L_d − L_q is negative inside an interior machine; electrical speed is P times the mechanical one."""
    assert abs(IPMSM.delta_L + 0.040) < 1e-12 and SPMSM.delta_L == 0
    assert IPMSM.omega_e_rated == 4 * IPMSM.omega_m_rated


def test_a_changed_value_is_no_longer_the_papers():
    """Changing R_c makes R_c the user's and leaves the original, and every other origin, alone."""
    changed = IPMSM.changed(R_c=300.0)
    assert (changed.R_c, changed.origins["R_c"].kind) == (300.0, "given")
    assert (IPMSM.R_c, IPMSM.origins["R_c"].kind) == (200.0, "identified")
    assert all(changed.origins[name] == IPMSM.origins[name] for name in machines.PMSM_UNITS if name != "R_c")
    reason = Origin("assumed", "a study", 100.0, 400.0)
    assert IPMSM.changed(R_c=300.0, origins={"R_c": reason}).origins["R_c"] == reason


def test_a_users_machine_is_all_given():
    """Without origins every value is the user's; P may be a float that is whole."""
    machine = PmsmParameters(**{**USER, "P": 3.0})
    assert {origin.kind for origin in machine.origins.values()} == {"given"}
    assert machine.P == 3 and isinstance(machine.P, int)


def test_a_machine_cannot_be_changed_in_place():
    """A parameter set is frozen, its origins too, so that a result always belongs to one machine."""
    with pytest.raises(FrozenInstanceError):
        IPMSM.R_c = 1.0
    with pytest.raises(TypeError):
        IPMSM.origins["R_c"] = Origin("given")
    source = {"R_c": Origin("assumed", "x", 1.0, 2.0)}
    machine = PmsmParameters(**USER, origins=source)
    source["R_c"] = Origin("printed")
    assert machine.origins["R_c"].kind == "assumed"


def test_a_machine_travels_to_another_process():
    """Pickled or deeply copied it is the same machine with the same origins: an executor's workers need that."""
    for twin in (pickle.loads(pickle.dumps(IPMSM)), copy.deepcopy(IPMSM)):
        assert twin == IPMSM and hash(twin) == hash(IPMSM)
        assert dict(twin.origins) == dict(IPMSM.origins)
        assert twin.rows() == IPMSM.rows()


def test_equality_is_of_values():
    """Two machines are equal when all values are, wherever these come from."""
    assert PmsmParameters(**USER) == PmsmParameters(**USER, origins={"R_c": Origin("printed")})
    assert PmsmParameters(**USER) != PmsmParameters(**{**USER, "R_c": 501.0})


def test_a_readers_machine_owes_nothing_to_the_example():
    """What agrees by chance is the reader's too; the example unchanged keeps its sources; what was not named stays."""
    values = {name: getattr(IPMSM, name) for name in ("R_s", "L_d", "P")}
    same, own = IPMSM.own(name="a copy", **values), IPMSM.own(name="mine", **{**values, "R_s": 2.0})
    assert same.origins == IPMSM.origins and same.name == "a copy"
    assert {own.origins[name].kind for name in values} == {"given"} and own.origins["J"] == IPMSM.origins["J"]
    assert (own.R_s, own.L_d) == (2.0, IPMSM.L_d)
