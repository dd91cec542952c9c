"""A fit by passes of the navigation filter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.coarse_alignment import StartPoint
from sdimu_calibration.core.alignment.prepared import PreparedData
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.effects.bias import GYRO_BIAS
from sdimu_calibration.core.estimation.free_azimuth import azimuth_is_lost
from sdimu_calibration.core.estimation.free_inertial import Compensated
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.evidence.navigation_evidence import KnownPass, known_pass
from sdimu_calibration.core.filter.filter_pass import NAV, PassOutput, PassState, new_output, run_pass
from sdimu_calibration.core.filter.passes import Pass, Solution, motion_about, pass_settings
from sdimu_calibration.core.filter.passes import solve as solve_filter
from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.progress import silent
from sdimu_calibration.core.results import NOT_TRUSTED, History

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


_SIGMAS = 3.0
"""Error of the azimuth (sigma) that is reckoned with: chance ends there."""
_LEAST_ATTITUDES = 3
"""Number of attitudes from which azimuth and gyro biases come apart: with fewer the sigmas themselves are bent."""
_NO_HEADING_RAD = np.radians(1.0)
"""Error of the azimuth (rad) from which it is called not observable: a heading so wrong is of no use."""
_SAME = np.cos(np.radians(10.0))
"""Cosine of a rotation (1) above which two attitudes are one: 10 deg are less than any step of a plan."""


def azimuth_warning(solution: Solution[Pass]) -> str | None:
    """Say so when there are too few attitudes, or the second order of the azimuth exceeds the sigma of a gyro bias.

    A wrong azimuth a turns the horizontal Earth rate, O = 7.29e-5 rad/s times the cosine of latitude. The filter counts
    the first order, O a, across; along, the second order O a^2 / 2 is missing in it and goes into the gyro biases,
    whatever their sigma says. Where Earth rate has been seen from many attitudes the azimuth is known to an arcminute
    and this is nothing; after one or two stops it is known only as well as a gyro bias, and the estimate is bent.

    The second order is taken at three sigma, against the smallest sigma of a bias. With one or two attitudes the
    sigmas themselves are bent, and only the attitudes are counted.
    """
    attitudes = _attitudes(solution)
    if attitudes < _LEAST_ATTITUDES:
        told = (
            f"the IMU was at rest in {attitudes} attitude{'s' if attitudes > 1 else ''} only: azimuth and gyro biases "
            f"cannot be separated, and their sigmas are {NOT_TRUSTED}; use a plan with more attitudes"
        )
        return Note(told, Topic.NOT_TRUSTED)
    P, names = solution.last.state.P, solution.setup.sensors.names
    sigma = np.sqrt(np.diag(P))
    biases = [sigma[NAV + i] for i, name in enumerate(names) if name in GYRO_BIAS.labels]
    if not biases:
        return None
    azimuth = float(sigma[-1])
    bent = 0.5 * (_SIGMAS * azimuth) ** 2 * earth.RATE * float(np.cos(solution.setup.site.latitude_rad))
    if bent <= min(biases):
        return None
    return (
        f"the azimuth is known only to {np.degrees(azimuth):.2g} deg: gyro biases may be wrong by "
        f"{np.degrees(bent) * 3600.0:.2g} deg/h beyond their sigma; use a plan with more attitudes"
    )


def azimuth_note(solution: Solution[Pass]) -> str | None:
    """Say so where the Earth turns about the vertical so nearly that no heading can come from it.

    What a gyro bias leaves open of the horizontal Earth rate is an azimuth. The filter's own sigma does not show it:
    the second order of an azimuth that may be anything is taken for knowledge. An azimuth that a site states is known.
    """
    site = solution.setup.site
    p = len(solution.setup.sensors.prior)
    biases = [k for k, name in enumerate(solution.setup.sensors.names) if name in GYRO_BIAS.labels]
    if site.initial_azimuth_rad is not None or not biases:
        return None
    bias = float(np.sqrt(min(np.diag(solution.last.state.P[NAV : NAV + p, NAV : NAV + p])[biases])))
    horizontal = earth.RATE * abs(float(np.cos(site.latitude_rad)))
    if bias <= _NO_HEADING_RAD * horizontal:
        return None
    return (
        f"the azimuth is not observable: at latitude {np.degrees(site.latitude_rad):.4g} deg the horizontal Earth rate "
        f"is {_deg_h(horizontal):.2g} deg/h, and the best gyro bias is known to {_deg_h(bias):.2g} deg/h; "
        "the coefficients do not need it, but headings of this test mean nothing"
    )


def _deg_h(rate: float) -> float:
    return float(np.degrees(rate) * 3600.0)


def _attitudes(solution: Solution[Pass]) -> int:
    """Count attitudes in which measurements were taken, up to the least that is enough."""
    C = solution.last.output.C_nb[solution.prepared.phases.used]
    count = 0
    while len(C) and count < _LEAST_ATTITUDES:
        count += 1
        cosine = 0.5 * (np.einsum("kij,ij->k", C, C[0]) - 1.0)
        C = C[cosine < _SAME]
    return count
