"""Execute a notebook's code cells in this process, without a kernel: ``python -m drivelib.pack.cells ITEM PARAMETERS``.

An emulator runs one plain process; a kernel would start a second one outside it. Files go where the runner's
environment says. Beside them goes ``raw.json``, a digest of every number left in the notebook's namespace, because
rounded files hide what happens in the last bits.
"""

import hashlib
import json
import os
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np

from drivelib import notebook, paths, record

DEPTH = 4


def execute(item, given):
    """Run all code cells with some parameters changed; return the namespace that they leave.

    Raises
    ------
    ValueError
        If a parameter does not exist.
    """
    content = notebook.read(paths.notebook(item))
    notebook.check_overrides(given, notebook.parameters(content, item), item)
    namespace = {"__name__": "__main__"}
    for number, cell in enumerate(content["cells"], start=1):
        if cell["cell_type"] == "code":
            exec(compile(notebook.source(cell), f"{item}, cell {number}", "exec"), namespace)
            if notebook.PARAMETERS_TAG in cell["metadata"].get("tags", ()):
                namespace.update(given)
    return namespace


def raw(namespace):
    """Return ``{name: digest}`` of every float and array that the names hold, to the last bit."""
    found = {}
    for name, value in namespace.items():
        parts = [] if name.startswith("_") else list(_numbers(value, DEPTH))
        if parts:
            found[name] = hashlib.sha256(b"".join(parts)).hexdigest()
    return found


def _numbers(value, depth):
    if isinstance(value, (float, np.floating)):
        yield np.float64(value).tobytes()
    elif isinstance(value, np.ndarray) and value.dtype.kind == "f":
        yield value.tobytes()
    elif depth and isinstance(value, dict):
        for each in value.values():
            yield from _numbers(each, depth - 1)
    elif depth and isinstance(value, (list, tuple)):
        for each in value:
            yield from _numbers(each, depth - 1)
    elif depth and is_dataclass(value) and not isinstance(value, type):
        for field in fields(value):
            yield from _numbers(getattr(value, field.name), depth - 1)


if __name__ == "__main__":
    digests = raw(execute(sys.argv[1], json.loads(sys.argv[2])))
    record.write_atomically(Path(os.environ[record.PUBLISH], "raw.json"), json.dumps(digests, indent=1).encode())
