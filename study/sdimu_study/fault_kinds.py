"""Faults put into a recording: what drivers, clocks, tables and people do to data that no sensor model knows.

A fault is a pure function of a recording, a size and a random generator. What comes out is a recording *as its
messages arrive*: stamps may repeat or run back and numbers may be NaN, as no `Recording` of the reader has them. Faults
of the motion (the IMU slips on its mount, the table stops) are functions of the platform's motion instead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.recording import Recording
from sdimu_sim.core.platform import PlatformMotion

Rng = np.random.Generator

_ARCMIN = np.pi / 180.0 / 60.0


@dataclass(frozen=True)
class Fault:
    """A kind of fault."""

    name: str
    what: str
    """In a few words, for people."""
    unit: str
    """Of `sizes`."""
    sizes: tuple[float, float, float, float, float]
    """From hardly visible to gross, length 5."""
    samples: Callable[[Recording, float, Rng], Recording] | None = None
    """(recording, size, rng) -> recording as its messages arrive."""
    motion: Callable[[PlatformMotion, Recording, float, Rng], PlatformMotion] | None = None
    """(motion, phases of the undisturbed test, size, rng) -> motion."""


def stretches(recording: Recording, dwell: bool) -> list[tuple[float, float]]:
    """Begin and end (s) of every dwell, or of every turn, of a sound recording with a status."""
    phase = recording.phase
    assert phase is not None
    edge = np.flatnonzero(np.diff(np.concatenate([[not phase.dwell[0]], phase.dwell]).astype(int)) != 0)
    ends = np.append(phase.t[edge[1:]], recording.t[-1])
    return [(float(phase.t[k]), float(e)) for k, e in zip(edge, ends, strict=True) if bool(phase.dwell[k]) == dwell]


def _some(recording: Recording, dwell: bool, rng: Rng) -> tuple[float, float]:
    """One dwell (not the first or last) or turn, drawn."""
    all_of = stretches(recording, dwell)
    return all_of[int(rng.integers(1, len(all_of) - 1))]


def _place(recording: Recording, dwell: bool, length: float, rng: Rng) -> float:
    """Begin (s) of a stretch of a length in a dwell or turn, or in its middle when it does not fit."""
    begin, end = _some(recording, dwell, rng)
    return float(rng.uniform(begin, max(end - length, begin + 1e-3)))


def _keep(recording: Recording, rows: Bools | Ints) -> Recording:
    return replace(recording, t=recording.t[rows], omega_ib_b=recording.omega_ib_b[rows], f_ib_b=recording.f_ib_b[rows])


def _without(recording: Recording, begin: float, length: float) -> Recording:
    return _keep(recording, (recording.t <= begin) | (recording.t > begin + length))


def _gap(dwell: bool) -> Callable[[Recording, float, Rng], Recording]:
    return lambda r, size, rng: _without(r, _place(r, dwell, size, rng), size)


def _lost_turns(r: Recording, size: float, rng: Rng) -> Recording:
    """Whole turns are missing, from within the dwell before to within the one after."""
    turns = stretches(r, False)
    for k in rng.choice(len(turns) - 1, int(size), replace=False):
        r = _without(r, turns[k][0] - 3.0, turns[k][1] - turns[k][0] + 6.0)
    return r


def _dropouts(r: Recording, size: float, rng: Rng) -> Recording:
    return _keep(r, rng.random(len(r.t)) >= size)


def _duplicates(r: Recording, size: float, rng: Rng) -> Recording:
    return _keep(r, np.repeat(np.arange(len(r.t)), 1 + (rng.random(len(r.t)) < size)))


def _out_of_order(r: Recording, size: float, rng: Rng) -> Recording:
    """One sample in a hundred arrives `size` samples late."""
    late = rng.random(len(r.t)) < 0.01
    return _keep(r, np.argsort(np.arange(len(r.t)) + late * (size + 0.5), kind="stable"))


def _repeated(r: Recording, size: float, rng: Rng) -> Recording:
    """Give samples the stamp of the one before."""
    same = rng.random(len(r.t)) < size
    same[0] = False
    return replace(r, t=np.where(same, np.roll(r.t, 1), r.t))


def _replaced(value: float) -> Callable[[Recording, float, Rng], Recording]:
    def apply(r: Recording, size: float, rng: Rng) -> Recording:
        omega, force = r.omega_ib_b.copy(), r.f_ib_b.copy()
        rows = np.flatnonzero(rng.random(len(r.t)) < size)
        columns = rng.integers(0, 6, len(rows))
        omega[rows[columns < 3], columns[columns < 3]] = value
        force[rows[columns >= 3], columns[columns >= 3] - 3] = -value
        return replace(r, omega_ib_b=omega, f_ib_b=force)

    return apply


def _change(
    triad: str, change: Callable[[Floats, Recording, float, Rng], Floats]
) -> Callable[[Recording, float, Rng], Recording]:
    """Make a fault of one drawn axis of a triad from a function of its readings (n,)."""

    def apply(r: Recording, size: float, rng: Rng) -> Recording:
        name = "omega_ib_b" if triad == "gyro" else "f_ib_b"
        values = getattr(r, name).copy()
        axis = int(rng.integers(3))
        values[:, axis] = change(values[:, axis].copy(), r, size, rng)
        return replace(r, **{name: values})

    return apply


def _saturated(x: Floats, _r: Recording, size: float, _rng: Rng) -> Floats:
    """Clip at a share of the largest reading."""
    limit = size * float(np.abs(x).max())
    return np.clip(x, -limit, limit)


def _stuck(x: Floats, r: Recording, size: float, rng: Rng) -> Floats:
    begin = float(rng.uniform(0.2, 0.6)) * float(r.t[-1])
    rows = np.flatnonzero((r.t >= begin) & (r.t < begin + size))
    x[rows] = x[rows[0]]
    return x


def _noise_of(x: Floats) -> float:
    return float(np.median(np.abs(np.diff(x)))) / 0.95


def _spikes(x: Floats, _r: Recording, size: float, rng: Rng) -> Floats:
    """Ten single samples wrong by `size` sigma of a sample's noise."""
    rows = rng.choice(len(x), 10, replace=False)
    x[rows] += size * _noise_of(x) * rng.choice([-1.0, 1.0], len(rows))
    return x


def _bursts(x: Floats, r: Recording, size: float, rng: Rng) -> Floats:
    """Three half seconds of wild numbers, `size` sigma of a sample's noise."""
    sigma = _noise_of(x)
    for begin in rng.uniform(0.05, 0.95, 3) * r.t[-1]:
        rows = (r.t >= begin) & (r.t < begin + 0.5)
        x[rows] += size * sigma * rng.standard_normal(int(rows.sum()))
    return x


def _sign(x: Floats, r: Recording, size: float, rng: Rng) -> Floats:
    """Take the sign from an axis for a while: everything reads positive."""
    begin = 0.0 if size >= r.t[-1] else float(rng.uniform(0.1, 0.5)) * float(r.t[-1])
    rows = (r.t >= begin) & (r.t < begin + size)
    x[rows] = np.abs(x[rows])
    return x


def _clock(sign: float, dwell: bool) -> Callable[[Recording, float, Rng], Recording]:
    """Stamps of the IMU that jump while its samples go on."""

    def apply(r: Recording, size: float, rng: Rng) -> Recording:
        at = _place(r, dwell, 0.5, rng)
        return replace(r, t=np.where(r.t > at, r.t + sign * size, r.t))

    return apply


def _status(r: Recording, **changes: object) -> Recording:
    assert r.phase is not None
    return replace(r, phase=replace(r.phase, **changes))  # type: ignore[arg-type]


def _says_dwell(r: Recording, size: float, rng: Rng) -> Recording:
    assert r.phase is not None
    turns = stretches(r, False)
    dwell = r.phase.dwell.copy()
    for k in rng.choice(len(turns), min(int(size), len(turns)), replace=False):
        dwell[(r.phase.t >= turns[k][0]) & (r.phase.t < turns[k][1])] = True
    return _status(r, dwell=dwell)


def _says_rotating(r: Recording, size: float, rng: Rng) -> Recording:
    assert r.phase is not None
    return _status(r, dwell=r.phase.dwell & (rng.random(len(r.phase.dwell)) >= size))


def _status_shifted(r: Recording, size: float, _rng: Rng) -> Recording:
    assert r.phase is not None
    return _status(r, t=r.phase.t + size)


def _wrong_stop(r: Recording, size: float, rng: Rng) -> Recording:
    assert r.phase is not None
    stop = r.phase.stop.copy()
    for k in rng.choice(int(stop.max()) + 1, min(int(size), int(stop.max()) + 1), replace=False):
        stop[r.phase.stop == k] = int(rng.integers(0, stop.max() + 1))
    return _status(r, stop=stop)


def _status_stops(r: Recording, size: float, _rng: Rng) -> Recording:
    assert r.phase is not None
    rows = r.phase.t <= size * r.t[-1]
    return _status(r, t=r.phase.t[rows], dwell=r.phase.dwell[rows], stop=r.phase.stop[rows])


def _cut_short(r: Recording, size: float, _rng: Rng) -> Recording:
    return _keep(r, r.t <= size * r.t[-1])


def _power_cycle(r: Recording, size: float, rng: Rng) -> Recording:
    """Ten seconds missing in a dwell; after them all biases are others, by `size` of 1 deg/h and 150 ug."""
    at = _place(r, True, 12.0, rng)
    after = (r.t > at)[:, None]
    gyro, accel = rng.standard_normal((2, 3)) * size
    return _without(
        replace(
            r,
            omega_ib_b=r.omega_ib_b + after * gyro * np.radians(1.0) / 3600.0,
            f_ib_b=r.f_ib_b + after * accel * 150e-6 * 9.80665,
        ),
        at,
        10.0,
    )


def _product(p: Floats, q: Floats) -> Floats:
    """Product of quaternions p (n, 4) and q (n, 4), scalar first."""
    w = p[:, 0] * q[:, 0] - np.sum(p[:, 1:] * q[:, 1:], axis=1)
    v = p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])
    return np.column_stack([w, v])


def _tilted(length_s: float) -> Callable[[PlatformMotion, Recording, float, Rng], PlatformMotion]:
    """Turn the whole platform by `size` arcmin about a drawn axis of n, within `length_s` of a dwell, for good."""

    def apply(m: PlatformMotion, r: Recording, size: float, rng: Rng) -> PlatformMotion:
        begin, end = _some(r, True, rng)
        length = min(length_s, 0.8 * (end - begin))
        at = rng.uniform(begin, end - length)
        axis = rng.standard_normal(3)
        axis /= np.linalg.norm(axis)
        s = np.clip((m.t - at) / length, 0.0, 1.0)
        angle = size * _ARCMIN * (s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi))
        rate = size * _ARCMIN * (1.0 - np.cos(2.0 * np.pi * s)) / length
        q = np.column_stack([np.cos(angle / 2.0), np.sin(angle / 2.0)[:, None] * axis])
        turned = _product(q, m.q_nt)
        v = np.column_stack([np.zeros(len(m.t)), rate[:, None] * axis])
        back = turned * np.array([1.0, -1.0, -1.0, -1.0])
        return PlatformMotion(m.t, turned, m.omega_nt_t + _product(_product(back, v), turned)[:, 1:])

    return apply


def _table_stops(m: PlatformMotion, _r: Recording, size: float, _rng: Rng) -> PlatformMotion:
    """Let the table stand still from a share of the test on; its status goes on as planned."""
    at = int(size * len(m.t))
    q, omega = m.q_nt.copy(), m.omega_nt_t.copy()
    q[at:], omega[at:] = q[at], 0.0
    return PlatformMotion(m.t, q, omega)


_SHARES = (1e-4, 1e-3, 0.01, 0.1, 0.5)
_CLIPS = (0.9999, 0.9995, 0.999, 0.99, 0.5)
_DENIED = (0.01, 0.1, 0.3, 0.7, 1.0)
_OTHER = (0.003, 0.03, 0.1, 0.3, 1.0)
_STUCK_S = (0.03, 0.3, 3.0, 30.0, 200.0)
_SPIKES = (10, 100, 1e3, 1e4, 1e6)
_BURSTS = (3, 10, 100, 1e3, 1e5)
_SIGN_S = (0.05, 0.5, 5.0, 50.0, 1e9)
_FORWARD_S = (0.004, 0.1, 1.0, 10.0, 3600.0)
_BACK_S = (0.004, 0.1, 1.0, 10.0, 100.0)

FAULTS: tuple[Fault, ...] = (
    Fault("gap_at_rest", "samples missing in a dwell", "s", (0.01, 0.1, 0.5, 3.0, 12.0), _gap(True)),
    Fault("gap_in_turn", "samples missing in a turn", "s", (0.01, 0.05, 0.2, 1.0, 6.0), _gap(False)),
    Fault("turns_lost", "whole turns missing", "turns", (1, 2, 3, 5, 9), _lost_turns),
    Fault("dropouts", "single samples missing everywhere", "share", _SHARES, _dropouts),
    Fault("duplicates", "samples sent twice", "share", _SHARES, _duplicates),
    Fault("out_of_order", "1 % of the samples come late", "samples", (1, 2, 5, 20, 100), _out_of_order),
    Fault("repeated_stamps", "stamp of the sample before", "share", (1e-4, 1e-3, 0.01, 0.1, 0.4), _repeated),
    Fault("nan", "a reading is NaN", "share", _SHARES, _replaced(np.nan)),
    Fault("infinite", "a reading is infinite", "share", _SHARES, _replaced(np.inf)),
    Fault("gyro_saturated", "gyro axis clipped", "of peak", _CLIPS, _change("gyro", _saturated)),
    Fault("accel_saturated", "accelerometer axis clipped", "of peak", _CLIPS, _change("accel", _saturated)),
    Fault("gyro_stuck", "gyro axis shows one number", "s", _STUCK_S, _change("gyro", _stuck)),
    Fault("accel_stuck", "accelerometer axis shows one number", "s", _STUCK_S, _change("accel", _stuck)),
    Fault("gyro_spikes", "ten wrong gyro samples", "sigma", _SPIKES, _change("gyro", _spikes)),
    Fault("accel_spikes", "ten wrong accelerometer samples", "sigma", _SPIKES, _change("accel", _spikes)),
    Fault("gyro_bursts", "half seconds of wild gyro", "sigma", _BURSTS, _change("gyro", _bursts)),
    Fault("accel_bursts", "half seconds of wild accelerometer", "sigma", _BURSTS, _change("accel", _bursts)),
    Fault("gyro_sign", "gyro axis without its sign", "s", _SIGN_S, _change("gyro", _sign)),
    Fault("accel_sign", "accelerometer axis without its sign", "s", _SIGN_S, _change("accel", _sign)),
    Fault("clock_forward_rest", "clock set forward in a dwell", "s", _FORWARD_S, _clock(1.0, True)),
    Fault("clock_forward_turn", "clock set forward in a turn", "s", _FORWARD_S, _clock(1.0, False)),
    Fault("clock_back_rest", "clock set back in a dwell", "s", _BACK_S, _clock(-1.0, True)),
    Fault("clock_back_turn", "clock set back in a turn", "s", _BACK_S, _clock(-1.0, False)),
    Fault("status_says_dwell", "status says dwell in turns", "turns", (1, 2, 5, 10, 18), _says_dwell),
    Fault("status_says_rotating", "status says rotating here and there", "share", _DENIED, _says_rotating),
    Fault("status_late", "status late by", "s", (0.3, 1.0, 3.0, 6.0, 10.0), _status_shifted),
    Fault("status_early", "status early by", "s", (-0.3, -1.0, -3.0, -6.0, -10.0), _status_shifted),
    Fault("status_wrong_stop", "stops numbered wrongly", "stops", (1, 2, 5, 10, 19), _wrong_stop),
    Fault("status_stops", "status falls silent after", "of test", (0.9, 0.7, 0.5, 0.2, 0.02), _status_stops),
    Fault("recording_ends", "the recording ends after", "of test", (0.9, 0.7, 0.4, 0.15, 0.03), _cut_short),
    Fault("power_cycle", "off for 10 s at rest, other biases after", "of prior", _OTHER, _power_cycle),
    Fault("bump", "the IMU tips in 0.2 s of a dwell", "arcmin", (0.03, 0.3, 3.0, 30.0, 300.0), motion=_tilted(0.2)),
    Fault("creep", "the base tilts all through a dwell", "arcmin", (0.003, 0.03, 0.3, 3.0, 30.0), motion=_tilted(1e9)),
    Fault("table_stops", "the table stands still after", "of test", (0.95, 0.7, 0.4, 0.15, 0.03), motion=_table_stops),
)
"""Every kind, by rising size."""
