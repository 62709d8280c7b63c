"""What an item's results depend on, as digests; an item is fresh when nothing of it has changed.

The record is local and ignored by git, so in a fresh clone everything is stale and really runs.
"""

import ast
import hashlib
import json
from contextlib import suppress
from dataclasses import asdict
from functools import cache
from pathlib import Path

from drivelib import ledger, notebook, paths
from drivelib.record import write_atomically

PACKAGE = Path(__file__).resolve().parent.parent
ARTEFACTS = ("png", "svg", "csv", "json")


def parts(item):
    """Return ``{part: digest}`` of all that decides an item's results, down to single source files."""
    return _parts(item, None, {})


def _parts(item, modules, seen):
    """Return the parts with the digests of ``modules``, by default of the import closure; ``seen`` keeps digests of files."""
    content = notebook.read(paths.notebook(item.id))
    claims = [asdict(claim) for claim in ledger.claims_of(item.id).values()]
    found = {"cells and parameters": notebook.digest(content), "claims": _digest(json.dumps(claims).encode())}
    found["assumptions"] = _digest(json.dumps(notebook.assumptions(content, item.id)).encode())
    if item.id == ledger.INDEX:
        found["findings"] = _digest(json.dumps([[paper.headlines, paper.findings] for paper in ledger.papers().values()]).encode())
    files = {f"drivelib/{module}": PACKAGE / module for module in (closure(notebook.code(content)) if modules is None else modules)}
    files |= {f"numbers of {needed}": paths.figure(needed, "json") for needed in item.needs}
    files["environment.lock"] = paths.root() / "environment.lock"
    for part, path in files.items():
        if path not in seen:
            seen[path] = file_digest(path) if path.exists() else "missing"
        found[part] = seen[path]
    return found


def artefacts(item_id):
    """Return the published files of an item, the JSON last; the index need not have any but its notebook."""
    return [paths.notebook(item_id), *(paths.figure(item_id, suffix) for suffix in ARTEFACTS)]


def published(item_id):
    """Return ``{relative path: digest}`` of an item's published files; missing files are left out."""
    return {path.relative_to(paths.root()).as_posix(): file_digest(path) for path in artefacts(item_id) if path.exists()}


def record(item_id):
    """Return the run record of an item, or an empty dictionary."""
    try:
        return json.loads(_record_path(item_id).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}


def write_record(item, run_parts, **facts):
    """Write the run record after publishing: digests, artefacts, provenance and durations."""
    content = {"parts": run_parts, "artefacts": published(item.id), **facts}
    write_atomically(_record_path(item.id), json.dumps(content, indent=1).encode())


def why_stale(item, seen=None):
    """Return why an item must run, as a list of reasons; empty when it is fresh.

    A dictionary handed to several calls as ``seen`` keeps the digests of files, most of which many items share.
    """
    known = record(item.id)
    if not known:
        return ["never run here"]
    # As long as neither the cells nor a module has changed, neither has what they import.
    seen = {} if seen is None else seen
    modules = [part.removeprefix("drivelib/") for part in known["parts"] if part.startswith("drivelib/")]
    now = _parts(item, modules, seen)
    if now != known["parts"]:
        now = _parts(item, None, seen)
    reasons = [f"{part} changed" for part in now if known["parts"].get(part) not in (None, now[part])]
    reasons += [f"{part} is new" for part in now if part not in known["parts"]]
    reasons += [f"{part} is gone" for part in known["parts"] if part not in now]
    files = published(item.id)
    for path in artefacts(item.id):
        name = path.relative_to(paths.root()).as_posix()
        same = files.get(name) == known["artefacts"].get(name)
        if name not in files and not same:
            reasons.append(f"{name} is missing")
        elif not same and path.suffix != ".ipynb":
            reasons.append(f"{name} was changed")
        elif not same and not reasons:
            reasons.append(f"the outputs of {name} were changed")
    return reasons


def closure(sources):
    """Return the drivelib files that some code imports, directly or through one another, sorted."""
    found, waiting = set(), list(sources)
    while waiting:
        for module in _imported(waiting.pop()):
            if module not in found:
                found.add(module)
                waiting.append((PACKAGE / module).read_text(encoding="utf-8"))
    return sorted(found)


def refuse_whole_package(sources):
    """Raise ValueError where a cell binds the name drivelib instead of a module of it.

    What is reached through that name is in nobody's closure, and in a forked kernel there is more than was asked for.
    """
    for text in sources:
        with suppress(SyntaxError):  # the cell will say so itself
            for node in ast.walk(ast.parse(text)):
                for alias in node.names if isinstance(node, ast.Import) else ():
                    if alias.name.split(".")[0] == "drivelib" and (alias.asname is None or alias.name == "drivelib"):
                        raise ValueError(f"line {node.lineno} of a cell imports {alias.name}; write: from drivelib import …")


@cache
def _imported(text):
    """Return the drivelib files that one source imports itself, as a tuple; none where it is no Python."""
    found = []
    try:
        tree = ast.parse(text)
    except SyntaxError:  # a cell that fails when it runs, or one with a magic command
        return ()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        for name in names:
            module = (name or "").split(".")
            if module[0] == "drivelib":
                for candidate in ("/".join(module[1:]) + ".py", "/".join([*module[1:], "__init__.py"])):
                    if (PACKAGE / candidate).is_file():
                        found.append(candidate)
    return tuple(found)


def file_digest(path):
    """Return the digest of a file; text with LF line ends, so that a checkout on Windows agrees."""
    content = path.read_bytes()
    return _digest(content if path.suffix == ".png" else content.replace(b"\r\n", b"\n"))


def _digest(content):
    return hashlib.sha256(content).hexdigest()


def _record_path(item_id):
    return paths.build("records", f"{item_id}.json")
