"""Drive models, controllers and evidence behind the replication notebooks.

Import the module you need (``from drivelib import pmsm``); nothing heavy is imported here.
"""

import hashlib
import os
from pathlib import Path

__version__ = "0.1.0"


def _numba_cache():
    """Return a cache folder named by the digest of all sources.

    numba keys its cache by the file of the compiled function alone and would miss a change in a function
    that it calls from another file.
    """
    package = Path(__file__).resolve().parent
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        digest.update(source.relative_to(package).as_posix().encode() + b"\0" + source.read_bytes())
    return package.parent / "build" / "numba" / digest.hexdigest()[:16]


os.environ.setdefault("NUMBA_CACHE_DIR", str(_numba_cache()))
