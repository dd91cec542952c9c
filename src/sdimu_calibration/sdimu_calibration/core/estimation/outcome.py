"""From a fit to the result that is written, shown and used: the one builder of `Calibration`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.blocks import let_go
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import AUTO, solve
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.origin import Origin, measured
from sdimu_calibration.core.progress import Progress, silent
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.results import INSEPARABLE, Calibration
from sdimu_calibration.core.specification import ImuSpecification, Model, Site

_ONE = 0.9995
"""Correlation (1) from which two coefficients are one: each then has thirty times the sigma it would have alone."""
WIDER = 1.2
"""Ratio of a sigma to the one if the model is right, from which a note reports it: less is seen in no use of it."""


def outcome(fit: Fit, held_out: bool = True, refuse: bool = True) -> Calibration:
    """Put a result together, in the body frame of the fit.

    Parameters
    ----------
    held_out : bool
        Also predict every stop from the others (costs some passes).
    refuse : bool
        Refuse a model that does not fit at all; False warns of it, for one whose missing effect is known.
    """
    statistics = replace(fit.statistics(), held_out_rms=fit.held_out_rms() if held_out else None)
    parameters = fit.sensors.parameters
    covariance = fit.covariance
    grave = (f.text for f in fit.faults if f.grave)
    against = fit.contradiction(statistics)
    if against and refuse:
        raise DataError(against)
    absurd = (against,) if against else ()
    warnings = (*grave, *absurd, *fit.warnings(statistics), *inseparable(fit.names, fit.covariance_at_site))
    light = tuple(f.text for f in fit.faults if not f.grave)
    return Calibration(
        body_frame=fit.body_frame,
        model=tuple(e.key for e in fit.sensors.effects),
        names=fit.names,
        units=tuple(p.unit for p in parameters),
        display_units=tuple(p.display_unit for p in parameters),
        values=fit.values,
        covariance=covariance,
        fit=statistics.entries(),
        data=fit.data_counts(),
        notes=(*fit.test.recording.notes, *fit.notes(), *light, *warnings),
        history=fit.history(),
        warnings=warnings,
        faults=fit.faults,
        estimator=fit.estimator,
        estimator_reason=fit.reason,
        noise=fit.noise_terms,
        drift_means=fit.drift_means,
        rests=fit.rests(),
        origin=_origin(fit),
        imu_noise=fit.test.imu.noise_alone,
        references=fit.references(),
    )


def _origin(fit: Fit) -> Origin:
    """Return the origin with what the samples say; those that lie in a file are let go again."""
    recording = fit.test.recording
    out = measured(fit.test.origin, recording, fit.test.imu.name)
    let_go(recording.omega_ib_b, recording.f_ib_b)
    return replace(out, effect_files=effect_files(fit))


def effect_files(fit: Fit) -> tuple[str, ...]:
    """Paths of the files that effects of the model were read from."""
    return tuple(dict.fromkeys(effect.file for effect in fit.sensors.effects if effect.file))


def inseparable(names: Sequence[str], covariance: Floats) -> list[Note]:
    """Name the coefficients that the data do not tell from each other, one line for a pair.

    Parameters
    ----------
    names : sequence of str, length p
    covariance : ndarray, shape (p, p)
        SI.
    """
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    unit = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0.0)
    correlation = np.triu(np.abs(covariance * np.outer(unit, unit)), 1)
    return [
        Note(
            f"{names[i]} and {names[j]} {INSEPARABLE} in this test (correlation "
            f"{correlation[i, j]:.5f}): their sum is known, neither of them is; take one out of the model",
            Topic.INSEPARABLE,
        )
        for i, j in np.argwhere(correlation > _ONE).tolist()
    ]


def doubted(result: Calibration, values: Floats, covariance: Floats) -> Calibration:
    """Put mean and covariance over all probable models in the place of those if the model is right.

    Parameters
    ----------
    result : Calibration
        If the model is right.
    values : ndarray, shape (p,)
        SI.
    covariance : ndarray, shape (p, p)
    """
    conditional = np.sqrt(np.diag(result.covariance))
    free = conditional > 0.0
    ratio = np.ones(len(conditional))
    ratio[free] = np.sqrt(np.diag(covariance))[free] / conditional[free]
    worst = int(np.argmax(ratio))
    note = (
        "sigmas hold for the models that the data leave open, too: that of "
        f"{result.names[worst]} is {ratio[worst]:.1f} times what it would be if this model were known to be right"
    )
    told = (note,) if ratio[worst] > WIDER else ()
    return replace(
        result, values=values, covariance=covariance, conditional_sigma=conditional, notes=(*result.notes, *told)
    )


def calibrate(
    recording: Recording,
    site: Site | None,
    imu: ImuSpecification,
    model: Model,
    progress: Progress = silent,
    held_out: bool = True,
    estimator: str = AUTO,
) -> Calibration:
    """Solve and put the result together.

    Parameters
    ----------
    recording, site, imu
        As in `PreparedTest`.
    model, progress, estimator
        As for `solve`.
    held_out : bool
        As for `outcome`.
    """
    result = outcome(solve(PreparedTest(recording, imu, site), model, estimator, progress=progress), held_out)
    progress("done", 1.0)
    return result
