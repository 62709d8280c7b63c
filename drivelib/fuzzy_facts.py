"""What table I and figure 5 imply: regularities of the rules, shape of the surface, equivalent gains."""

from typing import NamedTuple

import numpy as np

from drivelib.fuzzy import LABELS, RULES, FuzzyGains, fuzzy_output, fuzzy_surface
from drivelib.validation import number

ORIGIN_SLOPE = 1.5
"""Slope of u at the origin along e or Δe, to either side; `origin_slope` derives it."""

HOLDING_LIMIT = 2 / 3
"""Largest u at Δe = 0: rule (PG, Z) names PM, whose centroid is its peak."""


class RuleFacts(NamedTuple):
    """Regularities of a 7 × 7 rule table; a cell is (set of e, set of Δe, set of u)."""

    odd: bool
    """Turning both signs of the inputs turns the sign of the output."""
    symmetric: bool
    """Exchanging e and Δe changes nothing, so it does not matter which of them the rows are."""
    monotone: bool
    """No output falls along a row or a column."""
    by_sum: dict
    """Most frequent output set for each sum −6 … 6 of the input sets."""
    off_diagonal: list
    """Cells that differ from ``by_sum``; none if the output depends on the sum alone."""
    unlike_saturated_sum: list
    """Cells that differ from the sum of the input sets limited to NG … PG."""


def rule_facts(rules=RULES):
    """Return the regularities of a rule table.

    Parameters
    ----------
    rules : array_like of int, shape (7, 7)
        Output set −3 … 3 by set of e (row) and Δe (column); table I by default.

    Returns
    -------
    RuleFacts

    Raises
    ------
    ValueError
        If the shape or an entry is out of range.
    """
    rules = np.asarray(rules)
    if rules.shape != (7, 7) or not np.isin(rules, range(-3, 4)).all():
        raise ValueError(f"rules has shape {rules.shape}: must be 7 × 7 with whole entries from −3 (NG) to 3 (PG)")
    k = np.arange(-3, 4)
    total = k[:, None] + k
    common = {s: int(np.bincount(rules[total == s] + 3).argmax()) - 3 for s in range(-6, 7)}
    usual = np.vectorize(common.get)(total)
    return RuleFacts(
        odd=bool((rules == -rules[::-1, ::-1]).all()),
        symmetric=bool((rules == rules.T).all()),
        monotone=bool((np.diff(rules, axis=0) >= 0).all() and (np.diff(rules, axis=1) >= 0).all()),
        by_sum={s: LABELS[output + 3] for s, output in common.items()},
        off_diagonal=_cells(rules, rules != usual),
        unlike_saturated_sum=_cells(rules, rules != np.clip(total, -3, 3)),
    )


def _cells(rules, where):
    return [(LABELS[i], LABELS[j], LABELS[rules[i, j] + 3]) for i, j in np.argwhere(where)]


def origin_slope(e, de):
    """Directional derivative of `fuzzy_output` at the origin.

    The surface has a kink there, so no pair of partial derivatives describes it: 1.5 (e + Δe) where
    e and Δe have opposite signs, but only 1.5 times the larger of the two where they agree.

    Parameters
    ----------
    e, de : float
        Direction (1).

    Returns
    -------
    float
        lim u(t e, t Δe)/t for t → 0 from above (1).

    Raises
    ------
    ValueError
        If the direction is not finite.

    Notes
    -----
    In units of 1/3 let x, y be the inputs. Next to the origin set Z is clipped near 1, area near 1, and
    PP at a small height h: it adds the moment 2h − h/2, its own less half of the overlap, and NP likewise.
    Opposite signs clip PP and NP at |x| and |y|: 1.5 (|x| − |y|). Equal signs fire PP by both inputs, and
    max–min keeps the larger.
    """
    e, de = number("e", e), number("de", de)
    if e * de < 0:
        return ORIGIN_SLOPE * (e + de)
    return ORIGIN_SLOPE * (e if abs(e) >= abs(de) else de)


def equivalent_gains(gains, T_s):
    """Gains of the linear controller that the fuzzy one is for small e and Δe of opposite signs.

    The position form is a PD controller, without integral action; the incremental form is a PI.

    Parameters
    ----------
    gains : FuzzyGains
    T_s : float
        Sample time (s).

    Returns
    -------
    tuple of float
        K_p (N m s/rad), K_i (N m/rad), K_d (N m s²/rad).

    Raises
    ------
    ValueError
        If the sample time is not positive.
    """
    T_s = number("T_s", T_s, "s", above=0)
    of_e = ORIGIN_SLOPE * gains.K_u * gains.K_e
    of_de = ORIGIN_SLOPE * gains.K_u * gains.K_de
    if gains.form == "position":
        return of_e, 0.0, of_de * T_s
    return of_de, of_e / T_s, 0.0


def gains_like_pi(K_p, K_i, T_s, e_max):
    """Incremental fuzzy gains with the small-signal gains of a PI controller.

    Parameters
    ----------
    K_p, K_i : float
        Gains of the PI controller (N m s/rad, N m/rad).
    T_s : float
        Sample time (s).
    e_max : float
        Speed error that drives the input e to the edge of its range (rad/s); free, it sets where the
        controller stops being linear.

    Returns
    -------
    FuzzyGains

    Raises
    ------
    ValueError
        If a value is not finite and positive.
    """
    K_p = number("K_p", K_p, "N m s/rad", above=0)
    K_i = number("K_i", K_i, "N m/rad", above=0)
    T_s = number("T_s", T_s, "s", above=0)
    K_e = 1.0 / number("e_max", e_max, "rad/s", above=0)
    K_u = K_i * T_s / (ORIGIN_SLOPE * K_e)
    return FuzzyGains(K_e=K_e, K_de=K_p / (ORIGIN_SLOPE * K_u), K_u=K_u, form="incremental")


def holding_input(u):
    """Smallest normalised error at which the position form gives u at rest, that is with Δe = 0.

    A constant load T needs u = T/K_u, so a position form leaves the speed error holding_input(T/K_u)/K_e.

    Parameters
    ----------
    u : float
        Torque over K_u (1); its magnitude at most 2/3, the most that table I gives at Δe = 0.

    Returns
    -------
    float
        Normalised error e (1). Where u is 1/3 every error from 1/3 to 2/3 gives it: the smallest is returned.

    Raises
    ------
    ValueError
        If the controller cannot hold u at rest.
    """
    u = number("u", u, at_least=-HOLDING_LIMIT, at_most=HOLDING_LIMIT)
    low, high = 0.0, 1.0
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return float(np.copysign(high if u else 0.0, u))
        if fuzzy_output(middle, 0.0) < abs(u):
            low = middle
        else:
            high = middle


class LinearFit(NamedTuple):
    """How far the surface is from a line K (e + Δe), which eq. (21) amounts to when taken as printed."""

    K_least_squares: float
    rms: float
    """Root of the mean squared deviation with ``K_least_squares``."""
    K_minimax: float
    worst: float
    """Largest deviation with ``K_minimax``: no linear law stays closer everywhere."""


def linear_fit(points=601):
    """Return the linear laws nearest to the 49-rule surface on [−1, 1]².

    The surface is symmetric in e and Δe, so both best laws have equal gains for them.

    Parameters
    ----------
    points : int
        Points per axis, one more than a multiple of 6 so that every rule's centre is one of them.

    Returns
    -------
    LinearFit

    Raises
    ------
    ValueError
        If ``points`` is not one more than a multiple of 6.

    Notes
    -----
    Source: Zidani eq. (21), u = K_e e + K_Δe Δe, which has no rule table in it.
    """
    total, u = _grid(points)
    K = float((u * total).sum() / (total * total).sum())
    # Largest deviation as a function of K: convex, so its minimum can be bracketed.
    low, high = 0.0, 2.0
    while high - low > 1e-12:
        third = (high - low) / 3
        if abs(u - (low + third) * total).max() < abs(u - (high - third) * total).max():
            high -= third
        else:
            low += third
    K_minimax = 0.5 * (low + high)
    rms = float(np.sqrt(np.mean((u - K * total) ** 2)))
    return LinearFit(K, rms, K_minimax, float(abs(u - K_minimax * total).max()))


class Falls(NamedTuple):
    """Where the output falls although the error rises: max–min with centroid is not monotone."""

    share: float
    """Share of the steps along e that fall."""
    largest: float
    """Largest fall of u below what a smaller e gave, at the same Δe."""
    e_from: float
    e_to: float
    de: float


def falls(points=601):
    """Return where and how far the surface falls along e on a grid of [−1, 1]²; along Δe it is the same.

    Parameters
    ----------
    points : int
        Points per axis, one more than a multiple of 6.

    Returns
    -------
    Falls

    Raises
    ------
    ValueError
        If ``points`` is not one more than a multiple of 6.
    """
    _, u = _grid(points)
    drop = np.maximum.accumulate(u, axis=0) - u
    bottom, column = np.unravel_index(drop.argmax(), drop.shape)
    top = u[: bottom + 1, column].argmax()
    axis = np.linspace(-1.0, 1.0, points)
    steps = np.diff(u, axis=0)
    # Below 1e-13 lies rounding, not a fall.
    return Falls(
        float((steps < -1e-13).mean()), float(drop.max()), float(axis[top]), float(axis[bottom]), float(axis[column])
    )


def _grid(points):
    points = number("points", points, at_least=7, whole=True)
    if points % 6 != 1:
        raise ValueError(f"points = {points}: must be one more than a multiple of 6, such as 7, 61 or 601")
    axis = np.linspace(-1.0, 1.0, points)
    return axis[:, None] + axis, fuzzy_surface(axis[:, None], axis)
