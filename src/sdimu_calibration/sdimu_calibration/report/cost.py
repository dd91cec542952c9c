"""What it costs to ignore a missing effect: metres of a navigation without aid, and coefficients that are wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.grades import decimals
from sdimu_calibration.core.diagnosis.ladder import moved_coefficients
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
from sdimu_calibration.core.diagnosis.verdict import statements
from sdimu_calibration.core.estimation.free_inertial import NOTHING
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.results import NOT_TRUSTED, Calibration
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.report_extras import ReportExtras

_KILOMETRE = 1000.0
_CHANCE = 3.0
"""Error of position over its predicted sigma (1) from which it is no chance, of one stretch or two."""
_NOT_HELD = "what was found does not hold where it was not fitted"
"""What is said where a navigation without aid contradicts what was found."""
OVER_MODELS = "one sigma over all models that the data leave open"
"""What a diagnosis states behind an amount: larger than that of one model where several are open."""
TOO_LARGE = "+: too large without it"
"""What the sign of an amount says."""
_WHOLE_M = 10.0
"""Distance (m) from which metres have no decimals: a tenth of less is still seen."""


@dataclass(frozen=True)
class Off:
    """A coefficient that is wrong while an effect is missing."""

    name: str
    amount: float
    """By how much it is too large without the effect, in `unit`: value without it less value with it."""
    unit: str
    sigma: float
    """Sigma of the better value, in `unit`: how well the amount is known."""
    sigmas: float
    """The amount over the sigma that it is given with."""
    value: float = float("nan")
    """The better value, in `unit`."""

    @property
    def text(self) -> str:
        """In words: ``gyro_scale_y +26.2 +- 4.8 ppm (5.5 of its sigmas)``."""
        return f"{self.name} {self.size} ({abs(self.sigmas):.1f} of its sigmas)"

    @property
    def size(self) -> str:
        """The amount with its sigma and unit: ``+26.2 +- 4.8 ppm``."""
        return f"{self.alone} +- {self.known} {self.unit}"

    @property
    def better(self) -> str:
        """The better value with its sigma, without unit: ``-16.1 +- 4.8``."""
        return f"{self.value:.{decimals(self.sigma)}f} +- {self.known}"

    @property
    def alone(self) -> str:
        """The amount without unit: ``+26.2``."""
        return f"{self.amount:+.{decimals(self.sigma)}f}"

    @property
    def known(self) -> str:
        """Its sigma without unit: ``4.8``."""
        return f"{self.sigma:.{decimals(self.sigma)}f}"


def coefficients_off(before: Calibration, after: Calibration) -> tuple[Off, ...]:
    """Coefficients of a result that a better one puts elsewhere by more than chance, the worst first.

    Amounts are before less after, by how much the value before is too large; moves of a ladder have the other sign.
    """
    units = dict(zip(before.names, before.display_units, strict=True))
    at = {name: k for k, name in enumerate(before.names)}
    out = []
    for name, sigmas in moved_coefficients(before, after):
        size = float(np.sqrt(before.covariance[at[name], at[name]]))
        k = after.names.index(name)
        known = from_si(float(np.sqrt(after.covariance[k, k])), units[name])
        if abs(sigmas) * from_si(size, units[name]) <= known:
            # What it is off by is known no better than that.
            continue
        value = from_si(float(after.values[k]), units[name])
        out.append(Off(name, from_si(-sigmas * size, units[name]), units[name], known, -sigmas, value))
    return tuple(out)


def wrong_without(summary: DiagnosisSummary, more: ReportExtras | None) -> tuple[Off, ...]:
    """Coefficients that are wrong without what was found, as a calibration delivers them, the worst first."""
    d = summary.diagnosis
    if not summary.found:
        return ()
    given = more.given if more is not None and more.given is not None else d.before
    return coefficients_off(given, d.after)


@dataclass(frozen=True)
class InUse:
    """How far a navigation without aid drifts with each compensation, over all stretches that no fit has seen."""

    minutes: float
    """Length of a navigation."""
    stretches: int
    names: tuple[str, ...]
    """Of the compensations, the worst model first."""
    distance: tuple[float, ...]
    """Root mean square of the error of position at the end of the stretches (m), one a compensation."""
    promised: float = float("nan")
    """What the fit of the last compensation expects of the same (m); NaN where there is none."""

    @property
    def figures(self) -> str:
        """The distances one after the other: ``2.0 km -> 52 m -> 48 m``."""
        return in_metres(self.distance)

    @property
    def where(self) -> str:
        """Over how many stretches, and how they are summed up."""
        return "a stretch" if self.stretches == 1 else f"{self.stretches} stretches (root mean square)"

    @property
    def words(self) -> str:
        """What the distances are, and of which compensations."""
        return f"{self.kind}: {', '.join(self.names)}{self.expected}"

    @property
    def sentence(self) -> str:
        """Each distance with its compensation, then what they are: ``2.0 km (not compensated) -> 52 m (...): ...``."""
        told = (f"{metres(value)} ({name})" for value, name in zip(self.distance, self.names, strict=True))
        return f"{' -> '.join(told)}: {self.kind}{self.expected}"

    @property
    def kind(self) -> str:
        """What the distances are."""
        return f"position after {self.minutes:.0f} min without aid, over {self.where} that no fit has seen"

    @property
    def expected(self) -> str:
        """End of a sentence: what the last fit predicted, and whether what was found fails beyond the data it is of."""
        if not np.isfinite(self.promised):
            return ""
        told = f"; the last fit predicted {metres(self.promised)}"
        return f"{told}: {_NOT_HELD}" if self.fails else told

    @property
    def fails(self) -> bool:
        """Whether the navigation contradicts what was found: worse with it than without, and than chance allows."""
        if not np.isfinite(self.promised) or len(self.distance) < 3:
            return False
        return self.distance[-1] > max(self.as_given, _CHANCE * self.promised)

    @property
    def as_given(self) -> float:
        """The distance with the model as given (m), whatever models stand between it and the last."""
        return self.distance[1]


def held_to_use(d: Diagnosis, more: ReportExtras | None) -> Diagnosis:
    """Judge a diagnosis by a navigation without aid: what fails there is not told as certain, nor to be trusted.

    Parameters
    ----------
    more : ReportExtras or None
        With the navigations; without any the diagnosis is returned as it is.

    Returns
    -------
    Diagnosis
        The same object where nothing contradicts it.
    """
    use = in_use(more)
    if use is None or not use.fails:
        return d
    told = (
        f"{_NOT_HELD}: after {use.minutes:.0f} min without aid the position is {metres(use.distance[-1])} off, "
        f"{metres(use.as_given)} without it, {metres(use.promised)} as predicted: the estimate is {NOT_TRUSTED}"
    )
    after = d.after.warned(Note(told, Topic.NOT_TRUSTED))
    return replace(d, statements=statements(d, d.found_effects, held=False), after=after)


def in_use(more: ReportExtras | None) -> InUse | None:
    """Sum up the navigations without aid; None where there is none."""
    trials = more.trials if more is not None else ()
    if not trials:
        return None
    ends = np.array([[float(drift.distance[-1]) for drift in trial.drifts] for trial in trials])
    names = tuple("not compensated" if drift.name == NOTHING else drift.name for drift in trials[0].drifts)
    minutes = float(np.mean([trial.segment.length_s for trial in trials])) / 60.0
    promised = np.array([float(trial.drifts[-1].promised[-1]) for trial in trials])
    distance = np.sqrt(np.mean(ends**2, axis=0)).tolist()
    return InUse(minutes, len(trials), names, tuple(distance), float(np.sqrt(np.mean(promised**2))))


def in_use_entry(more: ReportExtras | None) -> dict[str, Any] | None:
    """Give the navigations without aid as plain data: error of position with each model (m); None where there is none.

    The models are those of the ladder, behind the samples as they are.
    """
    use = in_use(more)
    if use is None:
        return None
    return {
        "length_s": 60.0 * use.minutes,
        "stretches": use.stretches,
        "position": [{"model": name, "rms_m": size} for name, size in zip(use.names, use.distance, strict=True)],
        "predicted_m": use.promised,
    }


def in_metres(values: Sequence[float]) -> str:
    """Write distances (m) one after the other: ``543 -> 105 -> 55 m``; large ones in km."""
    if any(value >= _KILOMETRE for value in values):
        return " -> ".join(metres(value) for value in values)
    return f"{' -> '.join(_number(value) for value in values)} m"


def metres(value: float) -> str:
    """Write a distance (m): ``55 m``, ``3.2 km``."""
    return f"{_number(value / _KILOMETRE)} km" if value >= _KILOMETRE else f"{_number(value)} m"


def _number(value: float) -> str:
    return f"{value:.0f}" if value >= _WHOLE_M else f"{value:.1f}"
