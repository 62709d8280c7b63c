"""A trained network in Q15: integer weights, the integer arithmetic that the exported C does, and its error bound.

Inputs and outputs are int16, q = value / full_scale · 2¹⁵. A row of weights (one neuron) holds f fractional
bits of its own, chosen as large as 16-bit weights and a 32-bit accumulator allow, so that no sum can overflow.
tanh is a table of 2⁶ steps per unit up to 8 with linear interpolation; beyond, it saturates.

Outside the training range nothing is extrapolated. The network is asked at the nearest |ω_m| and |T| inside; with ω and ω'
the electrical speed there and the one asked for (at most the end of the range), a PMSM's currents then follow as

    i_oq = (i_q − ω (ψ + L_d i_d)/R_c)/(1 + ω² L_d L_q/R_c²)      i_od = i_d + ω L_q i_oq/R_c
    i_d' = i_od − ω' L_q s i_oq/R_c      i_q' = s i_oq + ω' (ψ + L_d i_od)/R_c

with s = T/T_low below the range, else the sign of T: the torque is in proportion to i_oq at given i_od, and a mirrored
point loses as little as it did, for in constant torque's loss, voltage and current only the term c q is odd (`pmsm_optimum`).
"""

from dataclasses import dataclass

import numpy as np

from drivelib.validation import number

ONE = 1 << 15
STEP_BITS = 6  # table steps per unit of the argument: 2**6
TABLE_END = 8  # tanh(8) = 1 - 2.3e-7, far below one step of Q15
TABLE = np.minimum(np.rint(np.tanh(np.arange((TABLE_END << STEP_BITS) + 1) / (1 << STEP_BITS)) * ONE), ONE - 1).astype(np.int64)
MARGIN = 1 + 1 / 16  # full scale beyond the largest value of the training data
LARGEST_BITS, SMALLEST_BITS = 15, 6
IRON_LIMIT = 32.0  # of a current's full scale: up to there no product of the extension overflows
INSIDE, EXTENDED, HELD = 0, 3, 4  # as the header has them


@dataclass(frozen=True)
class Q15Network:
    """Integer form of a network; built by `quantised`.

    Attributes
    ----------
    x_scale, y_scale : ndarray of float
        Full scale of inputs and outputs: what 2¹⁵ stands for.
    x_low, x_high : ndarray of int
        Training range of the inputs.
    W1, B1, f1 : ndarray of int, shapes (n_hidden, n_in), (n_hidden,), (n_hidden,)
        Weights with f1 fractional bits, biases with f1 + 15, and f1.
    W2, B2, f2 : ndarray of int, shapes (n_out, n_hidden), (n_out,), (n_out,)
        The same of the output layer.
    bound : ndarray of float, shape (n_out,)
        Largest possible error against the float64 network at the same inputs, in the units of the outputs, where
        these lie within full scale and inside the training range; beyond, the output saturates.
    iron : tuple of int, or None
        ψ, L_d and L_q over R_c times full-scale electrical speed, in Q15 of the currents; None for references that
        depend on |ω_m| and |T| alone.
    """

    x_scale: np.ndarray
    y_scale: np.ndarray
    x_low: np.ndarray
    x_high: np.ndarray
    W1: np.ndarray
    B1: np.ndarray
    f1: np.ndarray
    W2: np.ndarray
    B2: np.ndarray
    f2: np.ndarray
    bound: np.ndarray
    iron: tuple | None = None

    def to_q15(self, x):
        """Return inputs in Q15, rounded and saturated to int16."""
        return np.clip(np.rint(np.asarray(x) / self.x_scale * ONE), -ONE, ONE - 1).astype(np.int64)

    def from_q15(self, q):
        """Return what Q15 inputs stand for, in the units of the data."""
        return np.asarray(q) * self.x_scale / ONE

    def evaluate(self, q):
        """Return the Q15 outputs, shape (..., n_out), at Q15 inputs, bit for bit as the exported C."""
        q = np.asarray(q, dtype=np.int64)
        hidden = _tanh(np.clip(np.abs(q), self.x_low, self.x_high) @ self.W1.T + self.B1, self.f1)
        inside = np.clip(_rounded(hidden @ self.W2.T + self.B2, self.f2), -ONE, ONE - 1)
        if self.iron is None:
            return inside
        return np.where((self.status(q) == INSIDE)[..., None], inside, self._extended(q, inside))

    def status(self, q):
        """Return INSIDE, EXTENDED or HELD for Q15 inputs, as the exported C."""
        q = np.asarray(q, dtype=np.int64)
        inside = np.all((self.x_low <= q) & (q <= self.x_high), axis=-1)
        return np.where(inside, INSIDE, np.where(np.all(np.abs(q) <= self.x_high, axis=-1), EXTENDED, HELD))

    def _extended(self, q, currents):
        """Return the currents at Q15 inputs from those at the nearest speed and torque inside; see the module's text."""
        (omega_m, torque), (i_d, i_q) = np.moveaxis(q, -1, 0), np.moveaxis(currents, -1, 0)
        iron_0, iron_d, iron_q = self.iron
        low = self.x_low[1]
        small = np.abs(torque) < low
        share = np.where(small, np.sign(torque) * (np.abs(torque) * ONE // max(low, 1)), np.where(torque < 0, -ONE, ONE))
        forward = np.where(omega_m < 0, -1, 1)
        given, asked = (np.clip(np.abs(omega_m), least, self.x_high[0]) for least in (self.x_low[0], 0))
        turn_d, turn_q = _times(iron_d, given), _times(iron_q, given)
        left = i_q - _times(iron_0, given) - _times(turn_d, i_d)
        branch_q = np.sign(left) * (np.abs(left) * ONE // (ONE + _times(turn_d, turn_q)))  # towards zero, as C divides
        branch_d = i_d + _times(turn_q, branch_q)
        made = _times(forward * share, branch_q)
        d = branch_d - _times(_times(iron_q, asked), made)
        q = forward * (made + _times(iron_0, asked) + _times(_times(iron_d, asked), branch_d))
        return np.clip(np.stack([d, q], axis=-1), -ONE, ONE - 1)

    def predict(self, x):
        """Return the outputs in the units of the data, at inputs in theirs: quantised, evaluated, scaled back."""
        return self.evaluate(self.to_q15(x)) * self.y_scale / ONE


def quantised(network, machine=None):
    """Return a network (`drivelib.neural.Network`, tanh) as a `Q15Network`.

    Parameters
    ----------
    network : neural.Network
        (ω_m, T) → two outputs.
    machine : machines.PmsmParameters, optional
        Given where the outputs are its currents i_d and i_q, which change with the signs of speed and torque.

    Raises
    ------
    ValueError
        If its hidden layer is not tanh, a neuron's weights are too large for 16 bits, or R_c is so small that the iron
        loss takes more than 32 times the currents' full scale.
    """
    if network.activation != "tanh":
        raise ValueError(f"activation = {network.activation!r}: only 'tanh' has a Q15 form")
    W1, B1, W2, B2 = network.folded()
    inputs, targets = network.inputs, network.targets
    x_scale = MARGIN * np.maximum(np.abs(inputs.low), np.abs(inputs.high))
    y_scale = MARGIN * np.maximum(np.abs(targets.low), np.abs(targets.high))
    first, second = (W1 * x_scale, B1), (W2 / y_scale[:, None], B2 / y_scale)
    f1, f2 = _fractional_bits("W1", *first), _fractional_bits("W2", *second)
    edges = [np.rint(end / x_scale * ONE).astype(np.int64) for end in (inputs.low, inputs.high)]
    return Q15Network(
        x_scale, y_scale, *edges, *_integers(*first, f1), f1, *_integers(*second, f2), f2, _bound(W1 * x_scale, f1, second[0], f2, edges) * y_scale,
        None if machine is None else _iron(machine, x_scale[0], y_scale),
    )


def _iron(machine, omega_m, y_scale):
    scale_d, scale_q = y_scale
    speed = machine.P * omega_m / machine.R_c
    shares = np.array([speed * machine.psi_f / scale_q, speed * machine.L_d * scale_d / scale_q, speed * machine.L_q * scale_q / scale_d])
    if np.any(shares >= IRON_LIMIT):
        raise ValueError(f"R_c = {machine.R_c:g} ohm: the iron loss takes {np.max(shares):.3g} times the full scale of a current, more than {IRON_LIMIT:g}; must be larger")
    return tuple(int(value) for value in np.rint(shares * ONE))


def _fractional_bits(name, W, B):
    largest = np.maximum(np.max(np.abs(W), axis=1), 1e-300)
    total = np.sum(np.abs(W), axis=1) + np.abs(B)
    weights = np.floor(np.log2((ONE - 1) / largest))
    sums = np.floor(16 - np.log2(np.maximum(total, 1e-300) * (1 + 1e-3)) - 0.01)
    bits = np.minimum(np.minimum(weights, sums), LARGEST_BITS).astype(np.int64)
    for row in np.flatnonzero(bits < SMALLEST_BITS):
        raise ValueError(
            f"{name} row {row}: |weights| + |bias| add up to {total[row]:.4g} per full scale, too large for Q15 (about 2**{16 - SMALLEST_BITS}); "
            "train with fewer hidden neurons or another seed"
        )
    return bits


def _integers(W, B, bits):
    W = np.clip(np.rint(W * 2.0 ** bits[:, None]), 1 - ONE, ONE - 1).astype(np.int64)
    B = np.rint(B * 2.0 ** (bits + 15)).astype(np.int64)
    largest = np.sum(np.abs(W), axis=1) * ONE + np.abs(B) + (1 << 15)
    if np.any(largest >= 1 << 31):
        raise ValueError(f"row {int(np.argmax(largest))}: its sum does not fit 32 bits")
    return W, B


def _bound(W1, f1, W2, f2, edges):
    """Return the worst case of every rounding in `Q15Network.evaluate`, as a share of full scale."""
    reach = np.maximum(*np.abs(edges)) / ONE  # inputs are clamped
    argument = np.sum(2.0 ** -(f1[:, None] + 1) * reach, axis=1) + 2.0 ** -(f1 + 16)  # weights, bias: half a step each
    clamp = np.sum(np.abs(W1), axis=1) * 2.0**-16  # the ends of the range are rounded too
    interpolation = 4 / (3 * np.sqrt(3)) * 2.0 ** (-2 * STEP_BITS) / 8  # largest |tanh''| h²/8
    table = 2.0**-15 + 2.0 ** -(STEP_BITS + 15) + 2.0**-16  # entry (saturated at 1 - 2**-15), fraction cut off, result rounded
    hidden = argument + clamp + interpolation + table
    tail = 2.0**-16  # output rounded; it saturates only beyond the full scale
    return np.abs(W2) @ hidden + W2.shape[1] * 2.0 ** -(f2 + 1) + 2.0 ** -(f2 + 16) + tail


def _tanh(z, bits):
    shift = bits + 15 - STEP_BITS
    size = np.abs(z)
    index = size >> shift
    inside = index < len(TABLE) - 1
    index = np.where(inside, index, 0)
    fraction = (size & ((1 << shift) - 1)) >> (shift - 15)
    step = TABLE[index + 1] - TABLE[index]
    value = np.where(inside, TABLE[index] + ((step * fraction + (1 << 14)) >> 15), ONE - 1)
    return np.where(z < 0, -value, value)


def _rounded(value, bits):
    half = 1 << (bits - 1)
    return np.where(value >= 0, (value + half) >> bits, -((half - value) >> bits))


def _times(a, b):
    return _rounded(a * b, 15)


def float32_predict(network, x):
    """Return the network in single precision, each operation rounded as IEEE 754 asks, inputs clamped to its range.

    Sums run as in the exported C, bias first. tanh is taken as correctly rounded; a C library may differ by a unit
    in the last place or two.
    """
    W1, B1, W2, B2 = (single(values) for values in network.folded())
    x = np.clip(single(x), single(network.inputs.low), single(network.inputs.high))
    hidden = single(np.tanh(_summed(W1, B1, x)))
    return _summed(W2, B2, hidden)


def single(values):
    """Return values rounded to single precision, as float64."""
    return np.asarray(values, dtype=np.float32).astype(float)


def _summed(W, B, x):
    total = np.broadcast_to(B, x.shape[:-1] + B.shape)
    for column in range(W.shape[1]):
        total = single(total + single(W[:, column] * x[..., column, None]))
    return total


def float32_bound(network, tanh_ulps=2):
    """Return the largest error of the network in single precision, shape (n_out,), in the units of the outputs.

    The standard bound γ_n = n u/(1 − n u), u = 2⁻²⁴, on each sum (weights and inputs rounded, products, additions),
    carried through tanh, whose slope is at most 1 and whose library error is ``tanh_ulps`` units in the last place.

    References
    ----------
    N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., SIAM 2002, sec. 3.1.
    """
    number("tanh_ulps", tanh_ulps, at_least=0)
    W1, B1, W2, B2 = map(np.abs, network.folded())
    reach = np.maximum(np.abs(network.inputs.low), np.abs(network.inputs.high))

    def gamma(n):
        return n * 2.0**-24 / (1 - n * 2.0**-24)

    hidden = gamma(W1.shape[1] + 3) * (W1 @ reach + B1) + (tanh_ulps + 0.5) * 2.0**-24
    return W2 @ hidden + gamma(W2.shape[1] + 2) * (W2.sum(axis=1) * (1 + 1e-3) + B2)


def format_errors(network, x):
    """Return {"float", "Q15", "bound"}: what single precision and Q15 differ from double precision at inputs (n, n_in).

    "float" and "Q15" are the largest difference of any output as a share of that output's range, each at the inputs
    that the format holds; "bound" is the largest Q15 difference over `Q15Network.bound`, which must stay below 1.
    """
    q15 = quantised(network)
    held = np.clip(q15.from_q15(q15.to_q15(x)), network.inputs.low, network.inputs.high)  # what the integers stand for
    span = np.ptp(network.targets.from_unit(np.array([[-1.0], [1.0]])), axis=0)
    floats = np.max(np.abs(float32_predict(network, x) - network.predict(single(x))), axis=0)
    integers = np.max(np.abs(q15.predict(x) - network.predict(held)), axis=0)
    return {"float": float(np.max(floats / span)), "Q15": float(np.max(integers / span)), "bound": float(np.max(integers / q15.bound))}
