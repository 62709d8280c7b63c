"""Compile exported headers with the system's C compiler and call them; the motors and the points that tests/test_export_*.py do it at."""

import functools
import itertools
import shutil
import subprocess

import numpy as np
import pytest

from drivelib import dfim_map, dfim_optimum, export, fixed_point, loss_map, pmsm
from drivelib.dfim_machines import DFIM_4KW
from drivelib.machines import IPMSM, IPMSM_2200W, SPMSM
from drivelib.neural import Network, Range

COMPILER = shutil.which("gcc")
FLAGS = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror", "-O2"]
CHECKED = ["-fsanitize=undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
needs_gcc = pytest.mark.skipif(COMPILER is None, reason="needs gcc")

UNIT = 2.0**-24  # relative rounding error of single precision
CURRENT = {IPMSM: 6.0, SPMSM: 8.0, IPMSM_2200W: 9.12}
TIGHT = dfim_optimum.DfimLimits(phi_r=0.85, V_s=170.0, V_r=150.0, I_s=14.0, I_r=14.0)

MAIN = """
#include <stdio.h>
#include "{p}.h"
int main(int argc, char **argv)
{{
    (void)argv;
    if (argc > 1) {{
        int16_t in[2], out[3];
        while (fread(in, sizeof in[0], 2, stdin) == 2) {{
            out[2] = (int16_t){p}_network_q15(in[0], in[1], &out[0], &out[1]);
            if (fwrite(out, sizeof out[0], 3, stdout) != 3) return 1;
        }}
        return 0;
    }}
    float x[2];
    while (fread(x, sizeof x[0], 2, stdin) == 2) {{
        float out[7] = {{0.0f, 0.0f, 0.0f, -1.0f, -1.0f, 0.0f, 0.0f}};
        out[6] = (float){p}_network(x[0], x[1], &out[0], &out[1]);
        out[2] = (float){p}_optimum(x[0], x[1], &out[3], &out[4]);
        out[5] = {p}_torque_limit(x[0]);
        if (fwrite(out, sizeof out[0], 7, stdout) != 7) return 1;
    }}
    return 0;
}}
"""

DFIM_MAIN = """
#include <stdio.h>
#include "{p}.h"
int main(void)
{{
    float x[3], out[4];
    while (fread(x, sizeof x[0], 3, stdin) == 3) {{
        {p}_currents(x[0], x[1], x[2], &out[0], &out[1], &out[2]);
        out[3] = {p}_stator_frequency(100.0f * x[1], x[0]);
        if (fwrite(out, sizeof out[0], 4, stdout) != 4) return 1;
    }}
    return 0;
}}
"""


class Exported:
    """A compiled header; ``checked`` stops at undefined behaviour."""

    def __init__(self, folder, prefix, header, *, checked=True, main=MAIN):
        (folder / f"{prefix}.h").write_text(header)
        source, self.program = folder / f"{prefix}.c", folder / (prefix + ("_checked" if checked else ""))
        source.write_text(main.format(p=prefix))
        command = [COMPILER, *FLAGS, *(CHECKED if checked else []), str(source), "-o", str(self.program), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert not done.stderr

    def _run(self, data, *arguments):
        done = subprocess.run([str(self.program), *arguments], input=data, capture_output=True)
        assert done.returncode == 0, done.stderr.decode()
        assert not done.stderr
        return done.stdout

    def q15(self, q):
        """Return the Q15 network's outputs, shape (n, 2), and its status, at int16 inputs of shape (n, 2)."""
        out = np.frombuffer(self._run(np.asarray(q, np.int16).tobytes(), "q15"), np.int16).reshape(-1, 3)
        return out[:, :2], out[:, 2]

    def references(self, x):
        """Return (i_sd, i_sq, i_rq, ω_s) of a DFIM at torque, flux and rotor d current, shape (n, 4)."""
        return np.frombuffer(self._run(np.asarray(x, np.float32).tobytes()), np.float32).reshape(-1, 4).astype(float)

    def floats(self, x):
        """Return {"network", "status", "flag", "optimum", "limit"} at inputs of shape (n, 2)."""
        out = np.frombuffer(self._run(np.asarray(x, np.float32).tobytes()), np.float32).reshape(-1, 7).astype(float)
        return {"network": out[:, :2], "flag": out[:, 2].astype(int), "optimum": out[:, 3:5], "limit": out[:, 5], "status": out[:, 6].astype(int)}


def compiled(tmp_path, motor, **options):
    """Return a motor's compiled header; a second one in the same folder replaces the first."""
    found, network = motor
    return Exported(tmp_path, export.c_name(found.machine.name), export.c_header(found, network), **options)


@functools.cache
def made(machine):
    """Return a map and its trained network."""
    speed, torque = np.linspace(0.1, 1.5, 15) * machine.omega_m_rated, np.linspace(0.1, 1, 10) * machine.T_rated
    if machine is DFIM_4KW:
        found = dfim_map.dfim_map(machine, speed, torque, TIGHT)
        return found, loss_map.trained(loss_map.training_data(found), hidden=12, rms_percent=1.5)
    found = loss_map.loss_map(machine, speed, torque, V_max=pmsm.voltage_limit(machine), I_max=CURRENT[machine])
    return found, loss_map.trained(loss_map.training_data(found), hidden=16, rms_percent=0.3)


def harsh(seed):
    """Return a network whose neurons saturate, cancel and differ in size by orders of magnitude."""
    rng = np.random.default_rng(seed)
    hidden = int(rng.integers(1, 12))
    scale = 10.0 ** rng.uniform(-2, 1.3, hidden)
    W1, B1 = rng.normal(size=(hidden, 2)) * scale[:, None], rng.normal(size=hidden) * scale
    W2, B2 = rng.normal(size=(2, hidden)) * 10.0 ** rng.uniform(-2, 0.7), rng.normal(size=2)
    return Network(W1, B1, W2, B2, Range([10.0, 0.5], [200.0, 9.0]), Range([-8.0, 0.2], [0.0, 7.0]))


def quantised(motor):
    found, network = motor
    return fixed_point.quantised(network, None if found.machine is DFIM_4KW else found.machine)


def within_full_scale(q15, values):
    return np.clip(values, -q15.y_scale, q15.y_scale * (1 - 2.0**-15))


def single_range(network):
    """Return the training range as the header holds it."""
    return fixed_point.single(network.inputs.low), fixed_point.single(network.inputs.high)


def points(network, n):
    """Return operating points all over the training range, its corners among them."""
    low, high = single_range(network)
    x = np.random.default_rng(1).uniform(low, high, (n, 2)).astype(np.float32).astype(float)
    x[:4] = [[low[0], low[1]], [low[0], high[1]], [high[0], low[1]], high]
    return np.clip(x, low, high)


def outside_points(network, n=4_000):
    """Return operating points of either sign up to 130 % of the range, none of them in it; standstill and no torque among them."""
    low, high = single_range(network)
    x = np.random.default_rng(3).uniform(-1.3 * high, 1.3 * high, (n, 2))
    x[: n // 4, 1] = np.linspace(-low[1], low[1], n // 4)
    edges = np.array(list(itertools.product(*([-1.3 * b, -b, -a, 0.0, a / 2, a, b, 1.3 * b] for a, b in zip(low, high, strict=True)))))
    x = np.concatenate([x, edges]).astype(np.float32).astype(float)
    return x[np.any((x < low) | (x > high), axis=1)]


def made_torque(machine, omega_m, currents):
    return pmsm.torque(machine, *pmsm.branch_currents(machine, machine.P * omega_m, *currents.T))
