"""The examples in docstrings run and print what they say."""

import doctest
import importlib

import pytest

from drivelib.pack import architecture

MODULES = [architecture.module(name) for layer in architecture.LAYERS for name in layer.files]
# What a reader of the API reference meets first has an example.
SHOWN = (
    "drivelib.machines.ParameterSet.changed",
    "drivelib.pmsm.torque",
    "drivelib.curves.interior_minima",
    "drivelib.control.speed_gains",
    "drivelib.fuzzy.fuzzy_output",
    "drivelib.metrics.error_indices",
    "drivelib.dfim_drive.simulate",
    "drivelib.ensemble.evaluate",
    "drivelib.ledger.judge",
    "drivelib.table2.Printed.ratio",
    "drivelib.validation.number",
    "drivelib.record.begin",
)


@pytest.fixture(scope="module")
def examples():
    """Every docstring with an example, by its dotted name."""
    finder = doctest.DocTestFinder(exclude_empty=True)
    return {test.name: test for name in MODULES for test in finder.find(importlib.import_module(name), name) if test.examples}


def test_every_example_prints_what_it_says(examples):
    said = []
    for test in examples.values():
        runner = doctest.DocTestRunner(verbose=False)
        runner.run(test, out=said.append)
    assert "".join(said) == ""


@pytest.mark.parametrize("name", SHOWN)
def test_what_a_reader_meets_first_has_an_example(examples, name):
    assert name in examples
