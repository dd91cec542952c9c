"""What a joint fit says beyond its coefficients, as part of result.json; the diagnosis of a set as set.json."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.joint.recurrence import Recurrence
from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis
from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.results import (
    PowerOnDeviation,
    SetRecording,
    SetSummary,
    SetTrend,
    TurnOn,
)
from sdimu_calibration.storage.files.advice_words import sentence
from sdimu_calibration.storage.files.diagnosis_file import alone
from sdimu_calibration.storage.files.json_file import read_json, write_json
from sdimu_calibration.storage.files.standing_file import as_plain as standing_as_plain

FORMAT = "sdimu-set-diagnosis/1"


def as_plain(of_set: SetSummary) -> dict[str, Any]:
    """Give entries of result.json, SI: ``turn_on``, ``recordings``, ``power_ons``, ``scatter_p``, ``trends``."""
    return {
        "turn_on": [asdict(t) | {"triad": t.effect.partition("_")[0]} for t in of_set.turn_on],
        "recordings": [
            {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in vars(r).items()}
            for r in of_set.recordings
        ],
        "power_ons": [asdict(d) for d in of_set.deviations],
        "scatter_p": of_set.scatter_p.tolist(),
        "trends": [asdict(t) for t in of_set.trends],
        "left_out": [list(pair) for pair in of_set.left_out],
    }


def from_plain(content: Mapping[str, Any], count: int) -> SetSummary | None:
    """Read the entries back; None where the result is of one recording.

    Parameters
    ----------
    content : mapping
        Of result.json.
    count : int
        Number of coefficients.
    """
    if not content.get("recordings"):
        return None
    return SetSummary(
        tuple(_recording(entry, count) for entry in content["recordings"]),
        tuple(TurnOn(**_of(TurnOn, entry)) for entry in content.get("turn_on", ())),
        tuple(PowerOnDeviation(**_of(PowerOnDeviation, entry)) for entry in content.get("power_ons", ())),
        _numbers(content.get("scatter_p", ()), count),
        tuple(SetTrend(**_of(SetTrend, entry)) for entry in content.get("trends", ())),
        tuple((one_line(str(name)), one_line(str(why))) for name, why in content.get("left_out", ())),
    )


def _of(kind: Any, entry: Mapping[str, Any]) -> dict[str, Any]:
    """Entries that a class has: numbers as numbers (``null`` is NaN), words on one line."""
    out: dict[str, Any] = {}
    for name, expected in kind.__annotations__.items():
        value = entry[name]
        out[name] = one_line(str(value)) if expected == "str" else _number(value)
    return out


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)


def _numbers(values: Sequence[Any], count: int) -> Floats:
    found = np.array([_number(v) for v in values])
    if found.shape != (count,):
        raise ValueError(f"expected {count} numbers, found {len(found)}")
    return found


def _recording(entry: Mapping[str, Any], count: int) -> SetRecording:
    arrays = {key: _numbers(entry[key], count) for key in ("values", "sigma", "deviate")}
    return SetRecording(**(_of(_Plain, entry) | {"start_ns": int(entry["start_ns"])} | arrays))


class _Plain:
    """Entries of a recording that are no arrays."""

    name: str
    serial: str
    power_on: str
    temperature_degc: float
    duration_s: float
    samples: float
    nis: float


def write_set_diagnosis(path: Path, found: SetDiagnosis) -> None:
    """Write set.json: verdict, sentence, findings (SI), advice, what is known of the unit, and what comes back."""
    write_json(
        Path(path),
        {
            "format": FORMAT, "verdict": found.verdict, "sentence": found.sentence, "threshold": found.threshold,
            "findings": [asdict(f) | {"alike": list(f.alike)} for f in found.findings],
            "refused": [f.label for f in found.refused],
            "held_out_before": found.error_without, "held_out_after": found.after.fit["held_out_rms"],
            "advice": [sentence(one) for one in found.advice], "known": standing_as_plain(found.standing),
            "fit": {"before": {"model": list(found.before.model)}},
            "alone": alone(found.first.evidence, found.first.first), "recurrence": _recurrence(found.recurrence),
        },
    )  # fmt: skip


def _recurrence(found: Recurrence | None) -> dict[str, Any] | None:
    """Give what comes back as plain data; None where the model leaves nothing in the stops."""
    if found is None:
        return None
    return asdict(found) | {
        "answer": list(found.answer), "sensors": list(found.sensors),
        "kinds": [asdict(k) | {"sensors": list(k.sensors)} for k in found.kinds],
    }  # fmt: skip


def read_set_diagnosis(path: Path) -> dict[str, Any]:
    """Read set.json.

    Raises
    ------
    DataError
        When it is not there or not of this format.
    """
    return read_json(Path(path), FORMAT)
