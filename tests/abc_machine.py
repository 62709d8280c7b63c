"""The doubly fed motor in three-phase natural frames: six windings, inductances that depend on the rotor angle.

Shares nothing with drivelib but the parameter set. Self and mutual inductances of the windings follow
from the cyclic ones: with a magnetising inductance L_m per phase, M = 3/2 L_m, leakages L_s − M and L_r − M.
"""

import numpy as np
from scipy.integrate import solve_ivp

THIRD = 2.0 * np.pi / 3.0
SHIFTS = np.array([[0.0, THIRD, -THIRD], [-THIRD, 0.0, THIRD], [THIRD, -THIRD, 0.0]])


def phases(vector, angle=0.0):
    """Three phase values of the complex vector in a frame at ``angle``."""
    return np.real(vector * np.exp(1j * (angle - THIRD * np.arange(3))))


def vector(abc, angle=0.0):
    """Complex vector, seen from a frame at ``angle``, of three phase values (amplitude-invariant)."""
    return 2.0 / 3.0 * np.sum(abc * np.exp(1j * THIRD * np.arange(3))) * np.exp(-1j * angle)


class AbcMachine:
    """Six flux linkages, speed and electrical rotor angle as the state."""

    def __init__(self, machine, R_r=None):
        self.m = machine
        self.R = np.array([machine.R_s] * 3 + [machine.R_r if R_r is None else R_r] * 3)
        self.L_m = 2.0 * machine.M / 3.0

    def inductance(self, theta):
        own = self.L_m * np.array([[1.0, -0.5, -0.5], [-0.5, 1.0, -0.5], [-0.5, -0.5, 1.0]])
        mutual = self.L_m * np.cos(theta + SHIFTS)
        L_ss = own + (self.m.L_s - self.m.M) * np.eye(3)
        L_rr = own + (self.m.L_r - self.m.M) * np.eye(3)
        return np.block([[L_ss, mutual], [mutual.T, L_rr]])

    def torque(self, i, theta):
        """p ½ i' (dL/dθ) i, from the co-energy."""
        slope = -self.L_m * np.sin(theta + SHIFTS)
        return self.m.p * i[:3] @ slope @ i[3:]

    def currents(self, state):
        return np.linalg.solve(self.inductance(state[7]), state[:6])

    def initial(self, i_s, i_r, omega_m, theta_s=0.0, theta=0.0):
        """State with the given current vectors in the frame at theta_s; ``theta`` is p times the rotor angle."""
        i = np.concatenate([phases(i_s, theta_s), phases(i_r, theta_s - theta)])
        return np.concatenate([self.inductance(theta) @ i, [omega_m, theta]])

    def derivatives(self, t, state, v_s, v_r, T_load):
        i = self.currents(state)
        v = np.concatenate([v_s(t), v_r(t)])
        acceleration = (self.torque(i, state[7]) - T_load - self.m.f * state[6]) / self.m.J
        return np.concatenate([v - self.R * i, [acceleration, self.m.p * state[6]]])

    def run(self, state, t, v_s, v_r, T_load=0.0):
        """States at the times ``t``; v_s and v_r are functions of time that give three phase voltages."""
        solution = solve_ivp(
            self.derivatives, (t[0], t[-1]), state, method="DOP853", t_eval=t, rtol=1e-10, atol=1e-11, args=(v_s, v_r, T_load)
        )
        assert solution.success
        return solution.y.T
