"""Labels of figures: names that do not touch, text dark enough to read, printed values where the ledger has them."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.text import Text

from drivelib import ledger, plotting


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    plt.close("all")


def labelled(ends, *, names=None):
    """Return (figure, axis) with a line to each end, named at its end."""
    figure, axis = plotting.figure("t")
    for k, end in enumerate(ends):
        axis.plot([0, 1, 2], [0.5, 0.5, end], label=(names or "abcdefg")[k])
    axis.set(xlim=(0, 2), ylim=(0, 1))
    plotting.label_ends(axis)
    return figure, axis


def middles(figure, axis):
    """Return {name: height of its middle in pixels} and the boxes, as drawn."""
    figure.draw_without_rendering()
    boxes = {text.get_text(): Text.get_window_extent(text) for text in axis.texts}  # without the leader
    return {name: (box.y0 + box.y1) / 2 for name, box in boxes.items()}, boxes


@pytest.mark.parametrize("ends", [(0.5, 0.5, 0.5, 0.5), (0.01, 0.02, 0.9, 0.91), (1.0, 1.0, 0.0), (0.3, 0.31, 0.32, 0.33, 0.34, 0.35)])
def test_names_at_the_ends_do_not_touch_and_keep_the_lines_order(ends):
    figure, axis = labelled(ends)
    heights, boxes = middles(figure, axis)
    assert len(boxes) == len(ends)
    names = sorted(boxes, key=heights.get)
    for below, above in zip(names, names[1:], strict=False):
        assert boxes[below].y1 <= boxes[above].y0
        assert ends["abcdefg".index(below)] <= ends["abcdefg".index(above)]


def test_a_name_with_room_stands_at_its_lines_end():
    figure, axis = labelled((0.1, 0.5, 0.9))
    heights, boxes = middles(figure, axis)
    for name, end in zip("abc", (0.1, 0.5, 0.9), strict=True):
        x, y = axis.transData.transform((2, end))
        assert heights[name] == pytest.approx(y, abs=3)
        assert boxes[name].x0 > x


def test_a_line_that_leaves_the_picture_is_named_at_its_edge_and_a_nameless_one_not_at_all():
    figure, axis = plotting.figure("t")
    axis.plot([0, 1, 2, 3], [0.2, 0.4, 5.0, np.nan], label="out")
    axis.plot([0, 3], [0.1, 0.1])
    axis.set(xlim=(0, 2), ylim=(0, 1))
    plotting.label_ends(axis)
    heights, _ = middles(figure, axis)
    assert list(heights) == ["out"]
    assert heights["out"] == pytest.approx(axis.transData.transform((2, 1))[1], abs=3)


def test_text_is_darkened_until_it_reads_on_white():
    """WCAG's well-known edge: #767676 is the lightest grey with a contrast of 4.5 on white, #777777 fails."""
    assert plotting.ink("#767676") == "#767676"
    assert plotting.ink("#777777") != "#777777"
    for colour in plotting.COLOURS:
        red, green, blue = (int(plotting.ink(colour)[k : k + 2], 16) for k in (1, 3, 5))
        before = tuple(int(colour[k : k + 2], 16) for k in (1, 3, 5))
        assert np.argsort((red, green, blue), kind="stable").tolist() == np.argsort(before, kind="stable").tolist()  # the same hue


def test_a_printed_value_is_drawn_with_the_ledgers_tolerance():
    claim = ledger.claims_of("eskander/fig08_minimum_loss")["eskander/fig08"]
    figure, axis = plotting.figure("t")
    axis.set_ylim(118, 120)
    plotting.printed(axis, claim)
    (shaded,) = axis.patches
    assert (shaded.get_y(), shaded.get_y() + shaded.get_height()) == pytest.approx(claim.allowed)
    assert axis.lines[0].get_ydata()[0] == 118.9
    assert [text.get_text() for text in axis.texts] == ["printed: 118.9 ± 0.05 W"]


def test_a_zoom_shows_its_window_and_frames_it():
    figure, axis = plotting.figure("t")
    axis.set(xlim=(0, 8), ylim=(0, 10))
    inset = plotting.zoom(axis, (0.1, 0.5, 0.3, 0.4), (1, 2), (4, 5))
    assert (inset.get_xlim(), inset.get_ylim()) == ((1, 2), (4, 5))
    figure.draw_without_rendering()
    frame = next(child for child in axis.get_children() if type(child).__name__ == "InsetIndicator").rectangle
    assert (frame.get_x(), frame.get_y(), frame.get_width(), frame.get_height()) == pytest.approx((1, 4, 1, 1))
