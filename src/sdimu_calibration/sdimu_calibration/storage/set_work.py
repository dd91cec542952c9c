"""Where the recordings of a set are worked on: in this process, in several, or on a dask cluster; nothing twice.

What a recording says is kept by a number that follows from its bytes and from everything that was asked, so that a
tenth recording costs one, and a run that was killed goes on where it was.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import lru_cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core.effects.effect import Timetable
from sdimu_calibration.core.estimation.fit import Start
from sdimu_calibration.core.estimation.navigation_fit import MISFIT
from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.joint.member import Job, Report, tried
from sdimu_calibration.core.joint.reduction import Reduction
from sdimu_calibration.core.joint.set_evidence import held_out_chance
from sdimu_calibration.core.joint.set_fit import Run, SetFit
from sdimu_calibration.core.joint.set_result import SCATTERS, set_outcome
from sdimu_calibration.core.joint.stretch_rows import Places
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.wording import Work
from sdimu_calibration.storage.files.config import load_imu, load_site
from sdimu_calibration.storage.files.result_file import as_note
from sdimu_calibration.storage.files.whole_file import beside
from sdimu_calibration.storage.opening import CLASSES, DEFAULT_SITE
from sdimu_calibration.storage.recording_set import BagSource

REPORT_FORMAT = "sdimu-reduction/1"
"""What a recording says, as an NPZ file of plain arrays: no code is loaded from it."""
FEW = 3
"""Number of recordings up to which one process is faster: starting another takes as long as two recordings."""
_PART = 16
"""Number of recordings after which reports are written: what a kill may cost."""
_BLOCK = 1 << 20
"""Bytes that are read at a time for a checksum."""
_SOURCES = Path(__file__).resolve().parents[1]
"""Folder of the package."""

Told = Callable[[int, int], None]


def judged_outcome(fit: SetFit) -> Calibration:
    """Put the result of a joint fit together, with a warning where its recordings do not predict each other.

    As the fit of one recording is judged by stops that it has not seen; that chance does not reach the error is asked,
    too, as two recordings leave much to chance.

    Parameters
    ----------
    fit : SetFit
    """
    result = set_outcome(fit)
    error = result.fit["held_out_rms"]
    if error is None or error <= MISFIT or held_out_chance(fit, error) >= SCATTERS:
        return result
    told = (
        f"the model does not fit: the recordings do not predict each other (held-out error {error:.3f}; 1 is right): "
        "physics is missing, or they are not of one unit in one state"
    )
    note = Note(told, Topic.MISFIT, f"; run: {Work.DIAGNOSE}")
    return replace(result, notes=(*result.notes, note), warnings=(*result.warnings, note))


@contextmanager
def set_runner(
    count: int, workers: int, kept: Path | None, scheduler: str | None = None, told: Told | None = None
) -> Iterator[Run]:
    """Give the function that does the jobs of a set.

    Parameters
    ----------
    count : int
        Number of recordings.
    workers : int
        Number of processes of this machine; with one, or few recordings, the work is done here.
    kept : Path or None
        Folder in which reports are kept.
    scheduler : str, optional
        Address of a dask scheduler that does the work instead; its workers read the bags by the same paths.
    told : callable, optional
        Called with the number of jobs done and of all.
    """
    if scheduler is not None:
        from sdimu_calibration.storage.cluster import cluster  # noqa: PLC0415 (dask is for those who name a scheduler)

        with cluster(scheduler, workers) as on_cluster:
            yield _kept(lambda jobs: _from_cluster(on_cluster, jobs, told), kept)
        return
    if workers < 2 or count <= FEW:
        yield _kept(lambda jobs: _here(jobs, told), kept)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield _kept(lambda jobs: _in_pool(pool, jobs, told), kept)


def _here(jobs: Sequence[Job], told: Told | None) -> list[Report | DataError]:
    done: list[Report | DataError] = []
    for job in jobs:
        done.append(tried(job))
        if told:
            told(len(done), len(jobs))
    return done


def _in_pool(pool: ProcessPoolExecutor, jobs: Sequence[Job], told: Told | None) -> list[Report | DataError]:
    if any(not isinstance(e, str) for job in jobs for e in (*job.candidates, *job.model.effects)):
        # An effect of the user's own is a function, which no other process knows.
        return _here(jobs, told)
    places = {pool.submit(tried, job): k for k, job in enumerate(jobs)}
    found: dict[int, Report | DataError] = {}
    for future in as_completed(places):
        found[places[future]] = future.result()
        if told:
            told(len(found), len(jobs))
    return [found[k] for k in range(len(jobs))]


def _from_cluster(on_cluster: Any, jobs: Sequence[Job], told: Told | None) -> list[Report | DataError]:
    found: dict[str, Report | DataError] = {}
    for job, result in on_cluster(tried, jobs):
        # The text of an error stands for a job whose worker was lost.
        found[job.member.name] = DataError(f"{job.member.name}: {result}") if isinstance(result, str) else result
        if told:
            told(len(found), len(jobs))
    return [found[job.member.name] for job in jobs]


def _kept(work: Callable[[Sequence[Job]], Sequence[Report | DataError]], folder: Path | None) -> Run:
    """Do the jobs of which no report is kept."""
    if folder is None:
        return work

    def do(jobs: Sequence[Job]) -> list[Report | DataError]:
        places = [folder / f"{number}.npz" if (number := job_number(job)) else None for job in jobs]
        found: list[Report | DataError | None] = [None if place is None else read_report(place) for place in places]
        for part in _parts([k for k, report in enumerate(found) if report is None]):
            for k, fresh in zip(part, work([jobs[k] for k in part]), strict=True):
                _keep(places[k], fresh)
                found[k] = fresh
        return [
            replace(done, serial=job.member.serial, power_on=job.member.power_on) if isinstance(done, Report) else done
            for done, job in zip(found, jobs, strict=True)
            if done is not None
        ]

    return do


def _keep(place: Path | None, fresh: Report | DataError) -> None:
    """Write a report; a folder that cannot be written (a mounted archive) costs the time of another run, no result."""
    if place is not None and not isinstance(fresh, DataError):
        with suppress(OSError):
            write_report(place, fresh)


def _parts(places: Sequence[int]) -> list[Sequence[int]]:
    return [places[k : k + _PART] for k in range(0, len(places), _PART)]


def job_number(job: Job) -> str:
    """Give a job a number: another one for other bytes of the bag, another question or another program.

    Returns
    -------
    str
        Empty for a job with effects that have no name.
    """
    source = job.member.open
    effects = (*job.model.effects, *job.candidates)
    if not isinstance(source, BagSource) or any(not isinstance(e, str) for e in effects):
        return ""
    asked = (
        _program(),
        bag_checksum(source.bag),
        job.member.name,
        tuple(map(load_imu, CLASSES if source.imu is None else (source.imu,))),
        load_site(source.site or DEFAULT_SITE),
        source.site,
        source.source,
        source.handheld,
        source.measured_noise,
        source.reference_degc,
        job.model,
        job.estimator,
        job.local,
        job.candidates,
        job.with_local,
        job.stretches,
        job.noise,
        job.imu,
        None if job.about is None else sorted(job.about.items()),
        None
        if job.start is None
        else (job.start.names, job.start.coefficients.tobytes(), job.start.C_nb.tobytes(), job.start.more.tobytes()),
    )
    return hashlib.sha256(repr(asked).encode()).hexdigest()[:40]


@lru_cache(maxsize=1)
def _program() -> str:
    """SHA-256 of the sources that make a report: another program may answer the same question otherwise."""
    total = hashlib.sha256()
    for path in sorted(_SOURCES.rglob("*.py")):
        total.update(path.read_bytes())
    return total.hexdigest()


@lru_cache(maxsize=4096)
def bag_checksum(bag: Path) -> str:
    """SHA-256 of all files of a bag."""
    total = hashlib.sha256()
    files = sorted(p for p in bag.iterdir() if p.is_file()) if bag.is_dir() else [bag]
    for path in files:
        total.update(path.name.encode())
        with path.open("rb") as file:
            while block := file.read(_BLOCK):
                total.update(block)
    return total.hexdigest()


def write_report(path: Path, report: Report) -> None:
    """Write a report beside its place and rename it; the folder is made too."""
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
    }
    places = {} if report.places is None else {f"dwell_{key}": value for key, value in vars(report.places).items()}
    part = beside(path)
    try:
        with part.open("wb") as file:
            np.savez(
                file,
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
    )


def _places(arrays: dict[str, Any]) -> Places | None:
    own = {key.removeprefix("dwell_"): value for key, value in arrays.items() if key.startswith("dwell_")}
    return Places(**own) if own else None


def _term(entry: dict[str, Any]) -> NoiseTerm:
    return NoiseTerm(**(entry | {"alike": tuple(entry["alike"])}))


def _spans(rows: list[list[float]]) -> tuple[tuple[int, float, float], ...]:
    return tuple((int(k), float(a), float(b)) for k, a, b in rows)
