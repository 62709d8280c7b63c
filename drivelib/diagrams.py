"""Control schemes as graphs: what is drawn is what is checked.

A scheme is a set of blocks with positions and a list of named signals between them. Its claims are statements
about the graph ("the network's inputs are exactly i_q* and ω_r"), tested on the same object that is drawn.
"""

from dataclasses import dataclass, field

import networkx as nx
from matplotlib.patches import Circle, FancyBboxPatch, Polygon, Rectangle

from drivelib.validation import choice

KINDS = ("input", "output", "sum", "block", "pi", "network", "inverter", "motor", "gain", "sets", "centroid", "dfim")
SIZES = {
    "input": (0, 0), "output": (0, 0), "sum": (0.36, 0.36), "inverter": (1.1, 1.1), "motor": (1.1, 1.1), "pi": (1.0, 0.9),
    "gain": (1.1, 1.0), "dfim": (1.7, 1.7),
}  # fmt: skip
INK, FILL = "#000000", "#F4F7FA"


@dataclass(frozen=True)
class Block:
    """One block: kind decides the symbol, (x, y) is its centre, ``size`` its width and height."""

    name: str
    kind: str
    label: str
    x: float
    y: float
    size: tuple[float, float] | None = None

    def __post_init__(self):
        choice("kind", self.kind, KINDS)

    @property
    def extent(self):
        """Width and height of the symbol."""
        return self.size or SIZES.get(self.kind, (1.9, 1.1))


@dataclass(frozen=True)
class Signal:
    """One signal from block to block; ``path`` holds the wire's corners, ``sign`` counts at a sum.

    A ``stub`` shows only its end, from ``path[0]`` on, as a tag does in a signal-flow program.
    """

    name: str
    start: str
    end: str
    label: str = ""
    sign: int = 1
    path: tuple = ()
    at: tuple[float, float] | None = None
    stub: bool = False


@dataclass(frozen=True)
class Scheme:
    """A block diagram."""

    blocks: tuple[Block, ...]
    signals: tuple[Signal, ...]
    graph: nx.MultiDiGraph = field(init=False, compare=False)

    def __post_init__(self):
        graph = nx.MultiDiGraph()
        for block in self.blocks:
            graph.add_node(block.name, kind=block.kind)
        for signal in self.signals:
            for end in (signal.start, signal.end):
                if end not in graph:
                    raise ValueError(f"signal {signal.name!r} ends at {end!r}, which is no block")
            graph.add_edge(signal.start, signal.end, name=signal.name, sign=signal.sign)
        object.__setattr__(self, "graph", graph)

    def inputs(self, block):
        """Return the names of the signals that enter a block."""
        return {data["name"] for *_, data in self.graph.in_edges(block, data=True)}

    def outputs(self, block):
        """Return the names of the signals that leave a block."""
        return {data["name"] for *_, data in self.graph.out_edges(block, data=True)}

    def signs(self, block):
        """Return {signal: +1 or −1} at a summing point."""
        return {data["name"]: data["sign"] for *_, data in self.graph.in_edges(block, data=True)}

    def kinds(self):
        """Return the list of block kinds."""
        return [block.kind for block in self.blocks]

    def in_loop(self, *blocks):
        """Return whether one closed loop passes through all the blocks."""
        return any(set(blocks) <= part for part in nx.strongly_connected_components(self.graph))

    def loose_ends(self):
        """Return blocks that nothing enters (other than inputs) or nothing leaves (other than outputs)."""
        loose = [name for name, kind in self.graph.nodes(data="kind") if kind != "input" and not self.graph.in_degree(name)]
        return loose + [name for name, kind in self.graph.nodes(data="kind") if kind != "output" and not self.graph.out_degree(name)]


def draw(axes, scheme):
    """Draw a scheme on Matplotlib ``axes``."""
    blocks = {block.name: block for block in scheme.blocks}
    for block in scheme.blocks:
        _draw_block(axes, block)
    for signal in scheme.signals:
        _draw_signal(axes, blocks, signal)
    for signal in scheme.signals:
        for other in scheme.signals:
            if other is not signal and (other.start, other.name) == (signal.start, signal.name) and not (signal.stub or other.stub):
                common = [a for a, b in zip(signal.path, other.path, strict=False) if a == b]
                if common:  # where the wire forks
                    axes.plot(*common[-1], "o", color=INK, markersize=5)
    axes.set_aspect("equal")
    axes.axis("off")
    axes.autoscale_view()


def _draw_block(axes, block):
    width, height = block.extent
    left, bottom = block.x - width / 2, block.y - height / 2
    if block.kind == "input":
        axes.text(block.x - 0.1, block.y, block.label, ha="right", va="center", fontsize=12)
        return
    if block.kind == "output":
        axes.text(block.x + 0.1, block.y, block.label, ha="left", va="center", fontsize=12)
        return
    if block.kind == "gain":
        corners = [(left, bottom), (left, bottom + height), (left + width, block.y)]
        axes.add_patch(Polygon(corners, facecolor=FILL, edgecolor=INK, linewidth=1.5))
        axes.text(left + 0.36 * width, block.y, block.label, ha="center", va="center", fontsize=9.5)
        return
    if block.kind == "dfim":
        for radius in (width / 2, 0.66 * width / 2):  # stator and rotor
            axes.add_patch(Circle((block.x, block.y), radius, facecolor=FILL, edgecolor=INK, lw=1.5))
        axes.text(block.x, block.y, block.label, ha="center", va="center", fontsize=10)
        return
    if block.kind in ("sum", "motor"):
        axes.add_patch(Circle((block.x, block.y), width / 2, facecolor="white" if block.kind == "sum" else FILL, edgecolor=INK, lw=1.5))
        axes.text(block.x, block.y, block.label, ha="center", va="center", fontsize=10, linespacing=1.1)
        return
    shape = FancyBboxPatch((left, bottom), width, height, boxstyle="round,pad=0,rounding_size=0.06") if block.kind == "network" else Rectangle((left, bottom), width, height)
    shape.set(facecolor=FILL, edgecolor=INK, linewidth=1.5)
    axes.add_patch(shape)
    if block.kind == "inverter":
        axes.plot([left, left + width], [bottom, bottom + height], color=INK, lw=1.2, linestyle="-")
        axes.text(left + 0.28 * width, bottom + 0.72 * height, "=", ha="center", va="center", fontsize=12)
        axes.text(left + 0.72 * width, bottom + 0.28 * height, "3~", ha="center", va="center", fontsize=11)
        axes.text(block.x, bottom - 0.12, block.label, ha="center", va="top", fontsize=9.5)
    elif block.kind == "pi":
        # the step response of a PI controller: a jump, then a ramp
        step = [(0.15, 0.15), (0.15, 0.42), (0.85, 0.8)]
        axes.plot([left + x * width for x, _ in step], [bottom + y * height for _, y in step], color=INK, lw=1.4, linestyle="-")
        axes.text(left + 0.68 * width, bottom + 0.25 * height, block.label, ha="center", va="center", fontsize=10)
    elif block.kind in ("sets", "centroid"):
        # overlapping triangles; or their clipped union with its centre of gravity
        shape = {"sets": ((0, 0), (1, 2), (2, 0), (1, 0), (2, 2), (3, 0), (2, 0), (3, 2), (4, 0)), "centroid": ((0, 0), (0.4, 0.8), (1.6, 0.8), (2.1, 1.6), (2.9, 1.6), (4, 0), (0, 0))}
        x, y = zip(*shape[block.kind], strict=True)
        axes.plot([left + width * (0.18 + 0.16 * a) for a in x], [bottom + height * (0.56 + 0.17 * b) for b in y], color=INK, lw=1.1, linestyle="-")
        if block.kind == "centroid":
            axes.plot([left + width * 0.545] * 2, [bottom + height * 0.5, bottom + height * 0.92], color=INK, lw=1.1, linestyle=(0, (3, 2)))
        axes.text(block.x, bottom + 0.26 * height, block.label, ha="center", va="center", fontsize=10, linespacing=1.2)
    else:
        axes.text(block.x, block.y, block.label, ha="center", va="center", fontsize=10, linespacing=1.3)


def _draw_signal(axes, blocks, signal):
    points = [] if signal.stub else [_end(blocks[signal.start], (signal.path or ((blocks[signal.end].x, blocks[signal.end].y),))[0])]
    points += list(signal.path)
    points.append(_end(blocks[signal.end], points[-1]))
    xs, ys = zip(*points, strict=True)
    axes.plot(xs, ys, color=INK, lw=1.3, linestyle="-", solid_joinstyle="miter")
    axes.annotate("", points[-1], points[-2], arrowprops={"arrowstyle": "-|>", "color": INK, "lw": 1.3, "shrinkA": 0, "shrinkB": 0})
    if signal.label:
        x, y = signal.at or ((xs[0] + xs[1]) / 2, (ys[0] + ys[1]) / 2)
        clear = {"xytext": (0, 0 if signal.at else 10), "textcoords": "offset points"}  # off the wire, at any scale
        axes.annotate(signal.label, (x, y), ha="center", va="center", fontsize=11, **clear)
    if blocks[signal.end].kind == "sum":
        dx, dy = points[-2][0] - points[-1][0], points[-2][1] - points[-1][1]
        length = (dx**2 + dy**2) ** 0.5
        beside = (5 * dx / length - 6.5 * dy / length, 5 * dy / length + 6.5 * dx / length)  # clear of wire and circle at any scale
        axes.annotate("+" if signal.sign > 0 else "−", points[-1], xytext=beside, textcoords="offset points", ha="center", va="center", fontsize=11)


def _end(block, towards):
    """Return where a wire that comes from (or goes) ``towards`` meets the block's edge, horizontally or vertically."""
    width, height = block.extent
    dx, dy = towards[0] - block.x, towards[1] - block.y
    if block.kind == "dfim":  # on the circle
        radius = width / 2
        if abs(dy) < radius <= abs(dx):
            return block.x + (radius**2 - dy**2) ** 0.5 * (1 if dx > 0 else -1), towards[1]
        return towards[0], block.y + (radius**2 - dx**2) ** 0.5 * (1 if dy > 0 else -1)
    if abs(dy) < height / 2 or (abs(dx) >= width / 2 and block.kind in ("sum", "motor", "input", "output")):
        return block.x + (width / 2 if dx > 0 else -width / 2), towards[1] if width else block.y
    return towards[0] if abs(dx) < width / 2 else block.x, block.y + (height / 2 if dy > 0 else -height / 2)
