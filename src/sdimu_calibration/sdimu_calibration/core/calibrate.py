"""The orchestrator: (recording, site, IMU, model) -> Calibration. The live node ends with the same call."""

from __future__ import annotations

from dataclasses import replace
from zlib import crc32

import numpy as np

from sdimu_calibration.core.alignment.prepared import (
    ALL,
    HELD_ALL,
    HELD_SENSORS,
    SENSORS,
    PreparedData,
    TestSetup,
    reduce,
    set_up,
    stops_line,
)
from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.effects.accelerometer_frame import FRAME, accelerometer_frame_model, drifting, squares_count
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.filter.azimuth_known import azimuth_note, azimuth_warning
from sdimu_calibration.core.filter.filter_pass import PassState, new_output, run_pass
from sdimu_calibration.core.filter.passes import Pass, Solution, pass_settings, solve
from sdimu_calibration.core.filter.stop_misfit import stop_misfit
from sdimu_calibration.core.progress import Progress, silent
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.results import Calibration, History
from sdimu_calibration.core.specification import ImuSpecification, Model, Site

NOT_CONVERGED = "the passes did not come to rest: the estimate is not trustworthy; check --imu and --site"
_ABSURD = 1e3
_MISFIT = 1.2
"""NIS per degree of freedom, and held-out error, from which a user is told."""
_OUTSIDE = 4.5
"""Prior sigmas beyond which a coefficient is told."""
HELD_OUT_FOLDS = 3
"""Every stop is held out once, in this many groups of stops."""


def calibrate(
    recording: Recording,
    site: Site,
    imu: ImuSpecification,
    model: Model,
    progress: Progress | None = None,
    held_out: bool = True,
) -> Calibration:
    """Calibrate an IMU from one recording.

    Parameters
    ----------
    recording : Recording
    site : Site
    imu : ImuSpecification
        Noise densities and priors.
    model : Model
        Effects to estimate, weights of the measurements, frame of the report.
    progress : callable, optional
        Called with a word and the fraction done.
    held_out : bool
        Also predict every stop from the others (costs `HELD_OUT_FOLDS` passes).

    Returns
    -------
    Calibration

    Raises
    ------
    DataError
        When the recording or the options cannot be used.
    """
    tell = progress or silent
    setup = set_up(site, imu, model)
    tell("reduce", 0.0)
    prepared = reduce(recording, setup)
    turned = accelerometer_frame_model(setup.sensors, imu) if _large(setup, float(recording.t[-1])) else None
    if turned is not None:
        from sdimu_calibration.core.second_order.second_order_result import second_order_calibrate  # noqa: PLC0415 (built on this file)

        return second_order_calibrate(recording, replace(setup, sensors=turned.inner), prepared, turned, tell, held_out)
    solution = solve(setup, prepared, tell)
    result = assemble(recording, solution, held_out)
    tell("done", 1.0)
    return result


def _large(setup: TestSetup, duration: float) -> bool:
    """Tell whether squares count: of the errors, or of the attitude that the gyros lose over the test (s)."""
    turns = setup.model.body_frame == FRAME
    return squares_count(setup.sensors) or (turns and drifting(setup.sensors, setup.imu, setup.gravity, duration))


def assemble(recording: Recording, solution: Solution, held_out: bool) -> Calibration:
    """Put a result together in the reported body frame."""
    setup, prepared, last = solution.setup, solution.prepared, solution.last
    names, frame = setup.sensors.names, setup.model.body_frame
    fit = fit_statistics(last)
    fit["passes"] = float(solution.passes)
    fit["held_out_rms"] = held_out_rms(prepared, setup, last) if held_out else None
    J = body_frame.frame_jacobian(names, frame)
    warnings = (*(f.text for f in prepared.faults if f.grave), *_warnings(solution, fit))
    heading = azimuth_note(solution)
    told = (*recording.notes, *stops_line(recording, prepared), *([heading] if heading else []))
    return Calibration(
        body_frame=frame,
        model=tuple(e.key for e in setup.sensors.effects),
        names=names,
        units=tuple(p.unit for p in setup.sensors.parameters),
        display_units=tuple(p.display_unit for p in setup.sensors.parameters),
        values=body_frame.values_in_frame(names, last.estimate, frame),
        covariance=J @ last.covariance @ J.T,
        fit=fit,
        data=data_counts(recording, prepared) | {"conditions": conditions(setup)},
        notes=(*told, *(f.text for f in prepared.faults if not f.grave), *warnings),
        history=history(prepared, setup, solution.first),
        warnings=warnings,
        faults=prepared.faults,
    )


def _warnings(solution: Solution, fit: dict[str, float | None]) -> list[str]:
    """Say what speaks against the estimate."""
    last, sensors = solution.last, solution.setup.sensors
    azimuth = azimuth_warning(solution)
    return [
        *poor_fit(fit, solution.converged, solution.prepared, last.output.normalised),
        *([azimuth] if azimuth else []),
        *outside(sensors, last.estimate),
    ]


def poor_fit(fit: dict[str, float | None], converged: bool, prepared: PreparedData, normalised: Floats) -> list[str]:
    """Say in what the data do not fit the model; `normalised` are the whitened innovations of all epochs.

    Raises
    ------
    DataError
        When there is no fit at all.
    """
    nis, held_out = fit["nis_mean"] or 0.0, fit["held_out_rms"]
    lost = int(prepared.cycles.lost.sum())
    in_turn = f"; {lost} samples are missing by their stamps" if lost else ""
    if nis > _ABSURD:
        raise DataError(
            f"the recording contradicts the model: squared innovations are {nis:.3g} times what the noise explains"
            f"{in_turn}; check --imu, --site, units and axes"
        )
    out = [] if converged else [NOT_CONVERGED]
    if nis > _MISFIT or (held_out is not None and held_out > _MISFIT):
        text = f"NIS {nis:.3f}" + ("" if held_out is None else f", held-out error {held_out:.3f}")
        out.append(f"the model does not fit ({text}; 1 is right){in_turn}; run: sdimu diagnose")
    worst = stop_misfit(normalised, prepared)
    return [*out, worst] if worst else out


def outside(sensors: ImuModel, estimate: Floats) -> list[str]:
    """Name the coefficient, of `estimate` (p,), that is furthest from what the specification allows, if it is."""
    size = np.abs(estimate) / sensors.stated
    worst = int(np.argmax(size))
    if size[worst] <= _OUTSIDE:
        return []
    return [f"{sensors.names[worst]} is {size[worst]:.1f} times the sigma of the specification"]


def fit_statistics(finished: Pass) -> dict[str, float | None]:
    """Log-likelihood and mean normalised innovation squared of a pass."""
    nis = finished.output.nis
    dof = 3 * int(np.isfinite(nis).sum())
    return {
        "log_likelihood": float(finished.output.log_likelihood.sum()),
        "nis_mean": float(np.nansum(nis) / max(dof, 1)),
        "nis_dof": float(dof),
    }


def held_out_rms(prepared: PreparedData, setup: TestSetup, last: Pass) -> float | None:
    """RMS of normalised prediction errors at stops that the fit has not seen.

    The first stop stays in every fit (it gives the attitude); the others are left out in turn, in
    `HELD_OUT_FOLDS` interleaved groups. None when there are fewer than two stops.
    """
    stops = np.unique(prepared.phases.stop[prepared.phases.used])
    if len(stops) < 2:
        return None
    total, count = 0.0, 0
    for fold in range(HELD_OUT_FOLDS):
        out = np.isin(prepared.phases.stop, stops[1:][fold::HELD_OUT_FOLDS]) & (prepared.kind > 0)
        if not out.any():
            continue
        held = predict_stops(prepared, setup, last, out)
        white = held.output.normalised[out]
        total += float(np.nansum(white**2))
        count += int(np.isfinite(white).sum())
    return float(np.sqrt(total / count)) if count else None


def predict_stops(prepared: PreparedData, setup: TestSetup, last: Pass, out: Bools) -> Pass:
    """Repeat the last pass with the epochs `out` (m,) predicted and scored but not taken."""
    kind = prepared.kind.copy()
    kind[out & (kind == SENSORS)] = HELD_SENSORS
    kind[out & (kind == ALL)] = HELD_ALL
    state = PassState(*(v.copy() for v in last.start))
    output = new_output(len(prepared.epochs), len(setup.sensors.prior), False, len(prepared.epochs))
    run_pass(last.data._replace(kind=kind), pass_settings(setup, closed_loop=False), state, output)
    return replace(last, state=state, output=output)


def data_counts(recording: Recording, prepared: PreparedData) -> dict[str, float]:
    """Count what the data section of a result says."""
    phases, epochs = prepared.phases, prepared.epochs
    log = recording.temperature
    # Temperature effects count from the start of this recording; who uses the result needs to know from where.
    start = {} if log is None or not len(log.t) else {"start_temperature_degc": float(log.value[0])}
    return start | {
        "samples": float(len(recording.t)),
        "checksum": checksum(recording.t, recording.omega_ib_b, recording.f_ib_b),
        "lost": float(prepared.cycles.lost.sum()),
        "rejected": float(recording.rejected),
        "contradicted_s": float((epochs.end - epochs.start)[phases.contradicted].sum()),
        "duration_s": float(recording.t[-1]),
        "stops": float(len(np.unique(phases.stop[phases.used]))),
    }


def checksum(*arrays: Floats) -> float:
    """Give a number that other samples do not have: the same recording is known again by it."""
    value = 0
    for array in arrays:
        value = crc32(np.ascontiguousarray(array).tobytes(), value)
    return float(value)


def conditions(setup: TestSetup) -> float:
    """Give a number that another site or other noise densities do not have: they change what a likelihood means."""
    site, imu = setup.site, setup.imu
    place = (site.latitude_rad, site.height_m, setup.gravity)
    return checksum(np.array([*place, imu.gyro_white_noise, imu.accel_white_noise]))


def history(prepared: PreparedData, setup: TestSetup, first: Pass) -> History:
    """History of the closed-loop pass in the reported frame, at the epochs whose covariance was kept."""
    names, frame = setup.sensors.names, setup.model.body_frame
    J = body_frame.frame_jacobian(names, frame)
    out, phases = first.output, prepared.phases
    rows = np.arange(0, len(prepared.epochs), out.stride)
    variance = np.einsum("ij,kjl,il->ki", J, out.covariance[: len(rows)], J)
    return History(
        prepared.epochs.end[rows],
        np.array([body_frame.values_in_frame(names, v, frame) for v in out.estimate[rows]]),
        np.sqrt(variance),
        out.sigma[rows, 6:9],
        phases.stop[rows],
        phases.dwell[rows],
        phases.used[rows],
        out.nis[rows],
    )
