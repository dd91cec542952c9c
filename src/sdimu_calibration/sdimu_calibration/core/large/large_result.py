"""The result of the filter for errors of percents: as `calibrate`'s, from the passes of `large_errors`."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.batch.batch_data import layout
from sdimu_calibration.core.calibrate import HELD_OUT_FOLDS, conditions, data_counts, outside, poor_fit
from sdimu_calibration.core.filter.filter_pass import ALL, HELD_ALL, HELD_SENSORS, SENSORS
from sdimu_calibration.core.filter.passes import Progress
from sdimu_calibration.core.filter.reduced import Reduced, Setup, first_attitude
from sdimu_calibration.core.filter.rest_found import stops_line
from sdimu_calibration.core.large.large_errors import LargePass, firm_setup, run_stops, solve_large
from sdimu_calibration.core.large.triad import FRAME, TriadModel
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.results import Calibration, History


def large_calibrate(
    recording: Recording, inner: Setup, reduced: Reduced, turned: TriadModel, progress: Progress, held_out: bool
) -> Calibration:
    """Calibrate an IMU with errors of percents.

    Parameters
    ----------
    recording : Recording
    inner : Setup
        With the inner model of `turned`.
    reduced : Reduced
    turned : TriadModel
    progress : callable
    held_out : bool
        Also predict every stop from the others.

    Returns
    -------
    Calibration
        In the accelerometers' frame; its history is that of the last pass.
    """
    start = first_attitude(reduced.epochs, reduced.phases, inner)
    passes, converged = solve_large(inner, reduced, start, progress)
    last, asked = passes[-1], turned.asked
    nis = last.output.nis
    dof = 3 * int(np.isfinite(nis).sum())
    fit = {
        "log_likelihood": float(last.output.log_likelihood.sum()),
        "nis_mean": float(np.nansum(nis) / max(dof, 1)),
        "nis_dof": float(dof),
        "passes": float(len(passes)),
        "held_out_rms": _held_out(reduced, inner, last) if held_out else None,
    }
    warnings = (
        *(f.text for f in reduced.faults if f.grave),
        *poor_fit(fit, converged, reduced, last.output.normalised),
        *outside(inner.sensors, last.estimate),
    )
    told = (
        *recording.notes,
        *stops_line(recording, reduced),
        f"second order counts: {len(passes)} passes about exactly corrected samples, in the accelerometers' frame",
        *(f.text for f in reduced.faults if not f.grave),
    )
    progress("done", 1.0)
    return Calibration(
        body_frame=FRAME,
        model=tuple(e.name for e in asked.effects),
        names=asked.names,
        units=tuple(p.unit for p in asked.parameters),
        display_units=tuple(p.display_unit for p in asked.parameters),
        values=turned.values(last.estimate),
        covariance=turned.covariance(last.covariance),
        fit=fit,
        data=data_counts(recording, reduced) | {"conditions": conditions(inner)},
        notes=(*told, *warnings),
        history=_history(reduced, last, turned),
        warnings=warnings,
        faults=reduced.faults,
    )


def _held_out(reduced: Reduced, setup: Setup, last: LargePass) -> float | None:
    """RMS of normalised prediction errors at stops left out, as `calibrate.held_out_rms`."""
    stops = np.unique(reduced.phases.stop[reduced.phases.used])
    white = []
    for fold in range(HELD_OUT_FOLDS):
        out = np.isin(reduced.phases.stop, stops[1:][fold::HELD_OUT_FOLDS]) & (reduced.kind > 0)
        kind = reduced.kind.copy()
        kind[out & (kind == SENSORS)] = HELD_SENSORS
        kind[out & (kind == ALL)] = HELD_ALL
        _, output, _ = run_stops(
            last.data._replace(kind=kind), firm_setup(setup), last.start, reduced, layout(reduced), last.C_stop
        )
        white.append(output.normalised[out].ravel())
    found = np.concatenate(white)
    found = found[np.isfinite(found)]
    return float(np.sqrt(np.mean(found**2))) if len(found) else None


def _history(reduced: Reduced, last: LargePass, turned: TriadModel) -> History:
    """History of the last pass, at the epochs whose covariance was kept."""
    rows, out = last.rows, last.output
    variance = np.diagonal(turned.covariance(out.covariance), axis1=1, axis2=2)
    return History(
        reduced.epochs.end[rows],
        turned.values(last.reference + out.estimate[rows]),
        np.sqrt(variance),
        out.sigma[rows, 6:9],
        reduced.phases.stop[rows],
        reduced.phases.dwell[rows],
        reduced.phases.used[rows],
        out.nis[rows],
    )
