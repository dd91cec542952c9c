"""A fit by passes of the navigation filter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sdimu_calibration.core.alignment.coarse_alignment import StartPoint
from sdimu_calibration.core.alignment.prepared import PreparedData
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.estimation.azimuth_check import azimuth_note, azimuth_warning
from sdimu_calibration.core.estimation.free_azimuth import azimuth_is_lost
from sdimu_calibration.core.estimation.free_inertial import Compensated
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.evidence.navigation_evidence import KnownPass, known_pass
from sdimu_calibration.core.filter.filter_pass import PassOutput, PassState, new_output, run_pass
from sdimu_calibration.core.filter.passes import Pass, Solution, motion_about, pass_settings
from sdimu_calibration.core.filter.passes import solve as solve_filter
from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.progress import silent
from sdimu_calibration.core.results import History

_LOST = (
    "the noise that was learned hides the azimuth: gyro biases may be wrong by many of their sigmas; take the "
    "estimator 'second-order', which does without an azimuth"
)
"""Warning of a filter that cannot do without an azimuth."""


@dataclass(frozen=True)
class FilterFit(NavigationFit):
    """A fit by passes of the navigation filter."""

    solution: Solution[Pass]
    estimator = "filter"

    @property
    def body_frame(self) -> str:
        """Frame that the model asks for."""
        return self.model.body_frame

    def reported_values(self, settled: Floats) -> Floats:
        """Bring coefficients into `body_frame`."""
        return body_frame.values_in_frame(self.names, settled[: len(self.names)], self.body_frame)

    def reported_covariance(self, settled: Floats) -> Floats:
        """Bring a covariance of coefficients into `body_frame`."""
        J, p = body_frame.frame_jacobian(self.names, self.body_frame), len(self.names)
        return np.asarray(J @ settled[:p, :p] @ J.T)

    def added_columns(self, count: int) -> Ints:
        """Columns in `evidence` of the last `count` parameters of the model."""
        return np.arange(len(self.names) - count, len(self.names))

    @cached_property
    def known(self) -> KnownPass:
        """Navigation with the coefficients known at their final values."""
        return known_pass(self.prepared, self.setup, self.solution.last)

    def run_kinds(self, kind: Ints) -> PassOutput:
        """Repeat the last pass with other kinds of measurement."""
        state = PassState(*(v.copy() for v in self.solution.last.start))
        output = new_output(len(kind), len(self.estimate), False, len(kind))
        run_pass(
            self.solution.last.data._replace(kind=kind), pass_settings(self.setup, closed_loop=False), state, output
        )
        return output

    def on(self, prepared: PreparedData, C_nb: Floats) -> FilterFit:
        """Fit the same model to a part of the recording."""
        constant = self.setup.sensors.decay_rate == 0.0
        begin = StartPoint(np.ascontiguousarray(C_nb), self.estimate * constant)
        solution = solve_filter(self.setup, prepared, begin, silent)
        return replace(self, setup=solution.setup, prepared=prepared, solution=solution, noise=None)

    def compensated(self, prepared: PreparedData, estimate: Floats, C_start: Floats, end_of_fit: float) -> Compensated:
        """Take the errors out of all cycles, to first order."""
        sensors, cycles = self.setup.sensors, prepared.cycles
        seen = motion_about(prepared, self.setup, C_start, estimate)
        values = sensors.regressors(seen)
        # What fades is known where the fit ended, and fades away from there.
        fading = np.exp(-np.outer(np.abs(seen.t - end_of_fit), sensors.decay_rate[sensors.parameter]))
        errors = sensors.errors(values * fading, estimate) * cycles.dt[:, None]
        clean = replace(cycles, alpha=cycles.alpha - errors[:, :3], upsilon=cycles.upsilon - errors[:, 3:])
        return Compensated(clean, values, sensors.channel, sensors.parameter)

    def history(self) -> History:
        """History of the first pass in the reported frame, at the epochs whose covariance was kept."""
        out = self.solution.first.output
        J = body_frame.frame_jacobian(self.names, self.body_frame)
        rows = np.arange(0, len(self.prepared.epochs), out.stride)
        centring = self.centring[: len(self.names)]
        values = body_frame.values_in_frame(self.names, out.estimate[rows] @ centring.T, self.body_frame)
        J = J @ centring
        return self._rows_of_history(rows, out, values, J @ out.covariance[: len(rows)] @ J.T)

    def notes(self) -> tuple[str, ...]:
        """List the stops that were found; name an azimuth that is not observable."""
        heading = None if azimuth_is_lost(self, self.noise_terms) else azimuth_note(self.solution)
        return (*super().notes(), *([heading] if heading else []))

    def warnings(self, statistics: FitStatistics) -> tuple[str, ...]:
        """Misfit, an azimuth that is too little known, coefficients outside the specification."""
        lost = azimuth_is_lost(self, self.noise_terms)
        azimuth = _LOST if lost else azimuth_warning(self.solution)
        return (*super().warnings(statistics), *([azimuth] if azimuth else []))
