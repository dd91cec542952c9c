"""What every estimator ends with: a fit that answers the same questions, whichever estimator made it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self
from zlib import crc32

import numpy as np

from sdimu_calibration.core.alignment.prepared import TestSetup
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.data.blocks import let_go, pieces
from sdimu_calibration.core.effects.effect import Effect, Timetable
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.effects.references import told_of
from sdimu_calibration.core.effects.selection import of_catalogue
from sdimu_calibration.core.estimation.free_inertial import FreeInertialRun
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.evidence.consistency import Consistency
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.posterior.likely_noise import wander_of
from sdimu_calibration.core.recording import DataFault, Recording
from sdimu_calibration.core.results import NOT_TRUSTED, START_TEMPERATURE, History, Rest, no_history
from sdimu_calibration.core.site_reference import Reference
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.wording import Option

NOT_CONVERGED = Note(
    f"the passes did not converge: the estimate is {NOT_TRUSTED}; check {Option.IMU} and {Option.SITE}",
    Topic.NOT_TRUSTED,
)


def counts_of(
    recording: Recording, lost: Ints, stops: int, conditions: float, contradicted_s: float = 0.0
) -> dict[str, float]:
    """Make the entries of the data section of a result.

    Parameters
    ----------
    lost : ndarray of int, shape (n,)
        Samples missing before each cycle.
    conditions : float
        As `checksum` gives it, of what the recording was fitted under.
    contradicted_s : float
        Time (s) in which the IMU moved although the table said dwell.
    """
    log = recording.temperature
    # Who uses the result needs to know from which temperature its effects count.
    heat = {} if log is None or not len(log.t) else {START_TEMPERATURE: log.origin_degc}
    return heat | {
        "samples": float(len(recording.t)),
        "checksum": checksum(recording.t, recording.omega_ib_b, recording.f_ib_b),
        "lost": float(lost.sum()),
        "rejected": float(recording.rejected),
        "contradicted_s": contradicted_s,
        "duration_s": float(recording.t[-1]),
        "stops": float(stops),
        "conditions": conditions,
    }


def checksum(*arrays: Floats) -> float:
    """Give a number that other samples do not have: the same recording is known again by it."""
    value = 0
    for array in arrays:
        for rows in pieces(len(array)):
            value = crc32(np.ascontiguousarray(array[rows]).tobytes(), value)
        let_go(array)
    return float(value)


def conditions(setup: TestSetup) -> float:
    """Give a number that another site or other noise densities do not have: they change what a likelihood means."""
    site, imu = setup.site, setup.imu
    sigmas = tuple(v for v in (site.latitude_sigma_rad, site.gravity_sigma_m_s2) if v)
    if site.deflection_sigma_rad:
        # Beside what files of before hold: each in a place of its own.
        sigmas = (site.latitude_sigma_rad, site.gravity_sigma_m_s2, site.deflection_sigma_rad)
    place = (site.latitude_rad, site.height_m, setup.gravity, *sigmas)
    return checksum(np.array([*place, imu.gyro_white_noise, imu.accel_white_noise]))


@dataclass(frozen=True)
class Start:
    """Where a fit ended, for a fit of nearly the same model to begin."""

    names: tuple[str, ...]
    """Length p."""
    coefficients: Floats
    """SI, in the frame in which the estimator works, shape (p,)."""
    C_nb: Floats
    """Shape (3, 3) or (k, 3, 3). Initial attitude, or that of every rest; b to n."""
    more: Floats
    """Shape (m,). Whatever else the estimator learned (SI): of a handheld run the Earth's rate in n, then the three
    sigmas of `handheld_fit.LinearisationPoint.extra`; of all others nothing."""

    def coefficients_of(self, names: Sequence[str]) -> Floats:
        """Coefficients of another model, where this one has them.

        Parameters
        ----------
        names : sequence of str, length q

        Returns
        -------
        ndarray, shape (q,)
            SI, in the order of `names`; zero for a coefficient that this fit had not.
        """
        known = dict(zip(self.names, self.coefficients.tolist(), strict=True))
        return np.array([known.get(name, 0.0) for name in names])


@dataclass(frozen=True)
class Fit(ABC):
    """A finished fit of one model to one test."""

    test: PreparedTest
    model: Model
    sensors: ImuModel
    """The sensor model that was asked for, p parameters."""
    reason: str = field(default="", kw_only=True)
    """Why this estimator was taken."""
    doubt: Floats | None = field(default=None, kw_only=True)
    """Shape (q, q). What models that the data leave open add to the covariance of the estimator's coefficients (SI);
    None where nobody asked which they are."""
    moved: Floats | None = field(default=None, kw_only=True)
    """What these models add to the coefficients (SI), shape (q,)."""

    estimator = ""
    """Name of the estimator."""
    converged = True
    """The estimate stood still at the end; a least squares that does not is refused."""
    learns_scatter = False
    """The estimator learns the noise beyond white noise from the residuals, a missing effect with it."""
    azimuth_free = False
    """The azimuth is a convention, and the horizontal Earth rate is estimated in its place."""
    free_inputs_testable = True
    """A constant error of each stop and turn leaves residuals to test it by."""

    @property
    def names(self) -> tuple[str, ...]:
        """Coefficients in the order of `values`."""
        return self.sensors.names

    @property
    @abstractmethod
    def body_frame(self) -> str:
        """Name of the frame of `values`."""

    @property
    @abstractmethod
    def values(self) -> Floats:
        """Coefficients (SI) in `body_frame`, shape (p,)."""

    @property
    @abstractmethod
    def covariance(self) -> Floats:
        """Covariance of `values`, shape (p, p)."""

    @abstractmethod
    def reported_values(self, settled: Floats) -> Floats:
        """Bring coefficients of the estimator into `body_frame`.

        Parameters
        ----------
        settled : ndarray, shape (q,)
            In the order of the coefficients of `evidence` (SI).

        Returns
        -------
        ndarray, shape (p,)
            In the order of `names` (SI).
        """

    @abstractmethod
    def reported_covariance(self, settled: Floats) -> Floats:
        """Bring a covariance of the estimator's coefficients into `body_frame`.

        Parameters
        ----------
        settled : ndarray, shape (q, q)
            Of the coefficients of `evidence` (SI).

        Returns
        -------
        ndarray, shape (p, p)
            Of the coefficients of `names` (SI).
        """

    @abstractmethod
    def statistics(self) -> FitStatistics:
        """``log_likelihood``, ``nis_mean``, ``nis_dof``, ``passes``."""

    @abstractmethod
    def held_out_rms(self) -> float | None:
        """RMS of the normalised prediction errors at stops that a fit has not seen; None with fewer than two stops."""

    @property
    def found(self) -> tuple[Effect, ...]:
        """Effects of the catalogue that came to the model because somebody found them."""
        return of_catalogue(self.model.found)

    @abstractmethod
    def evidence(self, effects: Sequence[Effect] = ()) -> LinearEvidence:
        """Whitened residuals about this fit and the signatures of its parameters and those of `effects`."""

    @abstractmethod
    def added_columns(self, count: int) -> Ints:
        """Columns in `evidence` of the last `count` parameters of the model.

        Returns
        -------
        ndarray of int, shape (count,)
        """

    @abstractmethod
    def consistency(self, evidence: LinearEvidence | None = None) -> Consistency:
        """Check noise and innovations; say where the model fails.

        `evidence` about an extended fit, with nothing added, serves where the fit itself learned its sigmas.
        """

    @abstractmethod
    def data_counts(self) -> dict[str, float]:
        """Entries of the data section of a result."""

    @property
    @abstractmethod
    def timetable(self) -> Timetable:
        """When the recording stood and turned."""

    @property
    @abstractmethod
    def faults(self) -> tuple[DataFault, ...]:
        """What is wrong with the data and no physics of the sensor."""

    @property
    @abstractmethod
    def start(self) -> Start:
        """Where a fit of nearly the same model begins."""

    @abstractmethod
    def free_inertial(self, rivals: Sequence[tuple[str, Fit]]) -> tuple[FreeInertialRun, ...]:
        """Navigate without aid, with this fit and with `rivals` (name, fit), on parts that no fit has seen."""

    @property
    def noise_terms(self) -> tuple[NoiseTerm, ...]:
        """Noise with a memory that was learned."""
        return ()

    @property
    def drift_means(self) -> Mapping[str, float]:
        """Mean of the regressor of each drift of a bias over all dwells (SI); the biases are those in the mean."""
        return {}

    def history(self) -> History:
        """Estimate as the test went on; empty where the estimator knows only the end."""
        return no_history(len(self.names))

    def references(self) -> tuple[Reference, ...]:
        """List latitude and gravity of the site as told, and what the data made of them."""
        return told_of(self.test.site, self.names)

    @property
    def covariance_at_site(self) -> Floats:
        """Covariance of `values` if latitude and gravity were those of the site, shape (p, p)."""
        return self.covariance

    def notes(self) -> tuple[str, ...]:
        """Say what was assumed, learned and not determined, one line each."""
        return ()

    def warnings(self, statistics: FitStatistics) -> tuple[str, ...]:
        """Say what speaks against the estimate, one line each; `statistics` have the held-out error where known."""
        del statistics
        return ()

    def contradiction(self, statistics: FitStatistics) -> str:
        """Say that the model does not fit at all, with these `statistics`; empty where it does."""
        del statistics
        return ""

    def rests(self) -> tuple[Rest, ...]:
        """Rests of a run by hand with their residuals; none where stops are measured."""
        return ()

    def beyond_specification(self) -> list[str]:
        """Name coefficients far outside the IMU's file, one line each, the furthest first."""
        return []

    def contradicted_priors(self) -> list[str]:
        """Name stated priors that contradict the data, one line each, the worst first."""
        return []

    def dwell_means(self, effect: Effect) -> Floats:
        """Mean of the regressors (SI) of a drift of a bias over all dwells; zero where biases are not their means.

        Returns
        -------
        ndarray, shape (terms,)
        """
        return np.zeros(len(effect.terms))

    def with_doubt(self, doubt: Floats | None, moved: Floats | None = None) -> Self:
        """Return the fit with another covariance that open models add.

        Parameters
        ----------
        doubt : ndarray, shape (q, q), or None
            As the attribute `doubt`.
        moved : ndarray, shape (q,), or None
            As the attribute `moved`.
        """
        return replace(self, doubt=doubt, moved=moved)

    @cached_property
    def wander(self) -> Wander:
        """How wandering biases of the sensors would show in the test."""
        return wander_of(self.bare)

    @cached_property
    def bare(self) -> LinearEvidence:
        """Evidence about this fit without candidates."""
        return self.evidence()

    @property
    def has_temperature(self) -> bool:
        """Whether the recording has a temperature."""
        return self.test.recording.temperature is not None

    @cached_property
    def labels(self) -> frozenset[str]:
        """Labels of all parameters that the model, or the estimator for it, has."""
        return frozenset(label for effect in self.sensors.effects for label in effect.labels)
