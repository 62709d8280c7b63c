"""The exported files: compiled, run, and held against the Python they come from; every bound follows from the number format."""

import csv
import functools
import itertools

import numpy as np
import pytest

from drivelib import dfim_map, dfim_optimum, export, fixed_point, loss_map, pmsm, pmsm_optimum
from drivelib.dfim_machines import DFIM_4KW
from drivelib.machines import IPMSM, IPMSM_2200W, SPMSM
from drivelib.neural import Network, Range
from exported_c import DFIM_MAIN, Exported, needs_gcc

UNIT = 2.0**-24  # relative rounding error of single precision
CURRENT = {IPMSM: 6.0, SPMSM: 8.0, IPMSM_2200W: 9.12}


TIGHT = dfim_optimum.DfimLimits(phi_r=0.85, V_s=170.0, V_r=150.0, I_s=14.0, I_r=14.0)


@functools.cache
def made(machine):
    """Return a map and its trained network."""
    speed, torque = np.linspace(0.1, 1.5, 15) * machine.omega_m_rated, np.linspace(0.1, 1, 10) * machine.T_rated
    if machine is DFIM_4KW:
        found = dfim_map.dfim_map(machine, speed, torque, TIGHT)
        return found, loss_map.trained(loss_map.training_data(found), hidden=12, rms_percent=1.5)
    found = loss_map.loss_map(machine, speed, torque, V_max=pmsm.voltage_limit(machine), I_max=CURRENT[machine])
    return found, loss_map.trained(loss_map.training_data(found), hidden=16, rms_percent=0.3)


@pytest.fixture(params=[*CURRENT, DFIM_4KW], ids=lambda machine: machine.name)
def motor(request):
    """A map and its trained network, of every kind of motor."""
    return made(request.param)


@pytest.fixture(params=list(CURRENT), ids=lambda machine: machine.name)
def pmsm_motor(request):
    return made(request.param)


def compiled(tmp_path, motor, **options):
    found, network = motor
    return Exported(tmp_path, export.c_name(found.machine.name), export.c_header(found, network), **options)


def points(network, n, beyond=0.2):
    """Return operating points all over the training range, and a fifth of it beyond."""
    span = network.inputs.high - network.inputs.low
    x = np.random.default_rng(1).uniform(network.inputs.low - beyond * span, network.inputs.high + beyond * span, (n, 2))
    return np.maximum(x, 0).astype(np.float32).astype(float)


def quantised(motor):
    found, network = motor
    return fixed_point.quantised(network, None if found.machine is DFIM_4KW else found.machine)


def q15_points(n=20_000):
    """Return int16 pairs: every pair of extremes, and many between."""
    edges = [-32768, -32767, -1, 0, 1, 32766, 32767]
    inner = np.random.default_rng(2).integers(-32768, 32768, (n, 2))
    return np.concatenate([np.array(list(itertools.product(edges, edges))), inner])


def within_full_scale(q15, values):
    return np.clip(values, -q15.y_scale, q15.y_scale * (1 - 2.0**-15))


@needs_gcc
@pytest.mark.parametrize("checked", [True, False], ids=["sanitizer", "plain"])
def test_compiled_q15_is_the_python_integers_bit_for_bit(motor, tmp_path, checked):
    """Over the whole int16 plane, extremes included, with and without the sanitizer of undefined behaviour."""
    q = q15_points()
    got, status = compiled(tmp_path, motor, checked=checked).q15(q)
    q15 = quantised(motor)
    assert np.array_equal(got, q15.evaluate(q)) and np.array_equal(status, q15.status(q))
    assert {*np.unique(status)} == {0, 3, 4}


@needs_gcc
def test_compiled_q15_errs_within_its_stated_bound(motor, tmp_path):
    """Against the float64 network at the inputs that the integers stand for: half a step per rounding, carried to the output."""
    _, network = motor
    q15 = fixed_point.quantised(network)
    q = q15.to_q15(points(network, 10_000))
    x = np.clip(q15.from_q15(q), network.inputs.low, network.inputs.high)
    error = np.abs(compiled(tmp_path, motor).q15(q) * q15.y_scale / 2**15 - within_full_scale(q15, network.predict(x)))
    assert np.all(error <= q15.bound)
    assert np.all(q15.bound <= 0.02 * q15.y_scale)  # a bound of 2 % of full scale or more would say nothing


@needs_gcc
@pytest.mark.parametrize("checked", [True, False], ids=["sanitizer", "plain"])
def test_compiled_float_network_errs_within_the_bound_of_single_precision(motor, tmp_path, checked):
    """γ_n on every sum, two units for tanhf; beyond the training range the inputs are held at its border."""
    _, network = motor
    x = points(network, 10_000)
    wanted = network.predict(np.clip(x, network.inputs.low, network.inputs.high))
    error = np.abs(compiled(tmp_path, motor, checked=checked).floats(x)["network"] - wanted)
    bound = fixed_point.float32_bound(network)
    assert np.all(error <= bound)
    assert np.all(bound <= 1e-3 * np.max(np.abs(wanted), axis=0))


@needs_gcc
def test_compiled_formula_makes_the_torque_at_the_least_loss_inside_the_limits(pmsm_motor, tmp_path):
    """Judged by the physics, not by the currents alone, which near a flat optimum may differ by sqrt(eps).

    64 roundings of single precision are allowed; points within 1e-4 of a limit of reach may fall on either side.
    """
    found, network = pmsm_motor
    machine, allowed = found.machine, 64 * UNIT
    x = points(network, 4_000, beyond=0.0)
    out = compiled(tmp_path, pmsm_motor).floats(x)
    omega_e, T_e = machine.P * x[:, 0], x[:, 1]
    best, tighter, wider = (
        pmsm_optimum.optimum(machine, omega_e, T_e, V_max=found.V_max * scale, I_max=found.I_max * scale) for scale in (1, 1 - 1e-4, 1 + 1e-4)
    )
    answered = out["flag"] < 2
    assert np.all(answered[tighter.feasible]) and not np.any(answered[~wider.feasible])
    assert np.all(out["optimum"][~answered] == -1)  # left alone
    clear = answered & best.feasible
    i_d, i_q = out["optimum"][clear].T
    i_od, i_oq = pmsm.branch_currents(machine, omega_e[clear], i_d, i_q)
    assert np.all(np.abs(pmsm.torque(machine, i_od, i_oq) / T_e[clear] - 1) <= allowed)
    assert np.all(pmsm.stator_voltage(machine, omega_e[clear], i_od, i_oq) <= found.V_max * (1 + allowed))
    assert np.all(np.hypot(i_d, i_q) <= found.I_max * (1 + allowed))
    loss = pmsm.total_loss(machine, omega_e[clear], i_od, i_oq)
    slack = best.loss[clear] * allowed + np.maximum(best.loss - wider.loss, 0)[clear] * 1e4 * allowed
    deep = tighter.feasible[clear]  # at the very border the loss itself is infinitely steep in the limit
    assert np.all(np.abs(loss - best.loss[clear])[deep] <= 2 * slack[deep])
    moved = out["flag"][clear] == 1
    away = np.abs(pmsm_optimum.optimum(machine, omega_e, T_e).V_s / found.V_max - 1)[clear] > 1e-4
    away &= np.abs(np.hypot(*(getattr(pmsm_optimum.optimum(machine, omega_e, T_e), n) for n in ("i_d", "i_q"))) / found.I_max - 1)[clear] > 1e-4
    assert np.array_equal(moved[away], best.limited[clear][away])


@needs_gcc
def test_compiled_torque_limit_is_reachable_and_close(motor, tmp_path):
    """At every table node the limit is the map's own; between them no more than a step's chord away."""
    found, network = motor
    nodes = np.linspace(network.inputs.low[0], network.inputs.high[0], export.LIMIT_STEPS)
    limit = compiled(tmp_path, motor).floats(np.column_stack([nodes, np.ones_like(nodes)]))["limit"]
    wanted = np.nan_to_num(loss_map.torque_limit(found, nodes, 0.95))
    steepest = np.max(np.abs(np.diff(wanted))) / (nodes[1] - nodes[0])
    place = 4 * UNIT * nodes[-1] * steepest  # the speed in single precision
    assert np.allclose(limit, wanted, rtol=8 * UNIT, atol=64 * place + 1e-6)
    assert np.all(found.optimum(nodes, limit).feasible | (limit == 0))


@needs_gcc
@pytest.mark.parametrize("checked", [True, False], ids=["sanitizer", "plain"])
def test_compiled_dfim_formula_is_the_optimum_where_no_inverter_limit_acts(tmp_path, checked):
    """Flags as the Python optimum has them, but within 1e-4 of a limit; references to 64 roundings; both torque and flux kept."""
    found, network = motor = made(DFIM_4KW)
    x = points(network, 4_000, beyond=0.0)
    exported = compiled(tmp_path, motor, checked=checked)
    out = exported.floats(x)
    best = found.optimum(*x.T)
    beyond = best.limited | ~best.feasible
    free = dfim_optimum.point(found.machine, *x.T, *references(found, x[:, 1]), dfim_optimum.stator_frequency(found.machine, *x.T, found.limits))
    flux_alone = dfim_optimum.free_flux(found.machine, x[:, 1])
    clear = np.min([abs(used - 1) for used in usage(free, found.limits)] + [abs(flux_alone / found.limits.phi_r - 1)], axis=0) > 1e-4
    assert 0.05 < np.mean(beyond) < 0.95 and np.mean(clear) > 0.95
    assert np.array_equal((out["flag"] == 2)[clear], beyond[clear])
    assert np.array_equal((out["flag"] == 1)[clear], (best.capped & ~beyond)[clear])
    assert np.all(out["optimum"][out["flag"] == 2] == -1)
    kept = clear & ~beyond
    wanted = np.column_stack([best.phi_r, best.i_rd])[kept]
    assert np.all(np.abs(out["optimum"][kept] / wanted - 1) <= 64 * UNIT)


@needs_gcc
def test_compiled_dfim_currents_make_torque_and_flux(tmp_path):
    """From the flux equations and the torque of two vectors, with braking torque too; and the stator frequency at 100 times the flux as speed."""
    found, network = made(DFIM_4KW)
    m, rng = found.machine, np.random.default_rng(5)
    x = np.column_stack([rng.uniform(-25, 25, 2000), rng.uniform(0.1, 1, 2000), rng.uniform(-3, 8, 2000)]).astype(np.float32).astype(float)
    out = Exported(tmp_path, export.c_name(m.name), export.c_header(found, network), main=DFIM_MAIN).references(x)
    i_s, i_r = out[:, 0] + 1j * out[:, 1], x[:, 2] + 1j * out[:, 2]
    phi_r = m.L_r * i_r + m.M * i_s
    omega_s = dfim_optimum.stator_frequency(m, 100 * x[:, 1], x[:, 0], found.limits)
    assert np.all(abs(out[:, 3] / omega_s - 1) <= 64 * UNIT)
    size = m.L_r * abs(i_r) + m.M * abs(i_s)
    assert np.all(abs(phi_r - x[:, 1]) <= 64 * UNIT * size)
    torque = 1.5 * m.p * m.M * (np.conj(i_r) * i_s).imag
    assert np.all(abs(torque - x[:, 0]) <= 64 * UNIT * 1.5 * m.p * m.M * abs(i_r) * abs(i_s))


def references(found, torque):
    """Return what the formula gives before any inverter limit."""
    phi_r = np.minimum(dfim_optimum.free_flux(found.machine, torque), found.limits.phi_r)
    return phi_r, dfim_optimum.free_i_rd(found.machine, phi_r)


def usage(point, limits):
    return point.V_s / limits.V_s, point.V_r / limits.V_r, np.hypot(point.i_sd, point.i_sq) / limits.I_s, np.hypot(point.i_rd, point.i_rq) / limits.I_r


def harsh(seed):
    """Return a network whose neurons saturate, cancel and differ in size by orders of magnitude."""
    rng = np.random.default_rng(seed)
    hidden = int(rng.integers(1, 12))
    scale = 10.0 ** rng.uniform(-2, 1.3, hidden)
    W1, B1 = rng.normal(size=(hidden, 2)) * scale[:, None], rng.normal(size=hidden) * scale
    W2, B2 = rng.normal(size=(2, hidden)) * 10.0 ** rng.uniform(-2, 0.7), rng.normal(size=2)
    return Network(W1, B1, W2, B2, Range([10.0, 0.5], [200.0, 9.0]), Range([-8.0, 0.2], [0.0, 7.0]))


@pytest.fixture(scope="module")
def some_map():
    speed, torque = np.linspace(16, 160, 5), np.linspace(1, 14, 4)
    return loss_map.loss_map(IPMSM_2200W, speed, torque, V_max=300.0, I_max=9.0)


@needs_gcc
@pytest.mark.parametrize("seed", range(6))
def test_a_harsh_network_stays_exact_and_defined_too(some_map, tmp_path, seed):
    """Nothing overflows whatever the weights, and the stated bound still holds."""
    network = harsh(seed)
    q15, exported, q = fixed_point.quantised(network), compiled(tmp_path, (some_map, network)), q15_points(5_000)
    got = exported.q15(q)
    assert np.array_equal(got, q15.evaluate(q))
    x = np.clip(q15.from_q15(q), network.inputs.low, network.inputs.high)
    assert np.all(np.abs(got * q15.y_scale / 2**15 - within_full_scale(q15, network.predict(x))) <= q15.bound)
    x = points(network, 5_000)
    wanted = network.predict(np.clip(x, network.inputs.low, network.inputs.high))
    assert np.all(np.abs(exported.floats(x)["network"] - wanted) <= fixed_point.float32_bound(network))


@pytest.mark.parametrize("seed", range(20))
def test_no_sum_of_the_q15_network_can_leave_32_bits(seed):
    q15 = fixed_point.quantised(harsh(seed))
    for W, B in ((q15.W1, q15.B1), (q15.W2, q15.B2)):
        assert np.all(np.abs(W) < 2**15)
        assert np.all(np.abs(W).sum(axis=1) * 2**15 + np.abs(B) + 2**14 < 2**31)


def test_the_tanh_table_interpolates_within_its_bound():
    """Largest |tanh''| is 4/(3√3); h²/8 of it, half a step for the entry (one where it saturates), half for the result."""
    bits = np.array([15 - 2])  # 28 fractional bits: 8 units of the argument fit
    z = np.random.default_rng(0).integers(-(9 << 27), 9 << 27, 100_000)
    z[:3] = 0, (8 << 28) - 1, -(8 << 28)
    error = np.abs(fixed_point._tanh(z, bits) / 2**15 - np.tanh(z / 2.0**28))
    assert np.max(error) <= 4 / (3 * np.sqrt(3)) / 64**2 / 8 + 2.0**-15 + 2.0**-16 + 2.0**-21
    assert np.all(fixed_point._tanh(-z, bits) == -fixed_point._tanh(z, bits))


def test_the_float_emulation_errs_within_the_bound(motor):
    """tanh correctly rounded here, so half a unit for it."""
    _, network = motor
    x = points(network, 5_000, beyond=0.0)
    assert np.all(np.abs(fixed_point.float32_predict(network, x) - network.predict(x)) <= fixed_point.float32_bound(network, tanh_ulps=0.5))


def test_the_table_holds_the_map_with_flags(motor):
    found, _ = motor
    m = found.machine
    lines = [line for line in export.table_csv(found).splitlines() if not line.startswith("#")]
    table = list(csv.DictReader(lines))
    assert len(table) == found.omega_m.size * found.T_e.size
    flags = np.array([int(row["flag"]) for row in table]).reshape(found.best.feasible.shape)
    assert np.array_equal(flags == 2, ~found.best.feasible) and np.array_equal(flags == 1, found.best.limited)
    for row in table:
        if row["flag"] == "2":
            assert {row[name] for name in row if name not in ("omega_m", "T_e", "flag")} == {""}
            continue
        if m is DFIM_4KW:
            torque = 1.5 * m.p * m.M * (float(row["i_sq"]) * float(row["i_rd"]) - float(row["i_sd"]) * float(row["i_rq"]))
        else:
            torque = pmsm.torque(m, *pmsm.branch_currents(m, m.P * float(row["omega_m"]), float(row["i_d"]), float(row["i_q"])))
        assert abs(torque / float(row["T_e"]) - 1) < 1e-5  # seven digits are written


def test_onnx_gives_the_same_currents(motor):
    """By the reference evaluator of the package onnx, in single precision."""
    from onnx.reference import ReferenceEvaluator

    _, network = motor
    x = points(network, 2_000, beyond=0.0)
    (got,) = ReferenceEvaluator(export.onnx_model(network, "motor")).run(None, {"x": x.astype(np.float32)})
    assert np.all(np.abs(got - network.predict(x)) <= fixed_point.float32_bound(network))


def test_files_are_written_whole_and_named_after_the_machine(some_map, tmp_path):
    made = export.files(some_map, harsh(0))
    assert set(made) == {"ipmsm_2_2_kw.h", "ipmsm_2_2_kw.csv", "ipmsm_2_2_kw.onnx"}
    assert {path.name: path.read_bytes() for path in export.write(tmp_path / "new", made)} == made


@pytest.mark.parametrize(("name", "wanted"), [("IPMSM 2.2 kW", "ipmsm_2_2_kw"), ("900 W", "motor_900_w"), ("Größe */", "gr_e")])
def test_a_machines_name_becomes_an_identifier(name, wanted):
    assert export.c_name(name) == wanted


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f, n: (f, Network(n.W1, n.B1, n.W2, n.B2, n.inputs, n.targets, "logistic")), "only 'tanh'"),
        (lambda f, n: (f, Network(n.W1 * 1e4, n.B1, n.W2, n.B2, n.inputs, n.targets)), "too large for Q15"),
        (lambda f, n: (f, Network(n.W1, n.B1, n.W2[:1], n.B2[:1], n.inputs, Range([0.0], [1.0]))), "must be 2 and 2"),
        (lambda f, n: (loss_map.loss_map(f.machine.changed(R_s=0.0), f.omega_m, f.T_e, V_max=300, I_max=9), n), "R_s = 0 ohm"),
    ],
)
def test_what_cannot_be_exported_is_refused(some_map, change, message):
    with pytest.raises(ValueError, match=message):
        export.c_header(*change(some_map, harsh(3)))


def test_a_name_without_letters_is_refused():
    with pytest.raises(ValueError, match="must hold a letter"):
        export.c_name("±∞")
