"""The commands behind ``python -m drivelib``: what they print and their exit status."""

import random
import shutil
import subprocess
import tempfile
import time
from collections import Counter
from pathlib import Path

import filelock
from rich.console import Console
from rich.markup import escape
from rich.padding import Padding
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from drivelib import environment, ledger, notebook, paths
from drivelib.__main__ import parse_parameter
from drivelib.pack import check, difference, freshness, layers, publishing, readme, report, runner
from drivelib.record import EXPORTS, write_atomically
from drivelib.validation import choice

WIDE = 120  # columns that the table of claims needs
STYLES = {
    ledger.REPRODUCED: "green",
    ledger.SHOWN: "green",
    ledger.CORRECTED: "cyan",
    ledger.ASSUMED: "cyan",
    ledger.FITTED: "yellow",
    ledger.NOT_REPRODUCED: "red",
    ledger.CONTRADICTED: "red",
}


def reproduce(options):
    """Run what is stale, publish it, end with the table of verdicts; with --check compare instead."""
    console = Console()
    if options.jobs < 1:
        raise ValueError(f"--jobs {options.jobs}: must be at least 1")
    chosen = runner.select(options.items)
    paths.build().mkdir(exist_ok=True)
    lock = filelock.FileLock(paths.build("reproduce.lock"))
    try:
        lock.acquire(timeout=0)
    except filelock.Timeout:
        raise ValueError(f"another reproduce is at work in {paths.root()}; wait for it or stop it") from None
    with lock, runner.interruptible():
        return _check(console, chosen, options) if options.check else _publish(console, chosen, options)


def _publish(console, chosen, options):
    publishing.clear_leftovers()
    stage = Path(tempfile.mkdtemp(prefix="stage-", dir=paths.build()))
    ran, failures = {}, []
    try:
        while stale := _stale(chosen, ran, options.force):  # what one item publishes may make another stale
            ran |= stale
            failures += _run_and_publish(console, stale, options, stage)
    finally:
        shutil.rmtree(stage, ignore_errors=True)
    orphans = check.orphans(runner.items())
    found = report.results()
    if not failures and not options.items:
        readme.update(found)
    return _verdicts(console, chosen, found, failures, orphans, f"{len(ran)} of {len(chosen)} notebooks run")


def _stale(chosen, ran, force):
    seen = {}
    return {id_: item for id_, item in chosen.items() if id_ not in ran and (force or freshness.why_stale(item, seen))}


def _run_and_publish(console, stale, options, stage):
    """Run items and publish each as it ends; return the failed ones."""
    failures = []
    provenance = environment.provenance() | {"revision": _revision()}
    run_parts = {id_: freshness.parts(item) for id_, item in stale.items()}
    for outcome in _watched(console, stale, options, stage, seed=options.seed):
        if outcome.failure is None:
            # What it read may have been published since this run began.
            now = freshness.parts(stale[outcome.item]) if stale[outcome.item].needs else run_parts[outcome.item]
            changes = layers.claims(layers.files(paths.root(), outcome.item), layers.files(stage, outcome.item), outcome.item)
            try:
                publishing.publish(outcome, stale[outcome.item], now, provenance)
            except OSError as error:
                outcome.failure = f"could not be published: {error}"
                console.print(f"failed {outcome.item}: {outcome.failure}", markup=False, highlight=False, soft_wrap=True)
            else:
                for change in changes:
                    console.print(f"  changed: {change.what}", markup=False, highlight=False, soft_wrap=True)
        if outcome.failure:
            failures.append(outcome)
    return failures


def _check(console, chosen, options):
    stage = Path(tempfile.mkdtemp(prefix="drivelib-check-"))
    seed = random.SystemRandom().randrange(10**6) if options.seed is None else options.seed
    try:
        failures = [outcome for outcome in _watched(console, chosen, options, stage, check=True, seed=seed) if outcome.failure]
        differences = check.differences(stage, chosen) + [f"{name}: belongs to no notebook" for name in check.orphans(runner.items())]
        found = report.results(stage / "figures")
        text = (paths.root() / "README.md").read_text(encoding="utf-8")
        if not options.items and not failures and readme.rendered(text, found, stage / "figures") != text:
            differences.append("README.md: its verdict table is stale")
        if options.keep and (failures or differences):
            difference.write_page(paths.root(), stage, chosen, differences + [f"{o.item}: {o.failure}" for o in failures], Path(options.keep))
            console.print(f"difference page: {Path(options.keep) / 'index.html'}", highlight=False, soft_wrap=True)
    finally:
        shutil.rmtree(stage, ignore_errors=True)
    how = "byte by byte" if environment.is_reference() else f"within {check.TOLERANCE:g}, for this is not the reference platform"
    return _verdicts(console, chosen, found, failures, differences, f"{len(chosen)} notebooks run in the order of --seed {seed}, compared {how}")


def run(options):
    """Run one notebook with other parameters into a folder of its own."""
    console = Console()
    chosen = runner.select([options.item])
    if len(chosen) > 1:
        raise ValueError(f"{options.item!r} stands for {len(chosen)} items, and run takes one, such as {next(iter(chosen))}")
    (item,) = chosen.values()
    given = dict(map(parse_parameter, options.parameters))
    notebook.check_overrides(given, notebook.parameters(notebook.read(paths.notebook(item.id))), item.id)
    target = Path(options.out).resolve() if options.out else paths.build("runs", item.id)
    stage = Path(tempfile.mkdtemp(prefix="drivelib-run-"))
    try:
        with runner.interruptible():
            (outcome,) = runner.run({item.id: item}, jobs=1, stage=stage, target=target, parameters=given)
        if outcome.failure:
            console.print(f"[red]failed[/] {item.id}: {outcome.failure}", markup=True, highlight=False)
            return 1
        target.mkdir(parents=True, exist_ok=True)
        for path in outcome.files.values():
            write_atomically(target / path.name, path.read_bytes())
        for path in sorted((stage / EXPORTS / item.id).glob("*")):
            write_atomically(target / EXPORTS / path.name, path.read_bytes())
    finally:
        shutil.rmtree(stage, ignore_errors=True)
    console.print(f"{item.id} in {outcome.seconds:.1f} s, written to {target}", highlight=False, soft_wrap=True)
    return 0


def status(options):
    """Print what is stale and why."""
    console = Console()
    seen = {}
    for id_, item in runner.select(options.items).items():
        reasons = freshness.why_stale(item, seen)
        console.print(f"{id_}: " + (f"[yellow]stale[/]: {'; '.join(reasons)}" if reasons else "[green]fresh[/]"), highlight=False, soft_wrap=True)
    return 0


def claims(options):
    """Print the ledger as a table."""
    console = Console()
    if options.verdict:
        choice("--verdict", options.verdict, (*ledger.VERDICTS, report.OPEN))
    if options.paper:
        choice("--paper", options.paper, tuple(ledger.papers()))
    items = runner.select([options.item]) if options.item else None
    table = Table(box=None, pad_edge=False)
    for name in ("claim", "text", "asked", "ours", "verdict"):
        table.add_column(name, justify="right" if name == "ours" else "left", overflow="fold", no_wrap=name == "claim")
    shown = []
    for claim, result, verdict in report.rows(report.results()):
        if options.paper and not claim.id.startswith(options.paper + "/"):
            continue
        if (items and claim.item not in items) or (options.verdict and verdict != options.verdict):
            continue
        style = STYLES.get(verdict, "default")
        shown.append((claim.id, escape(claim.text), escape(report.asked(claim)), escape(report.ours(claim, result)), f"[{style}]{verdict}[/]"))
    if console.width < WIDE:  # a table's columns would be too narrow for words: two or three lines a claim
        for id_, text, asked, ours, verdict in shown:
            console.print(f"{id_}: {verdict}", highlight=False, soft_wrap=True)
            numbers = "; ".join(f"{name} {value}" for name, value in (("asked", asked), ("ours", ours)) if value)
            console.print(Padding(text + (f" ({numbers})" if numbers else ""), (0, 0, 0, 4), expand=False), highlight=False)
    else:
        for row in shown:
            table.add_row(*row)
        console.print(table)
    console.print(f"{len(shown)} claims", highlight=False)
    return 0


def clean_notebooks(options):
    """Rewrite notebooks in the committed form: no times, paths, widgets or foreign metadata."""
    for id_ in runner.select(options.items):
        path = paths.notebook(id_)
        content = notebook.read(path)
        new = notebook.dumps(notebook.normalised(content))
        if new != path.read_bytes():
            write_atomically(path, new)
            print(f"cleaned {path.relative_to(paths.root())}")
    return 0


def _watched(console, chosen, options, stage, check=False, seed=None):
    """Run items with one live display; yield each `attempt.Outcome`."""
    if not chosen:
        return
    expected = {id_: freshness.record(id_).get("seconds", 5.0) for id_ in chosen}
    began, busy, outcomes = time.monotonic(), [], []
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.fields[left]}"))
    live = console.is_terminal
    with Progress(*columns, console=console, disable=not live, transient=True) as progress:
        task = progress.add_task("starting", total=len(chosen), left="")

        def show():
            ahead = sum(expected[id_] for id_ in chosen if id_ not in {outcome.item for outcome in outcomes})
            done = sum(expected[outcome.item] for outcome in outcomes)
            pace = (time.monotonic() - began) / done if done else 1 / options.jobs
            progress.update(task, completed=len(outcomes), description=", ".join(busy) or "done", left=f"{ahead * pace:.0f} s left")

        def start(_, id_):
            busy.append(id_)
            show()

        for outcome in runner.run(chosen, jobs=options.jobs, stage=stage, mirror=check, seed=seed, fork=not options.plain, report=start):
            outcomes.append(outcome)
            if outcome.item in busy:
                busy.remove(outcome.item)
            show()
            said = f"[red]failed[/] {outcome.item}: " if outcome.failure else f"{outcome.item}"
            progress.console.print(said, end="", highlight=False)
            progress.console.print(outcome.failure or f" {outcome.seconds:.1f} s", markup=False, highlight=False, soft_wrap=True)
            yield outcome


def _verdicts(console, chosen, found, failures, problems, summary):
    counts = Counter(verdict for claim, _, verdict in report.rows(found) if claim.item in chosen)
    console.print(f"Verdicts of {', '.join(chosen) if len(chosen) <= 3 else f'{len(chosen)} items'}:", highlight=False, soft_wrap=True)
    table = Table(box=None, pad_edge=False, show_header=False)
    for verdict in (*ledger.VERDICTS, report.OPEN):
        if verdict in counts:
            table.add_row(str(counts[verdict]), f"[{STYLES.get(verdict, 'default')}]{verdict}[/]")
    console.print(table)
    for outcome in failures:
        console.print("failed: ", style="red", end="")
        console.print(f"{outcome.item}: {outcome.failure}", markup=False, highlight=False, soft_wrap=True)
    for line in problems:
        console.print("differs: ", style="red", end="")
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    console.print(summary + (f", {len(failures)} failed" if failures else "") + (f", {len(problems)} differences" if problems else ""), highlight=False)
    return 1 if failures or problems else 0


def _revision():
    git = shutil.which("git")
    if git is None:
        return "unknown"
    answer = subprocess.run([git, "rev-parse", "HEAD"], cwd=paths.root(), capture_output=True, text=True, check=False)
    return answer.stdout.strip() or "unknown"
