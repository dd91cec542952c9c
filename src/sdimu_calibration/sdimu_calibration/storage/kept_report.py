"""What a recording of a set said, kept as a file: the reduction, and what belongs to it, as plain arrays.

The first line is the format, the number of the job (`set_work.job_number`: recording, question and program) and a
digest of number and content. A file of another job, or of which a byte has changed, is not believed: its reduction is
made anew.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import zipfile
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
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.storage.files.result_file import as_note
from sdimu_calibration.storage.files.whole_file import beside

REPORT_FORMAT = "sdimu-reduction/3"
"""What a recording says: a line, then an NPZ file of plain arrays; no code is loaded from it."""
SUFFIX = ".reduction"
LONGEST = 1 << 28
"""Bytes of a kept report at most: a recording of a day with all candidates has a fifth."""


def write_report(path: Path, report: Report, number: str) -> None:
    """Write a report of a job beside its place and rename it; the folder is made too.

    Parameters
    ----------
    number : str
        Of the job that it answers.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    found, start = report.reduction, report.start
    words = {
        "format": REPORT_FORMAT,
        "name": report.name,
        "estimator": report.estimator,
        "reason": report.reason,
        "names": found.names,
        "labels": found.labels,
        "rows": found.rows,
        "unexplained": found.unexplained,
        "imu": vars(report.imu) | {"prior": dict(report.imu.prior), "prior_units": dict(report.imu.prior_units)},
        "start_names": start.names,
        "start_ns": report.start_ns,
        "temperature_degc": report.temperature_degc,
        "duration": report.times.duration,
        "stops": report.times.stops,
        "turns": report.times.turns,
        "data": dict(report.data),
        "statistics": report.statistics.entries(),
        "reported": report.names,
        "notes": report.notes,
        "warnings": report.warnings,
        "heading_rad": report.heading_rad,
        "noise": [vars(term) for term in report.noise],
        "widened": report.widened,
        "site": None if report.site is None else vars(report.site),
    }
    places = {} if report.places is None else {f"dwell_{key}": value for key, value in vars(report.places).items()}
    content = io.BytesIO()
    np.savez(
        content,
        words=np.frombuffer(json.dumps(words).encode(), dtype=np.uint8),
        A=found.A,
        y=found.y,
        point=found.point,
        weight=found.weight,
        start=start.coefficients,
        C_nb=start.C_nb,
        more=start.more,
        values=report.values,
        sigma=report.sigma,
        **places,
    )
    part = beside(path)
    try:
        part.write_bytes(_first_line(number, content.getvalue()) + content.getvalue())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def read_report(path: Path, number: str) -> Report | None:
    """Read the report of a job; None where there is none, or the file is damaged or of another: it is made again."""
    path = Path(path)
    try:
        if not path.is_file() or path.stat().st_size > LONGEST:
            return None
        whole = path.read_bytes()
        content = whole[whole.find(b"\n") + 1 :]
        if whole[: -len(content)] != _first_line(number, content):
            return None
        return _unpacked(content)
    except Exception:
        # Damage shows as errors of zipfile (a member that seems encrypted), of NumPy's headers and of the tokenizer.
        return None


def _first_line(number: str, content: bytes) -> bytes:
    """Format, number of the job, and a digest of all three."""
    digest = hashlib.sha256(f"{REPORT_FORMAT} {number}\n".encode() + content).hexdigest()
    return f"{REPORT_FORMAT} {number} {digest}\n".encode()


def _unpacked(content: bytes) -> Report | None:
    with zipfile.ZipFile(io.BytesIO(content)) as members:
        # Arrays are stored as they are: what unpacks to more is no report.
        if sum(member.file_size for member in members.infolist()) > len(content):
            return None
    with np.load(io.BytesIO(content), allow_pickle=False) as file:
        words = json.loads(file["words"].tobytes())
        return _report(words, {key: file[key] for key in file.files if key != "words"})


def _report(words: dict[str, Any], arrays: dict[str, Any]) -> Report | None:
    if words["format"] != REPORT_FORMAT:
        return None
    reduction = Reduction(
        tuple(words["names"]),
        tuple(words["labels"]),
        arrays["A"],
        arrays["y"],
        arrays["point"],
        arrays["weight"],
        int(words["rows"]),
        float(words["unexplained"]),
    )
    if reduction.A.shape != (len(reduction.y), len(reduction.names) + len(reduction.labels)):
        return None
    start = Start(tuple(words["start_names"]), arrays["start"], arrays["C_nb"], arrays["more"])
    times = Timetable(words["duration"], _spans(words["stops"]), _spans(words["turns"]))
    heat = words["temperature_degc"]
    return Report(
        words["name"],
        "",
        "",
        reduction,
        words["estimator"],
        words["reason"],
        ImuSpecification(**words["imu"]),
        start,
        int(words["start_ns"]),
        times,
        math.nan if heat is None else float(heat),
        words["data"],
        FitStatistics(**words["statistics"]),
        tuple(words["reported"]),
        arrays["values"],
        arrays["sigma"],
        tuple(words["notes"]),
        tuple(map(as_note, words["warnings"])),
        float(words["heading_rad"]),
        tuple(_term(entry) for entry in words["noise"]),
        bool(words["widened"]),
        _places(arrays),
        _site(words["site"]),
    )


def _places(arrays: dict[str, Any]) -> Places | None:
    own = {key.removeprefix("dwell_"): value for key, value in arrays.items() if key.startswith("dwell_")}
    return Places(**own) if own else None


def _site(entry: dict[str, Any] | None) -> Site | None:
    if entry is None:
        return None
    field = entry["magnetic_field_t"]
    return Site(**(entry | {"magnetic_field_t": None if field is None else tuple(field)}))


def _term(entry: dict[str, Any]) -> NoiseTerm:
    return NoiseTerm(**(entry | {"alike": tuple(entry["alike"])}))


def _spans(rows: list[list[float]]) -> tuple[tuple[int, float, float], ...]:
    return tuple((int(k), float(a), float(b)) for k, a, b in rows)
