"""The rule that turns numbers into verdicts, and the messages for a ledger that is wrong."""

import math

import pytest

from drivelib import claims, ledger

HEAD = '[items.fig01]\ntitle = "t"\n[[claims]]\nid = "a"\nitem = "fig01"\nwhere = "w"\ntext = "t"\n'


def claim(**values):
    return claims.Claim(id="p/a", item="p/fig01", where="w", text="t", **values)


def printed(text="118.9"):
    return claim(relation="matches", printed=text, tolerance=claims.half_last_digit(text))


@pytest.mark.parametrize(("text", "half"), [("118.9", 0.05), ("0.5265", 0.00005), ("900", 0.5), ("2.00", 0.005), ("0.0004809", 5e-8)])
def test_the_tolerance_is_half_a_unit_of_the_last_printed_digit(text, half):
    assert math.isclose(claims.half_last_digit(text), half)


def test_a_number_inside_the_tolerance_is_reproduced_and_outside_contradicted():
    assert ledger.judge(printed(), 118.94).verdict == ledger.REPRODUCED
    assert ledger.judge(printed(), 118.96).verdict == ledger.CONTRADICTED


def test_nan_never_holds():
    assert ledger.judge(printed(), math.nan).verdict == ledger.CONTRADICTED
    assert ledger.judge(claim(relation=">=", threshold=1), math.nan).verdict == ledger.CONTRADICTED


@pytest.mark.parametrize(
    ("relation", "threshold", "inside", "outside"),
    [("<=", 1.0, 1.0, 1.1), (">=", 1.0, 1.0, 0.9), ("==", 0, 0, 1), ("between", (1.0, 2.0), 2.0, 2.1)],
)
def test_each_relation_includes_its_bounds(relation, threshold, inside, outside):
    one = claim(relation=relation, threshold=threshold)
    assert one.holds(inside)
    assert not one.holds(outside)


def test_a_misprint_that_fails_while_its_mending_holds_is_corrected():
    assert ledger.judge(printed(), 118.9, as_printed=50).verdict == ledger.CORRECTED
    assert ledger.judge(printed(), 118.9, as_printed=118.9).verdict == ledger.REPRODUCED
    assert ledger.judge(printed(), 50, as_printed=118.9).verdict == ledger.CONTRADICTED


def test_what_is_left_open_decides_between_reproduced_assumed_and_not_reproduced():
    assert ledger.judge(printed(), 118.9, alternatives={"b": 118.9}).verdict == ledger.REPRODUCED
    assert ledger.judge(printed(), 118.9, alternatives={"b": 0}).verdict == ledger.ASSUMED
    assert ledger.judge(printed(), 0, alternatives={"b": 118.9}).verdict == ledger.ASSUMED
    assert ledger.judge(printed(), 0, alternatives={"b": 0}).verdict == ledger.NOT_REPRODUCED


def test_the_cases_are_named_on_both_sides_and_the_default_counts_once():
    others = {"default": 118.9, "b": 0, "c": 118.9}
    assert ledger.judge(printed(), 118.9, alternatives=others).window == "holds in 2 of 3 cases: as assumed here; c; not in: b"
    named = ledger.judge(printed(), "c", alternatives={"a": 118.9, "b": 0, "c": 118.9})
    assert named.window == "holds in 2 of 3 cases: c (as assumed here); a; not in: b" and named.ours == 118.9
    with pytest.raises(ValueError, match="p/a: ours = 'cc': must be one of 'c'. Did you mean c?"):
        ledger.judge(printed(), "cc", alternatives={"c": 118.9})
    assert ledger.judge(printed(), 118.9, alternatives={"b": 118.9}).window == "holds in all of the 2 cases tried"
    assert ledger.judge(printed(), 0, alternatives={"b": 0}).window == "holds in none of the 2 cases tried"


def test_what_the_papers_own_equation_refutes_is_contradicted_even_with_assumptions():
    refuted = claim(relation="<=", threshold=1, refuted_by="p/eq16")
    assert ledger.judge(refuted, 2, alternatives={"b": 3}).verdict == ledger.CONTRADICTED


def test_a_fit_is_never_called_reproduced():
    found = ledger.judge(printed(), 118.9, fit=(1, 1))
    assert found.verdict == ledger.FITTED
    assert found.window == "1 free, 1 matched"
    assert ledger.judge(printed(), 0, fit=(1, 1)).verdict == ledger.NOT_REPRODUCED


def test_a_structure_is_shown_and_an_omission_not_checkable():
    assert ledger.judge(claim(relation="==", threshold=0, structure=True), 0).verdict == ledger.SHOWN
    assert ledger.judge(claim(relation="==", threshold=0, structure=True), 1).verdict == ledger.CONTRADICTED
    assert ledger.judge(claim(omitted=("the goal",))).verdict == ledger.NOT_CHECKABLE


def test_a_claim_without_a_number_is_refused():
    with pytest.raises(ValueError, match="p/a: no measured value given"):
        ledger.judge(printed())


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[claims]\n", "no valid TOML"),
        (HEAD.replace('text = "t"\n', ""), "claim a: 'text' is missing"),
        (HEAD.replace('item = "fig01"', 'item = "fig1"'), "item 'fig1' is not listed. Did you mean p/fig01"),
        (HEAD + 'treshold = 1\n', "unknown field 'treshold'. Did you mean threshold"),
        (HEAD + 'relation = "<"\nthreshold = 1\nreason = "r"\n', "relation = '<': must be one of"),
        (HEAD + 'relation = "<="\nreason = "r"\n', "needs one threshold"),
        (HEAD + 'relation = "between"\nthreshold = 1\nreason = "r"\n', "needs two thresholds"),
        (HEAD + 'relation = "matches"\n', "needs the printed value"),
        (HEAD + 'relation = "matches"\nprinted = 2.0\n', "needs the printed value, as a string"),
        (HEAD + 'relation = "<="\nthreshold = "1"\nreason = "r"\n', "threshold = '1': must be a real number"),
        (HEAD + 'relation = "matches"\nprinted = "2"\ntolerance = inf\nreason = "r"\n', "tolerance = inf: must be a finite number"),
        ('[items.fig01]\ntopic = "t"\n', "item fig01: 'title' is missing"),
        (HEAD + 'relation = "<="\nthreshold = 1\n', "needs a reason"),
        (HEAD + 'relation = "<="\nprinted = "1"\nthreshold = 1\nreason = "r"\n', "'printed' goes with relation 'matches'"),
        (HEAD + 'expected_verdict = "true"\n', "expected_verdict = 'true': must be one of"),
        (HEAD + HEAD[HEAD.index("[[claims]]") :], "claim p/a is listed twice"),
    ],
)
def test_a_wrong_ledger_is_refused_by_name(tmp_path, text, message):
    path = tmp_path / "p.toml"
    path.write_text(text)
    with pytest.raises(ValueError) as error:
        ledger.load(path)
    assert "p.toml" in str(error.value)
    assert message in str(error.value)


def test_an_unknown_item_gets_a_suggestion():
    with pytest.raises(ValueError, match="Did you mean eskander/fig02_loss_at_speeds"):
        ledger.claims_of("eskander/fig02_loss_at_speed")
