"""Reading, checking and normalising notebooks."""

import json

import matplotlib.pyplot as plt
import pytest

from drivelib import notebook


def content(*cells):
    return {"nbformat": 4, "nbformat_minor": 5, "metadata": {}, "cells": list(cells)}


def code(source, outputs=(), tags=()):
    return {"cell_type": "code", "metadata": {"tags": list(tags)}, "source": source, "outputs": list(outputs), "execution_count": 7}


def test_parameters_are_read_and_anything_else_refused():
    good = content(code("a = 1\nb = [1.5, 'x']", tags=["parameters"]))
    assert notebook.parameters(good) == {"a": 1, "b": [1.5, "x"]}
    with pytest.raises(ValueError, match="line 2 of the parameters cell is no literal assignment"):
        notebook.parameters(content(code("a = 1\nb = a + 1", tags=["parameters"])))
    with pytest.raises(ValueError, match="the parameters cell is no Python"):
        notebook.parameters(content(code("a = (", tags=["parameters"])))
    with pytest.raises(ValueError, match="2 cells are tagged 'parameters'"):
        notebook.parameters(content(code("a = 1", tags=["parameters"]), code("b = 1", tags=["parameters"])))


def test_a_mistyped_parameter_suggests_the_nearest():
    with pytest.raises(ValueError, match=r"fig has no parameter 'R_C', it has R_c, T_e\. Did you mean R_c\?"):
        notebook.check_overrides({"R_C": 1}, {"R_c": 200.0, "T_e": 1.0}, "fig")


@pytest.mark.parametrize("value", ["x", True, None, [1]])
def test_a_parameter_of_another_kind_is_refused(value):
    with pytest.raises(ValueError, match="must be a number, such as 200.0"):
        notebook.check_overrides({"R_c": value}, {"R_c": 200.0}, "fig")


def test_the_digest_follows_sources_and_tags_not_outputs():
    one = content(code("a = 1"))
    assert notebook.digest(one) == notebook.digest(content(code("a = 1", outputs=[{"output_type": "stream", "name": "stdout", "text": "x"}])))
    assert notebook.digest(one) != notebook.digest(content(code("a = 2")))
    assert notebook.digest(one) != notebook.digest(content(code("a = 1", tags=["parameters"])))


def test_normalising_drops_what_varies_and_joins_streams():
    pieces = [{"output_type": "stream", "name": "stdout", "text": "a"}, {"output_type": "stream", "name": "stdout", "text": ["b\n"]}]
    cell = code("print()", outputs=pieces) | {"id": "random"}
    cell["metadata"] |= {"papermill": {"duration": 1}, "execution": {"shell": "now"}}
    whole = notebook.normalised(content(cell) | {"metadata": {"widgets": {}, "language_info": {"version": "3.11.7"}}})
    assert whole["cells"][0]["outputs"] == [{"output_type": "stream", "name": "stdout", "text": ["ab\n"]}]
    assert whole["cells"][0]["id"] == "cell-01"
    assert whole["cells"][0]["execution_count"] == 1
    assert "version" not in json.dumps(whole["metadata"])
    assert notebook.normalised(whole) == whole


def test_errors_stderr_and_widgets_are_unpublishable():
    error = {"output_type": "error", "ename": "ValueError", "evalue": "no"}
    stderr = {"output_type": "stream", "name": "stderr", "text": "warning"}
    widget = {"output_type": "display_data", "data": {"application/vnd.jupyter.widget-view+json": {}}, "metadata": {}}
    reasons = notebook.unpublishable(content(code("x", outputs=[error, stderr, widget])))
    assert notebook.normalised(content(code("x", outputs=[widget, error])))["cells"][0]["outputs"] == [error | {"data": {}}]
    assert ["raised" in reasons[0], "stderr" in reasons[1], "widget" in reasons[2]] == [True] * 3


@pytest.mark.parametrize("stream", [True, False])
def test_an_address_in_memory_is_unpublishable(stream):
    """What a cell shows whose last line is a call on an axis: no two runs show the same."""
    def shown(text):
        output = {"output_type": "stream", "name": "stdout", "text": text} if stream else {"output_type": "execute_result", "data": {"text/plain": text}, "metadata": {}}
        return notebook.unpublishable(content(code("1"), code("x", outputs=[output])))

    assert shown("a loss of 0x10 W, <IPython.core.display.Image object>") == []
    for thing in (object(), shown, plt.figure().add_subplot().set_xticks([1])):
        (reason,) = shown([f"{thing!r}\n"])
        assert "cell 2 shows an address in memory" in reason and hex(id(thing[0] if isinstance(thing, list) else thing)) in reason
    plt.close("all")


BROKEN = ("", '"cells": 3', '"cells": "x"', '"cells": [3]', '"cells": [{"cell_type": "code", "source": ""}]', '"cells": [{"cell_type": "code", "metadata": {}}]')


@pytest.mark.parametrize(
    "text",
    [
        *("", "{", "[]", '{"nbformat": 3}', '{"nbformat": 4, "nbformat_minor": 4}', '{"nbformat": 4, "nbformat_minor": null}'),
        *(f'{{"nbformat": 4, "nbformat_minor": 5{", " * bool(part)}{part}}}' for part in BROKEN),
    ],
)
def test_a_file_that_is_no_notebook_is_refused_by_name(tmp_path, text):
    path = tmp_path / "broken.ipynb"
    path.write_text(text)
    with pytest.raises(ValueError, match="broken.ipynb"):
        notebook.read(path)
