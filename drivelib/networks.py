"""Eskander's three networks: what they learn from, and what they cost beside a table and a formula.

The paper trains off line on "simulation results" of the loss model at different operating points. How many
points, and where, it does not say; here they are a regular grid over the operating range.
"""

from dataclasses import dataclass

import numpy as np

from drivelib import pmsm_angle, pmsm_optimum
from drivelib.pmsm_law import NetworkLaw
from drivelib.validation import grid, number


@dataclass(frozen=True)
class TrainingData:
    """Inputs (n, n_in) and targets (n, n_out) in SI units, with the names of their columns."""

    x: np.ndarray
    t: np.ndarray
    inputs: tuple[str, ...]
    targets: tuple[str, ...]


def nn_i_data(machine, i_q, omega_m, *, model="simplified"):
    """Return what NN_I learns: (i_q*, ω_r) → i_d,opt, from the optimum at given i_oq (section 3).

    Parameters
    ----------
    i_q, omega_m : array_like
        Grids of q-axis current (A) and mechanical speed (rad/s).
    """
    current, speed = _mesh(("i_q", i_q, "A"), ("omega_m", omega_m, "rad/s"))
    i_d = pmsm_optimum.optimal_i_od_at_i_oq(machine, machine.P * speed, current, model=model)
    return TrainingData(np.column_stack([current, speed]), i_d[:, None], ("i_q*", "omega_r"), ("i_d",))


def nn_s_data(machine, omega_m, T_e, *, model="simplified"):
    """Return what NN_S learns: (ω_r, load) → (i_q*, i_d,opt), from (14) and (16) mended (section 5).

    Parameters
    ----------
    omega_m, T_e : array_like
        Grids of mechanical speed (rad/s) and torque (N m).
    """
    speed, torque = _mesh(("omega_m", omega_m, "rad/s"), ("T_e", T_e, "N m"))
    i_q = torque / (1.5 * machine.P * machine.psi_f)
    i_d = pmsm_optimum.optimal_i_od_surface(machine, machine.P * speed, model=model)
    return TrainingData(np.column_stack([speed, torque]), np.column_stack([i_q, i_d]), ("omega_r", "T_L"), ("i_q*", "i_d"))


def nn_a_data(machine, omega_m, T_e):
    """Return what NN_A learns: (ω_r, load) → φ_op in radians, from (20) (section 6.3)."""
    speed, torque = _mesh(("omega_m", omega_m, "rad/s"), ("T_e", T_e, "N m"))
    phi = pmsm_angle.inverter_angle(machine, machine.P * speed, torque / (1.5 * machine.P * machine.psi_f))
    return TrainingData(np.column_stack([speed, torque]), phi[:, None], ("omega_r", "T_L"), ("phi",))


def as_law(network):
    """Return a trained network as the law of a drive loop (`pmsm_law.NetworkLaw`), with its training range."""
    return NetworkLaw(*network.folded(), low=network.inputs.low, high=network.inputs.high)


def sse_goal(data, rms_percent):
    """Return the sum squared error, targets mapped to [−1, 1], whose RMS is a share (%) of each target's range."""
    number("rms_percent", rms_percent, "%", above=0)
    return data.t.size * (2 * rms_percent / 100) ** 2


def epochs_to(result, goal):
    """Return the epoch at which each start's error first meets ``goal``, shape (S,); infinity where it never does."""
    met = result.history["sse"] <= goal
    return np.where(met.any(axis=1), met.argmax(axis=1), np.inf)


def operations(n_in, n_hidden, n_out):
    """Return {operation: count} for one evaluation of W2 tanh(W1 x + B1) + B2."""
    products = n_in * n_hidden + n_hidden * n_out
    return {"multiply-add": products, "tanh": n_hidden}


# i_d = ΔL k i_q²/x − b, x = (a + sqrt(a² + 4 ΔL² k i_q²))/2, a = λ − b ΔL, with
# b = ω² λ L_d/(R_s R_c + ω² L_d²) and k = (R_s R_c + ω² L_q²)/(R_s R_c + ω² L_d²); constants folded.
FORMULA_OPERATIONS = {"multiply-add": 11, "divide": 2, "square root": 1}
TABLE_OPERATIONS = {"multiply-add": 7}  # bilinear: two interpolations along one axis, one along the other, two indices


def table_size_for(function, low, high, error, *, largest=200, check=241):
    """Return the smallest n for which an n × n bilinear table of ``function(x, y)`` errs by at most ``error``.

    Parameters
    ----------
    function : callable
        Takes and returns arrays.
    low, high : pair of float
        Corner values of the two inputs.
    largest : int
        Where the search gives up; then infinity is returned.
    check : int
        Points per axis at which the error is taken.
    """
    from scipy.interpolate import RegularGridInterpolator

    fine = [np.linspace(a, b, check) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*fine, indexing="ij"), axis=-1)
    wanted = function(points[..., 0], points[..., 1])
    for n in range(2, largest + 1):
        axes = [np.linspace(a, b, n) for a, b in zip(low, high, strict=True)]
        nodes = np.meshgrid(*axes, indexing="ij")
        if np.max(np.abs(RegularGridInterpolator(axes, function(*nodes))(points) - wanted)) <= error:
            return n
    return np.inf


def _mesh(first, second):
    axes = [grid(*axis) for axis in (first, second)]
    return [values.ravel() for values in np.meshgrid(*axes, indexing="ij")]
