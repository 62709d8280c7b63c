"""The map of claims shows each claim once, legibly in colour and in grey."""

import matplotlib
import pytest
from matplotlib.patches import Rectangle

from drivelib import claim_map, ledger


def luminance(colour):
    """Relative luminance by WCAG 2.1."""
    channels = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in matplotlib.colors.to_rgb(colour)]
    return sum(weight * c for weight, c in zip((0.2126, 0.7152, 0.0722), channels, strict=True))


def test_every_claim_of_a_paper_is_one_square_in_its_items_row():
    found = claim_map.verdicts(ledger.papers()["eskander"])
    axis = claim_map.draw("Map", [{"Eskander": found}]).axes[0]
    squares = [patch for patch in axis.patches if isinstance(patch, Rectangle)]
    assert len(squares) == sum(len(claims) for claims in found.values()) == len(ledger.papers()["eskander"].claims)
    rows = sorted({round(square.get_y(), 1) for square in squares})
    per_row = [sum(round(square.get_y(), 1) == row for square in squares) for row in rows]
    assert per_row == [len(claims) for claims in found.values()]


@pytest.mark.parametrize("verdict", ledger.VERDICTS)
def test_each_verdict_has_a_letter_of_its_own_that_can_be_read(verdict):
    letter, colour = claim_map.LOOKS[verdict]
    assert [look[0] for look in claim_map.LOOKS.values()].count(letter) == 1
    text = 1.0 if verdict in claim_map.DARK else 0.0
    ground = luminance(colour)
    assert (max(text, ground) + 0.05) / (min(text, ground) + 0.05) >= 4.5  # WCAG AA


def test_an_item_without_a_record_and_an_empty_map_are_named(tmp_path, monkeypatch):
    monkeypatch.setenv("DRIVELIB_READ", str(tmp_path))
    with pytest.raises(ValueError, match="reproduce eskander/fig01_equivalent_circuit"):
        claim_map.verdicts(ledger.papers()["eskander"])
    with pytest.raises(ValueError, match="columns is empty"):
        claim_map.draw("Map", [{"A": {}}])
