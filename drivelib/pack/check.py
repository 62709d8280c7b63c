"""Hold freshly computed files against the committed ones and name the first difference."""

import csv
import io
import itertools
import json
import math

from drivelib import environment, ledger, paths
from drivelib.pack import freshness

TOLERANCE = ledger.TOLERANCE  # where byte identity is not claimed


def differences(stage, chosen):
    """Return one line per committed file that a fresh run in ``stage`` does not reproduce, or that no run writes.

    Byte for byte on the reference platform; elsewhere numbers within a tolerance, and pictures and
    notebooks are not compared.
    """
    exact = environment.is_reference()
    found = []
    for id_ in chosen:
        for committed in freshness.artefacts(id_):
            name = committed.relative_to(paths.root())
            fresh = stage / name
            if not fresh.exists():
                continue  # its run failed and is reported as such
            if not committed.exists():
                found.append(f"{name.as_posix()}: not committed")
            elif exact and freshness.file_digest(committed) != freshness.file_digest(fresh):
                found.append(f"{name.as_posix()}: {first_difference(committed, fresh, 0.0)}")
            elif not exact and committed.suffix in (".csv", ".json"):
                difference = first_difference(committed, fresh, TOLERANCE)
                if difference:
                    found.append(f"{name.as_posix()}: {difference}")
    return found


def orphans(known):
    """Return published files that belong to no item."""
    expected = {path for id_ in known for path in freshness.artefacts(id_)}
    there = (path for path in (paths.root() / "figures").rglob("*") if path.is_file())
    return sorted(path.relative_to(paths.root()).as_posix() for path in there if path not in expected)


def first_difference(committed, fresh, tolerance):
    """Return the first difference of two files in words, or "" where there is none beyond ``tolerance``."""
    compare = {".csv": _csv, ".json": _json, ".ipynb": _json}.get(committed.suffix)
    if compare is None:
        return "the picture differs"
    try:
        return compare(committed.read_text(encoding="utf-8"), fresh.read_text(encoding="utf-8"), tolerance)
    except ValueError as error:
        return f"not readable ({error})"


def _csv(committed, fresh, tolerance):
    tables = [list(csv.reader(io.StringIO(text))) for text in (committed, fresh)]
    header = next((row for row in tables[1] if row and not row[0].startswith("#")), [])
    for number, (old, new) in enumerate(itertools.zip_longest(*tables), start=1):
        if old is None or new is None or len(old) != len(new):
            return f"line {number}: committed {old}, computed {new}"
        for column, (a, b) in enumerate(zip(old, new, strict=True)):
            if not _same(a, b, tolerance):
                name = header[column] if column < len(header) else column + 1
                return f"line {number}, column {name}: committed {a}, computed {b}"
    return "" if tolerance else "line ends differ"


def _json(committed, fresh, tolerance):
    return _walk(json.loads(committed), json.loads(fresh), "", tolerance) or ("" if tolerance else "layout differs")


def _walk(old, new, where, tolerance):
    if isinstance(old, dict) and isinstance(new, dict):
        for key in {**new, **old}:
            if key in ("artefacts",) and tolerance:
                continue
            if key not in old or key not in new:
                return f"{where}/{key}: only {'computed' if key in new else 'committed'}"
            found = _walk(old[key], new[key], f"{where}/{key}", tolerance)
            if found:
                return found
        return ""
    if isinstance(old, list) and isinstance(new, list):
        for index, (a, b) in enumerate(zip(old, new, strict=False)):
            name = a.get("id", index) if isinstance(a, dict) else index
            found = _walk(a, b, f"{where}/{name}", tolerance)
            if found:
                return found
        return "" if len(old) == len(new) else f"{where}: {len(old)} entries committed, {len(new)} computed"
    if _same(old, new, tolerance):
        return ""
    if "/data/image/" in where:
        return f"{where}: the picture differs"
    shown = [str(value) if len(str(value)) < 120 else str(value)[:120] + "…" for value in (old, new)]
    return f"{where}: committed {shown[0].strip()}, computed {shown[1].strip()}"


def _same(old, new, tolerance):
    if old == new:
        return True
    if not tolerance:
        return False
    try:
        return math.isclose(float(old), float(new), rel_tol=tolerance, abs_tol=tolerance * 1e-3)
    except (TypeError, ValueError):
        return False
