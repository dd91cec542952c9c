"""A joint fit with an unknown function of the attitude that all recordings have in common.

Where a set leaves something that such a function explains, it belongs to the sensor. The weights of the function are
parameters of all recordings, and are integrated out of the coefficients; their size is the likeliest one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import CHANNELS
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.evidence.attitude_functions import covering
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.joint.combine import Combination, JointEstimate
from sdimu_calibration.core.joint.leftovers import with_places
from sdimu_calibration.core.joint.member import Report
from sdimu_calibration.core.joint.set_evidence import own_values
from sdimu_calibration.core.joint.set_fit import Run, SetFit, asked_again, columns_of, grouped_rows
from sdimu_calibration.core.joint.shared_function import SharedFunction
from sdimu_calibration.core.joint.turn_on import in_scatter, turn_on_scatter
from sdimu_calibration.core.noise_term import ATTITUDE, AXES, TRIADS
from sdimu_calibration.core.posterior.unknown import UnknownFunction, left_by_coefficients
from sdimu_calibration.core.results import TurnOn

_MOST = 150
"""Number of functions at most: several plans together cover more of the sphere than one."""
_LEARNINGS = 2
"""Number of times that each recording learns its noise beside the function: a third changes no size by a tenth."""


@dataclass(frozen=True)
class Beside:
    """A joint fit beside a function."""

    fit: SetFit
    """With the estimate beside the function."""
    reports: tuple[Report, ...] = ()
    """Rows with the weights."""
    shared: SharedFunction | None = None
    """None where there is none: then the estimate is that without."""
    gain: float = 0.0
    """Log-likelihood that the function adds (1)."""
    unknown: tuple[UnknownFunction, ...] = ()
    """The function at all stops, one a triad."""


def with_function(fit: SetFit, sensors: Sequence[str], run: Run) -> Beside:
    """Estimate the coefficients of a fit beside an unknown function of the attitude; of a run by hand as they are.

    Parameters
    ----------
    sensors : sequence of str
        Those that have one.
    run : callable
        Does the jobs.
    """
    if any(r.estimator == HandheldFit.estimator for r in fit.reports):
        return Beside(fit)
    places = [r.places for r in with_places(fit, run) if r.places is not None]
    stops = np.vstack([p.up for p in places])
    functions = covering(stops, np.vstack([p.way for p in places]), _MOST)
    shared = SharedFunction(functions, tuple(c for c in CHANNELS if c in sensors), {})
    reports = asked_again(fit, run, noise=(), function=shared)
    for _ in range(_LEARNINGS):
        shared = replace(shared, size=function_sizes(fit, reports, shared).likeliest(shared.size))
        reports = asked_again(fit, run, noise=(), function=shared)
    sizes = function_sizes(fit, reports, shared)
    shared = replace(shared, size=sizes.likeliest(shared.size))
    gain = sizes.log_likelihood(shared.size) - sizes.log_likelihood(sizes.least)
    estimate, turn_on = _estimated(fit, reports, shared)
    p = len(fit.names)
    of_fit = replace(estimate, values=estimate.values[:p], covariance=estimate.covariance[:p, :p])
    beside = replace(fit, estimate=of_fit, turn_on=turn_on, function=shared)
    return Beside(beside, tuple(reports), shared, gain, _at_stops(estimate, shared, stops))


def needless(beside: Beside, effects: Mapping[str, str], log_prior: Callable[[Sequence[str]], float]) -> list[str]:
    """Find the effects that the function explains: without them the posterior is larger, one after the other.

    Parameters
    ----------
    effects : mapping of str to str
        Names of coefficients of the fit by label, those of one recording among them.
    log_prior : callable
        Of labels to the log of their prior over that of none (1).

    Returns
    -------
    list of str
        Labels.
    """
    if beside.shared is None:
        return []
    kept = list(effects)

    def score(labels: Sequence[str]) -> float:
        lacks = [name for label, name in effects.items() if label not in labels]
        return _without(beside, lacks) + log_prior(labels)

    best = score(kept)
    while kept:
        trials = [[label for label in kept if label != one] for one in kept]
        scores = [score(trial) for trial in trials]
        if max(scores) < best:
            break
        best, kept = max(scores), trials[int(np.argmax(scores))]
    return [label for label in effects if label not in kept]


def _without(beside: Beside, names: Sequence[str]) -> float:
    """Log-likelihood of a fit without some coefficients, with the function as large as is likeliest then (1)."""
    fit, shared = beside.fit, beside.shared
    if shared is None:
        raise AssertionError("a function is needed")
    less, reports = _fit_without(fit, names), [_rows_without(r, fit, names) for r in beside.reports]
    sizes = function_sizes(less, reports, shared)
    return sizes.log_likelihood(sizes.likeliest(shared.size))


def _rows_without(report: Report, fit: SetFit, names: Sequence[str]) -> Report:
    """Give a recording the value of all others where it loses the one of its own."""
    common = {fit.names[own]: fit.names[shared] for own, shared in own_values(fit.names) if fit.names[own] in names}
    rows = report.reduction
    return (
        replace(report, reduction=replace(rows, names=tuple(common.get(n, n) for n in rows.names)))
        if common
        else report
    )


def _fit_without(fit: SetFit, names: Sequence[str]) -> SetFit:
    """Leave coefficients out of what a likelihood asks of a fit: names, weights, what varies and by how much."""
    at = [k for k, name in enumerate(fit.names) if name not in names]
    own = {effect: tuple(n for n in each if n not in names) for effect, each in fit.varying.items()}
    scatter = [t for t, each in zip(fit.turn_on, own.values(), strict=False) if each]
    return replace(
        fit,
        names=tuple(fit.names[k] for k in at),
        weight=fit.weight[at],
        varying={effect: each for effect, each in own.items() if each},
        turn_on=tuple(scatter),
    )


def _estimated(
    fit: SetFit, reports: Sequence[Report], shared: SharedFunction
) -> tuple[JointEstimate, tuple[TurnOn, ...]]:
    """Estimate coefficients and weights, and the scatter of the power-ons beside them."""
    combined = with_weights(fit, reports, shared)
    turn_on = turn_on_scatter(combined) if combined.components else ()
    return in_scatter(combined, turn_on), turn_on


def _at_stops(found: JointEstimate, shared: SharedFunction, force: Floats) -> tuple[UnknownFunction, ...]:
    """Work out the function of each triad at all stops, from the weights at the end of an estimate.

    `force` is the direction of the force at each stop in b, shape (n, 3) (1).
    """
    first = len(found.values) - len(shared.labels)
    weights, covariance = found.values[first:], found.covariance[first:, first:]
    values = left_by_coefficients(np.full(len(force), 1.0 / len(force)), force) @ shared.functions.at(force)
    out = []
    for triad in TRIADS:
        axes = tuple(axis for axis in AXES if f"{triad}_{'xyz'[axis]}" in shared.sensors)
        mean, sigma = np.zeros((len(force), 3)), np.zeros((len(force), 3))
        for axis in axes:
            own = np.flatnonzero(shared.of(f"{triad}_{'xyz'[axis]}"))
            mean[:, axis] = values @ weights[own]
            sigma[:, axis] = np.sqrt(
                np.einsum("nk,kl,nl->n", values, covariance[np.ix_(own, own)], values, optimize=True)
            )
        if axes:
            out.append(UnknownFunction(triad, ATTITUDE, force, np.zeros(len(force), bool), mean, sigma, axes))
    return tuple(out)


_RATIOS = np.geomspace(1e-3, 1e4, 57)
"""Ratios (1) of the sizes tried to the one at which a function is seen at all: neighbours differ by a third."""


@dataclass(frozen=True)
class FunctionSizes:
    """What a set says of the sizes of a function.

    Everything but the weights of the function is integrated once; the line of one sensor's size is then that of the
    eigenvalues of what the data say of its own weights.
    """

    shared: SharedFunction
    """Its sizes do not matter."""
    seen: dict[str, float]
    """Size at which the function of a sensor is seen at all (SI)."""
    of_weights: Information
    """On the weights, each over the size at which it is seen; coefficients and deviations integrated."""
    constant: float
    """What the log-likelihood has beside that of the weights (1)."""

    @property
    def least(self) -> dict[str, float]:
        """Sizes (SI) so small that the function is as good as none."""
        return {sensor: float(_RATIOS[0]) * size for sensor, size in self.seen.items()}

    def log_likelihood(self, size: Mapping[str, float]) -> float:
        """Log-likelihood of the sizes, coefficients and weights integrated over their priors.

        Parameters
        ----------
        size : mapping of str to float
            Of each sensor (SI).
        """
        known = self._known(size)
        return self.constant + self.of_weights.log_likelihood(known) + 0.5 * float(np.log(known).sum())

    def likeliest(self, size: Mapping[str, float]) -> dict[str, float]:
        """Find the likeliest size of each sensor, one after the other.

        Parameters
        ----------
        size : mapping of str to float
            To begin at (SI); what it lacks begins where it is seen.
        """
        found = {**self.seen, **size}
        for sensor in self.shared.sensors:
            own = self.shared.of(sensor)
            others = np.flatnonzero(~own)
            alone = self.of_weights.given(others, self._known(found)[others])
            eigen, vectors = np.linalg.eigh(alone.J[np.ix_(own, own)])
            along = (vectors.T @ alone.d[own]) ** 2
            gained = np.maximum(eigen, 0.0) * _RATIOS[:, None] ** 2
            line = (along * _RATIOS[:, None] ** 2 / (1.0 + gained) - np.log1p(gained)).sum(axis=1)
            found[sensor] = self.seen[sensor] * float(_RATIOS[np.argmax(line)])
        return {sensor: found[sensor] for sensor in self.shared.sensors}

    def _known(self, size: Mapping[str, float]) -> Floats:
        """Prior information of each weight over the size at which it is seen (1)."""
        ratios = [size[sensor] / self.seen[sensor] for sensor in self.shared.sensors]
        return np.tile(np.array(ratios) ** -2.0, len(self.shared.functions))


def function_sizes(fit: SetFit, reports: Sequence[Report], shared: SharedFunction) -> FunctionSizes:
    """Integrate everything but the weights of a function, each power-on in the scatter of a fit.

    Parameters
    ----------
    reports : sequence of Report
        Rows with the weights.
    """
    p = len(fit.names)
    squares = np.sum([np.sum(r.reduction.A[:, len(r.reduction.names) :] ** 2, axis=0) for r in reports], axis=0)
    seen = {sensor: float(np.median(squares[shared.of(sensor)])) ** -0.5 for sensor in shared.sensors}
    combined = with_weights(fit, reports, replace(shared, size=seen))
    constant, information = combined.integrated(fit.tau)
    known = combined.weight[:p]
    of_fit = Information(information.J[:p, :p], information.d[:p])
    constant += of_fit.log_likelihood(known) + 0.5 * float(np.log(known).sum())
    given = information.given(np.arange(p), known)
    unit = np.sqrt(combined.weight[p:])
    of_weights = Information(given.J[p:, p:] / np.outer(unit, unit), given.d[p:] / unit)
    return FunctionSizes(shared, seen, of_weights, constant)


def with_weights(fit: SetFit, reports: Sequence[Report], shared: SharedFunction) -> Combination:
    """Combine the recordings of a set in its coefficients and the weights of a function.

    Parameters
    ----------
    reports : sequence of Report
        Rows with the weights.
    """
    rows = grouped_rows(reports, (*fit.names, *shared.labels))
    components = columns_of(fit.varying, fit.names) if len(rows) > 1 else []
    return Combination(rows, np.concatenate([fit.weight, shared.known]), components)
