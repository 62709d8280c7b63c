"""Rows of the closed DFIM loop: one drive, and many."""

import os
import subprocess
import sys
import tempfile
import time

import c_loop
import joblib
import numpy as np
from measure import Row, in_turn, pairs

from drivelib import dfim, dfim_drive, dfim_many, environment
from drivelib.dfim_lanes import LANES
from drivelib.dfim_loop import LIMITS, empty_record, run_drive
from drivelib.dfim_scenario import DEFAULT_SCENARIO
from drivelib.encoder import sensor
from drivelib.speed_law import FuzzySpeed, NetworkSpeed, PiSpeed

DRIVE = DEFAULT_SCENARIO.changed(
    name="benchmark", duration=2.0, speed_reference=((0.0, 100.0),), load_torque=((0.0, 0.0), (1.0, 25.0), (1.5, 0.0))
)
FUZZY = FuzzySpeed(0.2, 50.0, 0.5, "incremental")
# The paper's network has one input, here as large as figure 8's: 15 hidden neurons.
NETWORK = NetworkSpeed(np.full((15, 1), 0.05), np.linspace(-1.0, 1.0, 15), np.full(15, 4.0), activation="logistic")

LABELS = {
    "haswell": "C, same instructions",
    "haswell free": "the same, -fno-trapping-math",
    "native free": "C, native, -fno-trapping-math",
    "haswell simd": "C with SIMD",
    "native simd": "C with SIMD, native",
}


def loop(scenario, speed=None):
    """Return a function that runs the compiled loop alone: no preparation, no record."""
    law = (PiSpeed(*scenario.speed_gains) if speed is None else speed).law()
    start, record = dfim_drive.initial_state(scenario), empty_record(scenario.steps, 0)
    plant, settings = dfim.coefficients(scenario.machine), dfim_drive.drive_settings(scenario)
    changes, profiles = dfim_drive.schedule(scenario)
    exact = sensor(None, 0, scenario.period)

    def run():
        hits = np.full(len(LIMITS), -1, dtype=np.int64)
        run_drive(scenario.steps, start.copy(), plant, settings, law, changes, profiles, (0, scenario.steps), 0, record, np.zeros(4), hits, exact)

    return run


def rows(repetitions):
    """Return the rows of one drive and of many."""
    many = [DRIVE.changed(omega_n=15.0 + k / 10) for k in range(LANES)]
    switching = DRIVE.changed(inverter="switching")
    functions = {
        "pi": loop(DRIVE), "fuzzy": loop(DRIVE, FUZZY), "network": loop(DRIVE, NETWORK), "pwm": loop(switching),
        "lanes": lambda: dfim_many.block([(scenario, None) for scenario in many]),
        "fuzzy lanes": lambda: dfim_many.block([(scenario, FUZZY) for scenario in many]),
        "network lanes": lambda: dfim_many.block([(scenario, NETWORK) for scenario in many]),
    }  # fmt: skip
    if c_loop.available():
        with tempfile.TemporaryDirectory() as folder:
            one, abreast = c_loop.Inputs([DRIVE]), c_loop.Inputs(many)
            for march in ("haswell", "native"):
                standard, free = c_loop.build(folder, march, free=False), c_loop.build(folder, march)
                functions[march] = lambda library=standard: one.run(library)
                functions[f"{march} free"] = lambda library=free: one.run(library)
                functions[f"{march} simd"] = lambda library=free: abreast.run(library)
            times = dict(zip(functions, in_turn(functions.values(), repetitions, inner=15), strict=True))
    else:
        times = dict(zip(functions, in_turn(functions.values(), repetitions, inner=15), strict=True))
    steps = DRIVE.steps
    step = {"unit": "ns", "scale": 1e9}

    def against_c(what, name, limit, reference="haswell", units=steps):
        label = LABELS[reference]
        if reference not in times:
            return Row(what, label, limit=limit, note="no C compiler")
        return Row(what, label, pairs(times[name], times[reference], units), limit=limit, **step)

    def many_at_once(what, name):
        return Row(what, "one by one", pairs(times[f"{name} lanes"], [LANES * t for t in times[name]], steps * LANES), "faster", **step)

    return [
        against_c("DFIM loop, averaged, per step", "pi", 1.3),
        against_c("the same", "pi", None, "haswell free"),
        against_c("the same", "pi", None, "native free"),
        against_c("with the fuzzy controller", "fuzzy", 2.5),
        against_c("with a network of 15 neurons", "network", 2.5),
        Row("with switching PWM", "our averaged loop", pairs(times["pwm"], times["pi"], steps), limit=10, **step),
        against_c("64 drives abreast, per step and drive, preparation included", "lanes", 2, "haswell simd", steps * LANES),
        against_c("the same", "lanes", None, "native simd", steps * LANES),
        many_at_once("64 drives abreast with the fuzzy controller", "fuzzy"),
        many_at_once("64 drives abreast with a network of 15 neurons", "network"),
        *ensemble_rows(repetitions),
    ]


def ensemble_rows(repetitions, count=1280):
    """Return the rows of the whole ensemble on all cores, scenarios built as it runs."""

    def run():
        dfim_many.simulate_many(DRIVE.changed(omega_n=10.0 + 20.0 * k / count) for k in range(count))

    own = in_turn([run], repetitions, clock=time.perf_counter)[0]
    work = in_turn([run], repetitions, clock=time.process_time)[0]
    code = (
        "from drivelib.dfim_drive import simulate; from drivelib.dfim_scenario import DEFAULT_SCENARIO as S\n"
        "simulate(S.changed(duration=2.0, speed_reference=((0.0, 100.0),), load_torque=((0.0, 0.0), (1.0, 25.0), (1.5, 0.0))), every=0)"
    )
    cores = os.cpu_count()

    def process():
        subprocess.run([sys.executable, "-c", code], check=True, env=environment.pinned())

    def single_runs():
        pool(joblib.delayed(one_drive)(10.0 + 20.0 * k / count) for k in range(count))

    with joblib.Parallel(n_jobs=cores) as pool:
        processes, jobs = in_turn([process, single_runs], repetitions, clock=time.perf_counter)
    drive = {"kind": "faster", "scale": 1e3, "unit": "ms"}
    scaled = f"{cores} cores; {count} drives measured, scaled"
    return [
        Row("10,000 drives of 2 s", "", [(t / count * 1e4, 0.0) for t in own], kind="value", limit=15, note=scaled),
        Row("the same, processor time divided by the cores", "", [(t / count / cores * 1e4, 0.0) for t in work], kind="value", note="free of other load"),
        Row("per drive of 2 s, all cores", "a process per drive", pairs(own, processes, count, cores), **drive),
        Row("the same", "joblib over single runs", pairs(own, jobs, count), **drive),
    ]


def one_drive(omega_n):
    """A single run as joblib sends it to its processes."""
    return dfim_drive.simulate(DRIVE.changed(omega_n=omega_n), every=0).peak
