"""Figures that say how wrong a model is: each defined once, whoever shows it (doc/figures-of-error.md)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.results import Calibration


def held_out(result: Calibration) -> float:
    """RMS of the normalised prediction errors where the fit has not seen the data; 1 is right, NaN if not computed.

    In the white noise of the IMU's file, so that models compare; `held_out_judged` is the one that judges a fit.
    Stops of a table are left out a third at a time, rests of a hand one at a time, recordings of a set one at a time.
    """
    return _number(result.fit.get("held_out_rms"))


def nis(result: Calibration) -> float:
    """Mean of the squared normalised innovations of the last pass in white noise; 1 is right, NaN if not computed."""
    return _number(result.fit.get("nis_mean"))


def degrees_of_freedom(result: Calibration) -> float:
    """Count the innovations of `nis` (1); NaN if not computed."""
    return _number(result.fit.get("nis_dof"))


def noise_learned(result: Calibration) -> bool:
    """Whether the result has figures in noise with a memory, beside those in the white noise of the IMU's file."""
    return result.fit.get("held_out_in_noise") is not None


def held_out_judged(result: Calibration) -> float:
    """Held-out error that judges a fit, in the noise that was learned where any was; NaN if not computed."""
    return _number(result.fit.get("held_out_in_noise")) if noise_learned(result) else held_out(result)


def nis_judged(result: Calibration) -> float:
    """NIS that judges a fit, in the noise that was learned where any was; NaN if not computed."""
    return _number(result.fit.get("nis_in_noise")) if noise_learned(result) else nis(result)


def log_likelihood(result: Calibration) -> float:
    """Log-likelihood of the recording under the model; NaN if not computed."""
    return _number(result.fit.get("log_likelihood"))


def held_out_ladder(results: Sequence[Calibration]) -> list[float]:
    """Held-out error of models of one recording, in sigmas that compare.

    A handheld fit learns the scatter that its errors are held against, so all of them are held against that of the
    last.

    `results`: the simplest model first.
    """
    if not all(is_handheld(result) for result in results):
        return [held_out(result) for result in results]
    scale = np.array([rest.ahead_sigma for rest in results[-1].rests])
    return [
        float(np.sqrt(np.mean((np.array([rest.ahead for rest in result.rests]) / scale) ** 2)))
        if 0 < len(result.rests) == len(scale)
        else float("nan")
        for result in results
    ]


def is_handheld(result: Calibration) -> bool:
    """Whether a result is of a run by hand."""
    return result.estimator == "handheld"


def _number(value: float | None) -> float:
    return float("nan") if value is None else float(value)
