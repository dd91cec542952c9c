"""Results below a folder, sorted into what fits together and what stands apart."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.fleet.common import Bytes
from sdimu_calibration.core.fleet.population import Measured, measured
from sdimu_calibration.core.fleet.study import Candidates
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.storage.files.diagnosis_file import Alone, DiagnosisFile, read_diagnosis, unpacked
from sdimu_calibration.storage.files.result_file import read_result
from sdimu_calibration.storage.files.whole_file import RESULT

DIAGNOSIS = "diagnosis.json"


@dataclass(frozen=True)
class Entry:
    """A result of a folder."""

    name: str
    """Folder of the result, as seen from the folder that was asked for."""
    path: Path
    """Its folder."""
    result: Calibration
    diagnosis: DiagnosisFile | None
    """Content of diagnosis.json beside it."""

    @property
    def unit(self) -> str:
        """Serial number; the name where nobody said one, so that it is a unit of its own."""
        return self.result.origin.serial or self.name

    @property
    def kind(self) -> tuple[str, tuple[str, ...], str]:
        """What must agree in a fleet: IMU, model (effects, sorted) and body frame."""
        return self.result.origin.imu, tuple(sorted(self.result.model)), self.result.body_frame


@dataclass(frozen=True)
class Gathered:
    """What a folder holds."""

    entries: tuple[Entry, ...]
    """Of the type that most results are of, in the order of their dates."""
    apart: tuple[str, ...]
    """One line for every result that does not fit."""
    given: tuple[Entry, ...]
    """Results with diagnosis.json, of the IMU and body frame of `entries`, one a recording, whatever was found."""


def gather(folders: Sequence[Path], one_model: bool = True) -> Gathered:
    """Find every result.json below some folders, and take those that fit together.

    `folders`: folders, or result.json files; `one_model`: set results of other models apart, not those of other IMU
    files and body frames alone.
    """
    apart: list[str] = []
    usable = [entry for name, path in _found(folders) if (entry := _read(name, path, apart)) is not None]
    if not usable:
        why = f" ({apart[0]})" if apart else ""
        raise DataError(f"{folders[0]}: no result.json that can be used below it{why}; make some: sdimu calibrate BAG")
    kinds = [entry.kind if one_model else (entry.kind[0], (), entry.kind[2]) for entry in usable]
    main = max(dict.fromkeys(kinds), key=kinds.count)
    fitting = [entry for entry in usable if not _misfit(entry, main, one_model)]
    entries: list[Entry] = []
    for entry in sorted(usable, key=lambda e: (e.result.origin.start_ns, e.name)):
        reason = _misfit(entry, main, one_model) or _repeats(entry, entries) or _part_of_set(entry, fitting)
        if reason:
            apart.append(f"{entry.name}: {reason}")
        else:
            entries.append(entry)
    return Gathered(tuple(entries), tuple(apart), _given(usable, main))


def _given(usable: Sequence[Entry], main: tuple[str, tuple[str, ...], str]) -> tuple[Entry, ...]:
    """Diagnosed results of an IMU and frame that began with the most usual model, one a recording."""
    diagnosed = [e for e in usable if e.diagnosis is not None and (e.kind[0], e.kind[2]) == (main[0], main[2])]
    models = [_model_before(e) for e in diagnosed]
    usual = max(dict.fromkeys(models), key=models.count, default=())
    alike = [entry for entry, model in zip(diagnosed, models, strict=True) if model == usual]
    out: list[Entry] = []
    for entry in alike:
        if not _repeats(entry, out) and not _part_of_set(entry, alike):
            out.append(entry)
    return tuple(out)


def _model_before(entry: Entry) -> tuple[str, ...]:
    """Model that a diagnosis began with; empty where the file does not say it."""
    try:
        return tuple(map(str, entry.diagnosis.fit["before"]["model"])) if entry.diagnosis else ()
    except (KeyError, TypeError):
        return ()


def _found(folders: Sequence[Path]) -> list[tuple[str, Path]]:
    """Name and path of each result below some folders."""
    out: dict[Path, str] = {}
    for folder in folders:
        if not folder.exists():
            raise DataError(f"{folder}: no such file or folder")
        for path in [folder] if folder.is_file() else sorted(folder.rglob(RESULT)):
            inner = path.parent.relative_to(folder) if folder.is_dir() else Path(path.parent.name)
            out.setdefault(path.resolve(), str(inner) if str(inner) != "." else folder.resolve().name)
    return [(name, path) for path, name in out.items()]


def _read(name: str, path: Path, apart: list[str]) -> Entry | None:
    """Read a result; None, and a line in `apart`, where it must not be used."""
    try:
        result = read_result(path)
        entry = Entry(name, path.parent, result, _diagnosis_beside(path.parent))
    except DataError as error:
        apart.append(str(error))
        return None
    if result.not_to_be_trusted:
        apart.append(f"{name}: not to be trusted: {result.not_to_be_trusted[0]}")
        return None
    if not (np.isfinite(result.values).all() and np.isfinite(np.diag(result.covariance)).all()):
        apart.append(f"{name}: has a value or a covariance that is no number")
        return None
    return entry


def _diagnosis_beside(folder: Path) -> DiagnosisFile | None:
    """Read the diagnosis of a recording, or of a set, beside its result; None where there is none."""
    return read_diagnosis(folder / DIAGNOSIS) if (folder / DIAGNOSIS).is_file() else None


def _misfit(entry: Entry, main: tuple[str, tuple[str, ...], str], one_model: bool) -> str:
    """Why a result does not fit to those of a kind; empty where it does."""
    (imu, model, frame), (mine, own, my_frame) = main, entry.kind
    if my_frame != frame:
        return f"body frame is {my_frame}, of the others it is {frame}: calibrate with a model of that body_frame"
    if mine != imu:
        return f"IMU file is {mine or 'not known'}, of the others it is {imu or 'not known'}: state one --imu for all"
    if one_model and own != model:
        more, less = sorted({*own} - {*model}), sorted({*model} - {*own})
        change = ", ".join([*(f"+ {name}" for name in more), *(f"- {name}" for name in less)])
        return f"other model ({change}): calibrate all with one model (--model, --add)"
    return ""


def _repeats(entry: Entry, before: Sequence[Entry]) -> str:
    """Which result is of the same recording; empty where none is."""
    mine = entry.result
    for other in before:
        its = other.result
        if mine.origin.start_ns and (
            (mine.origin.start_ns, mine.data.get("samples"), mine.origin.serial, mine.origin.recording)
            == (its.origin.start_ns, its.data.get("samples"), its.origin.serial, its.origin.recording)
        ):
            return f"is of the recording of {other.name}, which is counted"
    return ""


def _part_of_set(entry: Entry, every: Sequence[Entry]) -> str:
    """Which joint result has the recording of a result; empty where none has."""
    origin, samples = entry.result.origin, entry.result.data.get("samples")
    if entry.result.of_set is not None or not origin.start_ns:
        return ""
    mine = (origin.serial, origin.power_on, origin.start_ns, samples)
    for other in every:
        of_set = other.result.of_set
        if of_set and mine in {(r.serial, r.power_on, r.start_ns, r.samples) for r in of_set.recordings}:
            return f"its recording is one of the set {other.name}, which is counted"
    return ""


def as_measured(entries: Sequence[Entry]) -> Measured:
    """Put results of one type into arrays, coefficients in the order of the first."""
    names = entries[0].result.names
    values, covariances = [], []
    for entry in entries:
        result = entry.result
        if sorted(result.names) != sorted(names):
            raise DataError(f"{entry.name}: has other coefficients than {entries[0].name}")
        order = [result.names.index(name) for name in names]
        values.append(result.values[order])
        covariances.append(result.covariance[np.ix_(order, order)])
    starts = [entry.result.origin.start_ns for entry in entries]
    dates = np.array([1e-9 * ns if ns else np.nan for ns in starts])
    return measured(names, np.array(values), np.array(covariances), [entry.unit for entry in entries], dates)


def candidates(entries: Sequence[Entry]) -> Candidates:
    """Take the candidates alone from the diagnoses of units, one row a unit."""
    known: dict[str, str] = {}
    units: dict[str, list[_Alone]] = {}
    for entry in entries:
        alone = _alone(entry.diagnosis and entry.diagnosis.alone)
        if alone is not None:
            for label, unit in zip(alone.file.labels, alone.file.display_units, strict=True):
                known.setdefault(label, unit)
            units.setdefault(entry.unit, []).append(alone)
    names = {name: k for k, name in enumerate(known)}
    table = np.full((2, len(units), len(names)), np.nan)
    between = np.zeros((len(units), len(names), len(names)), np.int8)
    for row, found in enumerate(units.values()):
        table[:, row] = _mean(found, names)
        # Of the first: recordings of one plan have the same.
        places = [names[label] for label in found[0].file.labels]
        between[np.ix_([row], places, places)] = found[0].correlations
    return Candidates(tuple(known), tuple(known.values()), table[0], table[1], between)


@dataclass(frozen=True)
class _Alone:
    """Entry ``alone`` of a diagnosis, its correlations unpacked."""

    file: Alone
    correlations: Bytes


def _alone(content: Any) -> _Alone | None:
    """Read the entry; None where there is none that is whole, as in older files."""
    try:
        file = Alone.model_validate(content)
    except ValueError:
        return None
    k = len(file.labels)
    correlations = unpacked(file.correlations, k)
    lengths = {k, len({*file.labels}), len(file.display_units), *file.estimates.shape, *file.sigmas.shape}
    return _Alone(file, correlations) if correlations is not None and lengths == {k} else None


def _mean(found: Sequence[_Alone], names: Mapping[str, int]) -> Floats:
    """Weighted means of the estimates of a unit and their sigmas, shape (2, k); NaN where none knows an effect."""
    weight, total = np.zeros(len(names)), np.zeros(len(names))
    for one in (each.file for each in found):
        known = np.flatnonzero(np.isfinite(one.estimates) & np.isfinite(one.sigmas) & (one.sigmas > 0.0))
        places = [names[one.labels[k]] for k in known.tolist()]
        weight[places] += one.sigmas[known] ** -2.0
        total[places] += one.estimates[known] * one.sigmas[known] ** -2.0
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.array([total / weight, np.where(weight > 0.0, 1.0 / np.sqrt(weight), np.nan)])
