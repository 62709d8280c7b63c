"""The one figure style: colour-blind safe, told apart in grey by dash and weight, legible at half size."""

import matplotlib
import matplotlib.pyplot as plt
from cycler import cycler

# Okabe and Ito's palette without its yellow, ordered so that neighbours differ in lightness too.
COLOURS = ("#000000", "#D55E00", "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9")
DASHES = ("-", (0, (6, 1.5)), (0, (1.5, 1.2)), (0, (6, 1.5, 1.5, 1.5)), (0, (3, 1)), (0, (6, 1.2, 1.2, 1.2, 1.2, 1.2)), (0, (9, 2)))
GREY = "#666666"
BEHIND_TEXT = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.0}
ALLOWED = "#DDE7EE"

STYLE = {
    "figure.figsize": (7.2, 4.4),
    "figure.dpi": 150,
    "savefig.dpi": 150,
    "figure.constrained_layout.use": True,
    "font.family": "DejaVu Sans",
    "mathtext.fontset": "dejavusans",
    "font.size": 11,
    "axes.titlesize": 12,
    "axes.titlelocation": "left",
    "axes.labelsize": 11,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.7,
    "lines.linewidth": 1.9,
    "legend.frameon": False,
    "legend.fontsize": 10,
    "axes.prop_cycle": cycler(color=COLOURS) + cycler(linestyle=DASHES),
    "svg.hashsalt": "drivelib",
    "svg.fonttype": "path",
    "path.simplify": True,
    "text.usetex": False,
    "axes.unicode_minus": True,
}


def figure(title, rows=1, columns=1, *, height=None, sharex=False):
    """Return (figure, axes) in the pack's style, titled with the paper's own numbering."""
    matplotlib.rcdefaults()
    plt.rcParams.update(STYLE)
    width, default_height = STYLE["figure.figsize"]
    figure, axes = plt.subplots(rows, columns, figsize=(width, height or default_height * (0.55 + 0.45 * rows)), sharex=sharex)
    figure.suptitle(title, x=0.01, ha="left", fontsize=STYLE["axes.titlesize"])
    return figure, axes


def label_line(axis, x, y, text, *, index, offset=(5, 0), **kwargs):
    """Write a line's name beside its point number ``index``, in the line's last colour."""
    colour = axis.lines[-1].get_color()
    options = {"xytext": offset, "textcoords": "offset points", "va": "center", "fontsize": 10, "bbox": BEHIND_TEXT, **kwargs}
    axis.annotate(text, (x[index], y[index]), color=colour, **options)


def mark(axis, x, y, text=None, *, offset=(6, 6), **kwargs):
    """Mark a point that the text speaks of, with an optional label."""
    axis.plot(x, y, "o", color=COLOURS[0], markersize=5.5, markerfacecolor="white", markeredgewidth=1.6, zorder=5)
    if text:
        axis.annotate(text, (x, y), xytext=offset, textcoords="offset points", fontsize=10, bbox=BEHIND_TEXT, **kwargs)


def band(axis, low, high, text, *, at=0.99):
    """Shade a printed range across the axis and name it."""
    axis.axhspan(low, high, color=ALLOWED, zorder=0)
    axis.annotate(text, (at, high), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=10, color=GREY)
