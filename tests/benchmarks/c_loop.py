"""Compile ``dfim_loop.c`` with the system's gcc and run scenarios through it."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np

from drivelib import dfim, dfim_drive

SOURCE = Path(__file__).with_name("dfim_loop.c")
LANES = 64
FLAGS = ("-O3", "-ffp-contract=off", "-shared", "-fPIC")
# Vector loops need what our own compiler grants anyway: no errno, no floating-point traps. The bits are the same.
FREE = ("-fno-math-errno", "-fno-trapping-math", "-fopenmp-simd")
LIMITS = ("torque", "stator voltage", "rotor voltage", "stator current", "rotor current")


def available():
    """Return whether the C compiler is at hand."""
    return shutil.which("gcc") is not None


def build(folder, march="haswell", free=True):
    """Compile for one instruction set, free of traps or as the standard wants it; return the loaded library."""
    target = Path(folder) / f"dfim_loop_{march}_{free}.so"
    subprocess.run(["gcc", f"-march={march}", *FLAGS, *(FREE if free else ()), str(SOURCE), "-o", str(target), "-lm"], check=True)
    return ctypes.CDLL(str(target))


class Inputs:
    """Scenarios as the C loop takes them: element k of drive j stands at k · lanes + j.

    All scenarios share duration, period and the samples at which profiles change; PI speed control, averaged
    inverters, current model.
    """

    def __init__(self, scenarios, window=None):
        first, lanes = scenarios[0], len(scenarios)
        self.steps, h = first.steps, first.period
        begin, end = (0.0, first.duration) if window is None else window
        self.window = round(begin / h), round(end / h)
        schedules = [dfim_drive.schedule(s) for s in scenarios]
        self.changes = np.minimum(schedules[0][0], np.iinfo(np.int32).max).astype(np.int32)
        if any(not np.array_equal(schedules[0][0], changes) for changes, _ in schedules):
            raise ValueError("scenarios change their profiles at different samples: the C loop takes one schedule")
        self.profiles = np.ascontiguousarray(np.stack([values for _, values in schedules], axis=-1))
        settings = [dfim_drive.drive_settings(s) for s in scenarios]
        kept = [name for name in settings[0]._fields if name not in ("estimator", "corner", "substeps", "carrier_frequency", "V_dc_s", "V_dc_r")]
        self.settings = np.array([[float(getattr(s, name)) for s in settings] for name in kept])
        self.plant = np.array([dfim.coefficients(s.machine) for s in scenarios]).T.copy()
        self.gains = np.array([s.speed_gains for s in scenarios]).T.copy()
        self.start = np.array([dfim_drive.initial_state(s) for s in scenarios]).T.copy()
        self.lanes = lanes

    def run(self, library):
        """Return final states (16, lanes), indices (3, lanes) and first hits (5, lanes; −1 for never)."""
        state, index, hit = self.start.copy(), np.zeros((3, self.lanes)), np.full((5, self.lanes), -1.0)
        if self.lanes not in (1, LANES):
            raise ValueError(f"{self.lanes} scenarios: the C loop takes 1 or {LANES}")
        function = library.run_one if self.lanes == 1 else library.run_many
        values = (state, self.plant, self.settings, self.gains, self.changes, self.profiles)
        function(
            ctypes.c_int(self.steps), *(ctypes.c_void_p(v.ctypes.data) for v in values), *map(ctypes.c_int, self.window),
            ctypes.c_void_p(index.ctypes.data), ctypes.c_void_p(hit.ctypes.data),
        )  # fmt: skip
        return state, index, hit
