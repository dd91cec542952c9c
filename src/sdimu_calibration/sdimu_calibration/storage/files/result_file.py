"""The result of a calibration as result.json (format ``sdimu-result/1``)."""

from __future__ import annotations

import re
import reprlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.note import Note, Topic, without_advice
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.recording import DataError, DataFault
from sdimu_calibration.core.results import INSEPARABLE, NOT_TRUSTED, Calibration, History, Rest
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files import imu_noise, set_result_file
from sdimu_calibration.storage.files.json_file import read_json, write_json

FORMAT = "sdimu-result/1"
_ADVISES = re.compile(r"(.*)([;:,](?: or)? run:? sdimu diagnose)")
"""How a line of a file ends that advises a diagnosis."""
_TOPICS = {NOT_TRUSTED: Topic.NOT_TRUSTED, INSEPARABLE: Topic.INSEPARABLE}
"""What a line of a file is about, by its words."""
_LATEST_NS = 2**63
"""A stamp of 64 bits ends there."""


def write_result(path: Path, calibration: Calibration, verdict: Verdict | None = None) -> None:
    """Write result.json: SI numbers, ``null`` for what is not a finite number.

    Parameters
    ----------
    path : Path
        File to make or replace; its folder is made too.
    calibration : Calibration
    verdict : Verdict, optional
        Of a diagnosis, where one was made; no note then advises one.
    """
    conditional = calibration.conditional_sigma
    told = without_advice if verdict else tuple
    content = {
        "format": FORMAT,
        **({"verdict": verdict} if verdict else {}),
        "origin": plain_origin(calibration.origin),
        **({} if calibration.imu_noise is None else {imu_noise.KEY: imu_noise.as_plain(calibration.imu_noise)}),
        "estimator": calibration.estimator,
        "estimator_reason": calibration.estimator_reason,
        "body_frame": calibration.body_frame,
        "drift_means": dict(calibration.drift_means),
        "model": list(calibration.model),
        "coefficients": [
            {"name": name, "value": value, "sigma": sigma, "unit": unit, "display_unit": display, **alone}
            for name, value, sigma, unit, display, alone in zip(
                calibration.names,
                calibration.values.tolist(),
                np.sqrt(np.diag(calibration.covariance)).tolist(),
                calibration.units,
                calibration.display_units,
                [{} for _ in calibration.names] if conditional is None
                else [{"conditional_sigma": sigma} for sigma in conditional.tolist()],
                strict=True,
            )
        ],
        "covariance": calibration.covariance.tolist(),
        "fit": dict(calibration.fit),
        "data": {**calibration.data, "faults": [asdict(fault) for fault in calibration.faults]},
        "noise": [asdict(term) | {"unit": term.unit} for term in calibration.noise],
        **({"rests": [asdict(rest) for rest in calibration.rests]} if calibration.rests else {}),
        **({} if calibration.of_set is None else set_result_file.as_plain(calibration.of_set)),
        "notes": told(calibration.notes),
        "warnings": told(calibration.warnings),
        "history": {entry.name: getattr(calibration.history, entry.name).tolist() for entry in fields(History)},
    }
    write_json(path, content)


def read_result(path: Path) -> Calibration:
    """Read result.json, or the result.json in a folder.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Calibration

    Raises
    ------
    DataError
        When it is not there or not of this format.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "result.json"
    content = read_json(path, FORMAT)
    try:
        return _calibration(content)
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise DataError(f"{path}: not a complete {FORMAT} file ({type(error).__name__}: {error})") from error


def _word(value: Any) -> str:
    """Return a name or a unit: text without anything that a terminal or a file would obey."""
    if not isinstance(value, str) or not value.isprintable():
        raise ValueError(f"{reprlib.repr(value)} is no name or unit")
    return value


def _said(values: Sequence[Any]) -> tuple[str, ...]:
    return tuple(as_note(one_line(str(value), None)) for value in values)


def as_note(line: str) -> str:
    """Recognise in a line of a file what it is about, and the end that advises a diagnosis."""
    found = _ADVISES.fullmatch(line)
    if found is None:
        topics = (topic for words, topic in _TOPICS.items() if words in line)
        return Note(line, topic) if (topic := next(topics, None)) else line
    topic = Topic.DIFFERS if "is not the same in all recordings" in line else Topic.MISFIT
    # A note on noise says that the model fits.
    return Note(found[1], None if found[2].startswith(":") else topic, found[2])


def _calibration(content: Mapping[str, Any]) -> Calibration:
    coefficients = content["coefficients"]
    number = len(coefficients)
    return Calibration(
        body_frame=_word(content["body_frame"]),
        model=tuple(map(_word, content["model"])),
        names=tuple(_word(c["name"]) for c in coefficients),
        units=tuple(_word(c["unit"]) for c in coefficients),
        # Files written by others need not carry display units: then people see SI.
        display_units=tuple(_word(c.get("display_unit", c["unit"])) for c in coefficients),
        values=_array([c["value"] for c in coefficients], (number,)),
        covariance=_array(content["covariance"], (number, number)),
        fit=dict(content["fit"]),
        data={key: value for key, value in content["data"].items() if key != "faults"},
        notes=_said(content.get("notes", ())),
        history=_history(content.get("history") or {}, number),
        warnings=_said(content.get("warnings", ())),
        faults=tuple(_fault(entry) for entry in content["data"].get("faults", ())),
        estimator=one_line(str(content.get("estimator", ""))),
        estimator_reason=one_line(str(content.get("estimator_reason", ""))),
        noise=tuple(_term(entry) for entry in content.get("noise", ())),
        conditional_sigma=_conditional(coefficients),
        rests=tuple(_rest(entry) for entry in content.get("rests", ())),
        origin=_origin(content.get("origin", {})),
        imu_noise=imu_noise.from_plain(content.get(imu_noise.KEY)),
        of_set=set_result_file.from_plain(content, number),
        drift_means={name: float(mean) for name, mean in content.get("drift_means", {}).items()},
    )


def plain_origin(origin: Origin) -> dict[str, Any]:
    """Give an origin as plain data; paths only where the user named one."""
    return {key: value for key, value in asdict(origin).items() if value or not key.endswith("_file")}


def _origin(entry: Mapping[str, Any]) -> Origin:
    """Origin of a result; empty in older files, NaN for ``null``."""

    def read(name: str, default: Any) -> Any:
        value = entry.get(name, default)
        if isinstance(default, str):
            return one_line(str(value))
        return default if value is None else type(default)(value)

    found = Origin(**{each.name: read(each.name, each.default) for each in fields(Origin)})
    if not 0 <= found.start_ns < _LATEST_NS:
        raise ValueError(f"origin.start_ns is {reprlib.repr(found.start_ns)}, which is no stamp")
    return found


def _conditional(coefficients: Sequence[Mapping[str, Any]]) -> Floats | None:
    if not all("conditional_sigma" in entry for entry in coefficients):
        return None
    return _array([entry["conditional_sigma"] for entry in coefficients], (len(coefficients),))


def _term(entry: Mapping[str, Any]) -> NoiseTerm:
    given = {key: value for key, value in entry.items() if key != "unit"}
    return NoiseTerm(**given | {"alike": tuple(given.get("alike", ()))})


def _rest(entry: Mapping[str, Any]) -> Rest:
    """Rest of a result; ``null`` is NaN."""

    def number(value: Any) -> Any:
        return tuple(map(number, value)) if isinstance(value, list) else float("nan") if value is None else float(value)

    return Rest(**{key: number(value) for key, value in entry.items()})


def _fault(entry: Mapping[str, Any]) -> DataFault:
    values: dict[str, Any] = {key: float("nan") if value is None else value for key, value in entry.items()}
    return DataFault(**values)


def _history(content: Mapping[str, Any], number: int) -> History:
    """History of a result; empty when the file, written by others, has none."""
    m = len(content.get("t", ()))
    return History(
        t=_array(content.get("t", []), (m,)),
        value=_array(content.get("value", []), (m, number)),
        sigma=_array(content.get("sigma", []), (m, number)),
        attitude_sigma=_array(content.get("attitude_sigma", []), (m, 3)),
        stop=np.array(content.get("stop", []), np.int64),
        dwell=np.array(content.get("dwell", []), np.bool_),
        used=np.array(content.get("used", []), np.bool_),
        nis=_array(content.get("nis", []), (m, 4)),
    )


def _array(values: list[Any], shape: tuple[int, ...]) -> Floats:
    """Numbers with null for NaN as an array of that shape; ValueError when they do not fit."""
    return np.array(values, float).reshape(shape)


