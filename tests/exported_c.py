"""Compile exported headers with the system's C compiler and call them."""

import shutil
import subprocess

import numpy as np
import pytest

COMPILER = shutil.which("gcc")
FLAGS = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror", "-O2"]
CHECKED = ["-fsanitize=undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
needs_gcc = pytest.mark.skipif(COMPILER is None, reason="needs gcc")

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
