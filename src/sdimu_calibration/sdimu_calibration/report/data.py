"""Numbers behind the figures of a diagnosis: pure functions from `Diagnosis` to arrays. Figures only draw them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.scan import Scan, scan
from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES, Consistency, StopMean
from sdimu_calibration.core.evidence.handheld_evidence import CHANNELS as HANDHELD_CHANNELS
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.groups import free

CHANNEL_UNITS = ("mm",) * 3 + ("mm/s",) * 3 + ("deg/h",) * 3 + ("ug",) * 3
"""Customary unit of each measurement channel."""
VARIABLES = (
    ("a x", "g"),
    ("a y", "g"),
    ("a z", "g"),
    ("w x", "deg/h"),
    ("w y", "deg/h"),
    ("w z", "deg/h"),
    ("time", "min"),
    ("dT", "degC"),
)
"""Physical variables against which residuals are shown: specific force, body rate at rest, time, temperature."""


NOTABLE = 3.0
"""Sigmas beyond which a single number is pointed out."""


@dataclass(frozen=True)
class Residuals:
    """Innovations of the navigation filter with every coefficient at its estimate."""

    t: Floats
    """End of each epoch (s), shape (e,)."""
    stop: Ints
    """Shape (e,)."""
    sigma: Floats
    """Shape (e, 12). Predicted one sigma (SI); NaN where not measured."""
    before: Floats
    after: Floats
    """`before`, `after`: shape (e, 12). In sigmas, with the model as given and with what was found added; NaN where not
    measured."""


def added(diagnosis: Diagnosis) -> tuple[Ints, Floats]:
    """Columns of the model and of what was found, and the prior information of each."""
    evidence, chosen = diagnosis.evidence, diagnosis.found.chosen
    known = np.concatenate([evidence.model, chosen]).astype(np.int64)
    return known, np.concatenate([evidence.weight, np.zeros(len(chosen))])


def residuals(diagnosis: Diagnosis) -> Residuals:
    """Innovations before and after what was found is added.

    "After" is the linear refit on the whitened innovations; a nonlinear one differs by second order.
    """
    evidence = diagnosis.navigation
    given = _left(diagnosis, evidence.model, evidence.weight)
    left = _left(diagnosis, *added(diagnosis)) if len(diagnosis.found.chosen) else given
    L = evidence.output.L
    sigma = np.sqrt(np.einsum("eij,eij->ei", L, L))
    measured = np.isfinite(evidence.output.normalised)
    return Residuals(
        evidence.prepared.epochs.end,
        evidence.prepared.phases.stop,
        np.where(measured, sigma, np.nan),
        _coloured(given, diagnosis, sigma),
        _coloured(left, diagnosis, sigma),
    )


def _left(diagnosis: Diagnosis, known: Ints, weight: Floats) -> Floats:
    """Whitened innovations with the parameters at `known` estimated, wherever the evidence was linearised."""
    evidence = diagnosis.navigation
    estimate, _ = evidence.information.estimate(known, weight)
    return np.asarray(evidence.e - evidence.W[:, known] @ estimate)


def _coloured(white: Floats, diagnosis: Diagnosis, sigma: Floats) -> Floats:
    """Undo the whitening: innovations in their own sigmas, (e, 12)."""
    evidence = diagnosis.navigation
    full = np.zeros(sigma.shape)
    full[evidence.epoch, evidence.channel] = white
    innovation = np.einsum("eij,ej->ei", evidence.output.L, full)
    measured = np.isfinite(evidence.output.normalised)
    return np.where(measured, innovation / np.where(sigma > 0.0, sigma, 1.0), np.nan)


@dataclass(frozen=True)
class Grid:
    """Normalised residual means: `value` (12, s) of every channel at every stop of `stops` (s,); NaN where none."""

    stops: Ints
    value: Floats


def where(consistency: Consistency) -> Grid:
    """Lay out the stop means of a consistency check."""
    stops = np.unique([m.stop for m in consistency.where]).astype(np.int64)
    value = np.full((len(CHANNEL_NAMES), len(stops)), np.nan)
    for mean in consistency.where:
        value[CHANNEL_NAMES.index(mean.channel), np.searchsorted(stops, mean.stop)] = mean.normalised_mean
    return Grid(stops, value)


def places(rows: Sequence[StopMean]) -> tuple[Grid, list[str]]:
    """Lay out residuals by the channels that occur, and name the channels.

    Channels that nothing checks, such as the heading by which a handheld turn ends, do not occur.
    """
    stops = np.unique([p.stop for p in rows]).astype(np.int64)
    channels = list(dict.fromkeys(c for c in (*CHANNEL_NAMES, *HANDHELD_CHANNELS) if any(p.channel == c for p in rows)))
    value = np.full((len(channels), len(stops)), np.nan)
    for place in rows:
        value[channels.index(place.channel), np.searchsorted(stops, place.stop)] = place.normalised_mean
    return Grid(stops, value), channels


def stop_grid(found: Residuals, after: bool) -> Grid:
    """Sum over each stop of residuals in sigmas, over the root of their number: standard normal when white."""
    y = found.after if after else found.before
    stops = np.unique(found.stop[np.isfinite(y).any(axis=1)]).astype(np.int64)
    value = np.full((y.shape[1], len(stops)), np.nan)
    for k, stop in enumerate(stops):
        rows = y[found.stop == stop]
        count = np.isfinite(rows).sum(axis=0)
        value[:, k] = np.where(count > 0, np.nansum(rows, axis=0) / np.sqrt(np.maximum(count, 1)), np.nan)
    return Grid(stops, value)


@dataclass(frozen=True)
class Scored:
    """A candidate with its evidence, numbers in `unit` (customary)."""

    label: str
    family: str
    unit: str
    z: float
    left: float
    """`z`, `left`: score with the model as given, and with what was found added."""
    estimate: float
    sigma: float
    prior: float
    """The size that physics gives it (inf where unknown)."""
    retention: float
    """Share of its signature that the model leaves."""
    chosen: bool

    @property
    def coefficient(self) -> str:
        """The label without onset or time constant."""
        return self.label.partition("(")[0]


def scored(diagnosis: Diagnosis) -> list[Scored]:
    """Every candidate of catalogue and own equations that was tried, largest score first."""
    evidence = diagnosis.navigation
    p, free = len(evidence.weight), set(diagnosis.free.tolist())
    first = scan(evidence.information, evidence.model, evidence.weight)
    last = first if not len(diagnosis.found.chosen) else scan(evidence.information, *added(diagnosis))
    looked_at = [i for i in range(p, len(evidence.names)) if i not in free]
    return scores(evidence, first, last, looked_at, diagnosis.found.chosen)


def scores(evidence: LinearEvidence, first: Scan, last: Scan, columns: Sequence[int], chosen: Ints) -> list[Scored]:
    """Candidates at some columns, largest score first, from the scans without and with what was chosen."""
    rows = [_scored(evidence, i, first, last, i in chosen) for i in columns]
    return sorted(rows, key=lambda row: -abs(row.z))


def best_variants(entries: Sequence[Scored]) -> list[Scored]:
    """Those with a score, one a parameter: what was found, else the best of the onsets or time constants tried."""
    best: dict[str, Scored] = {}
    for entry in entries:
        if entry.z and (entry.chosen or entry.coefficient not in best):
            best[entry.coefficient] = entry
    return sorted(best.values(), key=lambda row: -abs(row.z))


def _scored(evidence: LinearEvidence, index: int, first: Scan, last: Scan, chosen: bool) -> Scored:
    candidate = evidence.candidates[index - len(evidence.weight)]
    unit = candidate.parameter.display_unit
    factor = from_si(1.0, unit)
    return Scored(
        candidate.label,
        candidate.family,
        unit,
        float(first.z[index]),
        float(last.z[index]),
        float(first.estimate[index]) * factor,
        float(first.sigma[index]) * factor,
        float(evidence.prior[index - len(evidence.weight)]) * factor,
        float(first.retention[index]),
        chosen,
    )


@dataclass(frozen=True)
class FreeInputs:
    """Sensor error that every dwell and turn would need of its own (minimum norm), s segments."""

    start: Floats
    end: Floats
    """`start`, `end`: seconds, shape (s,)."""
    turn: Bools
    """Shape (s,)."""
    before: Floats
    after: Floats
    """`before`, `after`: deg/h for the gyros, ug for the accelerometers, shape (s, 6)."""
    z: Floats
    """Score of each alone, with the model as given, shape (s, 6)."""


def free_inputs(diagnosis: Diagnosis) -> FreeInputs:
    """Lay the free-input remainders out in time."""
    times = diagnosis.navigation.times
    spans = np.array([[a, b] for _, a, b in (*times.stops, *times.turns)]).reshape(-1, 2)
    turn = np.arange(len(spans)) >= len(times.stops)
    factor = np.array([from_si(1.0, "deg/h")] * 3 + [from_si(1.0, "ug")] * 3)
    order = np.argsort(spans[:, 0], kind="stable")
    before, after, z = (
        np.reshape(v, (-1, 6))[order]
        for v in (
            diagnosis.free_inputs_before.estimate,
            diagnosis.free_inputs_after.estimate,
            diagnosis.free_inputs_before.z,
        )
    )
    return FreeInputs(spans[order, 0], spans[order, 1], turn[order], before * factor, after * factor, z)


def variables(diagnosis: Diagnosis) -> Floats:
    """Physical variables of `VARIABLES`, means over each epoch, shape (e, 8)."""
    evidence = diagnosis.navigation
    seen, epochs = evidence.seen, evidence.prepared.epochs
    columns = np.column_stack(
        [seen.a, seen.w * from_si(1.0, "deg/h"), (seen.t - 0.5 * seen.dt) * from_si(1.0, "min"), seen.temperature]
    )
    length = np.add.reduceat(seen.dt, epochs.first)
    return np.asarray(np.add.reduceat(columns * seen.dt[:, None], epochs.first) / length[:, None])


def binned(x: Floats, y: Floats, bins: int) -> tuple[Floats, Floats, Floats]:
    """Means of `y` and their standard errors in at most `bins` bins of equal counts of `x`, y of unit variance.

    Equal values of x never fall into different bins, so that a stop is not torn apart.

    Returns
    -------
    x, mean, error : ndarray, shape (b,)
    """
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    if not len(x):
        return np.empty(0), np.empty(0), np.empty(0)
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, bins + 1)))
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, max(len(edges) - 2, 0))
    count = np.bincount(place).astype(float)
    kept = count > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        at, mean = np.bincount(place, x) / count, np.bincount(place, y) / count
        error = 1.0 / np.sqrt(count)
    return at[kept], mean[kept], error[kept]


@dataclass(frozen=True)
class Explained:
    """What one of the found predicts against the misfit, all else estimated along (Frisch, Waugh, Lovell).

    `predicted` and `misfit`, shape (N,), in sigmas of the whitened innovations; on the diagonal when it is right.
    """

    label: str
    predicted: Floats
    misfit: Floats


def explained(diagnosis: Diagnosis) -> list[Explained]:
    """Added-variable data of everything that was found."""
    evidence = diagnosis.navigation
    known, weight = added(diagnosis)
    J = evidence.information.J
    estimate, _ = evidence.information.estimate(known, weight)
    left = _left(diagnosis, known, weight)
    p, out = len(evidence.weight), []
    for place in range(p, len(known)):
        others = np.delete(known, place)
        A = J[np.ix_(others, others)] + np.diag(np.delete(weight, place))
        unit = 1.0 / np.sqrt(np.diag(A))
        share = unit * np.linalg.solve(A * np.outer(unit, unit), unit * J[others, known[place]])
        predicted = (evidence.W[:, known[place]] - evidence.W[:, others] @ share) * estimate[place]
        out.append(Explained(evidence.names[known[place]], predicted, left + predicted))
    return out


def envelope(x: Floats, y: Floats, most: int) -> tuple[Floats, Floats]:
    """Thin a curve to about `most` points that keep the smallest and largest value of every stretch."""
    good = np.flatnonzero(np.isfinite(y))
    if len(good) <= most:
        return x[good], y[good]
    parts = np.array_split(good, most // 2)
    kept = sorted({int(f) for part in parts for f in (part[np.argmin(y[part])], part[np.argmax(y[part])])})
    return x[kept], y[kept]


def interrupted(x: Floats, y: Floats, gap: float) -> tuple[Floats, Floats]:
    """Put NaN where neighbours are more than `gap` apart, so that no line is drawn over what was not measured."""
    at = np.flatnonzero(np.diff(x) > gap) + 1
    return np.insert(x, at, np.nan), np.insert(y, at, np.nan)


def correlation(calibration: Calibration) -> tuple[tuple[str, ...], Floats]:
    """Names of the free coefficients and their correlation matrix."""
    shown = np.flatnonzero(free(calibration))
    C = calibration.covariance[np.ix_(shown, shown)]
    scale = 1.0 / np.sqrt(np.diag(C))
    return tuple(calibration.names[i] for i in shown), C * np.outer(scale, scale)


def hardest_pairs(names: tuple[str, ...], C: Floats, most: int = 6, least: float = 0.5) -> list[tuple[str, str, float]]:
    """Pairs that are hardest to separate: at most `most` with a correlation beyond `least`, strongest first."""
    i, j = np.triu_indices(len(names), 1)
    order = np.argsort(-np.abs(C[i, j]))[:most]
    return [(names[i[k]], names[j[k]], float(C[i[k], j[k]])) for k in order if abs(C[i[k], j[k]]) > least]
