"""Where work runs: a dask cluster, of local processes unless an address is given."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.extras import needed

dask, distributed = needed("dask"), needed("distributed")

_ENVIRONMENT = {
    # One thread a worker: two libraries that each start a thread a core only wait for each other.
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"),
    # Keep freed memory. Dask would give it back to the system at once, and every array of the next run would be fetched
    # page by page: more than half of the processor time of a run.
    **dict.fromkeys(("MALLOC_TRIM_THRESHOLD_", "MALLOC_MMAP_THRESHOLD_"), str(2**30)),
}
_ANSWER_S = 10

Run = Callable[[Callable[[Any], Any], Sequence[Any]], Iterator[tuple[Any, Any]]]


@contextmanager
def cluster(scheduler: str | None, workers: int) -> Iterator[Run]:
    """Give ``run(function, arguments)``, which yields (argument, result) as results come in.

    The result of a call whose worker was lost is the text of the error.

    `scheduler`: address of a dask scheduler; None starts processes on this machine, which end with the context.
    `workers`: number of local processes.
    """
    with _client(scheduler, workers) as client:

        def run(function: Callable[[Any], Any], arguments: Sequence[Any]) -> Iterator[tuple[Any, Any]]:
            futures = {client.submit(function, argument, pure=False): argument for argument in arguments}
            for future in distributed.as_completed(futures):
                yield futures.pop(future), _result(future)

        yield run


@contextmanager
def _client(scheduler: str | None, workers: int) -> Iterator[Any]:
    if scheduler is not None:
        try:
            client = distributed.Client(scheduler, timeout=_ANSWER_S)
        except (OSError, TimeoutError, ValueError) as error:
            raise DataError(f"--scheduler {scheduler}: no dask scheduler answers there") from error
        with client:
            yield client
        return
    with (
        # The allocator reads its limits when the process starts.
        dask.config.set({"distributed.nanny.pre-spawn-environ": _ENVIRONMENT}),
        distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",
            memory_limit=None,
            silence_logs=logging.CRITICAL,
        ) as local,
        distributed.Client(local) as client,
    ):
        yield client


def _result(future: Any) -> Any:
    try:
        return future.result()
    except Exception as error:
        return f"{type(error).__name__}: {error}"
