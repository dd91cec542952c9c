"""The diagnosis of a test that still runs: where the model fails so far, what would explain it, how far the error fell.

While it runs there is no search: one scan of all candidates, as `climb` begins. Once the test has ended, verdict and
probabilities are those of the diagnosis of its recording, to the last digit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, climb
from sdimu_calibration.core.diagnosis.measured_noise import in_measured_noise
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.survey import survey
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.evidence.consistency import StopMean
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.posterior.told import Probabilities
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.verdict import Verdict

_FEWEST_STOPS = 2
"""Number of stops at least: one is predicted from the others."""


@dataclass(frozen=True)
class Ranked:
    """A candidate beside the model as given."""

    label: str
    z: float
    """Estimate over sigma."""
    estimate: float
    sigma: float
    """`estimate`, `sigma`: SI."""
    display_unit: str
    """Customary."""


@dataclass(frozen=True)
class ModelError:
    """How large the error of a model is on the data so far."""

    added: tuple[str, ...]
    """What it has beyond the model that the test began with."""
    held_out: float
    """RMS of the normalised errors at stops predicted from the others (1 is right); NaN with fewer than two stops."""
    nis: float
    """Normalised innovation squared per degree of freedom (1 is right)."""


@dataclass(frozen=True)
class LiveDiagnosis:
    """What a diagnosis says of the data up to the end of a stop."""

    stop: int
    """The last one."""
    until_s: float
    """Length of the data (s)."""
    verdict: Verdict
    """``consistent``, ``misfit``, or ``waiting`` where nothing could be fitted; of a whole test that of `climb`."""
    sentence: str
    """The verdict for people; while it waits, for what."""
    added: tuple[str, ...] = ()
    """Effects beyond the model that the test began with."""
    threshold: float = float("inf")
    """Size of the score (sigma) that pure noise reaches; inf where no candidate is testable."""
    p_value: float = 1.0
    """Of what no candidate stands for."""
    where: tuple[StopMean, ...] = ()
    """Every channel and stop, largest first."""
    ranking: tuple[Ranked, ...] = ()
    """Every testable candidate, largest score first."""
    ladder: tuple[ModelError, ...] = ()
    """Every model that this test has had, on the same data, the one in use last."""
    noise: tuple[str, ...] = ()
    """What is wrong with the white noise of the IMU file, one line each."""
    probabilities: Probabilities | None = None
    """Of nothing, and of each family of effects; None before the test ends."""

    @property
    def standing(self) -> tuple[Ranked, ...]:
        """Candidates that stand out of the noise."""
        return tuple(r for r in self.ranking if abs(r.z) > self.threshold)


def waiting(stop: int, until_s: float, added: Sequence[str], why: str) -> LiveDiagnosis:
    """Return the diagnosis of a stop that cannot be fitted yet, which says why."""
    return LiveDiagnosis(stop, until_s, Verdict.WAITING, f"no diagnosis yet: {why}", tuple(added))


def so_far(
    test: PreparedTest, model: Model, added: Sequence[str] = (), ladder: Sequence[ModelError] = (), whole: bool = False
) -> tuple[LiveDiagnosis, Fit]:
    """Diagnose what there is of a test.

    Parameters
    ----------
    test : PreparedTest
        The data up to the end of a stop.
    added : sequence of str
        What `model` has beyond the model that the test began with.
    ladder : sequence of ModelError
        Of other models on the same data.
    whole : bool
        The test has ended: its verdict and probabilities are those of `climb`.

    Returns
    -------
    diagnosis : LiveDiagnosis
    fit : Fit
        Which it is of: in white noise, of the size that the data show.
    """
    fit, noise = _fit(test, model)
    done = survey(fit, outcome(fit, held_out=False))
    told = climb(fit) if whole else done
    return LiveDiagnosis(
        stop=max(done.evidence.stop.tolist(), default=0),
        until_s=float(test.recording.t[-1]),
        verdict=told.verdict,
        sentence=told.sentence,
        added=tuple(added),
        threshold=done.found.threshold,
        p_value=done.p_value,
        where=done.consistency.where,
        ranking=_ranked(done),
        ladder=(*ladder, _error(fit, done.evidence.only(np.empty(0, dtype=np.int64)), added)),
        noise=noise,
        probabilities=told.probabilities,
    ), fit


def error_of(test: PreparedTest, model: Model, added: Sequence[str] = ()) -> ModelError:
    """Say how large the error of a model is on a test; parameters as for `so_far`."""
    fit, _ = _fit(test, model)
    return _error(fit, fit.bare, added)


def _fit(test: PreparedTest, model: Model) -> tuple[Fit, tuple[str, ...]]:
    fit, _, noise = in_measured_noise(solve(test, model, learn=False))
    return fit, noise


def _error(fit: Fit, evidence: LinearEvidence, added: Sequence[str]) -> ModelError:
    """Error of the model of a fit; `evidence` about it, without candidates."""
    stops = np.unique(evidence.stop)
    held_out = Problem(evidence).held_out([]).rms if len(stops) >= _FEWEST_STOPS else float("nan")
    return ModelError(tuple(added), held_out, fit.statistics().nis_mean or float("nan"))


def _ranked(done: Diagnosis) -> tuple[Ranked, ...]:
    first, evidence = done.found.first, done.evidence
    p = len(evidence.weight)
    sigma: Floats = first.sigma
    columns = [k for k in range(p, len(first.z)) if np.isfinite(sigma[k])]
    rows = [
        Ranked(
            evidence.names[k],
            float(first.z[k]),
            float(first.estimate[k]),
            float(sigma[k]),
            evidence.candidates[k - p].parameter.display_unit,
        )
        for k in columns
    ]
    return tuple(sorted(rows, key=lambda r: -abs(r.z)))
