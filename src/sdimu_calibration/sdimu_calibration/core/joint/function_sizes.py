"""How large an unknown function of the attitude is that a set has in common: likelihood of its sizes.

Everything but the weights of the function is integrated once; the line of one sensor's size is then that of the
eigenvalues of what the data say of its own weights.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.joint.combine import Combination
from sdimu_calibration.core.joint.member import Report
from sdimu_calibration.core.joint.set_fit import SetFit, columns_of, grouped_rows
from sdimu_calibration.core.joint.shared_function import SharedFunction

_RATIOS = np.geomspace(1e-3, 1e4, 57)
"""Ratios (1) of the sizes tried to the one at which a function is seen at all: neighbours differ by a third."""


@dataclass(frozen=True)
class FunctionSizes:
    """What a set says of the sizes of a function."""

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
