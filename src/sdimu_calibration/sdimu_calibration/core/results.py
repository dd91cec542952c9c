"""Result objects: what a calibration ends with, and how it got there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from sdimu_calibration.core.arrays import Bools, Floats, Ints
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.note import MISFITS, Topic, topic_of
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.recording import DataFault
from sdimu_calibration.core.site_reference import Reference
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.verdict import Verdict

NOT_TRUSTED = "not to be trusted"
"""Words of a warning that forbids to use an estimate, by which a file tells it."""
UNTRUSTED_VERDICTS = frozenset({Verdict.UNEXPLAINED, Verdict.DATA_FAULT})
"""Verdicts of a diagnosis after which no estimate is to be trusted: the model is wrong, and no effect mends it."""
START_TEMPERATURE = "start_temperature_degc"
"""Key in the data section: temperature T0 from which temperature effects count (deg C), that at the start if no other
was stated."""
INSEPARABLE = "cannot be told from each other"
"""Words of a warning that two coefficients are one in a test, by which a file tells it."""
NO_AXES = (float("nan"),) * 3
"""Three axes without a number."""


@dataclass(frozen=True)
class History:
    """The last pass as the test went on, one row an epoch (m), in the reported body frame."""

    t: Floats
    """End of the epoch (s), shape (m,)."""
    value: Floats
    sigma: Floats
    """`value`, `sigma`: coefficients (SI), shape (m, p)."""
    attitude_sigma: Floats
    """N, E, D (rad), shape (m, 3)."""
    stop: Ints
    """Shape (m,)."""
    dwell: Bools
    used: Bools
    """`dwell`, `used`: shape (m,)."""
    nis: Floats
    """Shape (m, 4). Squared normalised innovation of position, velocity, rate, force (3 degrees of freedom each); NaN
    unmeasured."""


def no_history(p: int) -> History:
    """History of an estimator that has none: no rows of `p` coefficients."""
    none = np.zeros(0)
    flags = np.zeros(0, dtype=bool)
    rows = np.zeros((0, p))
    return History(none, rows, rows, np.zeros((0, 3)), np.zeros(0, dtype=np.int64), flags, flags, np.zeros((0, 4)))


@dataclass(frozen=True)
class Rest:
    """A rest of a run by hand, and what the fit leaves over there; residuals are measured less predicted."""

    start_s: float
    end_s: float
    """`start_s`, `end_s`: seconds."""
    rate: tuple[float, float, float]
    force: tuple[float, float, float]
    """`rate`, `force`: residuals of the means, in the axes of the IMU (rad/s, m/s^2)."""
    turn: tuple[float, float, float]
    """Residual of the turn to this rest, N, E, D (rad; the heading of north is arbitrary); NaN where nobody saw it."""
    rate_sigma: float
    force_sigma: float
    turn_sigma: float
    """`rate_sigma`, `force_sigma`, `turn_sigma`: what they scatter by an axis: white noise, and what was learned beyond
    it (rad/s, m/s^2, rad)."""
    ahead: tuple[float, float, float] = NO_AXES
    ahead_sigma: tuple[float, float, float] = NO_AXES
    """`ahead`, `ahead_sigma`: error of the force predicted from everything but itself, and what it scatters by (m/s^2);
    NaN in results of before."""


@dataclass(frozen=True)
class TurnOn:
    """Scatter of the coefficients of an effect from power-on to power-on."""

    effect: str
    sigma: float
    low: float
    high: float
    """`sigma`, `low`, `high`: standard deviation and bounds of its 95 % interval (SI); `low` is 0 where the data do not
    show any scatter."""
    power_ons: int
    """Number of power-ons that were seen."""
    unit: str = ""
    display_unit: str = ""


@dataclass(frozen=True)
class SetRecording:
    """One recording of a set."""

    name: str
    serial: str
    power_on: str
    start_ns: int
    temperature_degc: float
    """Mean; NaN where it is not recorded."""
    duration_s: float
    samples: float
    nis: float
    """`duration_s`, `samples`, `nis`: length (s), number of samples, mean normalised innovation squared (1)."""
    values: Floats
    sigma: Floats
    """`values`, `sigma`: shape (p,). Of its own fit (SI), in the order of the coefficients of the set; NaN where it has
    none."""
    deviate: Floats
    """Shape (p,). Its deviation from the joint estimate over the sigma of that (1); NaN where it says nothing."""


@dataclass(frozen=True)
class PowerOnDeviation:
    """Deviation of a coefficient in one power-on from its mean over all power-ons that might be."""

    power_on: str
    name: str
    value: float
    sigma: float
    """`value`, `sigma`: SI."""


@dataclass(frozen=True)
class SetTrend:
    """A coefficient that follows something from recording to recording."""

    name: str
    covariate: str
    slope: float
    sigma: float
    """`slope`, `sigma`: SI per unit of the covariate."""
    p_value: float
    """All coefficients and covariates counted."""


@dataclass(frozen=True)
class SetSummary:
    """What a joint fit says beyond the coefficients."""

    recordings: tuple[SetRecording, ...]
    turn_on: tuple[TurnOn, ...]
    deviations: tuple[PowerOnDeviation, ...]
    scatter_p: Floats
    """Shape (p,). Probability that a constant coefficient scatters as far from recording to recording; NaN where none
    sees it."""
    trends: tuple[SetTrend, ...]
    """The least probable first."""
    left_out: tuple[tuple[str, str], ...] = ()
    """Recordings that could not be used, and why."""

    @property
    def counted(self) -> str:
        """How many recordings these are: ``1 recording``, ``3 recordings``, ``2 of 3 recordings``."""
        used, refused = len(self.recordings), len(self.left_out)
        return f"{used} of {used + refused} recordings" if refused else counted(used, "recording")

    @property
    def together(self) -> str:
        """The same as the heading of a table: ``3 recordings together, without far``."""
        some = f"{self.counted} together" if len(self.recordings) > 1 else self.counted
        return ", without ".join([some, *([", ".join(name for name, _ in self.left_out)] if self.left_out else [])])


@dataclass(frozen=True)
class Calibration:
    """A calibration result.

    Attributes
    ----------
    model : tuple of str
        Effects.
    names, units, display_units : tuple of str, length p
    values : ndarray, shape (p,)
        SI, in `body_frame`.
    covariance : ndarray, shape (p, p)
        With what models that the data leave open add, where a diagnosis asked which they are.
    fit : mapping
        log_likelihood, nis_mean, nis_dof, held_out_rms (None when not computed), passes.
    data : mapping
        samples, lost, rejected, contradicted_s, duration_s, stops.
    notes : tuple of str
        What the user should know, one line each.
    history : History
        Of the last pass.
    warnings : tuple of str
        Those of the notes that say that the estimate is not to be trusted as it stands.
    faults : tuple of DataFault
        What is wrong with the data and no physics of the sensor.
    estimator : str
        Name of the estimator; empty in results of others.
    estimator_reason : str
        Why it was taken.
    noise : tuple of NoiseTerm
        Noise with a memory that was learned; values and covariance are those in it.
    drift_means : mapping of str to float
        Mean over all dwells of the regressor of each drift of a bias (SI), by the name of its coefficient. The biases
        are those in the mean over the dwells: the bias in the equation is less by coefficient times mean.
    conditional_sigma : ndarray, shape (p,), or None
        Standard deviation (SI) if the model is right; None where `covariance` is that.
    rests : tuple of Rest
        Of a run by hand, in order; empty for all others.
    of_set : SetSummary or None
        Of a joint fit of several recordings.
    origin : Origin
        Which unit, when, at which temperature, from which recording.
    imu_noise : ImuSpecification or None
        Name, grade and noise of the specification with which samples were weighed, without its priors; None in older
        results and those of others.
    references : tuple of Reference
        Latitude and gravity of the site as told, and what the data made of them; empty in older results.
    """

    body_frame: str
    model: tuple[str, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    display_units: tuple[str, ...]
    values: Floats
    covariance: Floats
    fit: Mapping[str, float | None]
    data: Mapping[str, float]
    notes: tuple[str, ...]
    history: History
    warnings: tuple[str, ...] = ()
    faults: tuple[DataFault, ...] = ()
    estimator: str = ""
    estimator_reason: str = ""
    noise: tuple[NoiseTerm, ...] = ()
    drift_means: Mapping[str, float] = field(default_factory=dict)
    conditional_sigma: Floats | None = None
    rests: tuple[Rest, ...] = ()
    of_set: SetSummary | None = None
    origin: Origin = field(default_factory=Origin)
    imu_noise: ImuSpecification | None = None
    references: tuple[Reference, ...] = ()

    def with_serial(self, serial: str) -> Calibration:
        """Return the result as one of the unit with this serial number."""
        return replace(self, origin=replace(self.origin, serial=serial))

    @property
    def not_to_be_trusted(self) -> tuple[str, ...]:
        """Why the estimate must not be used as it stands, one line each; empty where nothing forbids it."""
        grave = [fault.text for fault in self.faults if fault.grave]
        return tuple(dict.fromkeys([*grave, *self._about(Topic.NOT_TRUSTED)]))

    def warned(self, *lines: str) -> Calibration:
        """Return the result with more warnings, which are notes as well; one that it has is not said twice."""
        new = tuple(line for line in lines if line not in self.warnings)
        return replace(self, notes=(*self.notes, *new), warnings=(*self.warnings, *new))

    @property
    def misfits(self) -> tuple[str, ...]:
        """Where the model does not fit the data, one line each: those of the warnings that send to a diagnosis."""
        return self._about(*MISFITS)

    @property
    def inseparable(self) -> tuple[str, ...]:
        """Pairs of coefficients that are one in this test, one line each."""
        return self._about(Topic.INSEPARABLE)

    def _about(self, *topics: Topic) -> tuple[str, ...]:
        return tuple(line for line in self.warnings if topic_of(line) in topics)


def of_recordings(result: Calibration) -> SetSummary:
    """Give what the result of a joint fit says beyond the coefficients."""
    if result.of_set is None:
        raise AssertionError("the result of a set says what it is of")
    return result.of_set
