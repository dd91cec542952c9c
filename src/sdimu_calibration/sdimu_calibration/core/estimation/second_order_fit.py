"""A fit by second-order passes: samples corrected exactly, in the frame of the accelerometers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sdimu_calibration.core.alignment.alignment import UNKNOWN_AZIMUTH
from sdimu_calibration.core.alignment.coarse_alignment import StartPoint
from sdimu_calibration.core.alignment.prepared import PreparedData, first_attitude
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects import earth_rate
from sdimu_calibration.core.effects.accelerometer_frame import FRAME, AccelerometerFrameModel
from sdimu_calibration.core.estimation.free_inertial import Compensated
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.evidence.navigation_evidence import KnownPass, known_second_order_pass
from sdimu_calibration.core.filter.filter_pass import NAV, PassOutput
from sdimu_calibration.core.filter.passes import Solution, motion_about
from sdimu_calibration.core.navigation.correct_cycles import correct_cycles, spread
from sdimu_calibration.core.progress import silent
from sdimu_calibration.core.results import History
from sdimu_calibration.core.second_order.bend import Bend, bend
from sdimu_calibration.core.second_order.second_order_passes import (
    SecondOrderPass,
    firm_setup,
    run_stops,
    second_order_pass,
    solve_second_order,
)

NO_AZIMUTH = (
    "the noise that was learned hides the azimuth: the horizontal Earth rate was estimated in its place; the "
    "coefficients do not need the azimuth, headings of this test mean nothing"
)
"""Note on a fit that does without the azimuth."""


@dataclass(frozen=True)
class SecondOrderFit(NavigationFit):
    """A fit by passes about exactly corrected samples, in the frame of the accelerometers."""

    solution: Solution[SecondOrderPass]
    frame_model: AccelerometerFrameModel
    estimator = "second-order"

    @property
    def azimuth_free(self) -> bool:  # type: ignore[override]
        """Whether the horizontal Earth rate is estimated in the place of the azimuth."""
        return earth_rate.EAST in self.setup.sensors.names

    @property
    def body_frame(self) -> str:
        """Frame of the accelerometers."""
        return FRAME

    def reported_values(self, settled: Floats) -> Floats:
        """Read the coefficients asked for out of those of the estimator."""
        return self.frame_model.values(settled)

    def reported_covariance(self, settled: Floats) -> Floats:
        """Read a covariance out of that of the estimator."""
        return self.frame_model.covariance(settled, self.settled)

    def added_columns(self, count: int) -> Ints:
        """Columns in `evidence`, which is that of the inner model, of the last `count` parameters of the model."""
        return self.frame_model.place[len(self.names) - count :]

    @cached_property
    def bend(self) -> Bend:  # type: ignore[override]
        """What the squares of coefficients that only priors decide add to mean and covariance."""

        def about(reference: Floats) -> tuple[Floats, Floats]:
            at = second_order_pass(self.prepared, firm, self.alignment, last.smoothed_start, reference)
            return at.estimate, at.covariance

        last, firm = self.solution.last, firm_setup(self.setup)
        return bend(self.setup.sensors, last.estimate, last.covariance, about)

    @cached_property
    def known(self) -> KnownPass:
        """Navigation with the coefficients known at their final values."""
        return known_second_order_pass(self.prepared, self.setup, self.alignment, self.solution.last)

    def run_kinds(self, kind: Ints) -> PassOutput:
        """Repeat the last pass with other kinds of measurement."""
        last = self.solution.last
        data = last.data._replace(kind=kind)
        return run_stops(data, firm_setup(self.setup), last.start, self.prepared, last.where, last.C_stop)[1]

    def on(self, prepared: PreparedData, C_nb: Floats) -> SecondOrderFit:
        """Fit the same model to a part of the recording."""
        begin = StartPoint(np.ascontiguousarray(C_nb), self.estimate)
        alignment = first_attitude(prepared.epochs, prepared.phases, self.setup)
        alignment = alignment.with_azimuth_of(C_nb) if self.azimuth_free else alignment
        solution = solve_second_order(self.setup, prepared, alignment, begin, silent)
        return replace(
            self, setup=solution.setup, prepared=prepared, alignment=alignment, solution=solution, noise=None
        )

    def compensated(self, prepared: PreparedData, estimate: Floats, C_start: Floats, end_of_fit: float) -> Compensated:
        """Take the errors out of all cycles, exactly; all coefficients are constants, wherever the fit ended."""
        del end_of_fit
        sensors, near = self.setup.sensors, motion_about(prepared, self.setup, C_start, estimate)
        clean = correct_cycles(prepared.cycles, near, sensors, estimate)
        terms = spread(sensors.regressors(clean.seen), sensors.channel, sensors.parameter, clean.weight)
        return Compensated(clean.cycles, *terms)

    def history(self) -> History:
        """History of the last pass, at the epochs whose covariance was kept."""
        last = self.solution.last
        rows, out = last.rows, last.output
        T = self.centring
        values = self.frame_model.values((last.reference + out.estimate[rows]) @ T.T)
        covariance = self.frame_model.covariance(T @ out.covariance @ T.T, self.settled)
        history = self._rows_of_history(rows, out, values, covariance)
        if not self.azimuth_free:
            return history
        names, prior = self.setup.sensors.names, self.setup.sensors.prior
        at = names.index(earth_rate.EAST)
        open_rad = np.minimum(out.sigma[rows, NAV + at] / prior[at], 1.0) * UNKNOWN_AZIMUTH
        attitude = np.column_stack([history.attitude_sigma[:, :2], np.hypot(history.attitude_sigma[:, 2], open_rad)])
        return replace(history, attitude_sigma=attitude)

    def notes(self) -> tuple[str, ...]:
        """List the stops that were found; say how many passes were made."""
        text = f"second order: {self.passes} passes about exactly corrected samples, in the accelerometers' frame"
        hidden = (NO_AZIMUTH,) if self.azimuth_free else ()
        return (*super().notes(), text, *hidden)
