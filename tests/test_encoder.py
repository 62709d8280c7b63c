"""The encoder against NumPy's rounding and SciPy's filter; the weighted PI and its observer against their own algebra."""

import numpy as np
import pytest
from scipy.signal import lfilter

from drivelib.dfim_drive import simulate
from drivelib.dfim_many import simulate_many
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.encoder import Encoder, encoder_speed, sensor
from drivelib.speed_law import PiSpeed, WeightedPiSpeed, weighted_command

H = 1e-4
SHORT = DEFAULT_SCENARIO.changed(duration=0.6, speed_reference=((0.0, 40.0),), load_torque=((0.0, 0.0), (0.3, 20.0)))


def readings(encoder, theta):
    seen = sensor(encoder, theta.size, H)
    return np.array([encoder_speed(seen, angle, k, H) for k, angle in enumerate(theta)])


def test_speed_is_the_filtered_difference_of_rounded_positions():
    """No count is ever lost: the same as NumPy's rounding, differences and SciPy's first-order filter."""
    rng = np.random.default_rng(3)
    theta = np.cumsum(rng.uniform(-0.02, 0.03, 4000))
    encoder = Encoder(counts=1000, noise=0.4, corner=500.0, seed=11)
    place = np.round(theta * 1000 / (2 * np.pi) + 0.4 * np.random.default_rng(11).standard_normal(4000))
    raw = np.diff(place, prepend=0.0) * 2 * np.pi / 1000 / H
    a = np.exp(-500.0 * H)
    assert readings(encoder, theta) == pytest.approx(lfilter([1 - a], [1, -a], raw), abs=1e-8)


def test_without_noise_the_mean_speed_is_true_and_the_ripple_that_of_one_count():
    """At constant speed the difference takes two neighbouring values, one count per period apart."""
    theta = 7.3 * H * np.arange(50_000)
    seen = readings(Encoder(counts=10_000, noise=0.0, corner=100.0), theta)[5000:]
    assert seen.mean() == pytest.approx(7.3, rel=1e-3)
    assert 0 < np.ptp(seen) <= 2 * np.pi / 1e4 / H * -np.expm1(-100.0 * H) * 1.001


def test_a_fine_encoder_with_a_fast_filter_is_no_encoder():
    fine = SHORT.changed(encoder=Encoder(counts=2**40, noise=0.0, corner=1e6))
    apart = np.abs(simulate(fine)["omega_m"] - simulate(SHORT)["omega_m"])
    assert apart.max() < 0.05  # half a period of delay at 255 rad/s² and what it does to the loop


def test_indices_are_of_the_true_speed_and_noise_repeats_with_its_seed():
    coarse = SHORT.changed(encoder=Encoder(counts=2000, seed=4))
    run = simulate(coarse)
    assert run.error_indices().IAE == pytest.approx(run.indices.IAE, rel=1e-9)
    assert run.peak == np.abs(run["omega_ref"] - run["omega_m"])[:-1].max()
    assert np.array_equal(simulate(coarse).data, run.data)
    assert not np.array_equal(simulate(SHORT.changed(encoder=Encoder(counts=2000, seed=5))).data, run.data)


def test_many_at_once_see_the_encoder_too():
    coarse = SHORT.changed(encoder=Encoder(counts=2000))
    assert simulate_many([coarse] * 9)["IAE"] == pytest.approx([simulate(coarse).indices.IAE] * 9, rel=1e-12)


def test_weight_one_without_observer_is_the_pi():
    gains = DEFAULT_SCENARIO.speed_gains
    plain, weighted = simulate(SHORT, PiSpeed(*gains)), simulate(SHORT, WeightedPiSpeed(*gains))
    assert np.abs(plain["T_ref"] - weighted["T_ref"]).max() < 1e-9


def test_the_weight_moves_the_zero_and_leaves_the_answer_to_loads():
    """b scales the zero of Ω/Ω*: at b = 0 the two real poles of ξ = 1 leave no overshoot. A load sees the poles alone."""
    small = SHORT.changed(xi=1.0, speed_reference=((0.0, 1.0),), load_torque=((0.0, 0.0), (1.0, 1.0)), duration=1.3)
    gains = small.speed_gains
    plain, ip = simulate(small, PiSpeed(*gains)), simulate(small, WeightedPiSpeed(*gains, weight=0.0))
    before, after = plain.t < 1.0, plain.t >= 1.0  # by then e^-20 of the start is left
    assert plain["omega_m"][before].max() > 1.05 > 1.002 > ip["omega_m"][before].max()
    dips = [(run["omega_ref"] - run["omega_m"])[after].max() for run in (plain, ip)]
    assert dips[0] == pytest.approx(dips[1], rel=2e-3)


def observed(pole, load, steps, J=0.2):
    """Errors (rad/s, N m) of the observer beside a plant J dω/dt = T − load that is driven by a known torque."""
    law, state = WeightedPiSpeed(1.0, 0.0, pole=pole, J=J).law(), np.zeros(4)
    omega, torque, errors = 0.0, 0.0, []
    for k in range(steps):
        weighted_command(law, 0.0, omega, 0.0, torque, 50.0, H, state)
        errors.append((omega - state[2], -load - state[3]))
        torque = 3.0 * np.sin(0.01 * k)
        omega += H / J * (torque - load)
    return np.array(errors)


def test_the_observer_finds_a_constant_load_with_two_equal_poles():
    """Error_k = (c + d k) z^k exactly, so error/z^k has no second difference; in the end nothing is left."""
    z = 0.98
    errors = observed(z, 12.0, 1500)
    scaled = errors[:300, 1] / z ** np.arange(300)
    assert np.abs(np.diff(scaled, 2)).max() < 1e-6 * np.abs(scaled).max()
    assert np.abs(errors[-1]).max() < 1e-6 and abs(errors[0, 1]) > 10


def test_the_observer_takes_the_load_off_a_p_controller():
    """P alone stands at T/K; with the observer at the set point, friction included."""
    held = SHORT.changed(duration=1.5)
    alone, helped = (simulate(held, WeightedPiSpeed(8.0, 0.0, pole=pole, J=0.2)) for pole in (1.0, np.exp(-200 * H)))
    assert 40.0 - alone["omega_m"][-1] == pytest.approx((20.0 + 0.001 * 40) / 8.001, rel=1e-3)
    assert abs(40.0 - helped["omega_m"][-1]) < 1e-4


@pytest.mark.parametrize("bad", [{"counts": 3}, {"counts": 10.5}, {"noise": -1.0}, {"corner": 0.0}, {"corner": np.nan}, {"seed": -1}])
def test_bad_encoders_are_refused(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        Encoder(**bad)


@pytest.mark.parametrize("bad", [{"weight": 1.5}, {"weight": -0.1}, {"pole": 0.0}, {"pole": 1.1}, {"J": 0.0}, {"K_p": 0.0}, {"K_i": -1.0}])
def test_bad_weighted_controllers_are_refused(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        WeightedPiSpeed(**{"K_p": 1.0, "K_i": 1.0, **bad})


def test_a_scenario_takes_encoders_only():
    with pytest.raises(ValueError, match="encoder"):
        DEFAULT_SCENARIO.changed(encoder=10_000)
