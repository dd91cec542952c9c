"""What a recording of a set says, as an NPZ file of plain arrays: no code is loaded from it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core.effects.effect import Timetable
from sdimu_calibration.core.estimation.fit import Start
from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.joint.member import Report
from sdimu_calibration.core.joint.reduction import Reduction
from sdimu_calibration.core.joint.stretch_rows import Places
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.storage.files.result_file import as_note
from sdimu_calibration.storage.files.whole_file import beside

FORMAT = "sdimu-reduction/1"


def write_report(path: Path, report: Report) -> None:
    """Write a report beside its place and rename it; the folder is made too."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    found, start = report.reduction, report.start
    words = {
        "format": FORMAT, "name": report.name, "estimator": report.estimator, "reason": report.reason,
        "names": found.names, "labels": found.labels, "rows": found.rows, "unexplained": found.unexplained,
        "imu": vars(report.imu) | {"prior": dict(report.imu.prior), "prior_units": dict(report.imu.prior_units)},
        "start_names": start.names, "start_ns": report.start_ns, "temperature_degc": report.temperature_degc,
        "duration": report.times.duration, "stops": report.times.stops, "turns": report.times.turns,
        "data": dict(report.data), "statistics": report.statistics.entries(), "reported": report.names,
        "notes": report.notes, "warnings": report.warnings, "heading_rad": report.heading_rad,
        "noise": [vars(term) for term in report.noise], "widened": report.widened,
    }  # fmt: skip
    places = {} if report.places is None else {f"dwell_{key}": value for key, value in vars(report.places).items()}
    part = beside(path)
    try:
        with part.open("wb") as file:
            np.savez(
                file, words=np.frombuffer(json.dumps(words).encode(), dtype=np.uint8), A=found.A, y=found.y,
                point=found.point, weight=found.weight, start=start.coefficients, C_nb=start.C_nb, more=start.more,
                values=report.values, sigma=report.sigma, **places,
            )  # fmt: skip
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def read_report(path: Path) -> Report | None:
    """Read a report; None where there is none, or the file is damaged: it is then made again."""
    path = Path(path)
    if not path.is_file():
        return None
    try:
        with np.load(path, allow_pickle=False) as file:
            words = json.loads(file["words"].tobytes())
            return _report(words, {key: file[key] for key in file.files if key != "words"})
    except Exception:
        # Damage shows as errors of zipfile (a member that seems encrypted), of NumPy's headers and of the tokenizer.
        return None


def _report(words: dict[str, Any], arrays: dict[str, Any]) -> Report | None:
    if words["format"] != FORMAT:
        return None
    reduction = Reduction(
        tuple(words["names"]), tuple(words["labels"]), arrays["A"], arrays["y"], arrays["point"], arrays["weight"],
        int(words["rows"]), float(words["unexplained"]),
    )  # fmt: skip
    if reduction.A.shape != (len(reduction.y), len(reduction.names) + len(reduction.labels)):
        return None
    start = Start(tuple(words["start_names"]), arrays["start"], arrays["C_nb"], arrays["more"])
    times = Timetable(words["duration"], _spans(words["stops"]), _spans(words["turns"]))
    heat = words["temperature_degc"]
    return Report(
        words["name"], "", "", reduction, words["estimator"], words["reason"], ImuSpecification(**words["imu"]), start,
        int(words["start_ns"]), times, math.nan if heat is None else float(heat), words["data"],
        FitStatistics(**words["statistics"]),
        tuple(words["reported"]), arrays["values"], arrays["sigma"], tuple(words["notes"]),
        tuple(map(as_note, words["warnings"])),
        float(words["heading_rad"]), tuple(_term(entry) for entry in words["noise"]), bool(words["widened"]),
        _places(arrays),
    )  # fmt: skip


def _places(arrays: dict[str, Any]) -> Places | None:
    own = {key.removeprefix("dwell_"): value for key, value in arrays.items() if key.startswith("dwell_")}
    return Places(**own) if own else None


def _term(entry: dict[str, Any]) -> NoiseTerm:
    return NoiseTerm(**(entry | {"alike": tuple(entry["alike"])}))


def _spans(rows: list[list[float]]) -> tuple[tuple[int, float, float], ...]:
    return tuple((int(k), float(a), float(b)) for k, a, b in rows)
