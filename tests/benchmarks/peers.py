"""Times one unit of each peer that is installed; run by the peers' own Python, prints JSON {peer: seconds or why not}.

Needs nothing of drivelib. Arguments: the rule table as JSON (7 × 7, peaks −3 … 3), repetitions.
"""

import json
import sys
import time
import warnings

LABELS = ("NG", "NM", "NP", "Z", "PP", "PM", "PG")
PEAKS = [k / 3 for k in range(-3, 4)]


def gym_electric_motor(rules):
    """One step of 100 µs of the doubly fed induction motor with continuous voltages."""
    import gym_electric_motor as gem

    env = gem.make("Cont-CC-DFIM-v0", tau=1e-4)
    env.reset()
    action = env.action_space.sample() * 0.0

    def steps():
        for _ in range(300):
            _, _, terminated, _, _ = env.step(action)
            if terminated:
                env.reset()

    return steps, 300


def motulator(rules):
    """One control period of an induction-motor drive under vector control."""
    raise ImportError("no script for the version at hand")


def simpful(rules):
    """One new input of the 49 rules, Mamdani."""
    import simpful as sf

    system = sf.FuzzySystem(show_banner=False)
    for name in ("e", "de", "u"):
        sets = [
            sf.TriangleFuzzySet(PEAKS[max(k - 1, 0)], PEAKS[k], PEAKS[min(k + 1, 6)], term=label) for k, label in enumerate(LABELS)
        ]
        system.add_linguistic_variable(name, sf.LinguisticVariable(sets, universe_of_discourse=[-1, 1]))
    system.add_rules([f"IF (e IS {LABELS[i]}) AND (de IS {LABELS[j]}) THEN (u IS {LABELS[rules[i][j] + 3]})" for i in range(7) for j in range(7)])

    def inputs():
        for k in range(5):
            system.set_variable("e", 0.1 + 0.11 * k)
            system.set_variable("de", 0.3 - 0.07 * k)
            system.inference()

    return inputs, 5


def pyfuzzylite(rules):
    """One new input of the 49 rules, minimum, maximum, centroid of 200 points."""
    import fuzzylite as fl

    def terms():
        return [fl.Triangle(label, PEAKS[max(k - 1, 0)], PEAKS[k], PEAKS[min(k + 1, 6)]) for k, label in enumerate(LABELS)]

    engine = fl.Engine(
        input_variables=[fl.InputVariable(name=name, minimum=-1, maximum=1, terms=terms()) for name in ("e", "de")],
        output_variables=[
            fl.OutputVariable(name="u", minimum=-1, maximum=1, aggregation=fl.Maximum(), defuzzifier=fl.Centroid(200), terms=terms())
        ],
        rule_blocks=[
            fl.RuleBlock(
                conjunction=fl.Minimum(), implication=fl.Minimum(), activation=fl.General(),
                rules=[
                    fl.Rule.create(f"if e is {LABELS[i]} and de is {LABELS[j]} then u is {LABELS[rules[i][j] + 3]}")
                    for i in range(7) for j in range(7)
                ],
            )
        ],
    )  # fmt: skip

    def inputs():
        for k in range(20):
            engine.input_variable("e").value = 0.1 + 0.04 * k
            engine.input_variable("de").value = 0.3 - 0.03 * k
            engine.process()

    return inputs, 20


def pyrenn(rules):
    """One epoch of Levenberg-Marquardt for one 2-2-1 start on 1000 samples."""
    import numpy as np
    import pyrenn as prn

    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (2, 1000))
    t = 0.7 * np.tanh(1.5 * x[0] - x[1]) + 0.3 * np.sin(2 * x[0] * x[1])
    return lambda: prn.train_LM(x, t, prn.CreateNN([2, 2, 1]), verbose=False, k_max=3, E_stop=1e-12), 3


def main():
    """Time every peer and print what was found."""
    rules, repetitions = json.loads(sys.argv[1]), int(sys.argv[2])
    found = {}
    warnings.simplefilter("ignore")
    for peer in (gym_electric_motor, motulator, simpful, pyfuzzylite, pyrenn):
        name = peer.__name__.replace("_", "-")
        try:
            work, units = peer(rules)
            work()
            found[name] = []
            for _ in range(repetitions):
                began = time.perf_counter()
                work()
                found[name].append((time.perf_counter() - began) / units)
        except ImportError:
            found[name] = "peer not installed"
        except Exception as error:
            found[name] = f"peer failed: {type(error).__name__}: {error}"
    print(json.dumps(found))


if __name__ == "__main__":
    main()
