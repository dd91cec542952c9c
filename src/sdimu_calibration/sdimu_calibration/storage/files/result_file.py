"""The result of a calibration as result.json (format ``sdimu-result/1``), of a recording or of a set."""

from __future__ import annotations

import math
import re
import reprlib
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import AfterValidator, ConfigDict, Field, SerializerFunctionWrapHandler, model_serializer

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.note import Note, Topic, without_advice
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.recording import DataError, DataFault
from sdimu_calibration.core.results import (
    INSEPARABLE,
    NOT_TRUSTED,
    UNTRUSTED_VERDICTS,
    Calibration,
    History,
    PowerOnDeviation,
    Rest,
    SetRecording,
    SetSummary,
    SetTrend,
    TurnOn,
    no_history,
)
from sdimu_calibration.core.site_reference import Reference
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.stated_noise import with_learned
from sdimu_calibration.core.units import parse_unit
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.config import config_folder, load_imu
from sdimu_calibration.storage.files.json_file import entry
from sdimu_calibration.storage.files.result_model import (
    Array,
    Entry,
    Figure,
    Line,
    Number,
    ResultModel,
    Said,
    complete,
    is_semidefinite,
    read_model,
)

FORMAT: Final = "sdimu-result/1"
ORIGIN = Entry(seldom=("site_file", "imu_file", "effect_files"))
"""How an origin stands in a file: with paths only where the user named them."""
_ADVISES = re.compile(r"(.*)([;:,](?: or)? run:? sdimu diagnose)")
"""How a line of a file ends that advises a diagnosis."""
_TOPICS = {NOT_TRUSTED: Topic.NOT_TRUSTED, INSEPARABLE: Topic.INSEPARABLE}
"""What a line of a file is about, by its words."""
_SLACK_OF_CORRELATION = 1e-3
"""Share of the product of two sigmas (1) by which rounding may move a covariance: far below a digit that is wrong."""
_EARLIEST_NS = -(10**9)
"""Start (ns) of a recording at least: an interval before its first stamp, which may be 0."""
_LATEST_NS = 2**63
"""A stamp of 64 bits ends there."""


def _is_word(value: str) -> str:
    if not value.isprintable():
        raise ValueError(f"{reprlib.repr(value)} is no name or unit")
    return value


def _is_stamped(origin: Origin) -> Origin:
    if not _EARLIEST_NS <= origin.start_ns < _LATEST_NS:
        raise ValueError(f"start_ns is {reprlib.repr(origin.start_ns)}, which is no stamp")
    return origin


def _is_ranged(origin: Origin) -> Origin:
    if math.isfinite(origin.temperature_low_degc) != math.isfinite(origin.temperature_high_degc):
        raise ValueError("temperature_low_degc and temperature_high_degc: a number is expected of both, or of neither")
    return origin


Word = Annotated[str, AfterValidator(_is_word)]
"""A name or a unit: text without anything that a terminal or a file would obey."""
Size = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class Coefficient(ResultModel):
    """A coefficient; files of others need not carry display units: then people see SI."""

    name: Word
    value: Number
    sigma: Number = np.nan
    unit: Word
    display_unit: Word = ""
    conditional_sigma: Number = np.nan


class Data(ResultModel):
    """What was counted in the data, and their faults, which come last."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, Figure | None]
    faults: tuple[Annotated[DataFault, Entry()], ...] = ()

    @model_serializer(mode="wrap")
    def _faults_last(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        plain: dict[str, Any] = write(self)
        faults = {"faults": plain.pop("faults")} if "faults" in plain else {}
        return plain | faults


class ImuNoise(ResultModel):
    """Name, grade and noise (SI) of the specification with which samples were weighed."""

    name: Line
    grade: Line
    gyro_white_noise: Size = Field(alias="gyro_white_noise_rad_s_sqrt_hz")
    accel_white_noise: Size = Field(alias="accel_white_noise_m_s2_sqrt_hz")
    gyro_random_walk: Size = Field(alias="gyro_random_walk_rad_s_sqrt_s")
    accel_random_walk: Size = Field(alias="accel_random_walk_m_s2_sqrt_s")
    gyro_quantisation: Size = Field(alias="gyro_quantisation_rad")
    accel_quantisation: Size = Field(alias="accel_quantisation_m_s")
    gyro_bias_instability: Size = Field(alias="gyro_bias_instability_rad_s")
    accel_bias_instability: Size = Field(alias="accel_bias_instability_m_s2")

    @property
    def specification(self) -> ImuSpecification:
        """The same as an object of the core, without priors."""
        return replace(ImuSpecification("", 0.0, 0.0), **dict(self))


class ResultFile(ResultModel):
    """result.json, in the order of its keys; those of a set stand from `turn_on` to `left_out`."""

    format: Literal["sdimu-result/1"] = FORMAT
    verdict: str = ""
    origin: Annotated[Origin, ORIGIN, AfterValidator(_is_stamped), AfterValidator(_is_ranged)] = Origin()
    imu_noise: ImuNoise | None = None
    estimator: Line = ""
    estimator_reason: Line = ""
    body_frame: Word
    drift_means: dict[str, float] = Field(default_factory=dict)
    model: tuple[Word, ...]
    coefficients: tuple[Coefficient, ...]
    covariance: Array
    fit: dict[str, Figure | None]
    data: Data
    references: tuple[Annotated[Reference, Entry()], ...] = ()
    noise: tuple[Annotated[NoiseTerm, Entry({"unit": lambda term: term.unit})], ...] = ()
    rests: tuple[Annotated[Rest, Entry()], ...] = ()
    turn_on: tuple[Annotated[TurnOn, Entry({"triad": lambda one: one.effect.partition("_")[0]})], ...] = ()
    recordings: tuple[Annotated[SetRecording, Entry()], ...] = ()
    power_ons: tuple[Annotated[PowerOnDeviation, Entry()], ...] = ()
    scatter_p: Array = np.zeros(0)
    trends: tuple[Annotated[SetTrend, Entry()], ...] = ()
    left_out: tuple[tuple[Line, Line], ...] = ()
    notes: tuple[Said, ...] = ()
    warnings: tuple[Said, ...] = ()
    history: Annotated[History, Entry()] | None = None


def write_result(path: Path, calibration: Calibration, verdict: Verdict | None = None) -> None:
    """Write result.json: SI numbers, ``null`` for what is not a finite number.

    `verdict`: of a diagnosis, where one was made; no note then advises one.
    """
    c, told = calibration, without_advice if verdict else tuple
    seldom: dict[str, Any] = {
        "verdict": verdict,
        "references": c.references,
        "rests": c.rests,
        "imu_noise": c.imu_noise and _noise_of(c.imu_noise),
    }
    # From the root, so that they are found from any folder.
    files = tuple(str(Path(file).resolve()) for file in c.origin.effect_files)
    ResultFile.model_construct(
        format=FORMAT,
        **{key: value for key, value in seldom.items() if value},
        origin=replace(c.origin, effect_files=files),
        **entry(c, "estimator estimator_reason body_frame model covariance noise history"),
        drift_means=dict(c.drift_means),
        coefficients=_coefficients(c),
        fit=dict(c.fit),
        data=Data.model_construct(**dict[str, Any](c.data), faults=c.faults),
        **({} if c.of_set is None else _of_set(c.of_set)),
        notes=told(c.notes),
        warnings=told(c.warnings),
    ).write(path)


def _noise_of(imu: ImuSpecification) -> ImuNoise:
    return ImuNoise.model_construct(**{name: getattr(imu, name) for name in ImuNoise.model_fields})


def _coefficients(c: Calibration) -> tuple[Coefficient, ...]:
    columns: dict[str, Any] = {
        "name": c.names,
        "value": c.values.tolist(),
        "sigma": np.sqrt(np.diag(c.covariance)).tolist(),
        "unit": c.units,
        "display_unit": c.display_units,
    }
    if c.conditional_sigma is not None:
        columns["conditional_sigma"] = c.conditional_sigma.tolist()
    rows = zip(*columns.values(), strict=True)
    return tuple(Coefficient.model_construct(**dict(zip(columns, row, strict=True))) for row in rows)


def _of_set(of_set: SetSummary) -> dict[str, Any]:
    """Keys that a joint fit has beyond those of a recording."""
    own = {each.name: getattr(of_set, each.name) for each in fields(of_set)}
    return own | {"power_ons": own.pop("deviations")}


def read_result(path: Path) -> Calibration:
    """Read result.json, or the result.json in a folder."""
    return _read(path)[1]


def read_judged_result(path: Path) -> tuple[Calibration, tuple[str, ...]]:
    """Read result.json, and why it is not to be trusted, for those who go on to use it.

    Parameters
    ----------
    path : Path
        File, or a folder with a result.json.

    Returns
    -------
    result : Calibration
    reasons : tuple of str
        One line each; empty where nothing speaks against it.

    Raises
    ------
    DataError
        Where a value, a variance or a covariance is no finite number: nothing can be corrected with it.
    """
    path, result, verdict = _read(path)
    for name, value, row in zip(result.names, result.values, result.covariance, strict=True):
        if not np.isfinite(value + row).all():
            raise DataError(f"{path}: {name}: its value or a covariance is no number; calibrate again")
    judged = (
        [f"its diagnosis ended as '{verdict}': the model is wrong or the data are, and no effect mends it"]
        if verdict in UNTRUSTED_VERDICTS
        else []
    )
    reasons = dict.fromkeys([*judged, *result.not_to_be_trusted, *result.misfits])
    return result, tuple(f"{path}: {line}" for line in reasons)


def _read(path: Path) -> tuple[Path, Calibration, str]:
    """Path of the file itself, what it holds, and its verdict."""
    path = Path(path) / "result.json" if Path(path).is_dir() else Path(path)
    if not path.exists():
        raise DataError(f"{path}: no such file (expected a result.json or its folder, as sdimu calibrate leaves it)")
    file = read_model(path, ResultFile)
    with complete(path, FORMAT):
        return path, _calibration(file), file.verdict


def _calibration(file: ResultFile) -> Calibration:
    coefficients, p = file.coefficients, len(file.coefficients)
    covariance = file.covariance.reshape(p, p)
    _check_units(file)
    _check_covariance(covariance)
    conditional = all("conditional_sigma" in c.model_fields_set for c in coefficients)
    return Calibration(
        **entry(file, "body_frame model fit estimator estimator_reason noise rests origin references drift_means"),
        names=tuple(c.name for c in coefficients),
        units=tuple(c.unit for c in coefficients),
        display_units=tuple(c.display_unit if "display_unit" in c.model_fields_set else c.unit for c in coefficients),
        values=np.array([c.value for c in coefficients], float),
        covariance=covariance,
        data=file.data.model_extra or {},
        notes=tuple(map(as_note, file.notes)),
        history=no_history(p) if file.history is None else _whole_history(file.history, p),
        warnings=tuple(map(as_note, file.warnings)),
        faults=file.data.faults,
        conditional_sigma=np.array([c.conditional_sigma for c in coefficients], float) if conditional else None,
        imu_noise=None if file.imu_noise is None else file.imu_noise.specification,
        of_set=_set_summary(file, p) if file.recordings else None,
    )


def _check_units(file: ResultFile) -> None:
    """Refuse a coefficient that is there twice, or in a unit that its value would not be taken in."""
    effects = (registry.find(name) for name in file.model)
    catalogue = {one.name: one.unit for effect in effects if effect for one in effect.parameters}
    seen = set()
    for number, one in enumerate(file.coefficients):
        key = f"coefficients.{number}"
        if one.name in seen:
            raise ValueError(f"{key}.name: '{one.name}' is there twice")
        seen.add(one.name)
        if one.unit != catalogue.get(one.name, one.unit):
            raise ValueError(f"{key}.unit: '{one.unit}', expected '{catalogue[one.name]}' (values are in SI)")
        if parse_unit(one.display_unit or one.unit).dimension != parse_unit(one.unit).dimension:
            raise ValueError(f"{key}.display_unit: '{one.display_unit}' is no unit of what is in '{one.unit}'")


def _check_covariance(covariance: Floats) -> None:
    """Refuse numbers that are no covariance; those that are missing (NaN) pass."""
    variance = np.diag(covariance)
    if (variance < 0.0).any():
        raise ValueError("covariance: a variance is below zero")
    # Products of sigmas, not of variances, which may be larger than any number.
    sigma = np.sqrt(variance)
    off = _SLACK_OF_CORRELATION * np.outer(sigma, sigma)
    known = off > 0.0
    of_nothing = (np.abs(covariance) > 0.0) & ~(known | np.isnan(sigma[:, None] * sigma))
    if of_nothing.any():
        raise ValueError("covariance: a covariance stands beside a variance of zero")
    if (np.abs(covariance - covariance.T) > off)[known].any():
        raise ValueError("covariance: is not symmetric")
    if (np.abs(covariance) > np.outer(sigma, sigma) + off)[known].any():
        raise ValueError("covariance: a correlation is beyond 1")
    some = np.flatnonzero(variance > 0.0)
    of_some = covariance[np.ix_(some, some)]
    if np.isfinite(of_some).all() and not is_semidefinite(of_some, _SLACK_OF_CORRELATION):
        raise ValueError("covariance: a variance is below zero along some direction")


def _whole_history(history: History, p: int) -> History:
    """History with its arrays in their shapes; those that are missing are empty."""
    m = len(history.t)
    widths = {"value": p, "sigma": p, "attitude_sigma": 3, "nis": 4}
    shaped: dict[str, Any] = {name: getattr(history, name).reshape(m, width) for name, width in widths.items()}
    return replace(history, **shaped)


def _set_summary(file: ResultFile, p: int) -> SetSummary:
    arrays = [file.scatter_p, *(a for r in file.recordings for a in (r.values, r.sigma, r.deviate))]
    for array in arrays:
        if array.shape != (p,):
            raise ValueError(f"expected {p} numbers, found {len(array)}")
    return SetSummary(file.recordings, file.turn_on, file.power_ons, file.scatter_p, file.trends, file.left_out)


def as_note(line: str) -> str:
    """Recognise in a line of a file what it is about, and the end that advises a diagnosis."""
    found = _ADVISES.fullmatch(line)
    if found is None:
        topics = (topic for words, topic in _TOPICS.items() if words in line)
        return Note(line, topic) if (topic := next(topics, None)) else line
    topic = Topic.DIFFERS if "not the same in all recordings" in line else Topic.MISFIT
    # A note on noise says that the model fits.
    return Note(found[1], None if found[2].startswith(":") else topic, found[2])


def noise_for(result: Calibration, imu: str | None) -> tuple[ImuSpecification, str]:
    """Find the noise that goes with a result: of the IMU file that is named, else of the calibration itself.

    A result that does not hold it (of an older version, or of others) has that of the file in config/imu that it names,
    or of a usual IMU: a run by hand is one of a cheap sensor, and a table gyro would say thousands of times less noise.

    Parameters
    ----------
    imu : str or None
        Name or path of an IMU file; None or empty where nobody names one.

    Returns
    -------
    specification : ImuSpecification
    whose : str
        Whose noise it is, for people.
    """
    if imu:
        return load_imu(imu), f"'{imu}' (--imu)"
    if result.imu_noise is not None:
        known = with_learned(result.imu_noise, result.noise)
        learned = "" if known == result.imu_noise else ", with what was learned"
        return known, f"'{result.imu_noise.name}', with which the result was calibrated{learned}"
    if result.origin.imu in {path.stem for path in (config_folder() / "imu").glob("*.yaml")}:
        return load_imu(result.origin.imu), f"'{result.origin.imu}', the IMU that the result names"
    name = "mems_by_hand" if result.estimator == "handheld" else "dtg"
    return load_imu(name), f"'{name}', as the result does not hold its noise and no --imu is given: state your own"
