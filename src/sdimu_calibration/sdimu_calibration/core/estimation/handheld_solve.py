"""From a handheld test and a model to a fit, with room where the data contradict the priors of the IMU file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.alignment.prepared import check_priors
from sdimu_calibration.core.effects import imu_model
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.effects.references import stated_gravity
from sdimu_calibration.core.estimation.fit import Start
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.handheld.contradicted_priors import GAIN, contradicted, widest_priors
from sdimu_calibration.core.handheld.handheld_fit import LinearisationPoint, fit_run
from sdimu_calibration.core.handheld.handheld_scene import first_linearisation, fit_priors
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.wording import Option


def solve_handheld(test: PreparedTest, model: Model, start: Start | None, progress: Progress) -> HandheldFit:
    """Fit a handheld run.

    Parameters
    ----------
    start : Start or None
        Where a fit of nearly the same model ended: its priors stand. None tries wider ones too.
    """
    if test.assumed_site:
        raise DataError(
            f"the test was opened for navigation at the assumed site {test.assumed_site}, and a handheld fit takes no "
            "assumed site: in Python, state the site or open the test with open(..., handheld=True)"
        )
    check_priors(test.imu)
    progress("rests", 0.1)
    wide = widest_priors(test.imu, imu_model.build(model.effects, test.imu))
    if start is not None or wide is test.imu:
        return _fit(test, model, start, progress)
    try:
        fit: HandheldFit | None = _fit(test, model, None, progress)
    except DataError:
        fit = None
    try:
        free = _fit(test.with_imu(wide), model, None, progress)
    except DataError:
        if fit is None:
            raise
        return fit
    beyond = contradicted(test.imu, free.sensors, free.values, np.sqrt(np.diag(free.covariance)))
    if not beyond:
        return _fit(test, model, None, progress) if fit is None else fit
    roomy = test.with_imu(replace(test.imu, prior={**test.imu.prior, **beyond}))
    again = _fit(_told(roomy, test, free.sensors, beyond), model, None, progress)
    if fit is not None and again.statistics().log_likelihood < fit.statistics().log_likelihood + GAIN:
        return fit
    return again


def _told(roomy: PreparedTest, test: PreparedTest, sensors: ImuModel, wider: Mapping[str, float]) -> PreparedTest:
    """Note which priors of the IMU file the data contradict."""
    parts = []
    for effect in sensors.effects:
        name, unit = effect.family or effect.name, effect.parameters[0].display_unit
        before = max((size for size in imu_model.prior_sizes(effect, test.imu) if size), default=None)
        if name in wider and before is not None:
            parts.append(f"{name} {from_si(before, unit):.3g} -> {from_si(wider[name], unit):.2g} {unit}")
    note = (
        f"the data contradict priors of IMU '{test.imu.name}', which are widened: {', '.join(parts)}; if the IMU is of "
        f"another class, name its file ({Option.IMU})"
    )
    return replace(roomy, recording=replace(roomy.recording, notes=(*roomy.recording.notes, note)))


def _fit(test: PreparedTest, model: Model, start: Start | None, progress: Progress) -> HandheldFit:
    sensors = imu_model.build(model.effects, test.imu)
    inner, ready = imu_model.with_references(sensors, stated_gravity(test.site)), test.run
    priors = fit_priors(inner, test.imu, test.site, ready.rests)
    progress("least squares", 0.3)
    if start is None:
        point = first_linearisation(ready.run, inner, priors.gravity)
    else:
        point = LinearisationPoint(
            start.coefficients_of(inner.names), start.C_nb, start.more[:3].copy(), start.more[3:].copy()
        )
    return HandheldFit(test, model, sensors, ready, priors, fit_run(ready.run, priors, point, test.scatter))
