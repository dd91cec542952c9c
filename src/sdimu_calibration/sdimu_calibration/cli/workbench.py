"""`sdimu workbench`: look at recordings in the browser, add effects, watch the error fall."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.option_groups import with_options, words_of
from sdimu_calibration.cli.options import BagsArgument, Recorded, SetOption
from sdimu_calibration.cli.progress import bar
from sdimu_calibration.cli.serving import HOST, PORT, check_port
from sdimu_calibration.cli.set_run import single
from sdimu_calibration.core.data_error import DataError

if TYPE_CHECKING:
    from sdimu_calibration.core.estimation.prepared_test import PreparedTest
    from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis
    from sdimu_calibration.core.progress import Progress
    from sdimu_calibration.core.specification import Model

    Judge = Callable[[Sequence[str], Progress], SetDiagnosis]


@dataclass(frozen=True)
class Served:
    """Where the page is served, and what it begins with."""

    port: Annotated[int, typer.Option(min=1, max=65535, help="Port on this machine.")] = PORT
    host: Annotated[str, typer.Option(help="Address to listen on; others than this machine only when asked.")] = HOST
    model: Annotated[
        str | None, typer.Option(help="Model to start from: name in config/model or path; baseline when left out.")
    ] = None
    set_file: SetOption = None


@with_options
def workbench(bags: BagsArgument = None, *, served: Served, opening: Recorded) -> None:
    """Open recordings in the browser; runs until it is stopped with Ctrl-C."""
    import logging
    from functools import partial

    from werkzeug.serving import make_server

    from sdimu_calibration.report.workbench.app import build
    from sdimu_calibration.report.workbench.fit import FitSession
    from sdimu_calibration.report.workbench.recording_cache import RecordingCache, neighbours
    from sdimu_calibration.report.workbench.setting import Setting
    from sdimu_calibration.storage.files.config import load_site
    from sdimu_calibration.storage.files.model_choice import named_model
    from sdimu_calibration.storage.opening import open_test

    host, port, set_file = served.host, served.port, served.set_file
    check_port(host, port)
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
    if test.why_handheld:
        raise DataError(
            f"{name}: a handheld run, in which nothing is navigated ({test.why_handheld}): use sdimu diagnose "
            f"{name} (its report has the same figures)"
        )
    return test


def bench_of_set(
    bags: Sequence[Path], file: Path | None, model: str | None, opening: Recorded
) -> tuple[Mapping[str, Callable[[], PreparedTest]], Model, Judge]:
    """Read a set for the workbench: each of its recordings by itself, and what judges them together.

    Parameters
    ----------
    file : Path or None
        Set file, in the place of bags.
    model : str or None
        As the option of the same name.

    Returns
    -------
    openers : mapping of str to callable
        What opens each recording, by its name.
    model : Model
        To start from.
    judge : callable
        Diagnoses the set with effects added; it gets their names and a progress function.
    """
    from sdimu_calibration.core.joint.set_diagnosis import diagnose_set
    from sdimu_calibration.core.joint.set_fit import SetOptions
    from sdimu_calibration.storage.files.model_choice import named_model
    from sdimu_calibration.storage.recording_set import BagSource, load_set, set_of
    from sdimu_calibration.storage.set_work import set_runner

    like = BagSource(Path(), opening.site, opening.imu, opening.source)
    wanted = set_of(bags, like) if file is None else load_set(file, like)
    named = model or wanted.model

    def judge(added: Sequence[str], progress: Progress) -> SetDiagnosis:
        options = SetOptions(named_model(named, added), wanted.estimator, scopes=wanted.scopes)
        # In this process: the recordings of a person at a page are few, and the cores are those of the page, too.
        with set_runner(len(wanted.members), 1, None) as run:
            return diagnose_set(wanted.members, options, run, (), progress)

    return {member.name: member.open for member in wanted.members}, named_model(named, []), judge
