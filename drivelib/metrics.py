"""Error indices and step metrics of a speed record, from every sample that the simulation made.

The error is taken as linear within a period (the reference is held, the speed nearly straight) and its
indices are integrated exactly, sign changes included. The first function is compiled inside the drive
loop as well, so that indices kept in the loop and indices of the recorded arrays are the same numbers.
"""

from typing import NamedTuple

import numpy as np

from drivelib.validation import array, grid, number


def interval_indices(t, period, e_start, e_end):
    """Return ∫|e|, ∫e² and ∫t|e| over one period in which the error runs straight from e_start to e_end.

    Scalars or arrays; unchecked, because compiled inside the drive loop. Time in s, error in rad/s.
    """
    a, b = abs(e_start), abs(e_end)
    crosses = 1.0 * (e_start * e_end < 0.0)
    total = a + b + (1.0 - crosses)  # only used, and then a + b, where the error crosses zero
    first = period * a / total
    rest = period - first
    iae = (1.0 - crosses) * 0.5 * period * (a + b) + crosses * 0.5 * (first * a + rest * b)
    ise = period * (e_start * e_start + e_start * e_end + e_end * e_end) / 3.0
    straight = period * period * (a + 2.0 * b) / 6.0
    broken = a * first * first / 6.0 + b * rest * (0.5 * first + rest / 3.0)
    return iae, ise, t * iae + (1.0 - crosses) * straight + crosses * broken


class ErrorIndices(NamedTuple):
    """IAE (rad), ISE (rad²/s), ITAE (rad s) and the horizon T (s) they cover.

    ``itae_printed`` is T · IAE: what Zidani's table II seems to hold, eq. (25) having no time in its ITAE.
    """

    IAE: float
    ISE: float
    ITAE: float
    horizon: float

    @property
    def itae_printed(self):
        return self.horizon * self.IAE


def error_indices(t, omega_ref, omega_m, start=None, end=None):
    """Return the ErrorIndices of a speed record: eq. (25), with the time that its ITAE lacks.

    Parameters
    ----------
    t : array, shape (n,)
        Sample times (s).
    omega_ref, omega_m : array, shape (n,)
        Speed reference, held from each sample to the next, and speed (rad/s).
    start, end : float, optional
        Window (s), by default the whole record; whole periods count, and ITAE's time runs from ``start``.

    Raises
    ------
    ValueError
        If the time grid is not increasing, lengths differ, or the window holds no period.

    Examples
    --------
    An error of 2 rad/s that stands for 3 s: 2 · 3, 2² · 3, and 2 · 3²/2:

    >>> t = np.linspace(0.0, 3.0, 301)
    >>> found = error_indices(t, np.full(301, 10.0), np.full(301, 8.0))
    >>> print(f"{found.IAE:.3f} rad, {found.ISE:.3f} rad²/s, {found.ITAE:.3f} rad s")
    6.000 rad, 12.000 rad²/s, 9.000 rad s
    """
    t, omega_ref, omega_m = _record(t, omega_ref, omega_m)
    start = t[0] if start is None else number("start", start, "s")
    end = t[-1] if end is None else number("end", end, "s", above=start)
    slack = 1e-6 * (t[1] - t[0])
    inside = (t[:-1] >= start - slack) & (t[1:] <= end + slack)
    if not inside.any():
        raise ValueError(f"start = {start} s, end = {end} s: no period of the record from {t[0]} to {t[-1]} s lies inside")
    e_start, e_end = omega_ref[:-1] - omega_m[:-1], omega_ref[:-1] - omega_m[1:]
    parts = interval_indices(t[:-1] - start, np.diff(t), e_start, e_end)
    iae, ise, itae = (float(np.sum(part[inside])) for part in parts)
    return ErrorIndices(iae, ise, itae, end - start)


class StepMetrics(NamedTuple):
    """What one event does to the speed.

    ``peak``: the error e = Ω* − Ω of largest size after the event (rad/s, signed; for a load step, the dip).
    ``peak_time``: when, after the event (s). ``recovery_time``: after which |e| stays within the band
    (s; inf if it never does). ``overshoot``: how far the speed passes the reference, on the side away
    from where the event pushed it (rad/s, ≥ 0). ``steady_error``: mean error over the window's end (rad/s).
    ``ripple``: peak-to-peak of the error over the same part (rad/s).
    """

    time: float
    peak: float
    peak_time: float
    recovery_time: float
    overshoot: float
    steady_error: float
    ripple: float


def step_metrics(t, omega_ref, omega_m, event, end, *, band=0.5, tail=0.2):
    """Return the StepMetrics of one event.

    Parameters
    ----------
    t, omega_ref, omega_m : array, shape (n,)
        Record: time (s), reference and speed (rad/s).
    event, end : float
        Time of the event and of the next one (s); the samples from the first to before the second count.
    band : float
        Half width of the band in which the speed counts as recovered (rad/s).
    tail : float
        Part of the window, at its end, over which steady error and ripple are taken.

    Raises
    ------
    ValueError
        If a record is malformed, the window holds fewer than ten samples, or band or tail is out of range.
    """
    t, omega_ref, omega_m = _record(t, omega_ref, omega_m)
    band, tail = number("band", band, "rad/s", above=0), number("tail", tail, above=0, at_most=1)
    event = number("event", event, "s")
    end = number("end", end, "s", above=event)
    slack = 1e-6 * (t[1] - t[0])
    inside = (t >= event - slack) & (t < end - slack)
    if np.count_nonzero(inside) < 10:
        raise ValueError(f"event = {event} s, end = {end} s: fewer than ten samples of the record lie between")
    return response_metrics(t[inside] - event, (omega_ref - omega_m)[inside], band=band, tail=tail, event=event)


def response_metrics(time, error, *, band=0.5, tail=0.2, event=0.0):
    """Return the StepMetrics of the speed error after one event.

    Parameters
    ----------
    time, error : array, shape (n,)
        Time since the event (s) and error Ω* − Ω (rad/s) at each sample until the next event.
    band, tail
        See ``step_metrics``.
    event : float
        Time of the event (s), passed on.

    Raises
    ------
    ValueError
        If an array is malformed, shapes differ, or band or tail is out of range.
    """
    time, error = grid("time", time), array("error", error, "rad/s")
    band, tail = number("band", band, "rad/s", above=0), number("tail", tail, above=0, at_most=1)
    if error.shape != time.shape:
        raise ValueError(f"error has shape {error.shape}: must be {time.shape}, as time")
    size = np.abs(error)
    k = int(np.argmax(size))
    outside = np.nonzero(size > band)[0]
    if outside.size == 0:
        recovery = 0.0
    elif outside[-1] == error.size - 1:
        recovery = np.inf
    else:
        recovery = float(time[outside[-1] + 1])
    last = error[int(np.ceil((1.0 - tail) * error.size)) :]
    return StepMetrics(
        time=event,
        peak=float(error[k]),
        peak_time=float(time[k]),
        recovery_time=recovery,
        overshoot=max(0.0, float(np.max(-np.sign(error[k]) * error[k:]))),
        steady_error=float(np.mean(last)),
        ripple=float(np.ptp(last)),
    )


def event_metrics(t, omega_ref, omega_m, events, *, band=0.5, tail=0.2):
    """Return the StepMetrics of each event; each window ends at the next event or at the record's end.

    Parameters as in ``step_metrics``; ``events`` are increasing times (s).

    Raises
    ------
    ValueError
        As ``step_metrics``; also if the events are not increasing.
    """
    events = array("events", events, "s")
    bounds = grid("events and end of record", np.append(events, t[-1] + (t[-1] - t[-2])))
    return [
        step_metrics(t, omega_ref, omega_m, start, end, band=band, tail=tail)
        for start, end in zip(bounds[:-1], bounds[1:], strict=True)
    ]


def _record(t, omega_ref, omega_m):
    t = grid("t", t)
    omega_ref, omega_m = array("omega_ref", omega_ref, "rad/s"), array("omega_m", omega_m, "rad/s")
    for name, values in (("omega_ref", omega_ref), ("omega_m", omega_m)):
        if values.shape != t.shape:
            raise ValueError(f"{name} has shape {values.shape}: must be {t.shape}, as t")
    return t, omega_ref, omega_m
