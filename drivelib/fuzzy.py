"""Zidani's fuzzy speed controller: table I, figure 5, and their exact max–min centroid.

Table I and the partition stand here once, as plain data; ``fuzzy_reference`` builds the scikit-fuzzy
controller from them, ``fuzzy_facts`` says what they imply. The functions below evaluate the same
controller in closed form, for drive loops that cannot wait 20 ms for a sample.

Derivation of the closed form
-----------------------------
Count in units of the distance between peaks, 1/3, so that peak k stands at k = −3 … 3. Each input fires
at most two neighbouring sets, with weights that add up to one.

A triangle clipped at height h has, on either side of its peak, the area p(h) = h − h²/2 and about its
peak the moment r(h) = h/2 − h²/2 + h³/6. The union of two neighbours is their sum less their overlap,
and the overlap min(A, B, x, 1 − x) is a trapezoid of area k(1 − k), k = min(A, B, 1/2), symmetric
about the point halfway between the peaks. Sets that are not neighbours do not overlap. So area and
moment of the whole union are sums of such cubics, and the centroid is their quotient: no sampled
universe, no table to interpolate.

References
----------
.. [1] Zidani, Brakta, Bendjeghaba, "Impact of Artificial Intelligence on Enhancing Dynamic Performance of
   DFIM", sec. IV.B: eq. (21)–(24), figure 5, table I.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numba.extending import register_jitable

from drivelib.compiled import OPTIONS
from drivelib.validation import array, choice, number

LABELS = ("NG", "NM", "NP", "Z", "PP", "PM", "PG")
"""The seven sets of e, Δe and u, from large negative to large positive."""

PEAKS = tuple(k / 3 for k in range(-3, 4))
"""Where each set is 1, in units of the normalised input or output; it is 0 from its neighbours' peaks on."""

TABLE_I = """
NG NG NG NM NP NP Z
NG NG NM NP NP Z  PP
NG NM NP NP Z  PP PP
NM NP NP Z  PP PP PM
NP NP Z  PP PP PM PG
NP Z  PP PP PM PG PG
Z  PP PP PM PG PG PG
"""
"""Output set by row (set of e) and column (set of Δe), both in the order of ``LABELS``, as printed."""

RULES = np.array([[LABELS.index(label) - 3 for label in row.split()] for row in TABLE_I.strip().splitlines()])
"""Table I as integers (7, 7): the peak number −3 … 3 of the output set."""
RULES.flags.writeable = False

FORMS = ("position", "incremental")


@register_jitable
def fuzzy_output(e, de):
    """Output of the 49 rules for one sample: max–min inference, exact centroid.

    Plain Python that compiled loops can call as it stands. Inputs beyond ±1 saturate: the outermost
    input sets stay at 1 there. The outermost output sets are half triangles inside [−1, 1], so
    |u| never exceeds their centroid, 8/9.

    Parameters
    ----------
    e, de : float
        Normalised speed error K_e e and its variation K_de Δe (1).

    Returns
    -------
    float
        Normalised command u (1). NaN if an input is NaN, so that a diverged loop shows.
        u(−e, −de) = −u(e, de) and u(de, e) = u(e, de) hold to the last bit.

    Notes
    -----
    Relies on two properties of table I, which the tests hold it to: the output depends on the sum of
    the input sets only and is odd in it, and neighbouring sums differ by one set at most. So the
    fired rules name at most three neighbouring sets: ``low``, ``mid``, ``high``.

    Source: Zidani sec. IV.B, table I and figure 5.

    Examples
    --------
    Zero inputs fire "zero" alone; inputs at the edge fire the last set alone, a half triangle with its centroid at 8/9:

    >>> print(f"{fuzzy_output(0.0, 0.0):.4f}, {fuzzy_output(1.0, 1.0):.4f}")
    0.0000, 0.8889
    """
    if math.isnan(e) or math.isnan(de):
        return math.nan
    x = min(max(3.0 * e, -3.0), 3.0)
    y = min(max(3.0 * de, -3.0), 3.0)
    # Only the half plane x + y >= 0 is computed: this makes oddness exact, and spares the half triangle NG.
    sign = 1.0
    if x + y < 0.0:
        sign, x, y = -1.0, -x, -y

    i, a_low, a_high = _fired(x)
    j, b_low, b_high = _fired(y)
    low = RULES[i + 3, j + 3]
    mid = RULES[i + 4, j + 3]
    high = RULES[i + 4, j + 4]
    h_low = min(a_low, b_low)
    h_mid = max(min(a_high, b_low), min(a_low, b_high))
    h_high = min(a_high, b_high)
    if low == mid:
        h_mid, h_low = max(h_mid, h_low), 0.0
    if high == mid:
        h_mid, h_high = max(h_mid, h_high), 0.0

    p_low = h_low - 0.5 * h_low * h_low
    p_mid = h_mid - 0.5 * h_mid * h_mid
    p_high = h_high - 0.5 * h_high * h_high
    k_low = min(h_low, h_mid, 0.5)
    k_high = min(h_high, h_mid, 0.5)
    overlap_low = k_low * (1.0 - k_low)
    overlap_high = k_high * (1.0 - k_high)

    area = 2.0 * p_mid + ((2.0 * p_high - overlap_high) + (2.0 * p_low - overlap_low))
    moment = (2.0 * p_high - 0.5 * overlap_high) - (2.0 * p_low - 0.5 * overlap_low)  # about the peak of mid
    # PG has no outer half: take it off again.
    if mid == 3:
        area -= p_mid
        moment -= _half_moment(h_mid)
    elif high == 3:
        area -= p_high
        moment -= p_high + _half_moment(h_high)
    return sign * (mid + moment / area) / 3.0


@register_jitable
def _fired(x):
    """Lower of the two sets that x (−3 … 3) fires, and the weights of both."""
    # Measured from zero outwards: x and −x then get the same weights to the last bit.
    inner = min(math.floor(abs(x)), 2)
    weight = abs(x) - inner
    if x < 0.0:
        return -inner - 1, weight, 1.0 - weight
    return inner, 1.0 - weight, weight


@register_jitable
def _half_moment(h):
    """Moment about its peak of one half of a triangle of base 1 clipped at height h."""
    return h * (0.5 - h * (0.5 - h / 6.0))


@register_jitable
def position_step(e, e_previous, K_e, K_de, K_u, T_max):
    """Torque reference of the position form, eq. (21)–(24) with the rule table as the sum of (21).

    Parameters
    ----------
    e, e_previous : float
        Speed error Ω* − Ω of this and of the last sample (rad/s).
    K_e, K_de, K_u, T_max : float
        Gains (s/rad, s/rad, N m) and torque limit (N m); see `FuzzyGains`.

    Returns
    -------
    float
        T* = K_u u(K_e e, K_de Δe), limited to ±T_max (N m).
    """
    return _limited(K_u * fuzzy_output(K_e * e, K_de * (e - e_previous)), T_max)


@register_jitable
def incremental_step(e, e_previous, T_previous, K_e, K_de, K_u, T_max):
    """Torque reference of the incremental form: u is the "variation of the command" of sec. IV.B.

    Parameters
    ----------
    e, e_previous : float
        Speed error Ω* − Ω of this and of the last sample (rad/s).
    T_previous : float
        Last torque reference as it was realised, after every limit (N m).
    K_e, K_de, K_u, T_max : float
        Gains (s/rad, s/rad, N m per sample) and torque limit (N m); see `FuzzyGains`.

    Returns
    -------
    float
        T* = T_previous + K_u u(K_e e, K_de Δe), limited to ±T_max (N m). The integral is the returned
        torque itself, so it stops at the limit and leaves it with the first increment of other sign.
    """
    return _limited(T_previous + K_u * fuzzy_output(K_e * e, K_de * (e - e_previous)), T_max)


@register_jitable
def _limited(T, T_max):
    # Written so that NaN passes through.
    if T > T_max:
        return T_max
    if T < -T_max:
        return -T_max
    return T


@dataclass(frozen=True)
class FuzzyGains:
    """Scaling of the fuzzy speed controller; printed nowhere in the paper.

    Parameters
    ----------
    K_e : float
        Gain of the speed error (s/rad): the error 1/K_e drives the input to the edge of its range.
    K_de : float
        Gain of the error's variation per sample (s/rad); for the same drive it grows as the sample time shrinks.
    K_u : float
        Torque (N m), or torque per sample in the incremental form, at u = 1.
    form : {"position", "incremental"}
        Whether u is the torque or its variation.

    Raises
    ------
    ValueError
        If a gain is not finite and positive, or the form is unknown (the nearest is suggested).
    """

    K_e: float
    K_de: float
    K_u: float
    form: str = "position"

    def __post_init__(self):
        for name, unit in (("K_e", "s/rad"), ("K_de", "s/rad"), ("K_u", "N m")):
            object.__setattr__(self, name, number(name, getattr(self, name), unit, above=0))
        choice("form", self.form, FORMS)


def fuzzy_surface(e, de):
    """Output of the 49 rules for arrays of inputs.

    Parameters
    ----------
    e, de : array_like
        Normalised inputs (1), any shapes that broadcast; values beyond ±1 saturate.

    Returns
    -------
    ndarray
        Normalised command u (1), of the broadcast shape, equal to `fuzzy_output` bit by bit.

    Raises
    ------
    ValueError
        If an input is not finite or the shapes do not broadcast.
    """
    e, de = np.broadcast_arrays(array("e", e), array("de", de))
    return _outputs(e.ravel(), de.ravel()).reshape(e.shape)


@njit(**OPTIONS)
def _outputs(e, de):
    u = np.empty(e.size)
    for n in range(e.size):
        u[n] = fuzzy_output(e[n], de[n])
    return u
