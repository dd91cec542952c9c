"""Each dwell of a recording as a candidate: a constant error of every sensor, and where the IMU was meanwhile.

Two recordings in another order pass the same attitudes at other times. What a model leaves in their dwells then says
what it belongs to (`recurrence`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects.effect import CHANNELS, Timetable
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.evidence.attitude_functions import way
from sdimu_calibration.core.evidence.handheld_evidence import HandheldEvidence
from sdimu_calibration.core.evidence.in_stops import InStops
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.navigation_evidence import NavigationEvidence
from sdimu_calibration.core.evidence.noise_kernels import Stretches
from sdimu_calibration.core.evidence.noise_root import root_of
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.joint.reduction import Reduction, reduced, unit_noise
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.recording import TemperatureLog

_READINGS = 9
"""Number of times of a dwell (1) at which its temperature is read: a thermometer changes little in one."""


@dataclass(frozen=True)
class Places:
    """Where the IMU was in each dwell of a recording, n of them."""

    middle: Floats
    """Time of the middle of each: seconds after the start of the recording (s), shape (n,)."""
    up: Floats
    """Shape (n, 3). Direction of the mean specific force in b: a unit vector."""
    temperature_degc: Floats
    """Shape (n,). Mean; NaN where none is recorded."""
    way: Floats
    """Directions of the specific force in b in dwells and turns (1), shape (k, 3)."""

    def __len__(self) -> int:
        """Return the number of dwells."""
        return len(self.middle)


def stretch_rows(fit: Fit) -> tuple[Reduction, Places]:
    """Compress what a recording says of its coefficients and of the errors in each dwell.

    Noise with a memory that was learned acts in turns alone: in dwells it would take in what may come back. Without it
    a turn is trusted as in white noise, and what it makes wrong in a coefficient of all recordings comes back in their
    dwells.

    Returns
    -------
    reduction : Reduction
        Its labels are those of the six sensors in the first dwell, in the second ...; one per rad/s or m/s^2.
    places : Places
    """
    evidence = fit.bare
    cut, own = _dwells(evidence.times), len(evidence.weight)
    labels = [f"{name} in dwell {k}" for k in range(len(cut)) for name in CHANNELS]
    W, e = np.hstack([evidence.W[:, :own], evidence.constant_signature(cut)]), evidence.e
    if fit.noise_terms and isinstance(fit, NavigationFit):
        noisy = unit_noise(_in_turns(fit.wander.in_white, fit.noise_terms), np.column_stack([W, e]))
        W, e = noisy[:, :-1], noisy[:, -1]
    wide = replace(evidence, W=W, e=e, names=(*evidence.names[:own], *labels))
    return reduced(wide), _places(evidence, cut, fit.test.recording.temperature)


def _in_turns(wander: Wander, terms: Sequence[NoiseTerm]) -> InStops:
    """Signatures of what noise with a memory does in turns, of modes of unit variance."""
    turning = np.zeros(wander.cut.cells, dtype=bool)
    turning[: len(wander.cut)] = wander.cut.turning
    cells = np.repeat(turning, len(CHANNELS))
    return wander.U.only(cells).combined(root_of(terms, wander.cut)[cells])


def _dwells(times: Timetable) -> Stretches:
    """Every dwell, uncut."""
    _, start, end = zip(*times.stops, strict=True)
    count = len(times.stops)
    return Stretches(np.array(start), np.array(end), np.arange(count), np.zeros(count, dtype=bool))


def _places(evidence: LinearEvidence, cut: Stretches, log: TemperatureLog | None) -> Places:
    motion = _seen(evidence)
    middle = motion.t - 0.5 * motion.dt
    up, heat = np.zeros((len(cut), 3)), np.full(len(cut), np.nan)
    for k, (begin, end) in enumerate(zip(cut.start.tolist(), cut.end.tolist(), strict=True)):
        rows = (middle >= begin) & (middle <= end)
        force = motion.f[rows].mean(axis=0)
        up[k] = force / float(np.linalg.norm(force))
        if log is not None and len(log.t):
            heat[k] = np.interp(np.linspace(begin, end, _READINGS), log.t, log.value).mean()
    return Places(0.5 * (cut.start + cut.end), up, heat, way(motion))


def _seen(evidence: LinearEvidence) -> Motion:
    """Motion along which the evidence was linearised; of a run by hand at its rests.

    Raises
    ------
    TypeError
        For an evidence of another kind.
    """
    if isinstance(evidence, HandheldEvidence):
        return evidence.rests
    if isinstance(evidence, NavigationEvidence):
        return evidence.seen
    raise TypeError(f"no motion in {type(evidence).__name__}")
