"""The drawn schemes are the tested schemes, and a broken scheme breaks its statements."""

import dataclasses

import matplotlib
import pytest

from drivelib import diagrams, plotting, schemes
from drivelib.diagrams import Block, Scheme, Signal

SCHEMES = {"fig. 4": (schemes.ipmsm_scheme, schemes.ipmsm_statements), "fig. 11": (schemes.spmsm_scheme, schemes.spmsm_statements)}


@pytest.mark.parametrize("name", SCHEMES)
def test_every_statement_holds(name):
    make, statements = SCHEMES[name]
    assert all(statements(make()).values())


@pytest.mark.parametrize("name", SCHEMES)
def test_removing_any_signal_breaks_a_statement_unless_the_text_does_not_speak_of_it(name):
    make, statements = SCHEMES[name]
    scheme = make()
    unspoken = {"theta_r"}
    for index, signal in enumerate(scheme.signals):
        rest = scheme.signals[:index] + scheme.signals[index + 1 :]
        broken = not all(statements(Scheme(scheme.blocks, rest)).values())
        assert broken or signal.name in unspoken, signal


def test_a_flipped_sign_at_the_sum_breaks_the_statement():
    scheme = schemes.ipmsm_scheme()
    flipped = tuple(dataclasses.replace(signal, sign=1) for signal in scheme.signals)
    assert not schemes.ipmsm_statements(Scheme(scheme.blocks, flipped))["the torque error is command minus actual torque"]


@pytest.mark.parametrize("name", SCHEMES)
def test_every_block_and_label_is_drawn(name):
    scheme = SCHEMES[name][0]()
    figure, axes = plotting.figure("t")
    diagrams.draw(axes, scheme)
    texts = {text.get_text() for text in axes.texts}
    for block in scheme.blocks:
        assert not block.label or block.label in texts
    for signal in scheme.signals:
        assert not signal.label or signal.label in texts
    matplotlib.pyplot.close(figure)


def test_a_signal_to_nowhere_and_an_unknown_kind_are_refused():
    with pytest.raises(ValueError, match="signal 'x' ends at 'b', which is no block"):
        Scheme((Block("a", "block", "", 0, 0),), (Signal("x", "a", "b"),))
    with pytest.raises(ValueError, match="kind = 'blok': must be one of .*Did you mean block"):
        Block("a", "blok", "", 0, 0)
