"""Drive models, controllers and evidence behind the replication notebooks.

Import the module you need (``from drivelib import pmsm``); nothing heavy is imported here.
"""

import functools
import hashlib
import os
from pathlib import Path

__version__ = "0.1.0"


@functools.cache
def sources_digest():
    """Return the digest of all of drivelib's sources.

    It names numba's cache folder: numba keys its cache by the file of the compiled function alone and would miss a
    change in a function that it calls from another file.
    """
    package = Path(__file__).resolve().parent
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        digest.update(source.relative_to(package).as_posix().encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()[:16]


os.environ.setdefault("NUMBA_CACHE_DIR", str(Path(__file__).resolve().parent.parent / "build" / "numba" / sources_digest()))
