"""A PM machine with iron loss in complex space vectors: the yardstick of tests/test_pmsm_*.py.

One stator equation replaces the paper's pairs. With x = x_d + j x_q, branch current i_o, flux linkage ψ:

    ψ = λ + L_d i_od + j L_q i_oq        e = j ω ψ        i = i_o + e/R_c        u = R_s i + e
    T = 3/2 P Im(ψ* i_o)                 input 3/2 Re(u i*)

No formula is shared with drivelib; only the meaning of the machine's parameters is.
"""

from types import SimpleNamespace

import numpy as np
from hypothesis import strategies as st

from drivelib.machines import IPMSM, SPMSM, PmsmParameters

MACHINES = {"interior": IPMSM, "surface": SPMSM, "inverse": IPMSM.changed(L_d=0.067, L_q=0.027)}


def state(m, omega_e, i_od, i_oq, model="full"):
    """Return everything that one operating point has, from the phasor equations above."""
    i_o = i_od + 1j * i_oq
    flux = m.psi_f + m.L_d * i_od + 1j * m.L_q * i_oq
    emf = 1j * omega_e * flux
    iron_current = emf / m.R_c
    i = i_o + iron_current if model == "full" else i_o + 0 * emf
    u = m.R_s * i + emf
    return SimpleNamespace(
        i=i,
        u=u,
        torque=1.5 * m.P * (np.conj(flux) * i_o).imag,
        copper=m.R_s * abs(i) ** 2,  # without 3/2, as are the iron loss and the sum
        iron=abs(emf) ** 2 / m.R_c,
        loss=m.R_s * abs(i) ** 2 + abs(emf) ** 2 / m.R_c,
        input=1.5 * (u * np.conj(i)).real,
    )


def at_torque(m, omega_e, T_e, i_od, model="full"):
    """Return the state on the curve of constant torque, i_oq from the torque equation."""
    i_oq = T_e / (1.5 * m.P * (m.psi_f + (m.L_d - m.L_q) * i_od))
    return state(m, omega_e, i_od, i_oq, model)


def motor_branch(m, T_e, count=4001):
    """Return i_od (A) over the whole branch where magnet and reluctance flux still add up to a positive sum."""
    reach = 3 * (m.psi_f / m.L_d + m.psi_f / m.L_q + abs(T_e) / (1.5 * m.P * m.psi_f))
    grid = reach * np.linspace(-1, 1, count) ** 3  # cubic: dense around zero
    return grid[m.psi_f + (m.L_d - m.L_q) * grid > 1e-3 * m.psi_f]


def _log(low, high):
    return st.floats(np.log(low), np.log(high)).map(np.exp)


@st.composite
def machines(draw):
    """Draw a machine between servo and traction size: interior, inverse or surface."""
    L_d = draw(_log(2e-4, 0.1))
    saliency = draw(st.one_of(st.just(1.0), _log(0.2, 5.0)))
    return PmsmParameters(
        R_s=draw(_log(0.02, 10)), L_d=L_d, L_q=L_d * saliency, psi_f=draw(_log(0.02, 1)), P=draw(st.integers(1, 8)),
        V_dc=draw(st.floats(50, 800)), R_c=draw(_log(30, 3000)), J=1e-3, B=0.0, omega_m_rated=100.0, T_rated=1.0,
    )  # fmt: skip


def speeds(low=-2000.0, high=2000.0):
    """Draw an electrical speed (rad/s), standstill among them; nothing denormal."""
    return st.one_of(st.just(0.0), st.floats(low, high)).map(lambda value: round(value, 6))


def torques(low=-20.0, high=20.0):
    """Draw a torque (N m) of either sign, zero among them."""
    return st.one_of(st.just(0.0), st.floats(low, high)).map(lambda value: round(value, 6))
