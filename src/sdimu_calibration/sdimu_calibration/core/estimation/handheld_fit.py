"""A fit of a handheld run: rests and turns by one least squares, nothing navigated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects.accelerometer_frame import FRAME
from sdimu_calibration.core.effects.effect import Effect, Timetable
from sdimu_calibration.core.estimation.fit import Fit, Start, checksum, counts_of
from sdimu_calibration.core.estimation.free_inertial import FreeInertialRun
from sdimu_calibration.core.evidence.consistency import NO_NOISE, Consistency
from sdimu_calibration.core.evidence.handheld_evidence import HandheldEvidence, handheld_evidence, places, timetable
from sdimu_calibration.core.evidence.information import conditioned
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.handheld.handheld import PreparedRun, handheld_notes
from sdimu_calibration.core.handheld.handheld_faults import data_faults
from sdimu_calibration.core.handheld.handheld_fit import FitPriors, HandheldSolution, rests_with_residuals
from sdimu_calibration.core.handheld.run_rows import RunRows, run_rows
from sdimu_calibration.core.recording import DataError, DataFault
from sdimu_calibration.core.results import Rest
from sdimu_calibration.core.site_reference import Reference, found


@dataclass(frozen=True)
class HandheldFit(Fit):
    """A fit of a handheld run."""

    ready: PreparedRun
    priors: FitPriors
    solution: HandheldSolution

    estimator = "handheld"
    learns_scatter = True
    free_inputs_testable = False

    @property
    def body_frame(self) -> str:
        """Frame of the accelerometers, where the model lets it turn."""
        return FRAME if len(self._kept) < len(self.names) else self.model.body_frame

    @property
    def _kept(self) -> Ints:
        """Coefficients that are fitted, shape (q,); what serves stands behind them in `priors.kept`."""
        kept = self.priors.kept
        return kept[: len(kept) - self.priors.model.serving]

    @property
    def values(self) -> Floats:
        """Coefficients (SI), shape (p,)."""
        best = self.solution.point.coefficients[: len(self.names)]
        return best if self.moved is None else best + self.reported_values(self.moved)

    @property
    def covariance(self) -> Floats:
        """Covariance of `values`, shape (p, p); zero for what the frame pins."""
        C = self._own(self.solution.covariance)
        return self.reported_covariance(C if self.doubt is None else C + self.doubt)

    def _own(self, covariance: Floats) -> Floats:
        """Take the coefficients' part of a covariance of all that is fitted; shape (q, q)."""
        q = len(self._kept)
        return covariance[:q, :q]

    @property
    def covariance_at_site(self) -> Floats:
        """Covariance of `values` if gravity were that of the site, shape (p, p)."""
        C, q = self.solution.covariance, len(self._kept)
        if q == len(C):
            return self.covariance
        return self.reported_covariance(self._own(conditioned(C, np.arange(q, len(C)))))

    def references(self) -> tuple[Reference, ...]:
        """List gravity and latitude of the site as told, and what the data made of gravity."""
        p, best = len(self.names), self.solution.point.coefficients
        sigma = np.sqrt(np.diag(self.solution.covariance)[len(self._kept) :])
        return found(super().references(), self.priors.model.names[p:], best[p:], sigma)

    def reported_values(self, settled: Floats) -> Floats:
        """Put the coefficients that are fitted among all; zero for what is pinned."""
        out = np.zeros(len(self.names))
        out[self._kept] = settled
        return out

    def reported_covariance(self, settled: Floats) -> Floats:
        """Put a covariance of what is fitted among all; zero for what is pinned."""
        out = np.zeros((len(self.names), len(self.names)))
        out[np.ix_(self._kept, self._kept)] = settled
        return out

    @property
    def scatter(self) -> Floats:
        """What is left beyond white noise: force (m/s^2), rate (rad/s), turn (share of the angle), shape (3,)."""
        return self.solution.point.extra

    @property
    def start(self) -> Start:
        """Where a fit of nearly the same model begins."""
        point = self.solution.point
        return Start(
            self.priors.model.names, point.coefficients, point.C_nb, np.concatenate([point.earth, point.extra])
        )

    def statistics(self) -> FitStatistics:
        """Marginal log-likelihood, mean squared residual over its redundancy, steps."""
        return self.solution.statistics

    def held_out_rms(self) -> float | None:
        """RMS of the normalised errors of the forces at each rest, predicted from everything else."""
        return self.solution.ahead.rms

    def evidence(self, effects: Sequence[Effect] = ()) -> HandheldEvidence:
        """Residuals of rests and turns about this fit, and the signatures of its parameters and those of `effects`."""
        point = self.solution.point
        return handheld_evidence(self.ready.run, self.priors, point, effects, self.test.imu, self.found)

    def rows(self) -> RunRows:
        """Equations about this fit, for recordings that learn their scatter together."""
        return run_rows(self.ready.run, self.priors, self.solution.point)

    def added_columns(self, count: int) -> Ints:
        """Columns in `evidence` of the last `count` parameters of the model."""
        q = len(self._kept)
        return np.arange(q - count, q)

    def consistency(self, evidence: LinearEvidence | None = None) -> Consistency:
        """Say where the model fails: every residual over its own sigma; the noise was learned.

        With `evidence` of an extended fit the sigmas are those that the extended fit learned.
        """
        about = evidence if isinstance(evidence, HandheldEvidence) else self.evidence()
        return Consistency(
            self.statistics().nis_mean,
            1.0,
            float("nan"),
            1.0,
            NO_NOISE,
            NO_NOISE,
            places(about, np.empty(0, dtype=np.int64)),
        )

    @cached_property
    def timetable(self) -> Timetable:
        """When the run rested and turned."""
        return timetable(self.ready.run)

    @cached_property
    def faults(self) -> tuple[DataFault, ...]:
        """What no hand does and no sensor should."""
        return (*self.ready.impossible, *data_faults(self.ready.recording, self.ready.run, self.solution))

    def data_counts(self) -> dict[str, float]:
        """Entries of the data section of a result."""
        run = self.ready.run
        under = checksum(np.array([self.priors.gravity, *self.priors.earth_mean]))
        return counts_of(self.ready.recording, run.cycles.lost, len(run.t), under)

    def notes(self) -> tuple[str, ...]:
        """Say what was assumed, learned and not determined."""
        places = (r.note for r in self.references() if r.name in self.priors.model.names)
        told = handheld_notes(self.ready.run, self.priors, self.solution, self.test.site)
        return (told[0], *self.ready.notes, *told[1:], *places)

    def rests(self) -> tuple[Rest, ...]:
        """Rests with their residuals."""
        return rests_with_residuals(self.ready.run, self.priors, self.solution)

    def free_inertial(self, rivals: Sequence[tuple[str, Fit]]) -> tuple[FreeInertialRun, ...]:
        """Refuse: a hand moves the IMU, so that its velocity and place are unknown."""
        del rivals
        raise DataError("a handheld run has no known velocity and place to compare a free navigation with")
