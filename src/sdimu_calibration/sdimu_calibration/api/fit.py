"""A fit as scripts and notebooks see it: coefficients with units, residuals, refits, files."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from sdimu_calibration.api.fitted import Fitted
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compensation import Compensated, compensate_recording, compensator
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import extend
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.report.page import write_report
from sdimu_calibration.storage.bags.file_room import results_folder
from sdimu_calibration.storage.files.effect_file import find_effects, new_parts
from sdimu_calibration.storage.files.result_file import write_result
from sdimu_calibration.storage.files.whole_file import written_together
from sdimu_calibration.storage.trace import traced


class CalibrationFit(Fitted):
    """A model fitted to a test.

    Indexed by the name of a coefficient; its ``repr`` is the table of coefficients, in a notebook as HTML.

    Attributes
    ----------
    core : Fit
        The fit of the estimator, with its matrices.
    """

    def __init__(self, core: Fit) -> None:
        self.core = core

    @property
    def test(self) -> PreparedTest:
        """The test that was fitted."""
        return self.core.test

    @cached_property
    def result(self) -> Calibration:
        """Coefficients, covariance, fit figures, notes and history."""
        return outcome(self.core)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coefficients, length p."""
        return self.core.names

    @property
    def values(self) -> Floats:
        """Coefficients (SI) in the reported body frame, shape (p,)."""
        return self.core.values

    @property
    def covariance(self) -> Floats:
        """Covariance of `values`, shape (p, p)."""
        return self.core.covariance

    @cached_property
    def residuals(self) -> Floats:
        """Whitened residuals with every coefficient at its estimate, shape (N,): standard normal when all is right."""
        evidence = self.core.bare
        estimate, _ = evidence.information.estimate(evidence.model, evidence.weight)
        return np.asarray(evidence.e - evidence.W @ estimate)

    @property
    def _heading(self) -> str:
        return f"{self.core.estimator}, body frame: {self.result.body_frame}"

    def add(self, effect: str | Effect | Candidate) -> CalibrationFit:
        """Fit again with an effect more, beginning where this fit ended.

        Parameters
        ----------
        effect : str, Effect or Candidate
            As `--add` takes it, or what a diagnosis found.
        """
        if not isinstance(effect, str | Effect | Candidate):
            raise DataError(f"add(effect=...): expected one effect, as --add takes it or as found, not {effect!r:.60}")
        return CalibrationFit(extend(self.core, _effects(effect, self.core), warm=True))

    def compensate(self, test: PreparedTest) -> Compensated:
        """Take the sensor errors out of the samples of a test.

        Returns
        -------
        Compensated
            Rates (rad/s) and specific forces (m/s^2), shape (n, 3) each, with covariances.
        """
        recording = test.recording
        own = [e for e in self.core.sensors.effects if not isinstance(e, str)]
        using = compensator(
            self.result,
            test.imu,
            own=own,
            has_temperature=recording.temperature is not None,
            same_start=recording.start_ns == self.test.recording.start_ns,
        )
        return compensate_recording(using, recording)

    def save(self, folder: str | Path) -> Path:
        """Write result.json and report.html into a folder, as `sdimu calibrate` does."""
        folder = results_folder(folder)
        with written_together(folder) as part:
            write_result(part / "result.json", self.result)
            write_report(part / "report.html", self.result, title="Calibration", fit=self.core, trace=traced())
        return folder


def _effects(effect: str | Effect | Candidate, fit: Fit) -> Sequence[Effect]:
    """Effects that are meant, without what the model has."""
    if isinstance(effect, str):
        return new_parts(find_effects(effect), fit.sensors.effects, effect)
    meant = effect if isinstance(effect, Effect) else effect.effect
    return new_parts((meant,), fit.sensors.effects, meant.name)
