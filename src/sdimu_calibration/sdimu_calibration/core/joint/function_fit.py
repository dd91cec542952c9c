"""A joint fit with an unknown function of the attitude that all recordings have in common.

Where a set leaves something that such a function explains, it belongs to the sensor. The weights of the function are
coefficients of all recordings, and everything about a set holds with them. Their size is the likeliest one in a fit;
the search weighs all sizes beside the effects (`function_prior`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import CHANNELS
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.evidence.attitude_functions import covering
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.joint.combine import Combination
from sdimu_calibration.core.joint.function_prior import OwnWeights
from sdimu_calibration.core.joint.leftovers import with_places
from sdimu_calibration.core.joint.member import Report
from sdimu_calibration.core.joint.reduction import Reduction
from sdimu_calibration.core.joint.scope import tagged
from sdimu_calibration.core.joint.set_fit import Run, SetFit, asked_again, columns_of, grouped_rows, with_reports
from sdimu_calibration.core.joint.shared_function import SharedFunction, is_weight
from sdimu_calibration.core.noise_term import ATTITUDE, AXES, TRIADS
from sdimu_calibration.core.posterior.unknown import UnknownFunction, left_by_coefficients

_MOST = 150
"""Number of functions at most: several plans together cover more of the sphere than one."""
_LEARNINGS = 2
"""Number of times that each recording learns its noise beside the function: a third changes no size by a tenth."""


def with_function(fit: SetFit, sensors: Sequence[str], run: Run) -> SetFit:
    """Fit a set beside an unknown function of the attitude; one with runs by hand stays as it is.

    Parameters
    ----------
    sensors : sequence of str
        Those that have one; without any the fit stays as it is.
    run : callable
        Does the jobs.
    """
    if not sensors or any(r.estimator == HandheldFit.estimator for r in fit.reports):
        return fit
    places = [r.places for r in with_places(fit, run) if r.places is not None]
    stops = np.vstack([p.up for p in places])
    functions = covering(stops, np.vstack([p.way for p in places]), _MOST)
    shared = SharedFunction(functions, tuple(c for c in CHANNELS if c in sensors), stops, {})
    # The noise that each recording learned without the function has taken it in.
    reports = asked_again(fit, run, function=shared, noise=())
    for _ in range(_LEARNINGS):
        shared = replace(shared, size=function_sizes(fit, reports, shared).likeliest(shared.size))
        reports = asked_again(fit, run, function=shared, noise=None)
    return in_size(with_reports(replace(fit, function=shared), reports))


def in_size(fit: SetFit) -> SetFit:
    """Return a fit beside a function in its likeliest size."""
    if fit.function is None:
        return fit
    sizes = function_sizes(fit, fit.reports, fit.function)
    shared = replace(fit.function, size=sizes.likeliest(fit.function.size))
    known = dict(zip(shared.labels, shared.known.tolist(), strict=True))
    reports = [replace(r, reduction=r.reduction.in_prior(known)) for r in fit.reports]
    return with_reports(replace(fit, function=shared), reports)


def with_own_functions(fit: SetFit, own: Sequence[OwnWeights]) -> SetFit:
    """Fit a set in which no function is common, and recordings have functions of their own.

    A common one that recordings must share against what they say has weights hundreds of times too large, and leaves
    the coefficients of its sensor as wide.

    Parameters
    ----------
    fit : SetFit
        Beside a common function.
    own : sequence of OwnWeights
        Of each recording, in the order of the reports.
    """
    reports = [
        replace(report, reduction=with_own_weights(report.reduction, report.name, weights))
        for report, weights in zip(fit.reports, own, strict=True)
    ]
    return with_reports(fit, reports)


def with_own_weights(rows: Reduction, recording: str, own: OwnWeights) -> Reduction:
    """Give a recording weights of its own in the place of common ones; those that it does not have are none.

    Parameters
    ----------
    recording : str
        Its name, which its own weights have behind theirs.
    """
    size = dict(zip(own.labels, own.size.tolist(), strict=True))
    kept = [k for k, name in enumerate(rows.names) if not is_weight(name) or name in size]
    every = [(rows.names[k], float(rows.weight[k])) for k in kept]
    return replace(
        rows,
        names=tuple(tagged(name, recording) if name in size else name for name, _ in every),
        A=rows.A[:, [*kept, *range(len(rows.names), rows.A.shape[1])]],
        point=rows.point[kept],
        weight=np.array([size[name] ** -2.0 if name in size else known for name, known in every]),
    )


def unknown_functions(fit: SetFit) -> tuple[UnknownFunction, ...]:
    """Work out the function of each triad at all stops, from the weights of a fit; none without a function."""
    shared = fit.function
    if shared is None:
        return ()
    own = np.array([fit.names.index(label) for label in shared.labels])
    weights, covariance = fit.estimate.values[own], fit.estimate.covariance[np.ix_(own, own)]
    force = shared.stops
    values = left_by_coefficients(np.full(len(force), 1.0 / len(force)), force) @ shared.functions.at(force)
    out = []
    for triad in TRIADS:
        axes = tuple(axis for axis in AXES if f"{triad}_{'xyz'[axis]}" in shared.sensors)
        mean, sigma = np.zeros((len(force), 3)), np.zeros((len(force), 3))
        for axis in axes:
            at = np.flatnonzero(shared.of(f"{triad}_{'xyz'[axis]}"))
            mean[:, axis] = values @ weights[at]
            sigma[:, axis] = np.sqrt(
                np.einsum("nk,kl,nl->n", values, covariance[np.ix_(at, at)], values, optimize=True)
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
    fit : SetFit
        With the weights among its coefficients, or without.
    reports : sequence of Report
        Rows with the weights.
    """
    bare = [k for k, name in enumerate(fit.names) if not is_weight(name)]
    names, labels, p = tuple(fit.names[k] for k in bare), shared.labels, len(bare)
    rows = grouped_rows(reports, (*names, *labels))
    squares = np.sum([np.sum(group.A[:, p:] ** 2, axis=0) for group in rows], axis=0)
    seen = {sensor: float(np.median(squares[shared.of(sensor)])) ** -0.5 for sensor in shared.sensors}
    components = columns_of(fit.varying, names) if len(rows) > 1 else []
    known = np.concatenate([fit.weight[bare], replace(shared, size=seen).known])
    combined = Combination(rows, known, components)
    constant, information = combined.integrated(fit.tau)
    known = combined.weight[:p]
    of_fit = Information(information.J[:p, :p], information.d[:p])
    constant += of_fit.log_likelihood(known) + 0.5 * float(np.log(known).sum())
    given = information.given(np.arange(p), known)
    unit = np.sqrt(combined.weight[p:])
    of_weights = Information(given.J[p:, p:] / np.outer(unit, unit), given.d[p:] / unit)
    return FunctionSizes(shared, seen, of_weights, constant)
