"""The control schemes that the papers draw, as data for `drivelib.diagrams`, with the statements that they must meet."""

from drivelib.diagrams import Block, Scheme, Signal


def ipmsm_scheme():
    """Return Eskander's fig. 4: a PI controller on torque gives i_q*, the network NN_I gives i_d from i_q* and ω_r."""
    blocks = (
        Block("command", "input", r"$T_e^*$", 0, 3),
        Block("torque error", "sum", "", 1.0, 3),
        Block("PI", "pi", "PI", 2.5, 3),
        Block("NN_I", "network", "NN$_I$\n2–2–1, tanh", 5.2, 0.9, (2.1, 1.2)),
        Block("transformation", "block", "dq → abc\ncurrents", 8.2, 2.4, (1.6, 2.2)),
        Block("inverter", "inverter", "current-controlled\nPWM inverter", 10.9, 2.4),
        Block("motor", "motor", "IPMSM", 13.3, 2.4),
        Block("torque", "block", "torque (3)", 10.9, 5.0, (1.7, 0.8)),
    )
    signals = (
        Signal("T_e*", "command", "torque error"),
        Signal("error", "torque error", "PI"),
        Signal("i_q*", "PI", "transformation", r"$i_q^*$", path=((3.6, 3.0), (4.0, 3.0)), at=(5.2, 3.25)),
        Signal("i_q*", "PI", "NN_I", path=((3.6, 3.0), (3.6, 1.15))),
        Signal("i_d_op", "NN_I", "transformation", r"$i_{d,op}$", path=((6.5, 0.9), (6.5, 1.7)), at=(7.0, 1.95)),
        Signal("i_abc*", "transformation", "inverter", r"$i_{abc}^*$"),
        Signal("i_abc", "inverter", "motor", r"$i_{abc}$"),
        Signal("i_abc", "motor", "torque", path=((13.3, 5.0),)),
        Signal("T_e", "torque", "torque error", r"$T_e$", sign=-1, path=((1.0, 5.0),), at=(5.2, 5.28)),
        Signal("omega_r", "motor", "NN_I", r"$\omega_r$", path=((13.3, -0.4), (3.6, -0.4), (3.6, 0.65)), at=(8.2, -0.18)),
        Signal("theta_r", "motor", "transformation", r"$\theta_r$", path=((14.3, 2.4), (14.3, 0.3), (8.2, 0.3)), at=(9.8, 0.5)),
    )
    return Scheme(blocks, signals)


def ipmsm_statements(scheme):
    """Return {statement: holds} for fig. 4, from the text of section 3.1."""
    return {
        "the torque error is command minus actual torque": scheme.signs("torque error") == {"T_e*": 1, "T_e": -1},
        "the PI controller gives i_q* from the torque error": scheme.inputs("PI") == {"error"} and scheme.outputs("PI") == {"i_q*"},
        "the network's inputs are i_q* and the rotor speed": scheme.inputs("NN_I") == {"i_q*", "omega_r"},
        "the network's one output is i_d,op": scheme.outputs("NN_I") == {"i_d_op"},
        "i_d,op and i_q* become three phase currents": {"i_q*", "i_d_op"} <= scheme.inputs("transformation"),
        "the torque loop is closed": scheme.in_loop("torque error", "PI", "transformation", "inverter", "motor"),
        "the network lies inside the loop": scheme.in_loop("NN_I", "motor"),
        "no block is left loose": not scheme.loose_ends(),
    }


def spmsm_scheme():
    """Return Eskander's fig. 11: the network NN_S gives both current references from speed and torque command, no PI."""
    blocks = (
        Block("command", "input", r"$T_e^*$", 0, 2.75),
        Block("NN_S", "network", "NN$_S$\n2–2–2, tanh", 2.0, 2.4, (1.8, 1.6)),
        Block("transformation", "block", "dq → abc\ncurrents", 5.6, 2.4, (1.6, 1.9)),
        Block("inverter", "inverter", "current-controlled\nPWM inverter", 8.3, 2.4),
        Block("motor", "motor", "SPMSM", 10.7, 2.4),
    )
    signals = (
        Signal("T_e*", "command", "NN_S", path=((0.1, 2.75),)),
        Signal("i_q*", "NN_S", "transformation", r"$i_q^*$", path=((3.9, 2.85),), at=(3.9, 3.08)),
        Signal("i_d_op", "NN_S", "transformation", r"$i_{d,op}$", path=((3.9, 2.0),), at=(3.9, 2.24)),
        Signal("i_abc*", "transformation", "inverter", r"$i_{abc}^*$"),
        Signal("i_abc", "inverter", "motor", r"$i_{abc}$"),
        Signal("omega_r", "motor", "NN_S", r"$\omega_r$", path=((10.7, -0.2), (0.5, -0.2), (0.5, 2.05)), at=(5.6, 0.02)),
        Signal("theta_r", "motor", "transformation", r"$\theta_r$", path=((11.7, 2.4), (11.7, 0.5), (5.6, 0.5)), at=(7.2, 0.72)),
    )
    return Scheme(blocks, signals)


def spmsm_statements(scheme):
    """Return {statement: holds} for fig. 11, from the text of sections 5.1 and 5.2."""
    return {
        "there is no PI controller": "pi" not in scheme.kinds(),
        "the torque command enters the network directly": scheme.inputs("NN_S") == {"T_e*", "omega_r"},
        "the network's outputs are i_q* and i_d,op": scheme.outputs("NN_S") == {"i_q*", "i_d_op"},
        "both references become three phase currents": {"i_q*", "i_d_op"} <= scheme.inputs("transformation"),
        "torque is not fed back": "T_e" not in {signal.name for signal in scheme.signals},
        "only the speed closes a loop through the network": scheme.in_loop("NN_S", "motor"),
        "no block is left loose": not scheme.loose_ends(),
    }
