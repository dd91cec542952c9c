"""Share out the runs of a campaign and gather them; knows nothing about what a run is."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from sdimu_calibration.core.progress import silent
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.cluster import cluster
from sdimu_study.shards import Shards
from sdimu_study.study import Row

Work = Callable[[int], dict[str, Any]]
Progress = Callable[[str, float], None]

HERE = "here"
"""Scheduler that runs everything in this process, one after the other."""
CHUNK = 4
"""Runs in a shard: a stopped campaign loses at most this many for each worker."""


def run_campaign(
    work: Work,
    seeds: Sequence[int],
    out: Path,
    scheduler: str | None = None,
    progress: Progress | None = None,
    workers: int = 2,
) -> list[Row]:
    """Run a piece of work for every seed that has not been done yet.

    The first missing seed runs alone, so that compiled code is on disk when the others start.

    Parameters
    ----------
    work : callable
        ``work(seed)`` gives what is to be kept, as JSON knows it (numpy too). It must be importable by the workers;
        make it a frozen dataclass with ``__call__``, whose fields are the settings that tell campaigns apart.
    seeds : sequence of int
    out : Path
        Folder for the shards.
    scheduler : str, optional
        Address of a dask scheduler; ``here`` for this process; by default local processes.
    progress : callable, optional
        Called with a word and the share done.
    workers : int
        Number of local processes.

    Returns
    -------
    list of dict
        One row a seed, in the order of `seeds`: ``seed``, ``wall_s``, ``cpu_s`` and what `work` gave; a run that
        failed has ``error`` (its text) instead. Failed runs are tried again when the campaign is run again.
    """
    if workers < 1:
        raise DataError(f"--workers {workers}: expected a whole number from 1")
    shards = Shards(out, work)
    wanted = list(dict.fromkeys(seeds))
    done = {seed: row for seed, row in shards.read().items() if "error" not in row}
    missing = [seed for seed in wanted if seed not in done]
    tell = progress or silent
    failures = 0
    tell(_word(len(wanted) - len(missing), len(wanted), failures), 1.0 - len(missing) / max(len(wanted), 1))
    if missing:
        for rows in _results(work, chunks(missing), scheduler, min(workers, len(missing))):
            shards.write(rows)
            done.update((row["seed"], row) for row in rows)
            failures += sum("error" in row for row in rows)
            count = sum(seed in done for seed in wanted)
            tell(_word(count, len(wanted), failures), count / len(wanted))
    kept = shards.read()  # as JSON gives them back: the same whether a run is new or of an earlier start
    return [kept[seed] for seed in wanted]


def chunks(seeds: Sequence[int]) -> list[list[int]]:
    """Seeds in groups of `CHUNK`, the first one alone."""
    return [list(seeds[:1])] + [list(seeds[k : k + CHUNK]) for k in range(1, len(seeds), CHUNK)]


def run_chunk(work: Work, seeds: Sequence[int]) -> list[Row]:
    """Run some seeds in this process; an error of one becomes its row."""
    rows = []
    for seed in seeds:
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            row = dict(work(seed))
        except Exception as error:  # whatever it is, it must not end the campaign
            row = {"error": f"{type(error).__name__}: {error}"}
        row |= {"seed": seed, "wall_s": time.perf_counter() - wall, "cpu_s": time.process_time() - cpu}
        rows.append(row)
    return rows


def _results(work: Work, groups: list[list[int]], scheduler: str | None, workers: int) -> Iterator[list[Row]]:
    """Rows of every group of seeds, as they are done; the first group before all others."""
    if scheduler == HERE:
        yield from (run_chunk(work, group) for group in groups)
        return
    with cluster(scheduler, workers) as run:
        for part in (groups[:1], groups[1:]):
            for group, rows in run(partial(run_chunk, work), part):
                yield rows if isinstance(rows, list) else [{"seed": seed, "error": rows} for seed in group]


def _word(count: int, total: int, failures: int) -> str:
    return f"run {count} of {total}" + (f", {failures} failed" if failures else "")
