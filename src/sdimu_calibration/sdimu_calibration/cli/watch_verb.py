"""`sdimu watch`: a test that runs elsewhere, seen in the terminal."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.option_groups import with_options
from sdimu_calibration.cli.serving import LivePage, PageOptions
from sdimu_calibration.core.data_error import DataError

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.cli.processes import RunningTest
    from sdimu_calibration.nodes.monitor import Monitor
    from sdimu_calibration.report.live_page.record import End, LiveRecord
    from sdimu_calibration.report.live_seen import Outline


_LOOK_S = 0.5
"""Time between two looks for a run that has begun (s): short beside the start of its nodes."""


@with_options
def watch(
    model: Annotated[
        str | None,
        typer.Option(
            help="Model that the node estimates: names the effects and their units; that of the run, baseline."
        ),
    ] = None,
    domain: Annotated[
        int | None,
        typer.Option(min=0, max=232, help="ROS domain; ROS_DOMAIN_ID, or that of the sdimu run on this machine."),
    ] = None,
    seconds: Annotated[
        float,
        typer.Option(
            "--for",
            min=0.0,
            help="Wall time to watch, and at most to wait for a run (s); 0 ends with the test, or with Ctrl-C.",
        ),
    ] = 0.0,
    add: Annotated[
        list[str] | None,
        typer.Option(metavar="EFFECT", help="Add an effect to the model of the running test; repeatable."),
    ] = None,
    *,
    page: PageOptions,
) -> None:
    """Watch a running test: stop, sigmas, light of the innovations, and the diagnosis at the end of each stop."""
    import time
    from contextlib import closing

    from sdimu_calibration.cli.console import console as make_console
    from sdimu_calibration.report.live_page.record import LiveRecord

    page.check()
    test = watched(domain)
    outline, first = outlined(test, model, tuple(add or ()))
    waited = test is None and _waited(domain, make_console(), seconds)
    used = _entered(domain, test)
    # The domain is read when ROS is loaded.
    from sdimu_calibration.nodes.monitor import Monitor

    console, begun = make_console(), time.monotonic()
    for line in opening_words(test, used, seconds)[: 1 if waited else None]:
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    start_ns = None if test is None else test.start_ns
    record = LiveRecord(outline) if test is None else LiveRecord(outline, test.folder, test.words)
    with LivePage(page, record, console) as shown, closing(Monitor(start_ns, first)) as monitor:
        awaited = _ask(console, monitor, add) if add else ()
        shown.begin()
        watching = _Watching(console, monitor, outline, awaited, record)
        is_over = _follow(watching, None if test is None else used, seconds)
        if not monitor.progress.heard:
            raise DataError(
                f"ROS domain {used}: nothing heard in {time.monotonic() - begun:.0f} s (is a test running? "
                "state its --domain)"
            )
        record.end(_end(is_over, seconds, record.folder))
    if is_over:
        results = f"; results in {record.folder}" if record.folder else ""
        console.print(f"the test has ended{results}", highlight=False, soft_wrap=True)


def _ask(console: Console, monitor: Monitor, add: Sequence[str]) -> tuple[str, ...]:
    """Let the running test add effects; the coefficients that it will estimate for it."""
    from sdimu_calibration.core.effects import selection
    from sdimu_calibration.report.live_seen import adding_words
    from sdimu_calibration.storage.files.effect_file import find_effects

    if why := monitor.add(add):
        raise DataError(f"--add {' '.join(add)}: {why}")
    console.print(adding_words(add), highlight=False, markup=False, soft_wrap=True)
    effects = (selection.resolve(effect) for text in add for effect in find_effects(text))
    return tuple(parameter.name for effect in effects for parameter in effect.parameters)


def _waited(domain: int | None, console: Console, seconds: float) -> bool:
    """Wait until ROS domain 0 has a test, True then; False at once where a domain is stated.

    Where a run of `sdimu` begins on this machine, watching begins anew in the place of this process: ROS reads the
    domain and its settings as it is loaded.

    Raises DataError after `seconds` (s), unless they are 0.
    """
    import os
    import sys
    import time
    from contextlib import closing

    from sdimu_calibration.cli.processes import stated_domain

    if domain is not None or stated_domain() is not None:
        return False
    from sdimu_calibration.nodes.monitor import Monitor

    console.print(
        "no sdimu run on this machine yet: waiting for one, or for nodes in ROS domain 0; Ctrl-C ends. Start one in "
        "another terminal: sdimu run",
        highlight=False,
        soft_wrap=True,
    )
    begun = time.monotonic()
    with closing(Monitor()) as monitor:
        while watched(None) is None:
            if monitor.listen(_LOOK_S).is_test:
                return True
            if seconds and time.monotonic() - begun > seconds:
                raise DataError(f"no run of sdimu began in {seconds:g} s, and ROS domain 0 is silent: state --domain")
    return os.execv(sys.executable, [sys.executable, "-P", "-m", "sdimu_calibration.cli.main", *sys.argv[1:]])


def opening_words(test: RunningTest | None, domain: int, seconds: float) -> tuple[str, ...]:
    """Say what is watched and until when; where no run is known, what is waited for and how one is started.

    `seconds`: wall time to watch (s); 0 for no end.
    """
    end = f"ends after {seconds:g} s" if seconds else "ends with the test, or with Ctrl-C"
    if test is not None:
        return (f"watching ROS domain {domain}, the run into {test.folder}; {end}",)
    return (
        f"watching ROS domain {domain}; {end}",
        f"no sdimu run is in this domain: waiting for the topics of a test. Start one in another terminal: "
        f"sdimu run --domain {domain}",
    )


def _end(is_over: bool, seconds: float, folder: str) -> End:
    """Say on the page how watching ended."""
    from sdimu_calibration.cli.serving import ended
    from sdimu_calibration.report.live_page.record import End

    if is_over:
        return ended(folder, "the report is there some seconds later" if folder else "")
    how = f"for {seconds:g} s, as asked" if seconds else "as long as its words were read"
    return End(True, f"Watched {how}; the test goes on.")


@dataclass
class Pace:
    """How long a test has taken, told from its pace since it is watched: it may have begun long before."""

    joined: tuple[float, float] | None = None
    """Time of the test and wall time (s) when it was first heard."""

    def wall(self, table_s: float, wall_s: float) -> float:
        """Wall time (s) that the test has taken so far at this pace; 0 while it is unknown."""
        if table_s <= 0.0:
            return 0.0
        if self.joined is None:
            self.joined = table_s, wall_s
        gone, took = table_s - self.joined[0], wall_s - self.joined[1]
        return table_s * took / gone if gone > 0.0 else 0.0


def watched(domain: int | None) -> RunningTest | None:
    """Return the run of `sdimu` on this machine that is meant; None where none is, but perhaps another's test."""
    from sdimu_calibration.cli.processes import running_tests, stated_domain
    from sdimu_calibration.core.recording import DataError

    tests = running_tests()
    stated = domain if domain is not None else stated_domain()
    if stated is not None:
        return next((test for test in tests if test.domain == stated), None)
    if len(tests) > 1:
        listed = ", ".join(f"--domain {test.domain} ({test.folder})" for test in tests)
        raise DataError(f"{len(tests)} tests run on this machine; state one: {listed}")
    return tests[0] if tests else None


def _entered(domain: int | None, test: RunningTest | None) -> int:
    """Domain that ROS will use, once it is loaded: that of a run of `sdimu`, or the stated one."""
    import os

    from sdimu_calibration.cli.processes import DOMAIN_VARIABLE, enter_domain, stated_domain

    if test is not None:
        enter_domain(test.domain)

    if domain is not None:
        os.environ[DOMAIN_VARIABLE] = str(domain)
    return stated_domain() or 0


def outlined(test: RunningTest | None, model: str | None, added: tuple[str, ...]) -> tuple[Outline, dict[str, float]]:
    """Outline of a test, and sigmas (SI) at its begin by coefficient: those of the IMU's file, where it is known.

    Those of the catalogue are among them: an effect may be added at any time, by whoever watches.
    """
    from sdimu_calibration.core.effects import selection
    from sdimu_calibration.core.effects.imu_model import build, prior_sigmas, prior_sizes
    from sdimu_calibration.core.effects.registry import get, names
    from sdimu_calibration.report.live_seen import Outline
    from sdimu_calibration.storage.files.config import load_imu
    from sdimu_calibration.storage.files.effect_file import extended_model

    chosen = extended_model(model or (test.model if test is not None else "baseline"), added)
    effects = [selection.resolve(e) for e in chosen.effects]
    units = {q.name: q.display_unit for effect in effects for q in effect.parameters}
    keys = [effect.key for effect in effects]
    if test is None:
        return Outline(0.0, 0, keys, units), {}
    imu = load_imu(test.imu)
    first = prior_sigmas(build(effects, imu), chosen.body_frame)
    sizes = {q.name: size for e in map(get, names()) for q, size in zip(e.parameters, prior_sizes(e, imu), strict=True)}
    later = {name: size for name, size in sizes.items() if size}
    return Outline(test.duration_s, test.stops, keys, units, test.diagnosed), {**later, **first}


@dataclass(frozen=True)
class _Watching:
    """Who shows a test, and what it is seen by."""

    console: Console
    monitor: Monitor
    outline: Outline
    awaited: Collection[str]
    """Coefficients of what it adds."""
    record: LiveRecord


def _follow(watching: _Watching, domain: int | None, seconds: float) -> bool:
    """Show a test until its end, or for a while; whether it has ended.

    `domain`: held by the run of `sdimu` as long as the test lasts; None for nodes that somebody else started.
    """
    import time

    from sdimu_calibration.cli.closed_pipe import is_read
    from sdimu_calibration.cli.processes import is_held
    from sdimu_calibration.cli.watch import Watch

    begun = time.monotonic()
    pace, monitor = Pace(), watching.monitor
    with Watch(watching.console, watching.outline, watching.awaited) as shown:
        while is_read() and (not seconds or time.monotonic() - begun < seconds):
            now = monitor.listen(0.2)
            wall_s = pace.wall(now.table_s, time.monotonic() - begun)
            shown.show(now, True, wall_s)
            watching.record.take(now, True, wall_s)
            watching.record.carry_out(monitor.add)
            if not is_held(domain) if domain is not None else monitor.left():
                return True
    return False
