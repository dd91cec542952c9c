"""Is the noise what the specification says, and are the innovations white? Necessary, and weak against effects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.alignment.prepared import PreparedData
from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.filter.filter_pass import PassOutput
from sdimu_calibration.core.filter.means_at_stops import means_at_stops
from sdimu_calibration.core.measurement_kind import SKIP
from sdimu_calibration.core.probability import chi2_head, chi2_tail
from sdimu_calibration.core.specification import EPOCH_S, ImuSpecification

CHANNEL_NAMES = (
    "position_n",
    "position_e",
    "position_d",
    "velocity_n",
    "velocity_e",
    "velocity_d",
    "gyro_x",
    "gyro_y",
    "gyro_z",
    "accel_x",
    "accel_y",
    "accel_z",
)
_GAUSS_MAD = 1.482602218505602
"""Factor from the median of |x| to the standard deviation: of Gaussian noise."""
_LAGS = 20
"""Number of lags of the Ljung-Box test: the customary one; what is slower shows in `Noise.slow`."""
_OUTLIER = 4.0
"""Difference of neighbouring epochs (sigma of it) from which both may be outliers: Gaussian noise puts one in 16 000
beyond it."""
_EQUAL = 1e-6
"""Relative difference of two differences that are the same number of pulses: rounding is smaller, noise larger."""
_TIED = 0.05
"""Share of differences that equal their median from which they are counts of pulses: noise gives one or two of all."""
_ONE_EPOCH = 1.5
"""Ratio of the usual epoch at rest to the nominal one from which epochs are long ones: missing samples make 1.1."""
_LEAST_PAIRS = 50
"""Number of neighbours, or of neighbouring means, at least: from fewer the noise is known no better than to 13 %."""
SLOW_S = 10
"""Length of the means (s) by which coloured noise is told from white: long against an epoch, short against a dwell."""


@dataclass(frozen=True)
class Noise:
    """Noise of one triad against its specification, from differences of neighbouring epochs at rest."""

    ratio: float
    """Measured over specified standard deviation, from the median of absolute differences (blind to outliers)."""
    sigma: float
    """Standard error of `ratio`."""
    spread: float
    """Measured over specified standard deviation, outliers and all."""
    kurtosis: float
    """Of the differences; 3 is Gaussian."""
    outliers: Ints
    """Epochs that differ from both neighbours, to the same side, by more than four sigma of the difference, shape (o,).
    """
    slow: float = 1.0
    """Scatter of neighbouring means over `SLOW_S` against that of seconds, 1 when the noise is white; NaN where the
    stops are too short to tell."""


NO_NOISE = Noise(1.0, 1.0, 1.0, 3.0, np.empty(0, dtype=np.int64))
"""Where there are too few neighbours to measure the noise, or they say nothing of it: as specified."""


@dataclass(frozen=True)
class StopMean:
    """How far a channel is off at a stop."""

    channel: str
    """One of `CHANNEL_NAMES`; of a handheld run one of `handheld_evidence.CHANNELS`."""
    stop: int
    normalised_mean: float
    """Mean innovation over its sigma; standard normal when the model is right."""


@dataclass(frozen=True)
class Consistency:
    """Consistency of the innovations of the full filter."""

    nis_mean: float
    """Normalised innovation squared per degree of freedom; 1 is right."""
    nis_p_value: float
    """Probability of a NIS as far from its mean, on either side, when the model is right."""
    first_nis: float
    """Mean NIS per degree of freedom at the first measurement of each stop: what the turns left."""
    ljung_box_p: float
    """Smallest p-value of the six sensor channels, times six."""
    gyro: Noise
    accel: Noise
    where: tuple[StopMean, ...]
    """Every channel and stop, largest first."""
    seconds: int = 0
    """Epochs that were measured."""


def check(output: PassOutput, prepared: PreparedData, imu: ImuSpecification) -> Consistency:
    """Test the innovations of a finished pass.

    Parameters
    ----------
    imu : ImuSpecification
        Whose white noise the pass took.
    """
    total, dof = float(np.nansum(output.nis)), 3 * int(np.isfinite(output.nis).sum())
    first = prepared.phases.first & (prepared.kind > 0)
    at_first = output.nis[first]
    standard = output.innovation / output.innovation_sigma
    single = prepared
    if prepared.seconds is not None:
        # Of a long test the filter takes longer epochs; single seconds say more of the noise, and of outliers.
        single = replace(prepared, epochs=prepared.seconds[0], phases=prepared.seconds[1])
    sensors = standard[prepared.kind > 0][:, 6:]
    return Consistency(
        nis_mean=total / max(dof, 1),
        nis_p_value=2.0 * min(chi2_tail(total, dof), chi2_head(total, dof)),
        first_nis=float(np.nanmean(at_first) / 3.0) if at_first.size else float("nan"),
        ljung_box_p=ljung_box(sensors),
        gyro=triad_noise(single, single.epochs.w_mean, imu.gyro_white_noise),
        accel=triad_noise(single, single.epochs.f_mean, imu.accel_white_noise),
        where=stop_means(standard, prepared),
        seconds=int((prepared.kind != SKIP).sum() if single is prepared else single.phases.used.sum()),
    )


def ljung_box(series: Floats) -> float:
    """Smallest p-value of the test for white noise over several series, times their number (Bonferroni).

    Source: G. Ljung, G. Box, "On a measure of lack of fit in time series models", Biometrika 65 (1978):
    ``n (n + 2) sum_k r_k^2 / (n - k)`` is chi-square with as many degrees of freedom as lags k.

    Parameters
    ----------
    series : ndarray, shape (n, c)
        One series a column, in any unit.

    Returns
    -------
    float
        1 where the series are too short to test.
    """
    n, count = series.shape
    if n <= 2 * _LAGS:
        return 1.0
    worst = 1.0
    for column in range(count):
        x = series[:, column] - series[:, column].mean()
        r = np.array([float(x[lag:] @ x[:-lag]) for lag in range(1, _LAGS + 1)]) / float(x @ x)
        q = n * (n + 2) * float(np.sum(r**2 / (n - np.arange(1, _LAGS + 1))))
        worst = min(worst, chi2_tail(q, _LAGS))
    return float(min(1.0, worst * count))


def triad_noise(prepared: PreparedData, means: Floats, density: float) -> Noise:
    """Noise of a triad from its epoch means at rest, neighbours of the same stop subtracted.

    Parameters
    ----------
    means : ndarray, shape (e, 3)
        Mean rate (rad/s) or force (m/s^2) of each epoch, as measured; biases and slow effects cancel in the
        differences.
    density : float
        Specified white noise (SI/sqrt(Hz)).
    """
    epochs = prepared.epochs
    good = prepared.phases.used
    pair = good[1:] & good[:-1] & (prepared.phases.stop[1:] == prepared.phases.stop[:-1])
    length = epochs.end - epochs.start
    # Longer epochs are those of a sensor that counts pulses: neighbours share the residue between them, and may differ
    # by much less, or more, than all of them do from what is predicted.
    if pair.sum() < _LEAST_PAIRS or np.median(length[good]) > _ONE_EPOCH * EPOCH_S:
        return NO_NOISE
    sigma = density * np.sqrt(1.0 / length[1:] + 1.0 / length[:-1])
    difference = ((means[1:] - means[:-1]) / sigma[:, None])[pair]
    size = np.abs(difference)
    median = float(np.median(size))
    # Means of pulses take few values, and their median jumps from one to the next.
    counted = float(np.mean(np.abs(size - median) <= _EQUAL * median)) > _TIED
    ratio = float(np.sqrt(np.mean(difference**2))) if counted else _GAUSS_MAD * median
    # An outlier differs from both its neighbours, to the same side.
    at = np.flatnonzero(pair)
    follows = at[1:] == at[:-1] + 1
    far = np.abs(difference) > _OUTLIER * ratio
    both = far[1:] & far[:-1] & (np.sign(difference[1:]) != np.sign(difference[:-1]))
    outliers = at[1:][follows & both.any(axis=1)]
    spread = float(np.sqrt(np.mean(difference**2)))
    kurtosis = float(np.mean(difference**4) / np.mean(difference**2) ** 2)
    # The median absolute deviation has 37 % of the efficiency of the standard deviation; differences share epochs.
    error = 1.4 * ratio / np.sqrt(2 * 0.37 * difference.size)
    slow = _slow(prepared, means) / (spread * density * np.sqrt(2.0 / SLOW_S))
    return Noise(ratio, error, spread, kurtosis, outliers, slow)


def _slow(prepared: PreparedData, means: Floats) -> float:
    """Scatter (rms) of the differences of neighbouring means over `SLOW_S` seconds, of one stop each.

    It is the Allan deviation times the root of two. `means` (e, 3) are those of the epochs.
    """
    phases = prepared.phases
    steps = []
    for stop in np.unique(phases.stop[phases.used]):
        rows = means[phases.used & (phases.stop == stop)]
        whole = len(rows) // SLOW_S
        steps.append(np.diff(rows[: whole * SLOW_S].reshape(whole, SLOW_S, 3).mean(axis=1), axis=0))
    found = np.concatenate(steps)
    if len(found) < _LEAST_PAIRS:
        return float("nan")
    return float(np.sqrt(np.mean(found**2)))


def stop_means(standard: Floats, prepared: PreparedData) -> tuple[StopMean, ...]:
    """Mean innovation of every channel at every stop, over its sigma; largest first.

    Parameters
    ----------
    standard : ndarray, shape (e, 12)
        Innovations over their sigmas (dimensionless); NaN where nothing was measured.
    prepared : PreparedData
        e epochs.

    Returns
    -------
    tuple of StopMean
        The mean over the m epochs of a stop, times the root of m.
    """
    stops, means = means_at_stops(standard, prepared)
    out = [
        StopMean(CHANNEL_NAMES[channel], int(stops[row]), float(means[row, channel]))
        for row, channel in np.argwhere(np.isfinite(means)).tolist()
    ]
    return tuple(sorted(out, key=lambda m: -abs(m.normalised_mean)))
