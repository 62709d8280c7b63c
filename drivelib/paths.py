"""Where things lie, independent of the working directory.

``DRIVELIB_ROOT`` points the pack at another tree (the tests' miniature packs use it).
"""

import os
from pathlib import Path

_HERE = Path(__file__).resolve().parent.parent

READ = "DRIVELIB_READ"  # set by the runner where a notebook is to read results that are not published


def root():
    """Return the folder that holds notebooks/, figures/ and the ledgers."""
    return Path(os.environ.get("DRIVELIB_ROOT") or _HERE)


def ledgers():
    """Return the folder of the claims ledgers."""
    return root() / "drivelib" / "papers"


def notebook(item):
    """Return the path of an item's notebook."""
    return root() / "notebooks" / f"{item}.ipynb"


def figure(item, suffix):
    """Return the published path of one artefact: ``suffix`` is png, svg, csv or json."""
    return root() / "figures" / f"{item}.{suffix}"


def results():
    """Return the folder below which a notebook reads the results of other items: the published ones, or a check's."""
    return Path(os.environ.get(READ) or root() / "figures")


def build(*parts):
    """Return a path below the ignored build folder."""
    return root().joinpath("build", *parts)
