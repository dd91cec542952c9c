"""What the model of a set leaves in each dwell of its recordings, and how alike two dwells are.

Every sensor of a recording might have an error of its own in each dwell: columns beside the coefficients, which are
estimated with them. What is left are their scores s and the information G on them; under
the model s is Gaussian with covariance G.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.effect import CHANNELS
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.joint.combine import stacked
from sdimu_calibration.core.joint.member import Report
from sdimu_calibration.core.joint.scope import split_tag
from sdimu_calibration.core.joint.set_evidence import white_power_on
from sdimu_calibration.core.joint.set_fit import Run, SetFit, asked_again, power_on

ATTITUDE, TIME, TEMPERATURE = "attitude", "time", "temperature"
KINDS = (ATTITUDE, TIME, TEMPERATURE)
"""What leftovers may come back with."""
_ATTITUDE_RAD = float(np.radians(20.0))
"""Angle (rad) over which the likeness of two attitudes falls to 1/e: far more than a mount differs between recordings,
less than the 45 deg between the stops of plans."""
_TIME_SHARES = (0.02, 0.15)
"""Shares of the longest recording (1) over which the likeness of two times falls to 1/e: half a stop of a plan for what
happens at one time, and several for a warm-up; the mean of both."""
_HEAT_SHARES = (0.05, 0.4)
"""The same of the range of all temperatures (1): a coefficient changes slowly with it, a hysteresis at one."""
_LEAST_HEAT = 0.3
"""Least temperature difference (K) that counts: thermometers are no better from day to day."""
_MOST_COLUMNS = 1000
"""Number of leftovers at most: the time of a test goes with the cube, and six recordings show what twenty do."""
_SEEN = 1e-12
"""Ratio (1) of the information on an error in a dwell to the largest from which it counts: below is rounding."""
_ALIKE = 0.5
"""Likeness (1) from which two dwells count as a pair: nearer to one place than to another."""


@dataclass(frozen=True)
class StopError:
    """What a sensor has left in a stop of a recording: over its sigma, standard normal when the model is right."""

    recording: str
    channel: str
    """One of `CHANNELS`."""
    stop: int
    before: float
    after: float
    """`before`, `after`: with the model as given, and with the effects that were found; NaN where nothing is seen."""


@dataclass(frozen=True)
class Leftovers:
    """Scores of all leftovers, m of them; units such that the information on a sensor's error is one in the mean."""

    score: Floats
    """Shape (m,)."""
    gram: Floats
    """Covariance of the scores under the model, shape (m, m)."""
    sensor: Ints
    """Into `CHANNELS`, shape (m,)."""
    recording: Ints
    """Shape (m,)."""
    likeness: Mapping[str, Floats]
    """Shape (m, m). By kind: 1 where two leftovers are of one attitude (time, temperature), 0 where nothing is common.
    """
    where: tuple[StopError, ...] = ()
    """The same for people: each by itself."""

    def only(self, keep: Ints) -> Leftovers:
        """Return some of the leftovers.

        Parameters
        ----------
        keep : ndarray of int, shape (k,)
        """
        square = np.ix_(keep, keep)
        return Leftovers(
            self.score[keep],
            self.gram[square],
            self.sensor[keep],
            self.recording[keep],
            {kind: value[square] for kind, value in self.likeness.items()},
        )

    def pairs(self, kind: str) -> int:
        """Count the pairs of dwells of two recordings that are alike in a kind."""
        one = self.sensor == self.sensor[0]
        other = self.recording[one][:, None] != self.recording[one][None, :]
        return int(np.count_nonzero((self.likeness[kind][np.ix_(one, one)] > _ALIKE) & other) // 2)

    def coincide(self, one: str, other: str) -> float:
        """Tell the share of dwells whose partner in another recording is the same one in both kinds."""
        mine = np.flatnonzero(self.sensor == self.sensor[0])
        of, square = self.recording[mine], np.ix_(mine, mine)
        shares = []
        for first, second in ((one, other), (other, one)):
            a, b = self.likeness[first][square], self.likeness[second][square]
            both = [
                b[row, theirs[int(np.argmax(a[row, theirs]))]] > _ALIKE
                for row in range(len(mine))
                for k in np.unique(of)
                if k != of[row]
                for theirs in [np.flatnonzero(of == k)]
                if a[row, theirs].max() > _ALIKE
            ]
            shares.append(float(np.mean(both)) if both else 0.0)
        return max(shares)


def leftovers(fit: SetFit, run: Run, given: Sequence[str] = ()) -> Leftovers:
    """Ask the recordings of a set what is left in each of their dwells.

    Parameters
    ----------
    fit : SetFit
        With everything that was found.
    run : callable
        Does the jobs.
    given : sequence of str
        Coefficients of the model as given.
    """
    reports = with_places(fit, run)
    fit = replace(fit, reports=tuple(reports))
    rows, own = [], []
    members: list[int] = []
    for group in fit.groups:
        white, wide = white_power_on(fit, group, fit.names, [_own(reports[k]) for k in group])
        rows.append(white)
        own.append(np.hstack(wide))
        members += group
    every, P = stacked(rows), len(fit.names)
    W = np.hstack([every.A, block_diag(*own)])
    full = Information(W.T @ W, W.T @ every.y)
    left = full.given(np.arange(P), fit.weight)
    asked = [reports[k] for k in members if reports[k].places is not None]
    found = _scaled(left.J[P:, P:], left.d[P:], asked, fit)
    return replace(found, where=_where(asked, _as_given(full, fit, given), _deviates(left, P)))


def _as_given(full: Information, fit: SetFit, given: Sequence[str]) -> Floats:
    """Deviates (1) of all m leftovers, shape (m,), in the model as given: all recordings share its coefficients."""
    P, p = len(fit.names), len(given)
    T = np.zeros((len(full.d), len(full.d) - P + p))
    weight = np.zeros(p)
    for k, name in enumerate(fit.names):
        base = split_tag(name)[0]
        if base in given:
            T[k, given.index(base)] = 1.0
            weight[given.index(base)] = fit.weight[k]
    T[P:, p:] = np.eye(len(full.d) - P)
    return _deviates(Information(T.T @ full.J @ T, T.T @ full.d).given(np.arange(p), weight), p)


def _deviates(left: Information, p: int) -> Floats:
    """Errors in dwells over their sigmas (1), each by itself, shape (m,); the first p parameters are no such errors."""
    J, d = np.diag(left.J)[p:], left.d[p:]
    seen = np.max(J, initial=0.0) * _SEEN < J
    return np.where(seen, d / np.sqrt(np.where(seen, J, 1.0)), np.nan)


def _where(reports: Sequence[Report], before: Floats, after: Floats) -> tuple[StopError, ...]:
    """Name the deviates (1) of leftovers, shape (m,): sensors of the first dwell of a recording, of its second ..."""
    places = [(r.name, stop) for r in reports for stop, _, _ in r.times.stops]
    named = [(name, channel, stop) for name, stop in places for channel in CHANNELS]
    return tuple(
        StopError(*at, one, other) for at, one, other in zip(named, before.tolist(), after.tolist(), strict=True)
    )


def with_places(fit: SetFit, run: Run) -> list[Report]:
    """Ask for the rows of recordings about the joint estimate with an error in each dwell; of many, of some."""
    columns = [len(CHANNELS) * len(r.times.stops) for r in fit.reports]
    most = max(2, int(_MOST_COLUMNS // max(*columns, 1)))
    # Spread over the set where it holds more than are asked.
    asked = set(np.unique(np.linspace(0, len(columns) - 1, min(most, len(columns))).round().astype(int)).tolist())
    places = [k for k in range(len(columns)) if k in asked]
    return asked_again(fit, run, places, stretches=True)


def _own(report: Report) -> Floats:
    """Columns of the dwells of a recording; none where they were not asked for."""
    rows = report.reduction
    return rows.A[:, len(rows.names) if report.places is not None else rows.A.shape[1] :]


def _scaled(J: Floats, d: Floats, reports: Sequence[Report], fit: SetFit) -> Leftovers:
    """Name the columns, and bring those of a sensor to the same unit."""
    count = len(CHANNELS)
    dwells = [r.places for r in reports if r.places is not None]
    begin = {name: min(r.start_ns for r in fit.reports if power_on(r) == name) for name in fit.power_ons}
    late = [1e-9 * (r.start_ns - begin[power_on(r)]) for r in reports]
    up = np.vstack([p.up for p in dwells])
    t = np.concatenate([p.middle + after for p, after in zip(dwells, late, strict=True)])
    heat = np.concatenate([p.temperature_degc for p in dwells])
    sensor = np.tile(np.arange(count), len(t))
    unit = np.ones(len(sensor))
    for channel in range(count):
        size = float(np.diag(J)[sensor == channel].mean())
        unit[sensor == channel] = 1.0 / np.sqrt(size) if size > 0.0 else 0.0
    alike = likeness(up, t / max(r.times.duration for r in reports), heat)
    return Leftovers(
        d * unit,
        J * np.outer(unit, unit),
        sensor,
        np.repeat(np.arange(len(dwells)), [count * len(p) for p in dwells]),
        {kind: np.repeat(np.repeat(value, count, 0), count, 1) for kind, value in alike.items()},
    )


def likeness(up: Floats, t: Floats, temperature_degc: Floats) -> dict[str, Floats]:
    """Say how alike n dwells are in attitude, time and temperature.

    Parameters
    ----------
    up : ndarray, shape (n, 3)
        Direction of gravity in b: unit vectors.
    t : ndarray, shape (n,)
        Time since the power-on over the length of the longest recording (1).
    temperature_degc : ndarray, shape (n,)
        NaN where none is recorded.

    Returns
    -------
    dict of ndarray, shape (n, n)
        ``exp(-distance)`` (1), a positive semidefinite function of places; of temperature zero where none is recorded.
    """
    apart = np.abs(t[:, None] - t[None, :])
    seen = np.isfinite(temperature_degc)
    heat = np.where(seen, temperature_degc, 0.0)
    span = float(np.ptp(heat[seen])) if seen.any() else 0.0
    cooler = np.abs(heat[:, None] - heat[None, :])
    close = np.mean([np.exp(-cooler / max(share * span, _LEAST_HEAT)) for share in _HEAT_SHARES], axis=0)
    return {
        ATTITUDE: np.exp(-np.arccos(np.clip(up @ up.T, -1.0, 1.0)) / _ATTITUDE_RAD),
        TIME: np.mean([np.exp(-apart / share) for share in _TIME_SHARES], axis=0),
        TEMPERATURE: np.where(seen[:, None] & seen[None, :], close, 0.0),
    }
