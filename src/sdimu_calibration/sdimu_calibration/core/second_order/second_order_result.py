"""The result of the filter for errors of percents: as `calibrate`'s, from the passes of `second_order_passes`."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.alignment.prepared import (
    ALL,
    HELD_ALL,
    HELD_SENSORS,
    SENSORS,
    PreparedData,
    TestSetup,
    first_attitude,
    stops_line,
)
from sdimu_calibration.core.alignment.rest_means import layout
from sdimu_calibration.core.calibrate import HELD_OUT_FOLDS, conditions, data_counts, outside, poor_fit
from sdimu_calibration.core.effects.accelerometer_frame import FRAME, AccelerometerFrameModel
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.results import Calibration, History
from sdimu_calibration.core.second_order.second_order_passes import (
    SecondOrderPass,
    firm_setup,
    run_stops,
    solve_second_order,
)


def second_order_calibrate(
    recording: Recording,
    inner: TestSetup,
    prepared: PreparedData,
    turned: AccelerometerFrameModel,
    progress: Progress,
    held_out: bool,
) -> Calibration:
    """Calibrate an IMU with errors of percents.

    Parameters
    ----------
    recording : Recording
    inner : TestSetup
        With the inner model of `turned`.
    prepared : PreparedData
    turned : AccelerometerFrameModel
    progress : callable
    held_out : bool
        Also predict every stop from the others.

    Returns
    -------
    Calibration
        In the accelerometers' frame; its history is that of the last pass.
    """
    start = first_attitude(prepared.epochs, prepared.phases, inner)
    passes, converged = solve_second_order(inner, prepared, start, progress)
    last, asked = passes[-1], turned.asked
    nis = last.output.nis
    dof = 3 * int(np.isfinite(nis).sum())
    fit = {
        "log_likelihood": float(last.output.log_likelihood.sum()),
        "nis_mean": float(np.nansum(nis) / max(dof, 1)),
        "nis_dof": float(dof),
        "passes": float(len(passes)),
        "held_out_rms": _held_out(prepared, inner, last) if held_out else None,
    }
    warnings = (
        *(f.text for f in prepared.faults if f.grave),
        *poor_fit(fit, converged, prepared, last.output.normalised),
        *outside(inner.sensors, last.estimate),
    )
    told = (
        *recording.notes,
        *stops_line(recording, prepared),
        f"second order counts: {len(passes)} passes about exactly corrected samples, in the accelerometers' frame",
        *(f.text for f in prepared.faults if not f.grave),
    )
    progress("done", 1.0)
    return Calibration(
        body_frame=FRAME,
        model=tuple(e.key for e in asked.effects),
        names=asked.names,
        units=tuple(p.unit for p in asked.parameters),
        display_units=tuple(p.display_unit for p in asked.parameters),
        values=turned.values(last.estimate),
        covariance=turned.covariance(last.covariance),
        fit=fit,
        data=data_counts(recording, prepared) | {"conditions": conditions(inner)},
        notes=(*told, *warnings),
        history=_history(prepared, last, turned),
        warnings=warnings,
        faults=prepared.faults,
    )


def _held_out(prepared: PreparedData, setup: TestSetup, last: SecondOrderPass) -> float | None:
    """RMS of normalised prediction errors at stops left out, as `calibrate.held_out_rms`."""
    stops = np.unique(prepared.phases.stop[prepared.phases.used])
    white = []
    for fold in range(HELD_OUT_FOLDS):
        out = np.isin(prepared.phases.stop, stops[1:][fold::HELD_OUT_FOLDS]) & (prepared.kind > 0)
        kind = prepared.kind.copy()
        kind[out & (kind == SENSORS)] = HELD_SENSORS
        kind[out & (kind == ALL)] = HELD_ALL
        _, output, _ = run_stops(
            last.data._replace(kind=kind), firm_setup(setup), last.start, prepared, layout(prepared), last.C_stop
        )
        white.append(output.normalised[out].ravel())
    found = np.concatenate(white)
    found = found[np.isfinite(found)]
    return float(np.sqrt(np.mean(found**2))) if len(found) else None


def _history(prepared: PreparedData, last: SecondOrderPass, turned: AccelerometerFrameModel) -> History:
    """History of the last pass, at the epochs whose covariance was kept."""
    rows, out = last.rows, last.output
    variance = np.diagonal(turned.covariance(out.covariance), axis1=1, axis2=2)
    return History(
        prepared.epochs.end[rows],
        turned.values(last.reference + out.estimate[rows]),
        np.sqrt(variance),
        out.sigma[rows, 6:9],
        prepared.phases.stop[rows],
        prepared.phases.dwell[rows],
        prepared.phases.used[rows],
        out.nis[rows],
    )
