"""How far a claim survives when what its paper leaves open is drawn: shares, intervals, and what decides.

    study = Study("steady", space, claims, measure)
    table = run(study, 10_000, seed=6)            # executor=… any concurrent.futures.Executor
    rows = summary(study, table, ledger_claims)   # one Row per claim

A study measures several claims in one draw. A measure that a draw cannot have (a point out of the motor's reach, a
network that did not converge, a drive that diverged) is NaN: the draw is flagged for that claim, counted and
left out of its share, with the reason in the column ``flag``.
"""

import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context

import numba
import numpy as np
from scipy.stats import binomtest

from drivelib.ensemble import evaluate
from drivelib.space import Space, Span
from drivelib.validation import number

REACH, NETWORK, DIVERGED = 1, 2, 4
FLAGS = {REACH: "point out of reach", NETWORK: "network did not converge", DIVERGED: "drive diverged"}
CONFIDENCE = 0.95
AT_ONCE = 100  # draws whose runs are answered together
LEAF = 0.02  # of the draws: a rule about fewer would describe chance
RARE = 0.005  # of the draws: what sets so few apart is not said
WORTH = 0.1  # of the first assumption's share in the tree's gain: a weaker one is not said to decide


@dataclass(frozen=True)
class Study:
    """Claims that are measured together in one draw.

    Parameters
    ----------
    name : str
    space : Space
        The assumptions that are drawn.
    claims : tuple of str
        Full ids, as in the ledgers.
    measure : callable
        ``measure(values, rng)`` returns ({claim: measure}, flags): the claims' own measures, NaN or absent where there is
        none, and the sum of the ``FLAGS`` that say why. Importable, for processes and clusters.
    labels : dict of str to str
        What readers call an assumption, with its unit in brackets.
    together : callable, optional
        With it ``measure`` is a generator: it yields lists of what it needs and is sent the answers. ``together`` answers such a list
        for many draws at once; an answer must not depend on what else is asked.
    """

    name: str
    space: Space
    claims: tuple
    measure: object
    labels: dict = field(default_factory=dict)
    together: object = None

    @property
    def columns(self):
        """Names of what one draw gives: assumptions (a choice as its place in the list), measures, flag."""
        return (*self.space.assumptions, *self.claims, "flag")


@dataclass(frozen=True)
class Row:
    """What the draws say of one claim.

    ``share``, ``low``, ``high``: share of the draws that count in which the claim holds, with its Wilson interval (1). ``deciding``:
    the one or two assumptions of the tree, the strongest first. ``rule``: the tree as text with the share in each leaf.
    """

    claim: str
    draws: int
    flagged: int
    holding: int
    share: float
    low: float
    high: float
    deciding: tuple
    rule: str


def one_draw(study, rng):
    """Return the columns of one draw."""
    (row,) = some_draws(study, [rng])
    return row


def some_draws(study, rngs):
    """Return the columns of some draws, a row each; a row does not depend on the others.

    At most AT_ONCE are under way together, so memory does not grow with a shard.
    """
    rows = []
    for start in range(0, len(rngs), AT_ONCE):
        part = rngs[start : start + AT_ONCE]
        values = [study.space.draw(rng) for rng in part]
        rows += [_row(study, *one) for one in zip(values, measured(study, values, part), strict=True)]
    return rows


def measured(study, values, rngs):
    """Return [(measures, flags)] of draws with these values of the assumptions."""
    found = [study.measure(*one) for one in zip(values, rngs, strict=True)]
    return _in_step(found, study.together) if study.together else found


def _in_step(generators, together):
    """Return what the generators return; they go on in step, and what all of them ask for is answered at once."""
    returned, asked = [None] * len(generators), {}

    def go_on(k, answers):
        try:
            asked[k] = generators[k].send(answers)
        except StopIteration as end:
            returned[k] = end.value
        except Exception as error:
            error.add_note(f"in draw {k} of the {len(generators)} that were worked out together")
            raise

    for k in range(len(generators)):
        go_on(k, None)
    while asked:
        now, asked = asked, {}
        answers = together([one for wanted in now.values() for one in wanted])
        for k, wanted in now.items():
            own, answers = answers[: len(wanted)], answers[len(wanted) :]
            go_on(k, own)
    return returned


def _row(study, values, found):
    measures, flag = found
    unknown = set(measures) - set(study.claims)
    if unknown:
        raise ValueError(f"study {study.name}: measures {', '.join(sorted(unknown))}, which are not among its claims")
    codes = [value if isinstance(study.space.assumptions[name], Span) else list(study.space.assumptions[name]).index(value) for name, value in values.items()]
    return (*codes, *(measures.get(claim, np.nan) for claim in study.claims), flag)


def run(study, draws, seed, **options):
    """Return the table of a study; ``options`` as ``ensemble.stream`` has them (executor, folder, shard_size).

    Draw k is the same for any executor, order and shard size.
    """
    version = f"numpy {np.__version__}, numba {numba.__version__}"
    function, batched = (some_draws, True) if study.together else (one_draw, False)
    return evaluate(draws, partial(function, study), study.columns, seed=seed, batched=batched, **{"shard_size": 100, "version": version, **options})


def processes(workers=None):
    """Return a pool of processes, one per core: right for studies whose draws spend much of their time in Python."""
    workers = os.cpu_count() if workers is None else number("workers", workers, at_least=1, whole=True)
    return ProcessPoolExecutor(workers, mp_context=get_context("spawn"))


def interval(holding, draws):
    """Return the Wilson interval of a share (1), 95 %.

    Raises
    ------
    ValueError
        If there is no draw.
    """
    found = binomtest(number("holding", holding, at_least=0, whole=True), number("draws", draws, at_least=1, whole=True))
    bounds = found.proportion_ci(CONFIDENCE, "wilson")
    return float(bounds.low), float(bounds.high)


def summary(study, table, claims):
    """Return one `Row` per claim of the study.

    Parameters
    ----------
    study : Study
    table : structured array
        From ``run``.
    claims : mapping of str to claims.Claim
        Says when a measure holds.

    Raises
    ------
    ValueError
        If every draw of a claim is flagged, so that it has no share.
    """
    rows = []
    for name in study.claims:
        counts = ~np.isnan(table[name])
        if not counts.any():
            raise ValueError(f"{name}: all {len(table)} draws are flagged ({reasons(table)}), so it has no share; widen the space of {study.name}")
        low, high = claims[name].allowed
        holds = (table[name][counts] >= low) & (table[name][counts] <= high)
        deciding, rule = decided_by(study, table[counts], holds)
        total, k = int(counts.sum()), int(holds.sum())
        rows.append(Row(name, len(table), len(table) - total, k, k / total, *interval(k, total), deciding, rule))
    return rows


def reasons(table):
    """Return, as text, how many draws carry each flag."""
    flags = table["flag"].astype(int)
    found = {reason: int(np.sum(flags & bit > 0)) for bit, reason in FLAGS.items()}
    return ", ".join(f"{count} {reason}" for reason, count in found.items() if count) or "none"


def decided_by(study, table, holds):
    """Return (assumptions, rule) of a decision tree of depth two: what separates draws that hold from those that do not.

    A choice among several enters as one yes-or-no question per value. Nothing decides where all draws hold, none does, all but one in
    two hundred agree, or no question that concerns a fiftieth of the draws tells them apart.
    """
    from sklearn.tree import DecisionTreeClassifier

    k = int(holds.sum())
    if min(k, len(holds) - k) <= RARE * len(holds):
        if k in (0, len(holds)):
            return (), "in every draw" if k else "in no draw"
        return (), f"in all but {len(holds) - k} draws" if 2 * k > len(holds) else f"in {k} of {len(holds)} draws"
    questions, features = [], []
    for name, values in study.space.assumptions.items():
        if isinstance(values, Span):
            questions.append((name, None)), features.append(table[name])
        else:
            questions += [(name, k) for k in range(len(values))]
            features += [table[name] == k for k in range(len(values))]
    leaf = max(1, int(LEAF * len(holds)))
    tree = DecisionTreeClassifier(max_depth=2, min_samples_leaf=leaf, random_state=0).fit(np.column_stack(features).astype(float), holds).tree_
    gains = {}
    for node in np.flatnonzero(tree.children_left >= 0):
        children = tree.children_left[node], tree.children_right[node]
        gain = tree.n_node_samples[node] * tree.impurity[node] - sum(tree.n_node_samples[c] * tree.impurity[c] for c in children)
        name = questions[tree.feature[node]][0]
        gains[name] = gains.get(name, 0.0) + gain
    if not gains:
        return (), f"nothing tells the {100 * holds.mean():.1f} % apart"
    strong = [name for name in gains if gains[name] >= WORTH * max(gains.values())]
    return tuple(sorted(strong, key=lambda name: -gains[name])[:2]), _text(study, tree, questions, 0)


def label(study, name):
    """Return what readers call an assumption, without its unit."""
    return study.labels.get(name, name).split(" [")[0]


def _text(study, tree, questions, node):
    if tree.children_left[node] < 0:
        return f"{100 * tree.value[node][0][-1]:.0f} %"
    no, yes = (_text(study, tree, questions, child) for child in (tree.children_left[node], tree.children_right[node]))
    name, choice = questions[tree.feature[node]]
    called = label(study, name)
    if choice is None:
        unit = study.labels.get(name, name).partition(" [")[2].rstrip("]")
        first, second = no, yes
        question = f"{called} ≤ {tree.threshold[node]:.3g}{' ' if unit else ''}{unit}"
    else:
        first, second = yes, no
        question = f"{called} = {study.space.assumptions[name][choice]}"
    first, second = (f"({text})" if ":" in text else text for text in (first, second))
    return f"{question}: {first}; else {second}"
