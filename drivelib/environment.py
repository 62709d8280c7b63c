"""The pins under which published numbers are computed, and the check that they are in force.

Each pin was seen to be needed or harmless for identical bytes on AVX-512 and AVX2 processors; libraries read
them when they load, so they must be set before Python starts.
"""

import os
import sys
from pathlib import Path

PINS = {
    # the same instructions on every processor with AVX2
    "OPENBLAS_CORETYPE": "Haswell",
    "NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR",
    "ATEN_CPU_CAPABILITY": "avx2",
    "MKL_CBWR": "COMPATIBLE",
    "NUMBA_CPU_NAME": "haswell",
    "NUMBA_CPU_FEATURES": "",
    # one thread: sums in one order
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    "NUMEXPR_NUM_THREADS": "1",
    # no hidden input
    "PYTHONHASHSEED": "0",
    "PYTHONNOUSERSITE": "1",
    "MPLBACKEND": "agg",
    "TZ": "UTC",
    "LC_ALL": "C.UTF-8",
    "LANG": "C.UTF-8",
    "SOURCE_DATE_EPOCH": "1000000000",
}

# Without these a process would not find itself or its libraries; everything else is dropped.
KEPT = ("PATH", "SYSTEMROOT", "TEMP", "TMP", "TMPDIR", "LD_LIBRARY_PATH", "DRIVELIB_ROOT")


def pinned(base=None, **extra):
    """Return a copy of the environment ``base`` (default: this process's) with the pins and ``extra`` set."""
    environment = dict(os.environ if base is None else base)
    environment.update(PINS)
    environment.update({name: str(value) for name, value in extra.items()})
    return environment


def kernel(private, **extra):
    """Return the environment of a notebook's kernel: pins, and no user's start-up files or settings.

    ``private`` is a folder of this run alone.
    """
    kept = {name: os.environ[name] for name in KEPT if name in os.environ}
    homes = ("HOME", "USERPROFILE", "IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR", "MPLCONFIGDIR")
    return pinned(kept, **{name: private for name in homes}, **extra)


def missing_pins():
    """Return the names of the pins that are not in force in this process.

    Any fixed hash seed will do: check mode draws another one on purpose, and no result may depend on it.
    """
    seed = os.environ.get("PYTHONHASHSEED", "")
    fixed = {"PYTHONHASHSEED": PINS["PYTHONHASHSEED"]} if seed.isdecimal() else {}
    return sorted(name for name, value in PINS.items() if (os.environ | fixed).get(name) != value)


def provenance():
    """Return what computed a result: Python, packages and processor, for the ignored run record."""
    import platform
    from importlib import metadata

    wanted = ("numpy", "scipy", "matplotlib", "torch", "numba", "scikit-fuzzy", "sympy", "papermill")
    return {
        "python": sys.version.split()[0],
        "platform": platform.platform(),
        "processor": _processor(),
        "packages": {name: metadata.version(name) for name in wanted},
    }


def is_reference():
    """Return whether byte identity is claimed here: Linux on x86-64 with AVX2."""
    import platform

    from drivelib.bootstrap import read_cpu_flags

    flags = read_cpu_flags()
    return sys.platform == "linux" and platform.machine() == "x86_64" and flags is not None and "avx2" in flags


def _processor():
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return "unknown"
