"""Runs of Zidani's drive in pieces, each going on from a state: one alone, or many abreast with the same bits.

    onset = alone(Piece(drive, law, x, profiles))
    rest = alone(Piece(drive, law, onset.x, more))
    parts = together(pieces)        # a Part each, or None where a drive diverged
"""

from contextlib import suppress
from typing import NamedTuple

import numpy as np

from drivelib import dfim, metrics
from drivelib.dfim_control import DriveSettings
from drivelib.dfim_drive import SimulationDiverged, drive_settings
from drivelib.dfim_lanes import FAMILIES, KEPT, LANES, ROWS, Laws, run_lanes
from drivelib.dfim_loop import CHANNELS, LIMITS, STATES, empty_record, run_drive
from drivelib.dfim_plant import SMALL_ANGLE
from drivelib.dfim_scenario import INVERTERS, Scenario
from drivelib.encoder import Sensor, sensor
from drivelib.speed_law import SpeedLaw
from drivelib.validation import choice

FEW = 3  # as fast one by one
_CHANNELS = [CHANNELS.index(name) for name in KEPT]
_NUMBERS = slice(0, ROWS.index("omega_ref"))  # states, plant, settings
_WINDOW = [ROWS.index("first"), ROWS.index("last")]
_UNHIT = [name for name in ROWS if name.startswith(("hit", "failed"))]


def suits(scenario):
    """Return whether drives of this scenario can go abreast: averaged inverters in one step per period, the speed known exactly."""
    return scenario.inverter == "averaged" and scenario.substeps == 1 and scenario.encoder is None


class Drive(NamedTuple):
    """A drive as the compiled loops take it: scenario, plant and settings, worked out once for all its runs."""

    scenario: Scenario
    plant: dfim.DfimCoefficients
    settings: DriveSettings
    sensor: Sensor

    @classmethod
    def of(cls, scenario):
        """Return a scenario's drive.

        Raises
        ------
        ValueError
            If the scenario is not one that pieces can run (``suits``).
        """
        if not suits(scenario):
            raise ValueError(f"{scenario.name}: pieces run with averaged inverters in one step per period, and without an encoder")
        return cls(scenario, dfim.coefficients(scenario.machine), drive_settings(scenario), sensor(None, 0, scenario.period))


class Piece(NamedTuple):
    """What is to be run.

    ``law``: of ``dfim_lanes.FAMILIES``. ``x``: state (16,) in the order of ``dfim_loop.STATES``; not changed. ``profiles``: (changes,
    values, steps): samples (m + 1,) from which the values (m, 3) act, the last one ``NEVER``: set point (rad/s), load
    (N m), factor on R_r; and the number of periods, one at least.
    """

    drive: Drive
    law: SpeedLaw
    x: np.ndarray
    profiles: tuple


class Part(NamedTuple):
    """A piece that was run: the ``KEPT`` channels (4, n), ErrorIndices and final state (16,)."""

    channels: np.ndarray
    indices: metrics.ErrorIndices
    x: np.ndarray

    def __getitem__(self, channel):
        return self.channels[KEPT.index(channel)]

    @property
    def error(self):
        """Speed error Ω* − Ω (rad/s)."""
        return self["omega_ref"] - self["omega_m"]


def alone(piece, *, inverter="averaged"):
    """Run a piece by itself, with either inverter; return its `Part`.

    Raises
    ------
    ValueError
        If the inverter is unknown, or the controller needs more than the error (``speed_law.WEIGHTED``): its observer's state is no
        part of a piece.
    SimulationDiverged
        If the state leaves all bounds.
    """
    _check([piece])
    (scenario, plant, settings, exact), (changes, values, steps) = piece.drive, piece.profiles
    if choice("inverter", inverter, INVERTERS) == "switching":
        settings = settings._replace(carrier_frequency=scenario.carrier_frequency)
    x, record, indices = piece.x.copy(), empty_record(steps, 1), np.zeros(4)
    hits = np.full(len(LIMITS), -1, dtype=np.int64)
    failed = run_drive(steps, x, plant, settings, piece.law, changes, values, (0, steps), 1, record, indices, hits, exact)
    if failed >= 0:
        raise SimulationDiverged(scenario, failed * scenario.period, dict(zip(STATES, x.tolist(), strict=True)))
    return Part(record.T[_CHANNELS], metrics.ErrorIndices(*indices[:3].tolist(), steps * scenario.period), x)


def together(pieces):
    """Run pieces abreast; return a list with the `Part` of each, None where the drive diverged.

    Averaged inverters. The bits are those of ``alone``, whatever else is in the list.

    Raises
    ------
    ValueError
        As ``alone``.
    """
    _check(pieces)
    parts = [None] * len(pieces)
    for family in sorted(set(FAMILIES.values())):
        # By length, for a block takes nearly as long as its longest.
        order = sorted((k for k in range(len(pieces)) if FAMILIES[pieces[k].law.kind] == family), key=lambda k: -pieces[k].profiles[2])
        for block in (order[start : start + LANES] for start in range(0, len(order), LANES)):
            left = _abreast(pieces, block, parts) if len(block) > FEW else block
            for k in left:
                with suppress(SimulationDiverged):
                    parts[k] = alone(pieces[k])
    return parts


def _check(pieces):
    if any(piece.law.kind not in FAMILIES for piece in pieces):
        raise ValueError("a PI with set-point weight cannot run in pieces: the state of its observer would be lost between them")


def _abreast(pieces, block, parts):
    """Fill the parts of a block; return those that the fast loop is not valid for."""
    left, (rows, records, final) = [], run_block([pieces[k] for k in block], keep=True)
    for j, k in enumerate(block):
        steps, period = pieces[k].profiles[2], pieces[k].drive.scenario.period
        if not rows["turned"][j] <= SMALL_ANGLE:
            left.append(k)
        elif rows["failed"][j] < 0:
            sums = [float(rows[name][j]) for name in ("iae", "ise", "itae")]
            parts[k] = Part(records[j], metrics.ErrorIndices(*sums, steps * period), final[j])
    return left


def run_block(pieces, *, windows=None, keep=False):
    """Run up to 64 pieces through ``dfim_lanes``.

    Parameters
    ----------
    pieces : list of Piece
        Controllers of one of ``dfim_lanes.FAMILIES``.
    windows : sequence of (int, int), optional
        First and last sample of each one's error indices; by default the whole.
    keep : bool
        Whether the channels ``KEPT`` are recorded.

    Returns
    -------
    rows : dict of str to ndarray, shape (n,)
        What ``dfim_lanes.ROWS`` names; hits and failures after a piece's end are taken out.
    records : list of ndarray, shape (4, steps + 1)
        Empty where none is kept.
    final : ndarray, shape (n, 16)
    """
    order = sorted(range(len(pieces)), key=lambda k: -pieces[k].profiles[2])
    rows = np.zeros((len(ROWS), LANES))
    rows[[ROWS.index(name) for name in _UNHIT]] = -1.0
    rows[ROWS.index("R_factor")] = 1.0  # until a profile begins
    for j, k in enumerate(order):
        drive, _, x, (_, _, steps) = pieces[k]
        rows[_NUMBERS, j] = (*x, *drive.plant, *drive.settings)
        rows[_WINDOW, j] = (0, steps) if windows is None else windows[k]
    profiles = [pieces[k].profiles for k in order]
    ends = np.array([steps for _, _, steps in profiles])
    changes = np.concatenate([own for own, _, _ in profiles])
    at = np.cumsum([0, *(len(own) for own, _, _ in profiles[:-1])])
    unused = np.zeros((1, 3))  # no value belongs to the last change, which never comes
    values = np.concatenate([part for _, own, _ in profiles for part in (own, unused)])
    record = np.empty((len(pieces), len(KEPT), ends[0] + 1) if keep else (0, 0, 0))
    final = np.empty((len(pieces), len(STATES)))
    run_lanes(rows.reshape(-1), ends, at, changes, values, _laws([pieces[k].law for k in order]), record, final)
    back = np.argsort(order)
    found = {name: row[back] for name, row in zip(ROWS, rows, strict=True)}
    for name in _UNHIT:
        found[name][found[name] >= ends[back] + (name == "failed")] = -1.0  # a drive fails at the end of a period, at its last sample too
    return found, [record[j, :, : ends[j] + 1] for j in back] if keep else [], final[back]


def _laws(laws):
    """Return the `Laws` of a block."""
    numbers = {name: np.zeros(LANES) for name in ("K_p", "K_i", "K_e", "K_de", "K_u", "B2", "activation")}
    kind, size = np.zeros(LANES, dtype=np.int64), max(law.B1.size for law in laws)
    W1, B1, W2 = np.zeros((3, size, LANES)), np.zeros((size, LANES)), np.zeros((size, LANES))
    for j, law in enumerate(laws):
        kind[j] = law.kind
        for name, values in numbers.items():
            values[j] = getattr(law, name)
        neurons, inputs = law.W1.shape
        W1[:inputs, :neurons, j], B1[:neurons, j], W2[:neurons, j] = law.W1.T, law.B1, law.W2
    return Laws(FAMILIES[laws[0].kind], kind, W1=W1, B1=B1, W2=W2, **numbers)


def joined(first, second):
    """Return two pieces that follow one another as one `Part`; the first one's last sample is the second one's first."""
    a, b = first.indices, second.indices
    later = b.ITAE + a.horizon * b.IAE
    indices = metrics.ErrorIndices(a.IAE + b.IAE, a.ISE + b.ISE, a.ITAE + later, a.horizon + b.horizon)
    return Part(np.concatenate([first.channels[:, :-1], second.channels], axis=1), indices, second.x)
