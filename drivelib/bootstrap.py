"""Build ``.venv`` from ``environment.lock``: what both make targets do first.

Standard library only, because it runs before anything is installed::

    python3.11 -m drivelib.bootstrap
"""

import hashlib
import os
import platform
import re
import shutil
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
STAMP = VENV / "drivelib-stamp"
LOCK = ROOT / "environment.lock"
REFERENCE_PYTHON = (3, 11)
DISK_GIB = 3.0  # the environment takes 1.8 GiB, its download 0.4 GiB, unpacking the rest
TORCH_INDEX = "TORCH_INDEX"  # set by the Makefile, overridable


def check_host(version=None, free_bytes=None, cpu_flags=None):
    """Return the warnings for this host; raise SystemExit where installing cannot work.

    Parameters default to what this host has: Python ``version`` (major, minor), ``free_bytes``
    on the disk of the checkout, ``cpu_flags`` (a set, or None where the system does not tell).
    """
    version = sys.version_info[:2] if version is None else version
    free_bytes = shutil.disk_usage(ROOT).free if free_bytes is None else free_bytes
    cpu_flags = read_cpu_flags() if cpu_flags is None else cpu_flags
    if tuple(version) != REFERENCE_PYTHON:
        raise SystemExit(
            f"drivelib: needs Python {REFERENCE_PYTHON[0]}.{REFERENCE_PYTHON[1]}, this is {version[0]}.{version[1]} "
            f"({sys.executable}). Name another one: make PYTHON=/path/to/python3.11 reproduce"
        )
    if free_bytes < DISK_GIB * 2**30:
        raise SystemExit(
            f"drivelib: {free_bytes / 2**30:.1f} GiB free on the disk of {ROOT}, {DISK_GIB:.0f} GiB are needed to install. "
            "Free some room, or clone to another disk"
        )
    warnings = []
    if (sys.platform, platform.machine()) != ("linux", "x86_64"):
        warnings.append(
            f"{sys.platform} on {platform.machine()}: the lock resolves here, but it was not run by us; "
            "results are compared within tolerance, not byte by byte"
        )
    elif cpu_flags is not None and "avx2" not in cpu_flags:
        warnings.append("this processor has no AVX2: results are compared within tolerance, not byte by byte")
    return warnings


def read_cpu_flags():
    """Return the processor's feature flags as a set, None where ``/proc/cpuinfo`` does not exist."""
    try:
        text = Path("/proc/cpuinfo").read_text()
    except OSError:
        return None
    found = re.search(r"^flags\s*:\s*(.*)$", text, re.MULTILINE)
    return set(found.group(1).split()) if found else None


def wanted_stamp():
    """Return what the stamp must hold: the hash of the lock and the Python version."""
    digest = hashlib.sha256(LOCK.read_bytes().replace(b"\r\n", b"\n"))
    digest.update(platform.python_version().encode())
    return digest.hexdigest()


def requirement_blocks(lock_text):
    """Return ``{name: text}``: each requirement of a lock with its hash lines."""
    blocks = re.split(r"\n(?=[A-Za-z0-9])", "\n" + lock_text.replace("\r\n", "\n"))
    result = {}
    for block in blocks[1:]:
        name = re.match(r"[A-Za-z0-9._-]+", block).group().lower()
        result[name] = result.get(name, "") + block.rstrip("\n") + "\n"
    return result


def install():
    """Create ``.venv`` with exactly the locked packages and this project, then write the stamp."""
    python = VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    print(f"drivelib: installing {LOCK.name} into {VENV.name} (about two minutes)", flush=True)
    venv.EnvBuilder(clear=True, with_pip=True, symlinks=os.name != "nt").create(VENV)

    def pip(*arguments):
        # Byte-compiling is done once at the end, in parallel.
        command = [python, "-m", "pip", "install", "-qq", "--disable-pip-version-check", "--no-compile", *arguments]
        subprocess.run(command, check=True, cwd=ROOT)

    # torch alone first: pip asks an extra index once per package, so the index must not be there for the others.
    torch_only = VENV / "torch.lock"
    torch_only.write_text(requirement_blocks(LOCK.read_text())["torch"])
    index = os.environ.get(TORCH_INDEX)
    extra = ["--extra-index-url", index] if index and sys.platform == "linux" else []
    pip("--no-deps", "--require-hashes", "--retries", "0", *extra, "-r", torch_only)
    pip("--require-hashes", "-r", LOCK)
    pip("--no-deps", "--no-build-isolation", "--editable", ".")
    # Some packages ship templates that are no valid Python, so the exit status says nothing.
    subprocess.run([python, "-m", "compileall", "-q", "-j", "0", VENV / "lib"], stdout=subprocess.DEVNULL, check=False)
    STAMP.write_text(wanted_stamp())


def main():
    """Install unless the stamp says that ``.venv`` is what the lock describes."""
    for warning in check_host():
        print(f"drivelib: {warning}", file=sys.stderr)
    if not (STAMP.exists() and STAMP.read_text() == wanted_stamp()):
        install()


if __name__ == "__main__":
    try:
        main()
    except subprocess.CalledProcessError as error:
        sys.exit(f"drivelib: installing failed (pip's message is above; exit status {error.returncode}). No stamp was written: run it again")
