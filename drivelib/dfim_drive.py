"""Simulate Zidani's drive: from a scenario and a speed controller to a record, indices and limits hit.

    run = simulate(DEFAULT_SCENARIO, FuzzySpeed(K_e=0.2, K_de=50.0, K_u=0.5, form="incremental"))
    run["omega_m"], run.indices, run.events(), run.first_hits
"""

from dataclasses import dataclass

import numpy as np

from drivelib import control, dfim, metrics
from drivelib.dfim_control import DriveSettings
from drivelib.dfim_decoupling import current_references, leakage_inductances
from drivelib.dfim_loop import CHANNELS, LIMITS, NEVER, STATES, empty_record, run_drive
from drivelib.dfim_scenario import DEFAULT_SCENARIO, FLUX_ESTIMATORS, Scenario
from drivelib.encoder import sensor
from drivelib.speed_law import PiSpeed
from drivelib.validation import nearest, number


class SimulationDiverged(ArithmeticError):
    """The drive's state left all bounds; ``time`` (s) and ``state`` (dict by name, SI units) say where."""

    def __init__(self, scenario, time, state):
        self.time, self.state = time, state
        values = ", ".join(f"{name} = {state[name]:.6g}" for name in ("omega_m", "phi_sd", "phi_sq", "phi_rd", "phi_rq"))
        super().__init__(f"{scenario.name}: diverged at t = {time:.6g} s with {values} (rad/s, Wb)")


@dataclass(frozen=True)
class DriveRun:
    """What a simulation returns; ``run["omega_m"]`` gives a channel, ``channels`` names them.

    ``t``: recorded times (s). ``indices``: ErrorIndices over the window, from every sample. ``first_hits``:
    time (s) of the first sample at which each limit was hit, limits never hit left out. ``state``: final
    state by name, SI units. ``peak``: largest |Ω* − Ω| at a sample of the window (rad/s). ``T_e`` is sampled at the control instants, ``T_min`` and ``T_max`` are its
    extremes at the switching instants until the next recorded sample (equal to T_e with averaged inverters).
    """

    scenario: Scenario
    t: np.ndarray
    data: np.ndarray
    indices: metrics.ErrorIndices
    first_hits: dict
    state: dict
    peak: float

    channels = CHANNELS

    def __getitem__(self, channel):
        if channel not in CHANNELS:
            raise ValueError(f"{channel!r} is no channel of a run{nearest(channel, CHANNELS)}")
        return self.data[:, CHANNELS.index(channel)]

    def error_indices(self, start=None, end=None):
        """Return the ErrorIndices of a window (s) of the record."""
        return metrics.error_indices(self.t, self["omega_ref"], self["omega_m"], start, end)

    def events(self, *, band=0.5, tail=0.2):
        """Return the StepMetrics of every change of reference or load (band in rad/s, see ``metrics``)."""
        return metrics.event_metrics(self.t, self["omega_ref"], self["omega_m"], self.scenario.events, band=band, tail=tail)


def drive_settings(scenario):
    """Return the DriveSettings of a scenario: the gains are computed from the machine that the controller knows."""
    known = scenario.known_machine
    sigma_L_s, sigma_L_r = leakage_inductances(known)
    stator = control.current_gains(known.R_s, sigma_L_s, scenario.current_bandwidth)
    rotor = control.current_gains(known.R_r, sigma_L_r, scenario.current_bandwidth)
    return DriveSettings(
        R_s=known.R_s,
        R_r=known.R_r,
        L_s=known.L_s,
        L_r=known.L_r,
        M=known.M,
        p=float(known.p),
        K_ps=stator.K_p,
        K_is=stator.K_i,
        K_pr=rotor.K_p,
        K_ir=rotor.K_i,
        phi_ref=scenario.phi_r_ref,
        T_limit=scenario.T_limit,
        v_s_limit=control.linear_voltage_limit(scenario.V_dc_s),
        v_r_limit=control.linear_voltage_limit(scenario.V_dc_r),
        i_s_limit=scenario.i_s_limit,
        i_r_limit=scenario.i_r_limit,
        law=control.FREQUENCY_LAWS[scenario.frequency_law],
        omega_r_constant=scenario.omega_r_constant,
        k_orientation=scenario.orientation_bandwidth,
        estimator=FLUX_ESTIMATORS.index(scenario.flux_estimator),
        corner=scenario.estimator_corner,
        period=scenario.period,
        substeps=scenario.substeps,
        carrier_frequency=scenario.carrier_frequency if scenario.inverter == "switching" else 0.0,
        V_dc_s=scenario.V_dc_s,
        V_dc_r=scenario.V_dc_r,
    )


def schedule(scenario):
    """Return the profiles merged, as the loop takes them: changes (m + 1,) in samples, values (m, 3)."""
    profiles = (scenario.speed_reference, scenario.load_torque, scenario.rotor_resistance)
    # A hair below, because 3 × 1e-4 is a little more than 0.0003.
    samples = [[int(np.ceil(time / scenario.period - 1e-6)) for time, _ in profile] for profile in profiles]
    changes = sorted({k for column in samples for k in column})
    values = np.empty((len(changes), 3))
    for j, (profile, column) in enumerate(zip(profiles, samples, strict=True)):
        for row, k in enumerate(changes):
            values[row, j] = profile[np.searchsorted(column, k, side="right") - 1][1]
    return np.array([*changes, NEVER], dtype=np.int64), values


def initial_state(scenario):
    """Return the state (16,) before the first sample: standing still, magnetised or without current."""
    x = np.zeros(len(STATES))
    if scenario.start == "magnetised":
        i_sd = float(current_references(0.0, scenario.phi_r_ref, scenario.machine)[0])
        phi_s, phi_r = dfim.flux_linkages(i_sd, 0.0, scenario.machine)
        x[STATES.index("phi_sd")], x[STATES.index("phi_rd")] = phi_s, phi_r
        x[STATES.index("phi_hat_d")] = phi_r
        x[STATES.index("u_sd")] = scenario.known_machine.R_s * i_sd
    x[STATES.index("e_previous")] = scenario.speed_reference[0][1]
    return x


def simulate(scenario=DEFAULT_SCENARIO, speed=None, *, every=1, window=None):
    """Simulate the drive.

    Parameters
    ----------
    scenario : Scenario
    speed : PiSpeed, WeightedPiSpeed, FuzzySpeed or NetworkSpeed, optional
        Speed controller; by default the PI of the scenario's ω_n and ξ.
    every : int
        Record each such sample; 0 records none, and leaves indices, limits and final state.
    window : (float, float), optional
        Start and end (s) of the error indices; by default the whole run.

    Returns
    -------
    DriveRun

    Raises
    ------
    ValueError
        If ``every`` or ``window`` is out of range.
    SimulationDiverged
        If the state leaves all bounds (10⁵ rad/s, a hundred times the flux reference, or not a number).

    Examples
    --------
    A PI controller leaves no error: half a second after the last load step is gone the drive runs at its last set point, 30 rad/s.

    >>> run = simulate(every=100)
    >>> print(f"{run['omega_m'][-1]:.1f} rad/s")
    30.0 rad/s
    """
    every = number("every", every, "samples", at_least=0, whole=True)
    start, end = (0.0, scenario.duration) if window is None else window
    start = number("window's start", start, "s", at_least=0)
    end = number("window's end", end, "s", above=start, at_most=scenario.duration)
    speed = PiSpeed(*scenario.speed_gains) if speed is None else speed
    steps, h = scenario.steps, scenario.period
    first, last = round(start / h), min(round(end / h), steps)
    changes, profiles = schedule(scenario)
    x, record = initial_state(scenario), empty_record(steps, every)
    indices, hits = np.zeros(4), np.full(len(LIMITS), -1, dtype=np.int64)
    failed = run_drive(
        steps, x, dfim.coefficients(scenario.machine), drive_settings(scenario), speed.law(),
        changes, profiles, (first, last), every, record, indices, hits,
        sensor(scenario.encoder, steps + 1, h),
    )  # fmt: skip
    state = dict(zip(STATES, x.tolist(), strict=True))
    if failed >= 0:
        raise SimulationDiverged(scenario, failed * h, state)
    return DriveRun(
        scenario=scenario,
        t=np.arange(record.shape[0]) * (every * h),
        data=record,
        indices=metrics.ErrorIndices(*indices[:3].tolist(), (last - first) * h),
        first_hits={name: float(k * h) for name, k in zip(LIMITS, hits, strict=True) if k >= 0},
        state=state,
        peak=float(indices[3]),
    )
