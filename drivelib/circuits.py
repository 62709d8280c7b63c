"""The d- and q-axis equivalent circuits of fig. 1 as a netlist: drawn from it, and solved from it by nodes.

Solving the netlist knows nothing of eq. (1) and (2), so it can test them.
"""

from dataclasses import dataclass

import numpy as np
import schemdraw
import schemdraw.elements as elm

from drivelib.validation import choice, number

GROUND = "0"


@dataclass(frozen=True)
class Element:
    """One element between two nodes: kind "source", "resistor" or "emf"; ``current`` names what flows through it."""

    kind: str
    name: str
    start: str
    end: str
    current: str = ""
    label: str = ""


def pmsm_circuit(axis):
    """Return the netlist of one axis: terminal voltage, R_s, and R_c parallel to the branch with the rotational emf."""
    choice("axis", axis, ("d", "q"))
    emf = r"$\omega_s(\lambda + L_d i_{od})$" if axis == "q" else r"$-\omega_s L_q i_{oq}$"
    return (
        Element("source", "V", "terminal", GROUND, label=f"$V_{axis}$"),
        Element("resistor", "R_s", "terminal", "gap", current=f"$i_{axis}$", label="$R_s$"),
        Element("resistor", "R_c", "gap", GROUND, current=f"$i_{{c{axis}}}$", label="$R_c$"),
        Element("emf", "E", "gap", GROUND, current=f"$i_{{o{axis}}}$", label=emf),
    )


def solve(machine, omega_e, V_d, V_q):
    """Solve both netlists by modified nodal analysis; return {name: value} of the currents (A) at the
    terminals and in the emf branch, and of the voltage (V) across that branch.

    Unknown are each axis' node voltages and the currents of its source and emf. The emf couples the axes
    through the branch currents: E_d = −ω L_q i_oq, E_q = ω (λ + L_d i_od).
    """
    omega_e = number("omega_e", omega_e, "rad/s")
    unknowns = [(axis, name) for axis in "dq" for name in ("terminal", "gap", "I_V", "I_E")]
    index = {key: row for row, key in enumerate(unknowns)}
    matrix, right = np.zeros((8, 8)), np.zeros(8)
    values = {"R_s": number("R_s", machine.R_s, "ohm", above=0), "R_c": machine.R_c}
    for axis, voltage in (("d", V_d), ("q", V_q)):
        for element in pmsm_circuit(axis):
            ends = [(index[axis, node], sign) for node, sign in ((element.start, 1), (element.end, -1)) if node != GROUND]
            if element.kind == "resistor":
                for row, sign in ends:
                    for column, other in ends:
                        matrix[row, column] += sign * other / values[element.name]
                continue
            row = index[axis, f"I_{element.name}"]
            for node, sign in ends:
                matrix[node, row] += sign  # the current leaves the node through the element
                matrix[row, node] += sign
            if element.kind == "source":
                right[row] = number(f"V_{axis}", voltage, "V")
            elif axis == "d":
                matrix[row, index["q", "I_E"]] += omega_e * machine.L_q
            else:
                matrix[row, index["d", "I_E"]] -= omega_e * machine.L_d
                right[row] = omega_e * machine.psi_f
    solution = np.linalg.solve(matrix, right)
    found = {}
    for axis in "dq":
        found[f"i_{axis}"] = -solution[index[axis, "I_V"]]
        found[f"i_o{axis}"] = solution[index[axis, "I_E"]]
        found[f"v_o{axis}"] = solution[index[axis, "gap"]]
    return found


def draw(axes, axis):
    """Draw one axis' circuit on Matplotlib ``axes``, element by element of its netlist."""
    elements = pmsm_circuit(axis)
    series = next(element for element in elements if element.end != GROUND)
    source, *shunts = (element for element in elements if element.end == GROUND)
    drawing = schemdraw.Drawing(show=False)
    drawing.config(fontsize=12, lw=1.5, unit=2.8, font="DejaVu Sans")
    feed = drawing.add(elm.SourceV().up().label(source.label))
    resistor = drawing.add(elm.Resistor().right().label(series.label))
    drawing.add(elm.CurrentLabelInline(direction="in", ofst=0.6).at(resistor).label(series.current))
    for place, shunt in enumerate(shunts):
        drawing.add(elm.Line().right(1.0 if place == 0 else 2.4))
        top = drawing.here
        symbol = elm.Resistor() if shunt.kind == "resistor" else elm.SourceControlledV().reverse()
        part = drawing.add(symbol.down().label(shunt.label, loc="bottom"))
        drawing.add(elm.CurrentLabelInline(direction="in", ofst=0.7).at(part).label(shunt.current, loc="top"))
        bottom = drawing.here
        if place < len(shunts) - 1:
            drawing.add(elm.Dot().at(top))
            drawing.add(elm.Dot().at(bottom))
        drawing.move_from(top)
    drawing.add(elm.Line().at(bottom).to(feed.start))
    drawing.draw(show=False, canvas=axes)
    axes.set_aspect("equal")
    axes.axis("off")
