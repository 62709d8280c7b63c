"""What changed against what was accepted: the commands ``difference`` and ``accept``.

Accepted is what git holds in its index. So `accept` shows old and new numbers and adds the files; the commit that
follows keeps them, and ``git diff --cached`` says the same in git's words.
"""

import shutil
import subprocess
import tempfile
from pathlib import Path

from rich.console import Console

from drivelib import paths
from drivelib.pack import difference as page
from drivelib.pack import freshness, layers, runner


def difference(options):
    """Compare in three layers, print and write the page; exit status 1 when something differs."""
    console = Console()
    chosen = runner.select(options.items)
    if options.against and options.fresh:
        raise ValueError("--against and --fresh exclude one another")
    target = Path(options.out) if options.out else page.default_folder()
    with tempfile.TemporaryDirectory(prefix="drivelib-difference-") as folder:
        problems = []
        if options.fresh:
            old, new = paths.root(), Path(folder)
            with runner.interruptible():
                outcomes = list(runner.run(chosen, jobs=options.jobs, stage=new, mirror=True))
            problems = [f"{outcome.item} failed: {outcome.failure}" for outcome in outcomes if outcome.failure]
            chosen = [outcome.item for outcome in outcomes if not outcome.failure]
        elif options.against:
            old, new = Path(options.against).resolve(), paths.root()
            if not (old / "figures").is_dir():
                raise ValueError(f"--against {options.against}: must be a tree with a folder figures/")
        else:
            old, new = accepted(Path(folder)), paths.root()
        found = page.write_page(old, new, list(chosen), problems, target)
    _show(console, found, problems)
    if found or problems:
        console.print(f"difference page: {target / 'index.html'}", highlight=False, soft_wrap=True)
    return 1 if found or problems else 0


def accept(options):
    """Print old and new numbers of what changed, then make the new ones the accepted ones."""
    console = Console()
    chosen = runner.select(options.items)
    with tempfile.TemporaryDirectory(prefix="drivelib-accepted-") as folder:
        found = layers.compare(accepted(Path(folder)), paths.root(), chosen)
    _show(console, found, [])
    files = [path.relative_to(paths.root()).as_posix() for item in chosen for path in freshness.artefacts(item) if path.exists()]
    _git("add", "--", *files)
    changed = {one.item for one in found}
    console.print(f"accepted: {len(changed)} changed items, {len(chosen) - len(changed)} as before or new", highlight=False)
    return 0


def accepted(folder):
    """Write the accepted notebooks and figures below ``folder`` and return it.

    Raises
    ------
    ValueError
        If this is no checkout of git.
    """
    names = _git("ls-files", "-z", "--", "figures", "notebooks")
    _git("checkout-index", "-z", "--stdin", f"--prefix={folder.as_posix()}/", given=names)
    return folder


def _git(*arguments, given=None):
    git = shutil.which("git")
    if git is None:
        raise ValueError("git is not installed, and what was accepted is what git holds; compare with --against DIR")
    safe = f"safe.directory={paths.root()}"
    done = subprocess.run([git, "-c", safe, *arguments], cwd=paths.root(), input=given, capture_output=True, text=True, check=False)
    if done.returncode:
        raise ValueError(f"git {arguments[0]}: {done.stderr.strip() or 'failed'}; without git compare with --against DIR")
    return done.stdout


def _show(console, found, problems):
    for line in problems:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    for one in found:
        console.print(f"{one.layer}: {one.item}: {one.what}", markup=False, highlight=False, soft_wrap=True)
    counts = {layer: sum(one.layer == layer for one in found) for layer in layers.LAYERS}
    console.print("differences: " + ", ".join(f"{count} in {layer}" for layer, count in counts.items()), highlight=False)
