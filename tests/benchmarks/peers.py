"""Times one unit of each peer that is installed; run by the peers' own Python, prints JSON {peer: seconds or why not}.

Needs nothing of drivelib. Arguments: the rule table as JSON (7 × 7, peaks −3 … 3), repetitions. All peers compute on
one core and are timed by their thread's own processor time, as ours.
"""

import contextlib
import io
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


def motulator(rules, pwm=False):
    """One control period of an induction motor under current-vector and speed control with sensor, 100 µs."""
    import motulator.drive.control.im as control
    from motulator.drive import model

    known = model.InductionMachineInvGammaPars(n_p=2, R_s=3.7, R_R=2.1, L_sgm=0.021, L_M=0.224)
    plant = model.InductionMachinePars(n_p=2, R_s=3.7, R_r=2.5, L_ell=0.023, L_s=0.245)
    settings = control.CurrentVectorControllerCfg(psi_s_nom=1.04, i_s_max=10.0, sensorless=False, T_s=1e-4)

    def steps():
        drive = model.Drive(model.InductionMachine(plant), model.MechanicalSystem(J=0.015), model.VoltageSourceConverter(u_dc=540), pwm=pwm)
        system = control.VectorControlSystem(control.CurrentVectorController(known, settings), control.SpeedController(J=0.015, alpha_s=25.0))
        system.set_speed_ref(lambda t: 60.0)
        drive.mechanics.set_external_load_torque(lambda t: 0.0 if t < 0.02 else 5.0)
        model.Simulation(drive, system, show_progress=False).simulate(t_stop=0.04)

    return steps, 400


def motulator_pwm(rules):
    """The same with carrier comparison."""
    return motulator(rules, pwm=True)


def acmsimpy(rules):
    """One control period of a synchronous motor under speed and current control, compiled by numba: its second tutorial."""
    import tutorials_ep2_full_dynamics as tutorial

    known = tutorial.The_Motor_Controller(1e-4, 1e-4, 4, 3, 1.1, 5e-3, 6e-3, 0.095, 0.0, 0.0006168)
    known.bool_overwrite_speed_commands = False
    plant = tutorial.The_AC_Machine(known)
    current = [tutorial.The_PI_Regulator(6.4, 6.4 * 238 * 1e-4, 600) for _ in range(2)]
    speed = tutorial.The_PI_Regulator(0.038, 0.038 * 30 * 1e-4, 4.0)
    known.cmd_rpm = 50.0
    return lambda: tutorial.ACMSimPyIncremental(0.0, 2.0, plant, known, *current, speed), 20_000


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


def training_problem():
    """Return 1000 samples, two inputs, one output."""
    import numpy as np

    x = np.random.default_rng(0).uniform(-1, 1, (1000, 2))
    return x, 0.7 * np.tanh(1.5 * x[:, 0] - x[:, 1]) + 0.3 * np.sin(2 * x[:, 0] * x[:, 1])


def pyrenn(rules):
    """One epoch of Levenberg-Marquardt for one 2-2-1 start on 1000 samples."""
    import pyrenn as prn

    x, t = training_problem()
    return lambda: prn.train_LM(x.T, t, prn.CreateNN([2, 2, 1]), verbose=False, k_max=3, E_stop=1e-12), 3


def torch_levenberg_marquardt(rules):
    """The same."""
    import torch
    import torch_levenberg_marquardt as tlm

    torch.set_num_threads(1)
    torch.manual_seed(0)
    x, t = (torch.as_tensor(values) for values in training_problem())
    network = torch.nn.Sequential(torch.nn.Linear(2, 2), torch.nn.Tanh(), torch.nn.Linear(2, 1)).double()
    training = tlm.training.LevenbergMarquardtModule(
        model=network, loss_fn=tlm.loss.MSELoss(), learning_rate=1.0, attempts_per_step=10, solve_method="cholesky"
    )
    return lambda: [training.training_step(x, t[:, None]) for _ in range(20)], 20


PEERS = (
    gym_electric_motor, motulator, motulator_pwm, acmsimpy, simpful, pyfuzzylite, pyrenn, torch_levenberg_marquardt,
)  # fmt: skip


def timed(peer, rules, repetitions):
    """Return seconds per unit, one number per repetition, or why there is none."""
    try:
        work, units = peer(rules)
        work()  # compiled and warm
        times = []
        for _ in range(repetitions):
            began = time.thread_time()
            work()
            times.append((time.thread_time() - began) / units)
    except ImportError:
        return "peer not installed"
    except Exception as error:
        return f"peer failed: {type(error).__name__}: {error}"
    return times


def main():
    """Time every peer and print what was found."""
    rules, repetitions = json.loads(sys.argv[1]), int(sys.argv[2])
    warnings.simplefilter("ignore")
    with contextlib.redirect_stdout(io.StringIO()):  # some of them talk
        found = {peer.__name__.replace("_", "-"): timed(peer, rules, repetitions) for peer in PEERS}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
