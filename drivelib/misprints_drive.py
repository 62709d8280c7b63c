"""Zidani's simulated drive with a formula taken as printed. For the errata only.

The drive's loop holds the mended formulas. A misprint that only scales a reference is a change of what the loop is
given, so that the same compiled loop shows its effect.
"""

import numpy as np

from drivelib.speed_law import NetworkSpeed, PiSpeed
from drivelib.validation import choice, number

READINGS = ("reference", "measured")
_SMALL = 1e-5  # tanh x = x to 1e-10 of full scale: a linear law in the network's clothes


def with_printed_references(scenario, reading="reference"):
    """Return (scenario, PiSpeed) in which the current references follow Zidani's (16) as printed.

    i_sd* = (L_R/M) φ* makes the flux L_R φ* (the number; the unit does not fit). i_sq* = L_R C*/(P M φ) is 3/2 of what (10)
    asks for at the flux φ that it divides by: the reference, which the machine never reaches, or the one measured. Torque
    command, limit and gains are scaled by what then becomes torque.

    Parameters
    ----------
    scenario : Scenario
    reading : {"reference", "measured"}
        What φ_Rd in the denominator is; the print allows both.
    """
    L_r = scenario.machine.L_r
    share = 1.5 * (L_r if choice("reading", reading, READINGS) == "reference" else 1.0)
    K_p, K_i = scenario.speed_gains
    drive = scenario.changed(phi_r_ref=L_r * scenario.phi_r_ref, T_limit=share * scenario.T_limit)
    return drive, PiSpeed(share * K_p, share * K_i)


def linear_fuzzy(K_e, K_de, K_u):
    """Return the incremental "fuzzy" controller of Zidani's (21) as printed: T* += K_u (K_e e + K_Δe Δe) each sample.

    Parameters
    ----------
    K_e, K_de : float
        Gains of error and of its variation per sample (s/rad).
    K_u : float
        Torque per sample (N m) at u = 1.
    """
    K_e, K_de = number("K_e", K_e, "s/rad", above=0), number("K_de", K_de, "s/rad", above=0)
    K_u = number("K_u", K_u, "N m", above=0)
    scale = _SMALL / max(K_e, K_de)
    return NetworkSpeed(scale * np.array([[K_e, K_de]]), np.zeros(1), np.array([K_u / scale]), form="incremental")
