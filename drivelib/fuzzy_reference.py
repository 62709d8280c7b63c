"""Table I and figure 5 in scikit-fuzzy, as a user of that library would write them.

The slow, independent twin of ``fuzzy.fuzzy_output``: about 20 ms per sample, on a sampled universe.
In a file of its own because importing scikit-fuzzy takes a second.
"""

import numpy as np
import skfuzzy
from skfuzzy import control

from drivelib.fuzzy import LABELS, PEAKS, RULES
from drivelib.validation import number


def control_system(samples=61):
    """Return the 49-rule controller as a scikit-fuzzy simulation.

    Set ``input["e"]``, ``input["de"]``, call ``compute()``, read ``output["u"]``; inputs beyond ±1 are
    clipped by the library.

    Parameters
    ----------
    samples : int
        Points of each universe on [−1, 1], one more than a multiple of 12. Then all peaks and all
        crossings of neighbouring sets are points of the universe, and what is left of the sampling
        error is at most 4 h² with the step h = 2/(samples − 1): scikit-fuzzy adds the points where a
        clipped set meets its own flanks, and misses only where it meets a neighbour's, at most twice
        under one output. There the sampled union is too large by at most 3 h²/8, at most 2/3 away
        from the centroid, in an area of at least 1/8.

    Returns
    -------
    skfuzzy.control.ControlSystemSimulation

    Raises
    ------
    ValueError
        If ``samples`` is not one more than a multiple of 12.

    References
    ----------
    .. [1] Zidani, Brakta, Bendjeghaba, sec. IV.B: figure 5, table I, max–min, center of gravity.
    """
    samples = number("samples", samples, "points", at_least=13, whole=True)
    if samples % 12 != 1:
        raise ValueError(f"samples = {samples} points: must be one more than a multiple of 12, such as 13, 61 or 121")
    universe = np.linspace(-1.0, 1.0, samples)
    e = control.Antecedent(universe, "e")
    de = control.Antecedent(universe, "de")
    u = control.Consequent(universe, "u", defuzzify_method="centroid")
    for variable in (e, de, u):
        for k, label in enumerate(LABELS):
            # The outermost sets have their outer foot at their own peak: half triangles.
            feet = PEAKS[max(k - 1, 0)], PEAKS[k], PEAKS[min(k + 1, 6)]
            variable[label] = skfuzzy.trimf(universe, feet)
    rules = [
        control.Rule(e[LABELS[i]] & de[LABELS[j]], u[LABELS[RULES[i, j] + 3]]) for i in range(7) for j in range(7)
    ]
    return control.ControlSystemSimulation(control.ControlSystem(rules))
