"""The command line: ``python -m drivelib --help``."""

import argparse
import ast
import errno
import os
import sys

ITEMS = "items, such as eskander/fig02, or a paper's name for all of its items (default: all)"
RUN = """An ID is a notebook's path below notebooks/ and may end before the first underscore. Repeat -p for more
than one parameter. Lists stand in quotes, as 'torque_range=[0.1,1]'. For example:

  python -m drivelib run eskander/fig02 -p T_e=2 -p 'speeds_rpm=[300,900]' --out mine"""


def main(arguments=None):
    """Parse the command line, run one command, return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m drivelib", description="Run, check and read the replication pack.")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    reproduce = commands.add_parser("reproduce", help="run the notebooks that are stale and publish their results")
    reproduce.add_argument("items", nargs="*", metavar="ID", help=ITEMS)
    reproduce.add_argument("--jobs", type=int, default=os.cpu_count(), help="notebooks at once (default: one per core)")
    reproduce.add_argument("--force", action="store_true", help="run fresh ones too")
    reproduce.add_argument("--check", action="store_true", help="run all, compare with the committed files, write nothing")
    reproduce.add_argument("--plain", action="store_true", help="start each kernel as a new Python instead of forking it")
    reproduce.add_argument("--seed", type=int, help="shuffle the order; with --check (drawn by default) the hash seed too")
    reproduce.add_argument("--keep", metavar="DIR", help="with --check: where to leave the difference page when something differs")

    difference = commands.add_parser("difference", help="what changed in numbers, arrays and pictures, as a page")
    difference.add_argument("items", nargs="*", metavar="ID", help=ITEMS)
    difference.add_argument("--against", metavar="DIR", help="another tree's root (default: the files that git holds as accepted)")
    difference.add_argument("--fresh", action="store_true", help="run the items and compare with the published files instead")
    difference.add_argument("--jobs", type=int, default=os.cpu_count(), help="with --fresh: notebooks at once")
    difference.add_argument("--out", metavar="DIR", help="where to write the page (default: build/difference)")
    accept = commands.add_parser("accept", help="print old and new numbers of what changed, and accept it: git add")
    accept.add_argument("items", nargs="*", metavar="ID", help=ITEMS)
    verify = commands.add_parser("verify", help="the expensive checks: permutations of the whole pack, or other processors")
    verify.add_argument("items", nargs="*", metavar="ID", help="with --cpu or --without: these items only")
    verify.add_argument("--cpu", action="append", default=[], help="compare with this processor, emulated by QEMU; may be repeated")
    verify.add_argument("--without", action="append", default=[], metavar="PIN", help="leave out a pin of the environment")
    verify.add_argument("-p", dest="parameters", action="append", default=[], metavar="NAME=VALUE")
    verify.add_argument("--jobs", type=int, default=os.cpu_count(), help="runs at once")

    own = "run one notebook with your own parameters, outside the published results"
    run = commands.add_parser("run", help=own, description=own, epilog=RUN, formatter_class=argparse.RawDescriptionHelpFormatter)
    run.add_argument("item", metavar="ID", help="one item, such as eskander/fig02")
    parameter = "a name and value of its parameters cell; repeat -p for more than one"
    run.add_argument("-p", dest="parameters", action="append", default=[], metavar="NAME=VALUE", help=parameter)
    run.add_argument("--out", metavar="DIR", help="where to write (default: build/runs)")

    status = commands.add_parser("status", help="what is stale, and why")
    status.add_argument("items", nargs="*", metavar="ID", help=ITEMS)
    claims = commands.add_parser("claims", help="the ledger as a table")
    claims.add_argument("--paper", help="one paper only")
    claims.add_argument("--item", metavar="ID", help="claims of one item only, such as eskander/fig02")
    claims.add_argument("--verdict", help="claims with this verdict only, in quotes, such as 'reproduced, corrected'")
    clean = commands.add_parser("clean-notebooks", help="bring notebooks that were saved by hand into the committed form")
    clean.add_argument("items", nargs="*", metavar="ID", help=ITEMS)
    site = commands.add_parser("site", help="everything as one static folder to be read in a browser, without a server")
    site.add_argument("--out", metavar="DIR", help="where to write (default: build/site)")
    site.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes at once")
    commands.add_parser("lab", help="JupyterLab with the runner's environment; all arguments go to JupyterLab")
    commands.add_parser("bench", help="measure speed beside C and other packages; --help lists its options")
    commands.add_parser("test", help="pytest with the runner's environment; all arguments go to pytest")

    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments[:1] in (["lab"], ["bench"], ["test"]):
        return _replace(*arguments)
    options = parser.parse_args(arguments)
    from drivelib.pack import commands as usual
    from drivelib.pack import review, site, verify

    implementation = {"difference": review, "accept": review, "site": site, "verify": verify}.get(options.command, usual)
    try:
        return getattr(implementation, options.command.replace("-", "_"))(options)
    except ValueError as error:
        print(f"drivelib: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        if error.errno not in (errno.ENOSPC, errno.EROFS, errno.EACCES, errno.EDQUOT, errno.EFBIG):
            raise
        print(f"drivelib: {error}", file=sys.stderr)
        return 1
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
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):  # as literal_eval has it
        return name, value


def _replace(name, *rest):
    """Become JupyterLab, pytest or the benchmark: the pins must be set before Python starts."""
    from drivelib import environment, paths

    program = {
        "lab": ["-m", "jupyterlab", paths.root() / "notebooks"],
        "test": ["-m", "pytest"],
        "bench": [paths.root() / "tests" / "benchmarks" / "bench.py"],
    }[name]
    command = [sys.executable, *map(str, program), *rest]
    environment_ = environment.pinned()
    if os.name == "nt":  # no exec that waits
        import subprocess

        return subprocess.call(command, env=environment_)
    os.execve(sys.executable, command, environment_)


if __name__ == "__main__":
    sys.exit(main())
