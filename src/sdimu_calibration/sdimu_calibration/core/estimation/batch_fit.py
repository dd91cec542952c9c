"""The fit by batch least squares.

Its residuals are not innovations, so what a diagnosis asks of it is answered by a navigation about its coefficients
that keeps them as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.effect import Effect, Timetable
from sdimu_calibration.core.estimation.fit import Fit, Start
from sdimu_calibration.core.estimation.free_inertial import FreeInertialRun
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.evidence.consistency import Consistency
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.navigation_evidence import NavigationEvidence
from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.recording import DataFault


@dataclass(frozen=True)
class BatchFit(Fit):
    """One least squares over all dwells and turns; its residuals are those of a navigation about its coefficients."""

    coefficients: Floats
    coefficient_covariance: Floats
    """`coefficients`, `coefficient_covariance`: SI, in `body_frame`, shapes (p,) and (p, p)."""
    summary: FitStatistics
    """Of the least squares."""
    about: NavigationFit
    """About the coefficients of this fit."""
    estimator = "batch"

    @property
    def body_frame(self) -> str:
        """Frame that the model asks for."""
        return self.model.body_frame

    @property
    def values(self) -> Floats:
        """Coefficients (SI) in `body_frame`, shape (p,)."""
        return self.coefficients if self.moved is None else self.coefficients + self._opened.values - self.about.values

    @property
    def covariance(self) -> Floats:
        """Covariance of `values`, shape (p, p)."""
        C = self.coefficient_covariance
        return C if self.doubt is None else C + self._opened.covariance - self.about.covariance

    @cached_property
    def _opened(self) -> NavigationFit:
        """The navigation about this fit over all models that stay open, whose columns are those of its evidence."""
        return self.about.with_doubt(self.doubt, self.moved)

    def reported_values(self, settled: Floats) -> Floats:
        """Bring coefficients of the navigation about this fit into its frame."""
        return self.about.reported_values(settled)

    def reported_covariance(self, settled: Floats) -> Floats:
        """Bring a covariance of the navigation about this fit into its frame."""
        return self.about.reported_covariance(settled)

    @property
    def start(self) -> Start:
        """Where a navigation of nearly the same model begins."""
        return self.about.start

    def statistics(self) -> FitStatistics:
        """Chi-square of the least squares and its degrees of freedom."""
        return self.summary

    def held_out_rms(self) -> float | None:
        """RMS of the normalised prediction errors at stops that a navigation has not seen."""
        return self.about.held_out_rms()

    def evidence(self, effects: Sequence[Effect] = ()) -> NavigationEvidence:
        """Whitened innovations about the coefficients of this fit, and the signatures of parameters and `effects`."""
        return self.about.evidence(effects)

    def added_columns(self, count: int) -> Ints:
        """Columns in `evidence` of the last `count` parameters of the model."""
        return self.about.added_columns(count)

    def consistency(self, evidence: LinearEvidence | None = None) -> Consistency:
        """Check the innovations of a navigation about the coefficients of this fit."""
        return self.about.consistency(evidence)

    @property
    def timetable(self) -> Timetable:
        """When the recording stood and turned."""
        return self.about.timetable

    @property
    def faults(self) -> tuple[DataFault, ...]:
        """What the preparation found wrong with the data."""
        return self.about.faults

    def data_counts(self) -> dict[str, float]:
        """Entries of the data section of a result."""
        return self.about.data_counts()

    def notes(self) -> tuple[str, ...]:
        """List the stops that were found."""
        # Not those of the passes: the passes only answer questions about these coefficients.
        return self.about.notes_on_data()

    def warnings(self, statistics: FitStatistics) -> tuple[str, ...]:
        """Misfit of the least squares and at stops of the navigation about it; what is outside the specification."""
        return self.about.warnings(statistics)

    def contradiction(self, statistics: FitStatistics) -> str:
        """Say that the navigation about the coefficients does not fit at all; empty where it does.

        The squares of a least squares over whole stops and turns are larger than innovations where physics is missing,
        and no measure of absurdity.
        """
        return self.about.contradiction(replace(self.about.statistics(), held_out_rms=statistics.held_out_rms))

    def free_inertial(self, rivals: Sequence[tuple[str, Fit]]) -> tuple[FreeInertialRun, ...]:
        """Navigate without aid on parts that no fit has seen; each is fitted again by navigation."""
        return self.about.free_inertial(rivals)
