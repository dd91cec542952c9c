"""What speaks against a model that has everything that was found. Alarms choose no effect: they make it unexplained."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import Enum

import numpy as np

from sdimu_calibration.core.diagnosis.rounds import UNEXPLAINED_P, Round
from sdimu_calibration.core.diagnosis.screen import Finding
from sdimu_calibration.core.error_figures import degrees_of_freedom, held_out_judged, nis_judged
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.consistency import Consistency
from sdimu_calibration.core.noise_term import unexplained
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import EPOCH_S, ImuSpecification

STILL_WRONG = 1.25
"""Held-out error (sigma) from which a model is not called explained: 1 is right, and an effect that only imitates the
cause fits here and fails elsewhere."""
_MISFIT = 0.05
"""Excess of the NIS per degree of freedom (1) up to which a model fits: its sigmas are then right to 2.5 %."""
_MISFIT_SIGMAS = 5.0
"""Excess of the NIS (standard deviations of it) up to which a model fits: in a short test chance goes beyond
`_MISFIT`."""
_PATCHES = 3
"""Number of drifts of one bias from which they are a patchwork: together they follow any wander."""


class Alarm(Enum):
    """What rings."""

    FREE_INPUTS = "free inputs"
    HELD_OUT = "held-out error"
    NIS = "NIS"
    DRAWN = "noise drawn anew, or that follows something"
    PATCHWORK = "drifts that follow any wander"


def alarms(
    done: Round,
    after: Calibration,
    consistency: Consistency,
    base: Fit,
    stated: ImuSpecification,
    findings: Sequence[Finding],
) -> frozenset[Alarm]:
    """Say what speaks against a model that has what was found.

    Parameters
    ----------
    done : Round
        The last one.
    after : Calibration
        With what was found.
    consistency : Consistency
        Measured against `stated`.
    base : Fit
        With the model as given, in the noise that the recording shows.
    findings : sequence of Finding
        Of the screen of the data.
    """
    noise = done.found.noise
    # The free inputs are constant in a dwell and in a turn; what changes within one shows in the NIS alone.
    # Noise that is faster than a stretch is learned by what it leaves from stretch to stretch; within, it stays.
    # Neighbouring epochs say what the noise is, but for a sensor that counts pulses.
    judged = not (base.learns_scatter or noise or stated.epoch_s > EPOCH_S)
    excess = misfit(after, consistency, stated, base.test.imu) if judged else 0.0
    rings = {
        Alarm.FREE_INPUTS: done.left_after.p_value < UNEXPLAINED_P,
        # What was added must also predict: an effect that only mimics the missing one fits here and fails elsewhere.
        Alarm.HELD_OUT: not base.learns_scatter and held_out_judged(after) > STILL_WRONG,
        Alarm.NIS: excess > largest_misfit(float(np.fmax(degrees_of_freedom(after), 1.0))),
        Alarm.DRAWN: bool(unexplained(noise, [finding.kind for finding in findings], base.test.recording.notes)),
        Alarm.PATCHWORK: patchwork(done.chosen),
    }
    return frozenset(alarm for alarm, rung in rings.items() if rung)


def misfit(final: Calibration, consistency: Consistency, stated: ImuSpecification, taken: ImuSpecification) -> float:
    """Excess of the NIS over what the noise of the recording itself explains, outliers and all.

    Differences of neighbouring seconds say what that noise is, whatever is slow.

    Parameters
    ----------
    consistency : Consistency
        Measured against `stated`.
    stated, taken : ImuSpecification
        Noise of the IMU file, and noise that the fit took.
    """
    gyro = consistency.gyro.spread * stated.gyro_white_noise / taken.gyro_white_noise
    accel = consistency.accel.spread * stated.accel_white_noise / taken.accel_white_noise
    return float(nis_judged(final) / (0.5 * (gyro**2 + accel**2)) - 1.0)


def largest_misfit(dof: float) -> float:
    """Excess of the NIS that a right model stays below.

    The NIS and the differences of neighbours are two estimates of one variance, the second with an efficiency of 2/3
    (Rice, Ann. Stat. 12, 1984): their ratio scatters by ``1/sqrt(dof)``.
    """
    return max(_MISFIT, _MISFIT_SIGMAS / float(np.sqrt(dof)))


def patchwork(chosen: Iterable[Candidate]) -> bool:
    """Whether one bias drifts by so many effects at once that they follow any wander and say nothing of its cause."""
    drifts = {(c.family, c.effect.variant, c.effect.terms[0].channel) for c in chosen if c.effect.bias_drift}
    of_sensor = [sensor for _, _, sensor in drifts]
    return any(of_sensor.count(sensor) >= _PATCHES for sensor in of_sensor)
