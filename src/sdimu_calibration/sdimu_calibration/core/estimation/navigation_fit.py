"""The fit by navigation: what it says of coefficients, drifts, noise and prediction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from sdimu_calibration.core.alignment.alignment import UNKNOWN_AZIMUTH, Alignment
from sdimu_calibration.core.alignment.coarse_alignment import StartPoint
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup, first_attitude, stops_line
from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.data.imu_class import understated_noise
from sdimu_calibration.core.effects import bias, earth_rate
from sdimu_calibration.core.effects.accelerometer_frame import AccelerometerFrameModel
from sdimu_calibration.core.effects.effect import Effect, Timetable
from sdimu_calibration.core.estimation.azimuth_words import NO_AZIMUTH, azimuth_note, azimuth_warning
from sdimu_calibration.core.estimation.fit import NOT_CONVERGED, Fit, Start, conditions, counts_of
from sdimu_calibration.core.estimation.fit_words import MISFIT, in_noise_in_words, said, stated_priors
from sdimu_calibration.core.estimation.free_inertial import AS_GIVEN, FreeInertialRun, free_inertial_runs
from sdimu_calibration.core.estimation.noise_estimate import NoiseEstimate, not_of_sensors
from sdimu_calibration.core.estimation.prior_check import contradicted, outside
from sdimu_calibration.core.estimation.site_rows import at_site, site_rows
from sdimu_calibration.core.evidence.consistency import Consistency, check
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.navigation_evidence import (
    KnownPass,
    NavigationEvidence,
    known_pass,
    navigation_evidence,
    timetable,
)
from sdimu_calibration.core.evidence.stop_misfit import stop_misfit
from sdimu_calibration.core.filter.bend import Bend, bend
from sdimu_calibration.core.filter.filter_pass import NAV, PassState, new_output, run_pass
from sdimu_calibration.core.filter.pass_loop import Pass
from sdimu_calibration.core.filter.pass_setup import firm_setup, pass_settings
from sdimu_calibration.core.filter.passes import one_pass
from sdimu_calibration.core.filter.solution import solve as solve_passes
from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.measurement_kind import ALL, HELD_ALL, HELD_SENSORS, SENSORS
from sdimu_calibration.core.noise_term import NoiseTerm, may_be_an_effect, unexplained
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.progress import silent
from sdimu_calibration.core.recording import DataFault
from sdimu_calibration.core.results import History
from sdimu_calibration.core.side_by_side import side_by_side
from sdimu_calibration.core.site_reference import Reference, found
from sdimu_calibration.core.wording import Option, Work

FILTER = "filter"
"""Name of the estimator."""
HELD_OUT_FOLDS = 3
"""Number of interleaved groups of stops, each held out once: two thirds of the stops are then in every fit."""
_ABSURD = 1e3
"""NIS per degree of freedom (1) from which there is no fit at all: units, axes or site are wrong."""
_NOISY = 4.0
"""NIS per degree of freedom (1) from which the rests are looked at: noise of twice the stated size is possible."""
_OF_THE_PASSES = ("bend", "known", "bare", "timetable", "wander", "centring", "_drifts", "_share_of_rest", "_held_out")
"""Cached properties that neither noise nor doubt changes."""
NO_FIELD = (
    "the site states no magnetic field: that of mid-northern latitudes is assumed; state magnetic_field_nt (north, "
    "east, down) in the site's file, or what magnetism takes is wrong"
)
"""Note on an effect of magnetism without a stated field."""


@dataclass(frozen=True)
class NavigationFit(Fit):
    """A fit by passes of the navigation filter about exactly corrected samples."""

    setup: TestSetup
    """With the sensor model of the estimator, q coefficients."""
    prepared: PreparedData
    alignment: Alignment
    last: Pass
    """About which the estimate is linear."""
    passes: int
    """How many there were."""
    frame_model: AccelerometerFrameModel
    converged: bool = True
    noise: NoiseEstimate | None = field(default=None, kw_only=True)
    """Noise with a memory that was learned; None where white noise was taken."""
    estimator = FILTER

    @property
    def azimuth_free(self) -> bool:  # type: ignore[override]
        """Whether the horizontal Earth rate is estimated in the place of the azimuth."""
        return earth_rate.EAST in self.setup.sensors.names

    @property
    def body_frame(self) -> str:
        """Frame that the model asks for."""
        return self.model.body_frame

    def reported_values(self, settled: Floats) -> Floats:
        """Read the coefficients asked for out of those of the estimator."""
        return self.frame_model.values(settled)

    def reported_covariance(self, settled: Floats) -> Floats:
        """Read a covariance out of that of the estimator."""
        return self.frame_model.covariance(settled, self.settled)

    def added_columns(self, count: int) -> Ints:
        """Columns in `evidence`, which is that of the inner model, of the last `count` parameters of the model."""
        return self.frame_model.place[len(self.names) - count :]

    @property
    def values(self) -> Floats:
        """Coefficients (SI) in `body_frame`, shape (p,)."""
        return self.reported_values(self.settled)

    @cached_property
    def covariance(self) -> Floats:
        """Covariance of `values`, shape (p, p)."""
        return self.reported_covariance(self.settled_covariance)

    @cached_property
    def known(self) -> KnownPass:
        """Navigation with the coefficients known at their final values."""
        return known_pass(self.prepared, self.setup, self.alignment, self.last)

    def on(self, prepared: PreparedData, C_nb: Floats) -> NavigationFit:
        """Fit the same model to a part of the recording.

        Parameters
        ----------
        C_nb : ndarray, shape (3, 3)
            Attitude at its start, b to n (dimensionless).
        """
        begin = StartPoint(np.ascontiguousarray(C_nb), self.estimate)
        alignment = first_attitude(prepared.epochs, prepared.phases, self.setup)
        alignment = alignment.with_azimuth_of(C_nb) if self.azimuth_free else alignment
        found = solve_passes(self.setup, prepared, alignment, begin, silent)
        own = replace(self, setup=found.setup, last=found.last, passes=found.passes, converged=found.converged)
        return replace(own, prepared=prepared, alignment=alignment, noise=None)

    @property
    def estimate(self) -> Floats:
        """Coefficients of the estimator (SI) about which everything is linear, shape (q,)."""
        return self.last.estimate

    @property
    def settled(self) -> Floats:
        """Coefficients of the estimator (SI) in the noise learned, biases as means over the dwells, shape (q,).

        What is reported follows from these.
        """
        best = self.estimate if self.noise is None else self.estimate + self.noise.deviation
        best = self.centring @ (best + self.bend.mean)
        return best if self.moved is None else best + self.moved

    @property
    def settled_covariance(self) -> Floats:
        """Covariance of `settled`, shape (q, q)."""
        T = self.centring
        C = self.estimate_covariance if self.noise is None else self.noise.covariance
        C = C + self.bend.covariance
        return np.asarray(T @ (C if self.doubt is None else C + self.doubt) @ T.T)

    @cached_property
    def bend(self) -> Bend:
        """What the squares of coefficients that only priors decide add to mean and covariance."""

        def about(reference: Floats) -> tuple[Floats, Floats]:
            at = one_pass(self.prepared, firm, self.alignment, last.smoothed_start, reference)
            return at.estimate, at.covariance

        last, firm = self.last, firm_setup(self.setup)
        return bend(self.setup.sensors, last.estimate, last.covariance, about)

    @property
    def covariance_at_site(self) -> Floats:
        """Covariance of `values` if latitude and gravity were those of the site, shape (p, p)."""
        return self.reported_covariance(at_site(self.setup.sensors, self.settled_covariance))

    def references(self) -> tuple[Reference, ...]:
        """List latitude and gravity of the site as told, and what the data made of them."""
        names, rows = self.setup.sensors.names, site_rows(self.setup.sensors)
        sigma = np.sqrt(np.diag(self.settled_covariance)[rows])
        return found(super().references(), [names[k] for k in rows], self.settled[rows], sigma)

    @cached_property
    def centring(self) -> Floats:
        """Map from the coefficients of the equations to those with biases as means over all dwells.

        Beside a ramp the bias of the equations is the one at the start, beside a warm-up the one at the end. A test may
        be unable to tell ramp from warm-up, and the bias then differs by many sigmas between them. Its mean over the
        dwells is the same, whatever drifts.

        Returns
        -------
        ndarray, shape (q, q)
            SI; the identity, and in the row of each bias the mean regressor of its drifts.
        """
        names = self.setup.sensors.names
        T = np.eye(len(names))
        for name, (channel, mean) in self._drifts.items():
            if bias.NAMES[channel] in names:
                T[names.index(bias.NAMES[channel]), names.index(name)] = mean
        return T

    @cached_property
    def _drifts(self) -> dict[str, tuple[int, float]]:
        """Channel of each drift of a bias, and the mean of its regressor over all dwells (SI)."""
        out = {}
        for effect in (effect for effect in self.setup.sensors.effects if effect.bias_drift):
            for mean, term in zip(self.dwell_means(effect).tolist(), effect.terms, strict=True):
                out[effect.parameters[term.parameter].name] = (term.channel, mean)
        return out

    @cached_property
    def _share_of_rest(self) -> Floats:
        """Share of each cycle in all dwells, shape (n,)."""
        epochs, dwell, seen = self.prepared.epochs, self.prepared.phases.dwell, self.known.seen
        rest = np.zeros(len(seen.t))
        for a, b in zip(epochs.first[dwell], epochs.last[dwell], strict=True):
            rest[a:b] = seen.dt[a:b]
        return np.asarray(rest / rest.sum())

    def dwell_means(self, effect: Effect) -> Floats:
        """Mean of the regressors of a drift of a bias over all dwells."""
        return np.asarray(self._share_of_rest @ effect.regressors(self.known.seen))

    def with_doubt(self, doubt: Floats | None, moved: Floats | None = None) -> Self:
        """Return the fit with another covariance that open models add; coefficients behind those of `doubt` serve."""
        more = len(self.setup.sensors.names)
        doubt = None if doubt is None else np.pad(doubt, (0, more - len(doubt)))
        moved = None if moved is None else np.pad(moved, (0, more - len(moved)))
        return self._by_the_same_passes(doubt=doubt, moved=moved)

    def with_noise(self, noise: NoiseEstimate | None) -> Self:
        """Return the fit in other noise; None is white noise."""
        return self._by_the_same_passes(noise=noise)

    def _by_the_same_passes(self, **other: Any) -> Self:
        """Return the fit with other fields that the passes do not hang on; what is known of them by now is kept."""
        fit = replace(self, **other)
        vars(fit).update({name: vars(self)[name] for name in _OF_THE_PASSES if name in vars(self)})
        return fit

    @property
    def noise_terms(self) -> tuple[NoiseTerm, ...]:
        """Noise with a memory that was learned."""
        return () if self.noise is None else self.noise.terms

    @property
    def drift_means(self) -> dict[str, float]:
        """Mean of the regressor of each drift of a bias over all dwells (SI), by the name of the coefficient."""
        return {name: mean for name, (_, mean) in self._drifts.items() if name in self.names}

    @property
    def estimate_covariance(self) -> Floats:
        """Covariance of `estimate`, shape (q, q)."""
        return self.last.covariance

    @property
    def start(self) -> Start:
        """Where a fit of nearly the same model begins."""
        return Start(self.setup.sensors.names, self.estimate, self.last.smoothed_start, np.empty(0))

    def statistics(self) -> FitStatistics:
        """Log-likelihood and mean normalised innovation squared of the last pass, and in the noise that was learned.

        NIS and held-out error are those in the noise of the IMU's file, whatever was learned: so they compare between
        models.
        """
        output = self.last.output
        dof = 3 * int(np.isfinite(output.nis).sum())
        nis = float(np.nansum(output.nis) / max(dof, 1))
        white = FitStatistics(float(output.log_likelihood.sum()), nis, float(dof), float(self.passes))
        if self.noise is None:
            return white
        return replace(
            white,
            log_likelihood=white.log_likelihood + self.noise.gain,
            nis_in_noise=self.noise.nis,
            held_out_in_noise=self.noise.held_out_rms,
        )

    def held_out_rms(self) -> float | None:
        """RMS of normalised prediction errors at stops that the fit has not seen.

        The first stop stays in every fit (it gives the attitude); the others are left out in turn, in
        `HELD_OUT_FOLDS` interleaved groups. None when there are fewer than two stops.
        """
        return self._held_out

    @cached_property
    def _held_out(self) -> float | None:
        stops = np.unique(self.prepared.phases.stop[self.prepared.kind > 0])
        folds = [np.isin(self.prepared.phases.stop, stops[1:][fold::HELD_OUT_FOLDS]) for fold in range(HELD_OUT_FOLDS)]
        left_out = [fold & (self.prepared.kind > 0) for fold in folds]
        errors = side_by_side(lambda out: self.predict(out)[out], [out for out in left_out if out.any()])
        count = sum(int(np.isfinite(white).sum()) for white in errors)
        return float(np.sqrt(sum(float(np.nansum(white**2)) for white in errors) / count)) if count else None

    def predict(self, out: Bools) -> Floats:
        """Repeat the last pass with some epochs predicted but not taken.

        Parameters
        ----------
        out : ndarray of bool, shape (e,)
            Epochs that are not taken.

        Returns
        -------
        ndarray, shape (e, 12)
            Whitened innovations of all epochs (dimensionless); NaN where nothing was measured.
        """
        kind = self.prepared.kind.copy()
        kind[out & (kind == SENSORS)] = HELD_SENSORS
        kind[out & (kind == ALL)] = HELD_ALL
        last = self.last
        state = PassState(*(v.copy() for v in last.start))
        output = new_output(len(kind), len(self.estimate), False, len(kind))
        run_pass(last.data._replace(kind=kind), pass_settings(firm_setup(self.setup)), state, output)
        return output.normalised

    def evidence(self, effects: Sequence[Effect] = ()) -> NavigationEvidence:
        """Whitened innovations about this fit and the signatures of its parameters and those of `effects`."""
        return navigation_evidence(self.prepared, self.setup, self.known, self.estimate, effects, self.found)

    def consistency(self, evidence: LinearEvidence | None = None) -> Consistency:
        """Check noise and innovations; say where the model fails."""
        del evidence
        imu, shaken = self.setup.imu, self.prepared.shaking
        if shaken is not None:
            scatter = np.hypot(imu.gyro_white_noise, shaken * np.sqrt(self.setup.epoch_s))
            imu = replace(imu, gyro_white_noise=float(scatter))
        return check(self.last.output, self.prepared, imu)

    @cached_property
    def labels(self) -> frozenset[str]:
        """Labels of all parameters that the model, or the estimator for it, has."""
        return super().labels | {label for effect in self.setup.sensors.effects for label in effect.labels}

    @cached_property
    def timetable(self) -> Timetable:
        """When the recording stood and turned."""
        return timetable(self.prepared)

    @property
    def faults(self) -> tuple[DataFault, ...]:
        """What the preparation found wrong with the data."""
        return self.prepared.faults

    def data_counts(self) -> dict[str, float]:
        """Entries of the data section of a result."""
        phases, epochs = self.prepared.phases, self.prepared.epochs
        stops = len(np.unique(phases.stop[phases.used]))
        against = float((epochs.end - epochs.start)[phases.contradicted].sum())
        return counts_of(self.test.recording, self.prepared.cycles.lost, stops, conditions(self.setup), against)

    def notes(self) -> tuple[str, ...]:
        """List the stops that were found, and those held out; name an azimuth that is not observable."""
        return said(*self.notes_on_data(), NO_AZIMUTH if self.azimuth_free else azimuth_note(self.setup, self.last))

    def notes_on_data(self) -> tuple[str, ...]:
        """List the stops that were found, and those held out."""
        held = ", ".join(map(str, self.test.held_out))
        spans = ", ".join(f"{begin:g}-{end:g}" for begin, end in self.test.excluded)
        magnetic = any(effect.needs == "magnetic" for effect in self.sensors.effects)
        return said(
            *stops_line(self.test.recording, self.prepared),
            held and f"stops held out of the fit: {held}",
            spans and f"times held out of the fit (s): {spans}",
            *stated_priors(self.model),
            *(r.note for r in self.references() if r.sigma),
            None if self.noise is None else self.noise.note,
            NO_FIELD if magnetic and self.setup.site.magnetic_field_t is None else "",
        )

    def contradiction(self, statistics: FitStatistics) -> str:
        """Say that there is no fit at all; empty where there is one."""
        nis = statistics.nis_mean
        if nis <= _ABSURD:
            return ""
        return (
            f"the recording contradicts the model: squared innovations are {nis:.3g} times what the noise explains"
            f"{self._lost_in_words()}; check {Option.IMU}, {Option.SITE}, units and axes{self._noise_in_words(nis)}"
        )

    def _noise_in_words(self, nis: float) -> str:
        """Name the noise of the IMU's file where it is the likely cause of a misfit; the rests are looked at."""
        test = self.test
        told = understated_noise(test.recording, test.imu, test.known_imus) if nis > _NOISY else ""
        return told and f"; {told}"

    def _lost_in_words(self) -> str:
        lost = int(self.prepared.cycles.lost.sum())
        return f"; {counted(lost, 'sample is', 'samples are')} missing by their stamps" if lost else ""

    def warnings(self, statistics: FitStatistics) -> tuple[str, ...]:
        """Misfit as a whole and of single stops, and coefficients outside the specification."""
        white = "" if self.noise is None else " in white noise"
        misfit: str | None = None
        judged = statistics.judged(may_be_an_effect(self.noise_terms))
        if any(figure is not None and figure > MISFIT for figure in judged):
            nis, held_out = statistics.nis_mean, statistics.held_out_rms
            text = f"NIS {nis:.3f}" + ("" if held_out is None else f", held-out error {held_out:.3f}")
            told = f"the model{white} does not fit ({text}; 1 is right){in_noise_in_words(statistics)}"
            told += self._lost_in_words() + self._noise_in_words(nis)
            misfit = Note(told, Topic.MISFIT, f"; run: {Work.DIAGNOSE}")
        elif odd := unexplained(self.noise_terms, [fault.kind for fault in self.faults], self.test.recording.notes):
            misfit = not_of_sensors(odd)
        return said(
            None if self.converged else NOT_CONVERGED,
            misfit,
            # Noise that was learned explains what a stop leaves in white noise.
            None if self.noise else stop_misfit(self.last.output.normalised, self.prepared),
            *self.contradicted_priors()[:1],
            *self.beyond_specification()[:1],
            None if self.azimuth_free else azimuth_warning(self.setup, self.prepared, self.last),
        )

    def beyond_specification(self) -> list[str]:
        """Name coefficients far outside the IMU's file, one line each, the furthest first."""
        return outside(self.setup.sensors, self.settled)

    def contradicted_priors(self) -> list[str]:
        """Name stated priors that contradict the data, one line each, the worst first."""
        return contradicted(self.setup.sensors, self.settled, self.settled_covariance)

    def free_inertial(self, rivals: Sequence[tuple[str, Fit]]) -> tuple[FreeInertialRun, ...]:
        """Navigate without aid, with this fit and with `rivals` (name, fit), on parts that no fit has seen."""
        navigating = ((name, fit) for name, fit in rivals if isinstance(fit, NavigationFit))
        return free_inertial_runs([(AS_GIVEN, self), *navigating])

    def history(self) -> History:
        """History of the last pass, at the epochs whose covariance was kept."""
        last, phases = self.last, self.prepared.phases
        out, T = last.output, self.centring
        rows = np.arange(0, len(self.prepared.epochs), out.stride)
        values = self.frame_model.values((last.reference + out.estimate[rows]) @ T.T)
        covariance = self.frame_model.covariance(T @ out.covariance @ T.T, self.settled)
        attitude = out.sigma[rows, 6:NAV]
        if self.azimuth_free:
            at = self.setup.sensors.names.index(earth_rate.EAST)
            open_rad = np.minimum(out.sigma[rows, NAV + at] / self.setup.sensors.prior[at], 1.0) * UNKNOWN_AZIMUTH
            attitude = np.column_stack([attitude[:, :2], np.hypot(attitude[:, 2], open_rad)])
        return History(
            self.prepared.epochs.end[rows],
            values,
            np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)),
            attitude,
            phases.stop[rows],
            phases.dwell[rows],
            phases.used[rows],
            out.nis[rows],
        )
