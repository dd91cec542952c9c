"""The record of a running test that a page reads: filled by what listens to the test, read by the threads of a server.

It knows neither ROS nor a browser. What it holds stays small however long the test lasts.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from queue import Empty, SimpleQueue
from typing import Any
from uuid import uuid4

from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.core.effects import registry
from sdimu_calibration.report.live_page.curves import Curves, Drawn
from sdimu_calibration.report.live_seen import (
    Estimated,
    Outline,
    Progress,
    adding_words,
    in_the_model,
    left_words,
    place_words,
    time_words,
)
from sdimu_calibration.report.live_text import Rows, SeenChoice, SeenDiagnosis
from sdimu_calibration.report.progress_text import Falling, falling, light

HEAD, CURVES, STOPS, DIAGNOSIS, CHOICES, ANSWER = "head", "curves", "stops", "diagnosis", "choices", "answer"
PARTS = (HEAD, CURVES, STOPS, DIAGNOSIS, CHOICES, ANSWER)
"""Parts of a record, each with a version that grows when it changes: a page fetches what is new to it."""


@dataclass(frozen=True)
class End:
    """How a test ended."""

    good: bool
    """It came to its end."""
    words: str
    """One sentence."""
    command: str = ""
    """Shows the report; empty where there is none."""


@dataclass(frozen=True)
class Head:
    """Where a test is, in words."""

    place: str = "waiting for the first message"
    time: str = ""
    light: str = ""
    share: float | None = None
    """Of the test that is done (0 to 1); None where nobody knows how long it is."""
    end: End | None = None
    """None while more may come."""


@dataclass(frozen=True)
class _Kept:
    """What a record holds."""

    head: Head = field(default_factory=Head)
    fallen: tuple[Falling, ...] = ()
    nis: tuple[tuple[int, Mapping[str, float]], ...] = ()
    """Stop, and mean squared innovation per degree of freedom by channel."""
    diagnosis: SeenDiagnosis = field(default_factory=SeenDiagnosis)
    errors: tuple[tuple[int, Rows], ...] = ()
    """Stop that a diagnosis is of, and the error of each model."""
    choices: tuple[SeenChoice, ...] = ()
    answer: str = ""
    not_yet: str = ""
    """What stands in the place of a diagnosis before there is one."""
    joined_s: float = 0.0
    """Time of the test (s) from which it was watched."""


@dataclass(frozen=True, kw_only=True)
class LiveView(_Kept):
    """A record at a moment, with its version by part; a page knows by the run whether it is the same test."""

    run: str
    versions: Mapping[str, int]
    curves: Drawn


class LiveRecord:
    """What was seen of a test so far, and what its page asks for.

    Parameters
    ----------
    test : Outline
        What was known before.
    folder : str
        Of the results; empty where nobody knows.
    about : str
        Which test it is, in one line: what is known of folder, plan, IMU, unit and site.
    """

    def __init__(self, test: Outline, folder: str = "", about: str = "") -> None:
        self.folder, self.about = folder, about
        self._test = test
        self._run = uuid4().hex
        self._lock = threading.Lock()
        self._kept, self._curves = _Kept(not_yet=test.not_yet), Curves()
        self._versions = dict.fromkeys(PARTS, 0)
        self._asked: SimpleQueue[str] = SimpleQueue()
        self._estimated = Estimated()

    def take(self, seen: Progress, streaming: bool, wall_s: float) -> None:
        """Take what is seen now.

        `streaming`: samples still come; False while the whole test is calibrated once more. `wall_s`: wall time that
        the test has taken so far (s).
        """
        fallen = tuple(falling(seen.first, seen.sigmas, self._test.units, self._test.effects))
        head = self._where(seen, streaming, wall_s)
        with self._lock:
            if not self._kept.joined_s:
                self._kept = replace(self._kept, joined_s=seen.table_s)
            self._put(HEAD, head=head)
            if self._curves.add(seen.filter_s, {f.effect: f.share for f in fallen}):
                self._kept = replace(self._kept, fallen=fallen)
                self._versions[CURVES] += 1
            self._put(STOPS, nis=tuple(sorted((stop, dict(nis)) for stop, nis in seen.nis_by_stop.items())))
            if seen.diagnosis is not self._kept.diagnosis:
                self._kept = replace(self._kept, diagnosis=seen.diagnosis)
                self._versions[DIAGNOSIS] += 1
            self._put(DIAGNOSIS, errors=tuple(sorted(seen.ladders.items())))
            self._put(CHOICES, choices=tuple(seen.choices))
            if added := self._estimated.added(seen.sigmas):
                words = f"{in_the_model(added)}; the next diagnosis tells the error with and without it"
                self._put(ANSWER, answer=words)

    def _where(self, seen: Progress, streaming: bool, wall_s: float) -> Head:
        test = self._test
        if not seen.table_s:
            return Head()
        left = left_words(test, seen, wall_s) if streaming else "no more to come"
        return Head(
            place_words(test, seen) if streaming else "last calibration",
            f"{time_words(test, seen)}, {left}",
            light(seen.nis, seen.verdict),
            min(seen.table_s / test.duration_s, 1.0) if test.duration_s else None,
        )

    def _put(self, part: str, **values: Any) -> None:
        if any(getattr(self._kept, name) != value for name, value in values.items()):
            self._kept = replace(self._kept, **values)
            self._versions[part] += 1

    def tell(self, place: str) -> None:
        """Say in the place of the stop what is done after the last sample."""
        with self._lock:
            self._put(HEAD, head=replace(self._kept.head, place=place, time=""))

    def end(self, end: End) -> None:
        """Say that nothing more will come, and why; the first end counts."""
        with self._lock:
            if self._kept.head.end is None:
                self._put(HEAD, head=replace(self._kept.head, place="ended", time="", end=end))

    def view(self) -> LiveView:
        """Return the record as it is now."""
        with self._lock:
            return LiveView(
                run=self._run, versions=dict(self._versions), curves=self._curves.drawn(), **vars(self._kept)
            )

    def ask(self, effect: str) -> None:
        """Ask for an effect more in the model of the test; raises DataError for one that is not offered.

        A page of this machine may name what the catalogue has, and no file.
        """
        if effect not in (*self.ranked(), *catalogue()):
            raise DataError(f"no effect '{effect}' in the catalogue (choose one of the list)")
        with self._lock:
            if self._kept.head.end is not None:
                raise DataError("the test has ended: sdimu calibrate --add takes an effect into its result")
            self._put(ANSWER, answer=f"adding {effect}: the test is asked \N{HORIZONTAL ELLIPSIS}")
        self._asked.put(effect)

    def carry_out(self, add: Callable[[list[str]], str]) -> None:
        """Let a test take the effects that pages asked for, and keep its answer.

        `add`: takes effects, and returns why they were not added; empty when they were.
        """
        while (effect := self._next_asked()) is not None:
            why = add([effect])
            with self._lock:
                self._put(ANSWER, answer=f"not added: {' '.join(why.split())}" if why else adding_words([effect]))

    def _next_asked(self) -> str | None:
        try:
            return self._asked.get_nowait()
        except Empty:
            return None

    def ranked(self) -> tuple[str, ...]:
        """Candidates of the last diagnosis, the largest score first."""
        with self._lock:
            return tuple(label for label, _ in self._kept.diagnosis.ranking)


def catalogue() -> tuple[str, ...]:
    """Coefficients of every effect that can be added by its name alone."""
    effects = (registry.get(name) for name in registry.names())
    return tuple(p.name for effect in effects if not effect.options for p in effect.parameters)
