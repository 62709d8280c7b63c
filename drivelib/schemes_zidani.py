"""The four control schemes that Zidani draws, as data for `drivelib.diagrams`, with the statements of the text that they must meet."""

from drivelib.diagrams import Block, Scheme, Signal

AXES = ("sd", "sq", "rd", "rq")
UPPER = {"sd": "Sd", "sq": "Sq", "rd": "Rd", "rq": "Rq"}


def current_scheme():
    """Return fig. 2: four PI current loops, compensation terms (14), and (12) solved for the inverters' voltages."""
    blocks = [
        Block("flux command", "input", r"$\varphi_{R}^*$", -0.4, 6.4),
        Block("torque command", "input", r"$C_{em}^*$", -0.4, 3.2),
        Block("references", "block", "current\nreferences\n(16)", 1.3, 4.8, (2.2, 8.6)),
        Block("decoupling", "block", "(12)\nsolved\nfor\n$V_S, V_R$", 9.5, 4.8, (1.5, 8.6)),
        Block("stator inverter", "inverter", "stator inverter", 11.9, 7.0),
        Block("rotor inverter", "inverter", "rotor inverter", 11.9, 3.2),
        Block("motor", "dfim", "DFIM", 14.4, 5.1),
        Block("compensation", "block", "compensation terms (14)", 9.6, -1.1, (5.4, 0.9)),
        Block("frame speeds", "input", r"$\omega_S,\ \omega_R$", 5.8, -1.1),
    ]
    signals = [
        Signal("phi_R*", "flux command", "references", path=((-0.3, 6.4),)),
        Signal("C_em*", "torque command", "references", path=((-0.3, 3.2),)),
        Signal("V_S", "decoupling", "stator inverter", "$V_S$", path=((10.8, 7.0),), at=(10.75, 7.3)),
        Signal("V_R", "decoupling", "rotor inverter", "$V_R$", path=((10.8, 3.2),), at=(10.75, 3.5)),
        Signal("stator voltage", "stator inverter", "motor", "stator", path=((14.4, 7.0),), at=(13.5, 7.28)),
        Signal("rotor voltage", "rotor inverter", "motor", "rotor", path=((14.4, 3.2),), at=(13.5, 3.48)),
        Signal("omega", "frame speeds", "compensation", path=((6.0, -1.1),)),
        Signal("i_sd, i_sq, i_rd, i_rq", "motor", "compensation", r"$I_{Sd}, I_{Sq}, I_{Rd}, I_{Rq}$", path=((15.8, 5.1), (15.8, -1.1)), at=(14.1, -0.75)),
    ]
    for axis, y in zip(AXES, (8.4, 6.0, 3.6, 1.2), strict=True):
        name = UPPER[axis]
        blocks += [
            Block(f"error {axis}", "sum", "", 3.6, y),
            Block(f"PI {axis}", "pi", "PI", 5.2, y),
            Block(f"voltage {axis}", "sum", "", 7.3, y),
        ]
        signals += [
            Signal(f"i_{axis}*", "references", f"error {axis}", rf"$I_{{{name}}}^*$", path=((3.0, y),), at=(2.86, y + 0.36)),
            Signal(f"i_{axis}", "motor", f"error {axis}", rf"$I_{{{name}}}$", sign=-1, path=((3.6, y - 0.95),), at=(4.05, y - 0.85), stub=True),
            Signal(f"error of i_{axis}", f"error {axis}", f"PI {axis}"),
            Signal(f"v_t{axis}c", f"PI {axis}", f"voltage {axis}", rf"$V_{{t{name}c}}$", at=(6.35, y + 0.36)),
            Signal(f"v_t{axis}c1", "compensation", f"voltage {axis}", rf"$V_{{t{name}c1}}$", path=((7.3, y - 0.95),), at=(8.0, y - 0.85), stub=True),
            Signal(f"v_t{axis}", f"voltage {axis}", "decoupling", rf"$V_{{t{name}}}$", path=((8.0, y),), at=(8.1, y + 0.36)),
        ]
    return Scheme(tuple(blocks), tuple(signals))


def current_statements(scheme):
    """Return {statement: holds} for fig. 2, from the text of section III.A."""
    found = {"the references follow from flux and torque command": scheme.inputs("references") == {"phi_R*", "C_em*"}}
    for axis in AXES:
        found |= {
            f"{axis}: the regulator's error is reference less current": scheme.signs(f"error {axis}") == {f"i_{axis}*": 1, f"i_{axis}": -1},
            f"{axis}: (14), regulated part plus compensation term": scheme.signs(f"voltage {axis}") == {f"v_t{axis}c": 1, f"v_t{axis}c1": 1},
            f"{axis}: the loop is closed": scheme.in_loop(f"error {axis}", f"PI {axis}", "decoupling", "motor"),
        }
    return found | {
        "there are four current correctors": scheme.kinds().count("pi") == 4,
        "the four combined voltages become stator and rotor voltage": scheme.inputs("decoupling") == {f"v_t{axis}" for axis in AXES}
        and scheme.outputs("decoupling") == {"V_S", "V_R"},
        "stator and rotor are each fed by an inverter": (scheme.inputs("stator inverter"), scheme.inputs("rotor inverter")) == ({"V_S"}, {"V_R"})
        and scheme.inputs("motor") == {"stator voltage", "rotor voltage"},
        "the compensation takes currents and both frame speeds": scheme.inputs("compensation") == {"omega", "i_sd, i_sq, i_rd, i_rq"},
        "no block is left loose": not scheme.loose_ends(),
    }


def speed_scheme():
    """Return fig. 3: PI on the speed error, torque command taken as torque, mechanical part (5)."""
    blocks = (
        Block("command", "input", r"$\Omega^*$", 0, 0),
        Block("speed error", "sum", "", 1.1, 0),
        Block("PI", "pi", r"$K_p+\frac{K_i}{s}$", 3.1, 0, (2.1, 1.3)),
        Block("torque loop", "block", "(16) and (17):\n$C_{em}=C_{em}^*$", 6.7, 0, (3.1, 1.2)),
        Block("acceleration", "sum", "", 9.7, 0),
        Block("mechanics", "block", r"$\dfrac{1}{J\,s+f}$", 11.6, 0, (1.7, 1.2)),
        Block("load", "input", r"$C_r$", 9.7, 1.3),
        Block("speed", "output", r"$\Omega$", 14.0, 0),
    )
    signals = (
        Signal("Omega*", "command", "speed error"),
        Signal("e", "speed error", "PI", "$e$"),
        Signal("C_em*", "PI", "torque loop", r"$C_{em}^*$"),
        Signal("C_em", "torque loop", "acceleration", r"$C_{em}$", at=(8.85, 0.34)),
        Signal("C_r", "load", "acceleration", sign=-1, path=((9.7, 1.4),)),
        Signal("J dOmega/dt + f Omega", "acceleration", "mechanics"),
        Signal("Omega", "mechanics", "speed", path=((13.1, 0),)),
        Signal("Omega", "mechanics", "speed error", sign=-1, path=((13.1, 0), (13.1, -1.5), (1.1, -1.5))),
    )
    return Scheme(blocks, signals)


def speed_statements(scheme):
    """Return {statement: holds} for fig. 3, from the text of section IV.A."""
    return {
        "the error is reference less speed": scheme.signs("speed error") == {"Omega*": 1, "Omega": -1},
        "a PI regulator acts on the error alone": scheme.inputs("PI") == {"e"} and scheme.kinds().count("pi") == 1,
        "its output is the torque command of (16)": scheme.outputs("PI") == {"C_em*"},
        "the load torque is subtracted from the motor's, (5)": scheme.signs("acceleration") == {"C_em": 1, "C_r": -1},
        "the speed loop is closed": scheme.in_loop("speed error", "PI", "torque loop", "mechanics"),
        "nothing else enters": scheme.kinds().count("input") == 2,
        "no block is left loose": not scheme.loose_ends(),
    }


def fuzzy_scheme():
    """Return fig. 4: error and its variation, input gains, fuzzification, 49 rules, defuzzification, output gain."""
    blocks = (
        Block("command", "input", r"$\Omega^*$", 0, 1.2),
        Block("speed", "input", r"$\Omega$", 0, -0.4),
        Block("error", "sum", "", 1.0, 1.2),
        Block("delay", "block", "$z^{-1}$", 2.3, -0.9, (0.9, 0.8)),
        Block("variation", "sum", "", 3.4, -0.9),
        Block("K_e", "gain", "$K_e$", 5.1, 1.2),
        Block("K_de", "gain", r"$K_{\Delta e}$", 5.1, -0.9, (1.2, 1.1)),
        Block("fuzzification", "sets", "fuzzification\n(fig. 5)", 7.5, 0.15, (2.8, 2.9)),
        Block("inference", "block", "inference\nmax–min\n49 rules\n(table I)", 10.5, 0.15, (2.2, 2.2)),
        Block("defuzzification", "centroid", "centre of\ngravity", 13.2, 0.15, (2.0, 2.2)),
        Block("K_u", "gain", "$K_u$", 15.4, 0.15),
        Block("torque command", "output", r"$T_e^*$", 16.7, 0.15),
    )
    signals = (
        Signal("Omega*", "command", "error"),
        Signal("Omega", "speed", "error", sign=-1, path=((1.0, -0.4),)),
        Signal("e", "error", "K_e", "$e(k)$", path=((1.6, 1.2), (3.4, 1.2)), at=(2.6, 1.5)),
        Signal("e", "error", "delay", path=((1.6, 1.2), (1.6, -0.9))),
        Signal("e", "error", "variation", path=((1.6, 1.2), (3.4, 1.2))),
        Signal("e(k-1)", "delay", "variation", sign=-1),
        Signal("de", "variation", "K_de", r"$\Delta e$", at=(3.98, -0.58)),
        Signal("K_e e", "K_e", "fuzzification", path=((5.9, 1.2),)),
        Signal("K_de de", "K_de", "fuzzification", path=((5.9, -0.9),)),
        Signal("memberships", "fuzzification", "inference"),
        Signal("clipped sets", "inference", "defuzzification"),
        Signal("u", "defuzzification", "K_u", "$u$", at=(14.5, 0.45)),
        Signal("T_e*", "K_u", "torque command"),
    )
    return Scheme(blocks, signals)


def fuzzy_statements(scheme):
    """Return {statement: holds} for fig. 4, from (21)-(24) and the text of section IV.B."""
    return {
        "(23): the error is reference less speed": scheme.signs("error") == {"Omega*": 1, "Omega": -1},
        "(24): its variation is this sample less the last": scheme.signs("variation") == {"e": 1, "e(k-1)": -1} and scheme.inputs("delay") == {"e"},
        "the gains K_e and K_Δe scale error and variation": scheme.inputs("K_e") == {"e"} and scheme.inputs("K_de") == {"de"},
        "both scaled inputs are made fuzzy": scheme.inputs("fuzzification") == {"K_e e", "K_de de"},
        "max–min inference with the rules, then the centre of gravity": scheme.outputs("inference") == scheme.inputs("defuzzification"),
        "(22): K_u scales the output to the torque command": scheme.inputs("K_u") == {"u"} and scheme.outputs("K_u") == {"T_e*"},
        "there are three gains": scheme.kinds().count("gain") == 3,
        "no block is left loose": not scheme.loose_ends(),
    }


def whole_scheme():
    """Return fig. 9: direct vector control with one speed controller, the four loops of fig. 2 and two PWM inverters."""
    blocks = (
        Block("speed command", "input", r"$\Omega^*$", 0.0, 7.0),
        Block("speed error", "sum", "", 0.9, 7.0),
        Block("speed controller", "network", "speed\ncontroller:\nPI, FLC\nor ANN", 2.7, 7.0, (2.2, 2.2)),
        Block("flux command", "input", r"$\varphi_R^*$", 4.3, 5.4),
        Block("references", "block", "current\nrefer-\nences\n(16)", 5.9, 6.2, (1.6, 2.9)),
        Block("current control", "block", "four PI\nloops,\ncompen-\nsation\n(fig. 2)", 8.8, 6.2, (1.8, 2.9)),
        Block("stator transformation", "block", "dq →\nabc", 11.6, 7.4, (1.2, 1.2)),
        Block("rotor transformation", "block", "dq →\nabc", 11.6, 5.0, (1.2, 1.2)),
        Block("stator inverter", "inverter", "PWM inverter 1", 13.9, 7.4),
        Block("rotor inverter", "inverter", "PWM inverter 2", 13.9, 5.0),
        Block("motor", "dfim", "DFIM", 16.3, 6.2),
        Block("measured currents", "block", "abc →\ndq", 13.9, 2.2, (1.3, 1.2)),
        Block("flux estimate", "block", "flux\nestimate (4)", 8.8, 2.2, (2.5, 1.2)),
        Block("frame", "block", r"frame: $\omega_S$, $\omega_R=\omega_S-p\,\Omega$" + "\n" + r"$\theta_S=\int\omega_S\,dt$, $\theta_R=\theta_S-p\,\theta$", 8.8, -0.2, (5.8, 1.5)),
    )
    signals = (
        Signal("Omega*", "speed command", "speed error"),
        Signal("e", "speed error", "speed controller"),
        Signal("C_em*", "speed controller", "references", r"$C_{em}^*$", path=((4.4, 7.0),), at=(4.42, 7.4)),
        Signal("phi_R*", "flux command", "references", path=((4.4, 5.4),)),
        Signal("i*", "references", "current control", r"$I_{Sdq}^*$" + "\n" + r"$I_{Rdq}^*$", at=(7.28, 6.95)),
        Signal("V_Sdq*", "current control", "stator transformation", r"$V_{Sdq}^*$", path=((10.0, 7.4),), at=(10.35, 7.78)),
        Signal("V_Rdq*", "current control", "rotor transformation", r"$V_{Rdq}^*$", path=((10.0, 5.0),), at=(10.35, 5.4)),
        Signal("V_Sabc*", "stator transformation", "stator inverter"),
        Signal("V_Rabc*", "rotor transformation", "rotor inverter"),
        Signal("stator voltage", "stator inverter", "motor", "stator", path=((16.3, 7.4),), at=(15.2, 7.7)),
        Signal("rotor voltage", "rotor inverter", "motor", "rotor", path=((16.3, 5.0),), at=(15.2, 5.3)),
        Signal("i_abc", "motor", "measured currents", r"$i_S,\ i_R$", path=((16.8, 2.2),), at=(15.7, 2.55)),
        Signal("i_dq", "measured currents", "flux estimate", r"$I_{Sdq}, I_{Rdq}$", path=((10.9, 2.2),), at=(12.0, 2.55)),
        Signal("i_dq", "measured currents", "current control", path=((10.9, 2.2), (10.9, 3.9), (9.3, 3.9))),
        Signal("phi_r", "flux estimate", "references", r"$\hat\varphi_{Rd}$", path=((5.9, 2.2),), at=(6.7, 2.6)),
        Signal("phi_r", "flux estimate", "frame", r"$\hat\varphi_{Rdq}$", at=(9.5, 1.1)),
        Signal("omega_S, omega_R", "frame", "current control", r"$\omega_S,\ \omega_R$", path=((8.3, 3.7),), at=(7.4, 3.9), stub=True),
        Signal("theta_S", "frame", "stator transformation", r"$\theta_S$", path=((11.6, 6.2),), at=(12.05, 6.4), stub=True),
        Signal("theta_R", "frame", "rotor transformation", r"$\theta_R$", path=((11.6, 3.8),), at=(12.05, 4.0), stub=True),
        Signal("theta_S, theta_R", "frame", "measured currents", r"$\theta_S,\ \theta_R$", path=((13.9, 0.1),), at=(13.0, 0.5)),
        Signal("Omega", "motor", "speed error", r"$\Omega$", sign=-1, path=((17.8, 6.2), (17.8, -1.8), (8.8, -1.8), (0.9, -1.8)), at=(3.2, -1.45)),
        Signal("Omega", "motor", "frame", path=((17.8, 6.2), (17.8, -1.8), (8.8, -1.8))),
    )
    return Scheme(blocks, signals)


def whole_statements(scheme):
    """Return {statement: holds} for fig. 9, from sections IV.C and V."""
    return {
        "the error is reference less speed": scheme.signs("speed error") == {"Omega*": 1, "Omega": -1},
        "one speed controller acts on the error alone": scheme.inputs("speed controller") == {"e"},
        "it gives the torque command": scheme.outputs("speed controller") == {"C_em*"},
        "the references (16) take torque command, flux command and flux": scheme.inputs("references") == {"C_em*", "phi_R*", "phi_r"},
        "direct vector control: the flux is estimated from measured currents": scheme.inputs("flux estimate") == {"i_dq"},
        "and the frame follows that estimate, not the reference": scheme.inputs("frame") == {"phi_r", "Omega"},
        "stator and rotor are each fed by an inverter": scheme.kinds().count("inverter") == 2
        and scheme.inputs("motor") == {"stator voltage", "rotor voltage"},
        "the regulators take references, measured currents and both frame speeds": scheme.inputs("current control") == {"i*", "i_dq", "omega_S, omega_R"},
        "each inverter gets its voltage through its own angle": scheme.inputs("stator transformation") == {"V_Sdq*", "theta_S"}
        and scheme.inputs("rotor transformation") == {"V_Rdq*", "theta_R"}
        and (scheme.inputs("stator inverter"), scheme.inputs("rotor inverter")) == ({"V_Sabc*"}, {"V_Rabc*"}),
        "measured currents are transformed with the same angles": scheme.inputs("measured currents") == {"i_abc", "theta_S, theta_R"},
        "speed loop and current loops are closed": scheme.in_loop("speed controller", "references", "current control", "motor", "measured currents"),
        "no block is left loose": not scheme.loose_ends(),
    }
