"""The one figure style: colour-blind safe, told apart in grey by dash and weight, legible at half size."""

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from cycler import cycler
from matplotlib.colors import to_hex, to_rgb
from scipy.optimize import isotonic_regression

# Okabe and Ito's palette without its yellow, ordered so that neighbours differ in lightness too.
COLOURS = ("#000000", "#D55E00", "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9")
DASHES = ("-", (0, (6, 1.5)), (0, (1.5, 1.2)), (0, (6, 1.5, 1.5, 1.5)), (0, (3, 1)), (0, (6, 1.2, 1.2, 1.2, 1.2, 1.2)), (0, (9, 2)))
GREY = "#666666"
BEHIND_TEXT = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.0}
ALLOWED = "#DDE7EE"
LEADER = {"arrowstyle": "-", "color": GREY, "lw": 0.8, "shrinkA": 1, "shrinkB": 1}

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


def label_line(axis, x, y, text, *, index=-1, offset=(5, 0), line=None, leader=False, **kwargs):
    """Write a line's name beside its point number ``index``, in the colour of ``line`` (default: the last one).

    With ``leader`` a thin line leads from the name to the point: for lines that lie on one another.
    """
    colour = ink((line or axis.lines[-1]).get_color())
    options = {"xytext": offset, "textcoords": "offset points", "va": "center", "fontsize": 10, "bbox": BEHIND_TEXT, **kwargs}
    if leader:
        options["arrowprops"] = LEADER
    axis.annotate(text, (x[index], y[index]), color=colour, **options)


def label_ends(axis, *, fontsize=10):
    """Write the name of each line that has a ``label`` to the right of its end, in place of a legend.

    Names that would touch are moved apart by as little as that takes, with a thin leader to the line's end. Call
    it once the axis' limits are set: a line that runs out of them is named where it leaves.
    """
    axis.figure.draw_without_rendering()  # lays the figure out, so that heights are known in points
    per_point = axis.figure.dpi / 72
    low, high = sorted(axis.transData.transform([(axis.get_xlim()[0], limit) for limit in axis.get_ylim()])[:, 1])
    lines = [line for line in axis.lines if not line.get_label().startswith("_")]
    ends = []
    for line in lines:
        x, y = (np.asarray(values, dtype=float) for values in line.get_data())
        last = np.flatnonzero(np.isfinite(y) & (x <= axis.get_xlim()[1]))[-1]
        across, height = axis.transData.transform((x[last], y[last]))
        ends.append((across, min(max(height, low), high)))
    ends = np.array(ends)
    order = np.argsort(ends[:, 1], kind="stable")
    steps = 1.3 * fontsize * per_point * np.arange(len(lines))
    free = isotonic_regression(ends[order, 1] - steps).x + steps  # the nearest heights that are a line of text apart
    shifts = (free - ends[order, 1]) / per_point
    moved = np.any(np.abs(shifts) > 2)  # then all names get a leader, and stand in one column where the lines end together
    for k, shift in zip(order, shifts, strict=True):
        axis.annotate(
            lines[k].get_label(), axis.transData.inverted().transform(ends[k]), xytext=(14 if moved else 5, shift),
            textcoords="offset points", va="center", fontsize=fontsize, color=ink(lines[k].get_color()), annotation_clip=False,
            arrowprops=LEADER if moved else None,
        )  # fmt: skip


def ink(colour):
    """Return a colour dark enough for text on white (contrast 4.5, WCAG AA): the same hue, darkened as far as needed."""
    rgb = np.array(to_rgb(colour))
    while 1.05 / (_luminance(rgb) + 0.05) < 4.5:
        rgb = 0.95 * rgb
    return to_hex(rgb)


def mark(axis, x, y, text=None, *, offset=(6, 6), **kwargs):
    """Mark a point that the text speaks of, with an optional label."""
    axis.plot(x, y, "o", color=COLOURS[0], markersize=5.5, markerfacecolor="white", markeredgewidth=1.6, zorder=5)
    if text:
        axis.annotate(text, (x, y), xytext=offset, textcoords="offset points", fontsize=10, bbox=BEHIND_TEXT, **kwargs)


def band(axis, low, high, text, *, at=0.99, va="bottom"):
    """Shade a range across the axis and name it at its upper edge, above (``va`` "bottom") or below ("top") it."""
    axis.axhspan(low, high, color=ALLOWED, zorder=0)
    axis.annotate(
        text, (at, high), xycoords=("axes fraction", "data"), xytext=(0, 2 if va == "bottom" else -2), textcoords="offset points",
        ha="right" if at > 0.5 else "left", va=va, fontsize=10, color=GREY,
    )  # fmt: skip


def printed(axis, claim, *, at=0.99, va="bottom"):
    """Draw what the paper prints for a ``matches`` claim of the ledger: the value as a line, its tolerance as a band."""
    value = float(claim.printed)
    axis.axhline(value, color=GREY, lw=1.1, linestyle=(0, (4, 2)), zorder=0.5)
    band(axis, value - claim.tolerance, value + claim.tolerance, f"printed: {claim.printed} ± {claim.tolerance:g} {claim.unit}", at=at, va=va)


def zoom(axis, place, xlim, ylim):
    """Return an inset at ``place`` (x, y, width, height in axes fractions) that shows a part of the axis, framed there too."""
    inset = axis.inset_axes(place, xlim=xlim, ylim=ylim)
    inset.tick_params(labelsize=9, pad=1.5)
    axis.indicate_inset_zoom(inset, edgecolor=GREY, lw=1.0)
    return inset


def _luminance(rgb):
    """Return the relative luminance (WCAG) of a colour."""
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))
