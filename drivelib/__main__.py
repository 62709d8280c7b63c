"""The command line: ``python -m drivelib --help``."""

import argparse
import ast
import os
import sys


def main(arguments=None):
    """Parse the command line, run one command, return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m drivelib", description="Run, check and read the replication pack.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    reproduce = commands.add_parser("reproduce", help="run the notebooks that are stale and publish their results")
    reproduce.add_argument("items", nargs="*", metavar="ID", help="items, such as eskander/fig02 (default: all)")
    reproduce.add_argument("--jobs", type=int, default=os.cpu_count(), help="notebooks at once (default: one per core)")
    reproduce.add_argument("--force", action="store_true", help="run fresh ones too")
    reproduce.add_argument("--check", action="store_true", help="run all, compare with the committed files, write nothing")
    reproduce.add_argument("--keep", metavar="DIR", help="with --check: where to leave the difference page when something differs")

    run = commands.add_parser("run", help="run one notebook with your own parameters, outside the published results")
    run.add_argument("item", metavar="ID")
    run.add_argument("-p", dest="parameters", action="append", default=[], metavar="NAME=VALUE")
    run.add_argument("--out", metavar="DIR", help="where to write (default: build/runs)")

    commands.add_parser("status", help="what is stale, and why")
    claims = commands.add_parser("claims", help="the ledger as a table")
    claims.add_argument("--paper", help="one paper only")
    claims.add_argument("--item", help="claims of items that start with this, such as eskander/fig02")
    claims.add_argument("--verdict", help="claims with this verdict only")
    clean = commands.add_parser("clean-notebooks", help="bring notebooks that were saved by hand into the committed form")
    clean.add_argument("items", nargs="*", metavar="ID")
    commands.add_parser("lab", help="JupyterLab with the runner's environment")
    commands.add_parser("bench", help="measure speed beside C and other packages; --help lists its options")
    commands.add_parser("test", help="pytest with the runner's environment; arguments go to pytest")

    given = sys.argv[1:] if arguments is None else list(arguments)
    if given and given[0] in ("bench", "test"):  # all that follows is theirs, in its order
        return _replace(*given)
    options = parser.parse_args(given)
    if options.command == "lab":
        return _replace("lab")
    from drivelib.pack import commands as implementation

    try:
        return getattr(implementation, options.command.replace("-", "_"))(options)
    except ValueError as error:
        print(f"drivelib: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("drivelib: interrupted; nothing half-written is left", file=sys.stderr)
        return 130


def parse_parameter(text):
    """Return (name, value) of ``NAME=VALUE``; a value that is no Python literal is a string.

    Raises
    ------
    ValueError
        If there is no equals sign.
    """
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise ValueError(f"-p {text!r}: must read NAME=VALUE")
    try:
        return name, ast.literal_eval(value)
    except (ValueError, SyntaxError):
        return name, value


def _replace(name, *rest):
    """Become JupyterLab, pytest or the benchmark: the pins must be set before Python starts."""
    from drivelib import environment, paths

    if name == "lab":
        module = ["-m", "jupyterlab", paths.root() / "notebooks"]
    elif name == "test":
        module = ["-m", "pytest", *rest]
    else:
        module = [paths.root() / "tests" / "benchmarks" / "bench.py", *rest]
    command = [sys.executable, *map(str, module)]
    environment_ = environment.pinned()
    if os.name == "nt":  # no exec that waits
        import subprocess

        return subprocess.call(command, env=environment_)
    os.execve(sys.executable, command, environment_)


if __name__ == "__main__":
    sys.exit(main())
