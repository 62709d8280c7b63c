"""Sliders over a picture that follows them, where a person sits before the notebook.

    panel = interactive.show(pmsm_panels.loss_curves, machine)

In JupyterLab this shows the panel. Under papermill, nbclient and the runner it shows one line instead and builds
nothing, so that no published notebook holds a widget, which nobody sees without a kernel. The first line of the
docstring of what builds a panel says what the panel shows.
"""

import io
import math
import os

import numpy as np
from IPython.display import Markdown, display

from drivelib.record import OUT, PUBLISH
from drivelib.validation import choice, number

SERVER = "JPY_SESSION_NAME"  # what a Jupyter server sets in the kernels that it starts, and nothing else does
SCALES = ("linear", "logarithmic")


def live():
    """Return whether a Jupyter server started this kernel, and not the runner from within one."""
    return SERVER in os.environ and PUBLISH not in os.environ and OUT not in os.environ


def show(build, *arguments, **options):
    """Display the panel that ``build(*arguments, **options)`` returns, and return it; elsewhere say where it is to be seen.

    Returns
    -------
    Panel or None
        None where nobody could move a slider.
    """
    if not live():
        title = build.__doc__.splitlines()[0]
        display(Markdown(f"*In JupyterLab (`make lab`) this cell shows {title[0].lower() + title[1:]}*"))
        return None
    panel = build(*arguments, **options)
    display(panel.box)
    return panel


def slider(label, value, low, high, unit="", *, scale="linear", steps=200):
    """Return an ipywidgets slider from ``low`` to ``high`` (in ``unit``) that starts at ``value``.

    Raises
    ------
    ValueError
        If the limits are not in order, a logarithmic scale does not start above zero, or the value lies outside.
    """
    from ipywidgets import FloatLogSlider, FloatSlider

    logarithmic = choice("scale", scale, SCALES) == "logarithmic"
    low = number(f"low end of {label}", low, unit, **({"above": 0} if logarithmic else {}))
    high = number(f"high end of {label}", high, unit, above=low)
    value = number(label, value, unit, at_least=low, at_most=high)
    common = {
        "description": f"{label} ({unit})" if unit else label, "readout_format": ".3r", "continuous_update": True,
        "layout": {"width": "27em"}, "style": {"description_width": "11em"},
    }  # fmt: skip
    if logarithmic:
        ends = math.log10(low), math.log10(high)
        return FloatLogSlider(value=value, min=ends[0], max=ends[1], step=(ends[1] - ends[0]) / steps, **common)
    return FloatSlider(value=value, min=low, max=high, step=(high - low) / steps, **common)


class Panel:
    """Sliders, a picture and a sentence with its numbers.

    Parameters
    ----------
    figure : matplotlib Figure
        Everything that stands still, and the curves.
    curves : dict of str to matplotlib Line2D
        What moves. Only these are drawn anew while the axes keep their limits: axes and labels cost ten times as much.
    sliders : dict of str to ipywidgets slider
    update : callable
        Called with the sliders' values by name; sets the curves' data and returns the sentence. A ValueError or
        ArithmeticError (a drive that diverged) is shown in its place, and the picture stays.

    Attributes
    ----------
    box : ipywidgets.VBox
        What is displayed.
    image, text : ipywidgets.Image, ipywidgets.HTML
        Picture (PNG) and sentence.
    """

    def __init__(self, figure, curves, sliders, update):
        import matplotlib.pyplot as plt
        from ipywidgets import HTML, HBox, Image, Layout, VBox
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        plt.close(figure)  # or the notebook would show it a second time, unmoved
        figure.set_dpi(100)  # the width of a cell in JupyterLab
        self.canvas = FigureCanvasAgg(figure)
        self.curves, self.sliders, self._update = curves, sliders, update
        for curve in curves.values():
            curve.set_animated(True)  # the canvas leaves these to _draw
        self._axes = {curve.axes: None for curve in curves.values()}
        self._limits = self._still = None
        self.image, self.text = Image(format="png"), HTML()
        rows = HBox(list(sliders.values()), layout=Layout(flex_flow="row wrap"))
        self.box = VBox([rows, self.text, self.image])  # the sentence stays in sight where the picture is higher than the screen
        self._follow()
        for widget in sliders.values():
            widget.observe(self._follow, "value")

    def _follow(self, _=None):
        try:
            said = self._update(**{name: widget.value for name, widget in self.sliders.items()})
        except (ValueError, ArithmeticError) as error:
            self.text.value = f"<b>Not possible:</b> {_escaped(str(error))}"
            return
        self.image.value = self._draw()
        self.text.value = _escaped(said)

    def _draw(self):
        from PIL import Image

        figure = self.canvas.figure
        limits = [(axis.get_xlim(), axis.get_ylim()) for axis in self._axes]
        if limits != self._limits:
            self.canvas.draw()
            figure.set_layout_engine("none")  # laid out once, or the axes would jump
            self._limits, self._still = limits, self.canvas.copy_from_bbox(figure.bbox)
        self.canvas.restore_region(self._still)
        for curve in self.curves.values():
            curve.axes.draw_artist(curve)
        png = io.BytesIO()
        Image.fromarray(np.asarray(self.canvas.buffer_rgba())).convert("RGB").save(png, "png", compress_level=1)
        return png.getvalue()


def nice_limit(value):
    """Return the next of 1, 1.5, 2, 3, 5, 7 times a power of ten at or above ``value``: an axis that rarely jumps."""
    value = number("value", value, above=0)
    power = 10.0 ** math.floor(math.log10(value))
    return float(power * np.array([1, 1.5, 2, 3, 5, 7, 10])[np.searchsorted([1, 1.5, 2, 3, 5, 7], value / power - 1e-9)])


def _escaped(text):
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
