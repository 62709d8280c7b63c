"""What print leaves open, against enumeration, monomials and exact rank."""

import itertools

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from drivelib.identifiability import directions, sensitivity, spread, what_to_print


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([(), (0,), (1,), (0, 2), (0, 1, 2)]))
def test_the_spread_is_that_of_an_enumeration(seed, printed):
    rng = np.random.default_rng(seed)
    values = rng.uniform(1, 5, (3, 4, 2))
    values[rng.random(values.shape) < 0.4] = np.nan
    values[0, 0, 0] = 2.0
    groups = {}
    for index in itertools.product(*map(range, values.shape)):
        if not np.isnan(values[index]):
            groups.setdefault(tuple(index[axis] for axis in printed), []).append(values[index])
    ratios = [max(group) / min(group) for group in groups.values()]
    assert spread(values, printed) == pytest.approx((np.median(ratios), max(ratios)))


def test_nothing_consistent_is_an_error():
    with pytest.raises(ValueError, match="no combination is consistent"):
        spread([np.nan, np.nan])
    with pytest.raises(ValueError, match=r"-1.0"):
        spread([1.0, -1.0])
    with pytest.raises(ValueError, match="printed = 1"):
        spread([1.0, 2.0], (1,))


def test_sensitivities_of_monomials_are_their_exponents():
    def results(a, b, c):
        return [a * b**2 / c, c**3, a**-0.5]

    np.testing.assert_allclose(sensitivity(results, [2.0, 3.0, 0.1]), [[1, 2, -1], [0, 0, 3], [-0.5, 0, 0]], atol=1e-9)
    with pytest.raises(ValueError, match="values = 0.0"):
        sensitivity(results, [2.0, 0.0, 1.0])
    with pytest.raises(ValueError, match="results = -2.0"):
        sensitivity(lambda a: [-a], [2.0])


def test_a_product_leaves_one_direction_open_and_a_number_of_its_own_none():
    """(ab, c) printed: a/b stays open, c is known; a 20 % change of c moves ln 1.2/0.01 half digits."""
    found = directions([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [0.01, 0.01], 1.2)
    assert found.open == 1 and found.determined.tolist() == [False, False, True]
    assert found.moved == pytest.approx(np.log(1.2) / 0.01 * np.array([np.sqrt(2), 1, 0]))
    assert what_to_print([[1.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [0.01, 0.01], 1.2, "abc") == [(("a",), pytest.approx(18.23)), (("b",), pytest.approx(18.23))]


def test_coarse_digits_leave_open_what_algebra_fixes():
    """c printed to 30 %: a change by 1.2 does not show, so it has to be printed better or at all."""
    matrix = [[1.0, 0.0], [0.0, 1.0]]
    assert directions(matrix, [0.01, 0.3], 1.2).determined.tolist() == [True, False]
    assert [names for names, _ in what_to_print(matrix, [0.01, 0.3], 1.2, "ac")] == [("c",)]
    assert what_to_print(matrix, [0.01, 0.01], 1.2, "ac")[0][0] == ()
    assert what_to_print([[0.0, 0.0]], [0.01], 1.2, "ac") == [(("a", "c"), np.inf)]


@settings(max_examples=25, deadline=None)
@given(st.lists(st.lists(st.integers(-2, 2), min_size=4, max_size=4), min_size=1, max_size=4))
def test_with_fine_digits_the_count_is_the_exact_rank(rows):
    rank = sympy.Matrix(rows).rank()
    halves = [1e-6] * len(rows)
    assert directions(rows, halves, 1.2).open == 4 - rank
    for names, _ in what_to_print(rows, halves, 1.2, "abcd"):
        rest = ["abcd".index(name) for name in "abcd" if name not in names]
        assert len(names) == 4 - rank and (not rest or sympy.Matrix(rows)[:, rest].rank() == len(rest))


@pytest.mark.parametrize(("halves", "factor", "words"), [([0.1], 1.2, "shape"), ([0.1, 0.0], 1.2, "halves = 0.0"), ([0.1, 0.1], 1.0, "factor = 1.0")])
def test_bad_input_is_named(halves, factor, words):
    with pytest.raises(ValueError, match=words):
        directions(np.eye(2), halves, factor)


def test_names_must_fit():
    with pytest.raises(ValueError, match="names has 3 entries: must have 2"):
        what_to_print(np.eye(2), [0.1, 0.1], 1.2, "abc")
