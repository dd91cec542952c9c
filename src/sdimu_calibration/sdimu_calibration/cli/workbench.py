"""`sdimu workbench`: look at recordings in the browser, add effects, watch the error fall."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.option_groups import with_options, words_of
from sdimu_calibration.cli.options import BagsArgument, Recorded, SetOption
from sdimu_calibration.cli.set_run import single

if TYPE_CHECKING:
    from sdimu_calibration.core.estimation.prepared_test import PreparedTest

HOST = "127.0.0.1"


@dataclass(frozen=True)
class Served:
    """Where the page is served, and what it begins with."""

    port: Annotated[int, typer.Option(min=1, max=65535, help="Port on this machine.")] = 8050
    host: Annotated[str, typer.Option(help="Address to listen on; others than this machine only when asked.")] = HOST
    model: Annotated[
        str | None, typer.Option(help="Model to start from: name in config/model or path; baseline when left out.")
    ] = None
    set_file: SetOption = None


@with_options
def workbench(bags: BagsArgument = None, *, served: Served, opening: Recorded) -> None:
    """Open recordings in the browser; runs until it is stopped with Ctrl-C."""
    import logging
    import socket
    from collections.abc import Callable, Mapping
    from functools import partial

    from werkzeug.serving import make_server

    from sdimu_calibration.cli.progress import bar
    from sdimu_calibration.cli.set_bench import bench_of_set
    from sdimu_calibration.core.recording import DataError
    from sdimu_calibration.report.workbench.app import build
    from sdimu_calibration.report.workbench.fit import FitSession
    from sdimu_calibration.report.workbench.recording_cache import RecordingCache, neighbours
    from sdimu_calibration.report.workbench.setting import Setting
    from sdimu_calibration.storage.files.config import load_site
    from sdimu_calibration.storage.files.model_choice import named_model
    from sdimu_calibration.storage.opening import open_test

    host, port, set_file = served.host, served.port, served.set_file
    with socket.socket() as probe:
        try:
            taken = probe.connect_ex((host, port)) == 0
        except OSError as error:
            raise DataError(f"--host {host}: {error.strerror or error}; name an address of this machine") from error
        if taken:
            raise DataError(f"port {port} is taken (choose another with --port)")
    specification, wanted = opening.specification, named_model(served.model, [])
    if opening.site is not None:
        load_site(opening.site)
    bag, judge, around = single(bags, set_file), None, dict[str, Path]()
    openers: Mapping[str, Callable[[], PreparedTest]]
    if bag is None:
        openers, wanted, judge = bench_of_set(bags or [], set_file, served.model, opening)
    else:
        around, source = neighbours(bag), opening.source
        openers = {name: partial(open_test, path, opening.site, specification, source) for name, path in around.items()}

    def session(name: str) -> FitSession:
        return FitSession(navigated(name, openers[name]()), wanted)

    shelf = RecordingCache(list(openers), session, around, words_of(opening, Recorded))
    console = plain()
    with bar(plain(stderr=True)) as progress:
        progress("reading", 0.0)
        bench = shelf.bench()
        bench.fit(Setting(), progress)
        bench.missing(Setting(), progress)
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    # The address is printed when the port listens: a browser that follows it at once is not refused.
    server = make_server(host, port, build(shelf, host, judge).server, threaded=True)
    console.print(f"workbench of {shelf.names[0]} at http://{host}:{port} (Ctrl-C ends it)", soft_wrap=True)
    server.serve_forever()


def navigated(name: str, test: PreparedTest) -> PreparedTest:
    """Return a test that is navigated."""
    from sdimu_calibration.core.recording import DataError

    if test.why_handheld:
        raise DataError(
            f"{name}: a handheld run, in which nothing is navigated ({test.why_handheld}): use sdimu diagnose "
            f"{name} (its report has the same figures)"
        )
    return test
