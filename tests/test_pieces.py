"""Pieces of runs abreast have the bits that they have alone, and a run in pieces those of the run in one."""

import numpy as np
import pytest

from drivelib import dfim_pieces
from drivelib.dfim_drive import SimulationDiverged, initial_state, schedule, simulate
from drivelib.dfim_loop import NEVER, STATES
from drivelib.dfim_machines import DFIM_SETS
from drivelib.dfim_pieces import KEPT, Drive, Piece, alone, together
from drivelib.dfim_scenario import DEFAULT_SCENARIO, FLUX_ESTIMATORS
from drivelib.encoder import Encoder
from drivelib.speed_law import FuzzySpeed, NetworkSpeed, PiSpeed, WeightedPiSpeed


def speed(rng, kind, gains):
    """A controller of each kind that goes abreast, networks of one to three inputs and up to 15 neurons."""
    if kind == 0:
        return PiSpeed(*gains)
    if kind in (1, 2):
        return FuzzySpeed(1 / 60, rng.uniform(0, 0.5), gains.K_p * 60 if kind == 1 else gains.K_p * rng.uniform(0.1, 1), ("position", "incremental")[kind - 1])
    n, inputs, form = rng.integers(1, 16), rng.integers(1, 4), ("position", "incremental")[kind % 2]
    W2 = rng.normal(size=n) * gains.K_p * (1 if form == "position" else 0.01)
    return NetworkSpeed(rng.normal(size=(n, inputs)) / 20, rng.normal(size=n), W2, rng.normal(), ("tanh", "logistic")[rng.integers(2)], form)


def pieces(n):
    """Pieces that differ in everything: motor, period, length, controller, flux estimate, loads and when they come."""
    rng = np.random.default_rng(5)
    for k in range(n):
        period = rng.uniform(1e-4, 4e-4)
        scenario = DEFAULT_SCENARIO.changed(
            machine=list(DFIM_SETS.values())[rng.integers(len(DFIM_SETS))], period=period, omega_n=rng.uniform(5, 40),
            flux_estimator=FLUX_ESTIMATORS[rng.integers(len(FLUX_ESTIMATORS))],
        )  # fmt: skip
        x = initial_state(scenario)
        x[STATES.index("omega_m")] = rng.uniform(-60, 60)
        steps = int(rng.integers(1, 400))
        changes = np.array([0 if k % 7 else 1, *np.sort(rng.integers(1, 450, size=rng.integers(0, 6))), NEVER])
        size = len(changes) - 1
        values = np.column_stack([rng.uniform(-60, 60, size), rng.uniform(-20, 20, size), rng.uniform(0.7, 1.5, size)])
        yield Piece(Drive.of(scenario), speed(rng, k % 5, scenario.speed_gains).law(), x, (changes, values, steps))


def same(a, b):
    return np.array_equal(a.channels, b.channels) and a.indices == b.indices and np.array_equal(a.x, b.x)


def test_pieces_abreast_have_the_bits_that_they_have_alone():
    asked = list(pieces(400))
    ours = together(asked)
    assert all(same(part, alone(piece)) for part, piece in zip(ours, asked, strict=True))
    backwards = together(asked[:90][::-1])[::-1]
    assert all(same(part, other) for part, other in zip(backwards, ours, strict=False)), "neighbours must not matter"
    assert together([]) == [] and same(together(asked[:1])[0], ours[0])


@pytest.fixture
def repeated(monkeypatch):
    """The pieces that were run alone since the test began."""
    seen, original = [], dfim_pieces.alone
    monkeypatch.setattr(dfim_pieces, "alone", lambda piece: [seen.append(piece), original(piece)][1])
    return seen


def pis(n):
    return list(pieces(5 * n))[::5]


def test_a_piece_that_diverges_is_none_and_harms_no_other(repeated):
    """By its fluxes, at its only sample, in a group of eight of its own: the frame does not turn, so nothing but the bound can tell."""
    asked = pis(16)
    x = np.zeros_like(asked[3].x)
    x[STATES.index("phi_sd")] = 1e4
    bad = asked[3]._replace(x=x, profiles=(*asked[3].profiles[:2], 1))
    with pytest.raises(SimulationDiverged):
        alone(bad)
    before, after = together(asked), together([*asked, bad])
    assert not repeated, "all must have gone abreast"
    assert after[-1] is None and all(same(a, b) for a, b in zip(before, after, strict=False))


def test_a_frame_too_fast_for_the_polynomials_is_computed_again(repeated):
    asked = pis(20)
    fast = asked[0].drive.scenario.changed(period=4e-4)
    x = asked[0].x.copy()
    x[STATES.index("omega_m")] = 800.0
    asked[0] = asked[0]._replace(drive=Drive.of(fast), x=x)
    assert 0.5 * fast.period * 0.5 * fast.machine.p * 800.0 > 0.125
    part = together(asked)[0]
    assert repeated == [asked[0]] and same(part, alone(asked[0]))


def test_a_piece_is_the_run_that_simulate_makes():
    scenario = DEFAULT_SCENARIO.changed(duration=0.3, speed_reference=((0.0, 60.0),), load_torque=((0.0, 0.0), (0.2, 20.0)))
    piece = Piece(Drive.of(scenario), PiSpeed(*scenario.speed_gains).law(), initial_state(scenario), (*schedule(scenario), scenario.steps))
    run = simulate(scenario)
    for part in (alone(piece), *together([piece] * 20)):
        assert np.array_equal(part.channels, [run[name] for name in KEPT]) and part.indices == run.indices
        assert np.array_equal(part.error, run["omega_ref"] - run["omega_m"])


def test_what_pieces_cannot_run_is_refused():
    (piece,) = pieces(1)
    weighted = piece._replace(law=WeightedPiSpeed(1.0, 1.0).law())
    for run in (alone, lambda one: together([one])):
        with pytest.raises(ValueError, match="cannot run in pieces"):
            run(weighted)
    for change in ({"inverter": "switching"}, {"substeps": 2}, {"encoder": Encoder()}):
        with pytest.raises(ValueError, match="pieces run with averaged inverters in one step per period, and without an encoder"):
            Drive.of(DEFAULT_SCENARIO.changed(**change))
    with pytest.raises(ValueError, match="inverter"):
        alone(piece, inverter="averaging")
