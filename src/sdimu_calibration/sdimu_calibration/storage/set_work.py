"""Where the recordings of a set are worked on: in this process, in several, or on a dask cluster; nothing twice.

What a recording says is kept by a number that follows from its bytes and from everything that was asked, so that a
tenth recording costs one, and a run that was killed goes on where it was.
"""

from __future__ import annotations

import hashlib
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import lru_cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from sdimu_calibration.core.estimation.fit_words import MISFIT
from sdimu_calibration.core.joint.member import Job, Report, tried
from sdimu_calibration.core.joint.set_evidence import held_out_chance
from sdimu_calibration.core.joint.set_fit import Run, SetFit
from sdimu_calibration.core.joint.set_result import SCATTERS, set_outcome
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.wording import Work
from sdimu_calibration.storage.bags.bag_folder import FileState, file_states
from sdimu_calibration.storage.files.config import load_imu, load_site
from sdimu_calibration.storage.kept_report import SUFFIX, read_report, write_report
from sdimu_calibration.storage.opening import CLASSES, DEFAULT_SITE
from sdimu_calibration.storage.recording_set import BagSource

FEW = 3
"""Number of recordings up to which one process is faster: starting another takes as long as two recordings."""
_PART = 16
"""Number of recordings after which reports are written: what a kill may cost."""
_SOURCES = Path(__file__).resolve().parents[1]
"""Folder of the package."""

Told = Callable[[int, int], None]


def judged_outcome(fit: SetFit) -> Calibration:
    """Put the result of a joint fit together, with a warning where its recordings do not predict each other.

    As the fit of one recording is judged by stops that it has not seen; that chance does not reach the error is asked,
    too, as two recordings leave much to chance.
    """
    result = set_outcome(fit)
    error = result.fit["held_out_rms"]
    if error is None or error <= MISFIT or held_out_chance(fit, error) >= SCATTERS:
        return result
    told = (
        f"the model does not fit: the recordings do not predict each other (held-out error {error:.3f}; 1 is right): "
        "physics is missing, or they are not of one unit in one state"
    )
    return result.warned(Note(told, Topic.MISFIT, f"; run: {Work.DIAGNOSE}"))


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
    with ExitStack() as running:
        each = [running.enter_context(_one_process()) for _ in range(min(workers, count))]
        yield _kept(Pool(each, told).do, kept)


def _one_process() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, get_context("spawn"), initializer=end_with, initargs=(os.getpid(),))


def _here(jobs: Sequence[Job], told: Told | None) -> list[Report | DataError]:
    done: list[Report | DataError] = []
    for job in jobs:
        done.append(tried(job))
        if told:
            told(len(done), len(jobs))
    return done


class Pool:
    """Processes of this machine, of which each has recordings of its own: it keeps them open from job to job."""

    def __init__(self, processes: Sequence[Executor], told: Told | None) -> None:
        """Take processes of one job at a time; `told` as of `set_runner`."""
        self._processes = processes
        self._told = told
        self._place: dict[str, int] = {}

    def do(self, jobs: Sequence[Job]) -> list[Report | DataError]:
        """Do jobs.

        Raises
        ------
        DataError
            Where the system ended a process.
        """
        if any(not isinstance(e, str) for job in jobs for e in (*job.candidates, *job.model.effects)):
            # An effect of the user's own is a function, which no other process knows.
            return _here(jobs, self._told)
        places = {one.submit(tried, job): k for k, (one, job) in enumerate(zip(self._shared(jobs), jobs, strict=True))}
        found: dict[int, Report | DataError] = {}
        for future in as_completed(places):
            try:
                found[places[future]] = future.result()
            except BrokenProcessPool as error:
                for process in self._processes:
                    process.shutdown(wait=False, cancel_futures=True)
                raise DataError(
                    "the system ended a process of --workers, usually because memory is short: state fewer; what is "
                    "done stays in the folder evidence of --out"
                ) from error
            if self._told:
                self._told(len(found), len(jobs))
        return [found[k] for k in range(len(jobs))]

    def _shared(self, jobs: Sequence[Job]) -> list[Executor]:
        """Give each job the process of its recording, the next one in turn for a new one; what is too much to another.

        No process has more jobs than an even share, so that none works while the others have nothing to do.
        """
        count = len(self._processes)
        own = [self._place.setdefault(job.member.name, len(self._place)) % count for job in jobs]
        most, load = -(-len(jobs) // count), [0] * count
        for k, place in enumerate(own):
            if load[place] == most:
                own[k] = load.index(min(load))
            load[own[k]] += 1
        return [self._processes[place] for place in own]


def _from_cluster(on_cluster: Any, jobs: Sequence[Job], told: Told | None) -> list[Report | DataError]:
    found: dict[str, Report | DataError] = {}
    for job, result in on_cluster(tried, jobs):
        # The text of an error stands for a job whose worker was lost.
        found[job.member.name] = DataError(f"{job.member.name}: {result}") if isinstance(result, str) else result
        if told:
            told(len(found), len(jobs))
    return [found[job.member.name] for job in jobs]


_WATCHED_S = 0.5
"""Time (s) after which a process looks whether its parent is there."""


def end_with(parent: int) -> None:
    """Let this process end when its parent has ended: nobody takes what it works on.

    `parent`: number of the process that started this one.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCHED_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True, name="parent").start()


def _kept(work: Callable[[Sequence[Job]], Sequence[Report | DataError]], folder: Path | None) -> Run:
    """Do the jobs of which no report is kept."""
    if folder is None:
        return work

    def do(jobs: Sequence[Job]) -> list[Report | DataError]:
        numbers = [job_number(job) for job in jobs]
        found: list[Report | DataError | None] = [
            read_report(folder / f"{number}{SUFFIX}", number) if number else None for number in numbers
        ]
        for part in _parts([k for k, report in enumerate(found) if report is None]):
            for k, fresh in zip(part, work([jobs[k] for k in part]), strict=True):
                _keep(folder, numbers[k], fresh)
                found[k] = fresh
        return [
            replace(done, serial=job.member.serial, power_on=job.member.power_on) if isinstance(done, Report) else done
            for done, job in zip(found, jobs, strict=True)
            if done is not None
        ]

    return do


def _keep(folder: Path, number: str, fresh: Report | DataError) -> None:
    """Write a report; a folder that cannot be written (a mounted archive) costs the time of another run, no result."""
    if number and not isinstance(fresh, DataError):
        with suppress(OSError):
            write_report(folder / f"{number}{SUFFIX}", fresh, number)


def _parts(places: Sequence[int]) -> list[Sequence[int]]:
    return [places[k : k + _PART] for k in range(0, len(places), _PART)]


def job_number(job: Job) -> str:
    """Give a job a number: another one for other bytes of the bag, another question or another program.

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
        job.of_fit,
        job.candidates,
        job.with_local,
        job.stretches,
        job.rivals,
        [(one.model, one.names, one.values.tobytes(), one.covariance.tobytes()) for one in job.others],
        job.equations,
    )
    return hashlib.sha256(repr(asked).encode()).hexdigest()[:40]


@lru_cache(maxsize=1)
def _program() -> str:
    """SHA-256 of the sources that make a report: another program may answer the same question otherwise."""
    total = hashlib.sha256()
    for path in sorted(_SOURCES.rglob("*.py")):
        total.update(path.read_bytes())
    return total.hexdigest()


def bag_checksum(bag: Path) -> str:
    """SHA-256 of all files of a bag; read again when one of them has changed."""
    return _checksum(file_states(bag))


@lru_cache(maxsize=4096)
def _checksum(files: tuple[FileState, ...]) -> str:
    total = hashlib.sha256()
    for path, size, *_ in files:
        total.update(f"{len(path.name.encode(errors='surrogateescape'))} {size} ".encode())
        total.update(path.name.encode(errors="surrogateescape"))
        with path.open("rb") as file:
            hashlib.file_digest(file, lambda: total)
    return total.hexdigest()
