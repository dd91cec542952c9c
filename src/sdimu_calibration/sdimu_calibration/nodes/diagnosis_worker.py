"""The process that diagnoses a running test: one request after the other, each a fit of what the journal holds.

It knows no ROS: it gets requests and gives answers through a pipe (`nodes.live_diagnosis`), and ends with it.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from sdimu_calibration.core.data.arrival import in_order, until
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.diagnosis.live_diagnosis import LiveDiagnosis, ModelError, error_of, so_far, waiting
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.front_door import OpeningOptions, open_test
from sdimu_calibration.core.recording import NOMINAL_FROM, DataError
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.report.cost import held_to_use, in_use_entry
from sdimu_calibration.report.live_picture import live_picture
from sdimu_calibration.report.page import write_report
from sdimu_calibration.report.report_extras import report_extras
from sdimu_calibration.storage.files.diagnosis_file import write_diagnosis
from sdimu_calibration.storage.files.journal import read_journal
from sdimu_calibration.storage.files.model_choice import by_hand, model_word, named_model
from sdimu_calibration.storage.files.whole_file import written_together
from sdimu_calibration.storage.trace import traced

Question = Callable[[Fit, LiveDiagnosis, Any], Any]
"""A further question of a fit: `WorkerSetup.question`."""
_NICE = 10
"""Steps by which samples come first."""


@dataclass(frozen=True)
class WorkerSetup:
    """What holds for all requests to a worker."""

    journal: Path
    """As `Journal.place`."""
    options: OpeningOptions
    model: str
    """Name or path; empty takes the one for a table, or for a run by hand."""
    question: Question | None = None
    """Function of a module that is asked of every fit, as ``question(fit, diagnosis, about)``; its answer must survive
    `pickle`."""
    pictures: bool = True
    """Draw each diagnosis."""
    report: Path | None = None
    """Folder that gets diagnosis.json and report.html at the end of the test."""
    awaited: bool = False
    """The test goes on with the answer: no sample comes first meanwhile."""


@dataclass(frozen=True)
class WorkerRequest:
    """Diagnose what there is."""

    stop: int
    until_ns: int | None
    """The last stamp that counts; None for everything."""
    models: tuple[tuple[str, ...], ...] = ((),)
    """What was added to the model, one entry for each model that the test has had, the one in use last."""
    about: Any = None
    """For the question."""
    report: bool = False
    """Leave the files of `WorkerSetup.report`, too."""
    asked: float = field(default_factory=time.monotonic)
    """When (s of the monotonic clock, which all processes share)."""


@dataclass(frozen=True)
class Answer:
    """What came of a request."""

    request: WorkerRequest
    diagnosis: LiveDiagnosis
    more: Any
    """Answer to the question; None without question or fit."""
    seconds: float
    """From the request to the answer."""
    reached_ns: int
    """Stamp of the last sample that was looked at (ns); 0 where there was none."""
    unreported: str = ""
    """Why the files of `WorkerSetup.report` are not there; empty where they are, or none are wanted."""


@dataclass(frozen=True)
class Picture:
    """What comes after each answer."""

    request: WorkerRequest
    png: bytes
    """Of the diagnosis; empty where it waits."""


def picture(answer: Answer) -> Picture:
    """Draw the diagnosis of an answer."""
    waiting = answer.diagnosis.verdict == Verdict.WAITING
    return Picture(answer.request, b"" if waiting else live_picture(answer.diagnosis))


class Diagnoser:
    """Answers requests, and remembers the last data and the errors of models on them."""

    def __init__(self, setup: WorkerSetup) -> None:
        self._setup = setup
        self._test: tuple[int | None, PreparedTest] | None = None
        self._reached_ns = 0
        self._errors: dict[tuple[str, ...], ModelError] = {}

    def answer(self, request: WorkerRequest) -> Answer:
        """Diagnose what there is; a diagnosis that waits where that is not possible yet."""
        more, added, unreported = None, request.models[-1], ""
        try:
            test = self._opened(request.until_ns)
            earlier = [self._error(test, models) for models in request.models[:-1]]
            found, fit = so_far(test, self._model(test, added), added, earlier, request.until_ns is None)
            self._errors[added] = found.ladder[-1]
            if self._setup.question is not None:
                more = self._setup.question(fit, found, request.about)
            if request.report:
                unreported = self._report(test, added)
        except DataError as error:
            until_s = float(self._test[1].recording.t[-1]) if self._test else 0.0
            found, unreported = waiting(request.stop, until_s, added, str(error)), str(error)
        return Answer(request, found, more, time.monotonic() - request.asked, self._reached_ns, unreported)

    def _report(self, test: PreparedTest, added: tuple[str, ...]) -> str:
        """Leave the files of the whole test where they are wanted; why that was not possible."""
        if self._setup.report is None:
            return ""
        try:
            name = " + ".join((model_word(self._setup.model, by_hand(test)), *added))
            leave_report(self._setup.report, test, self._model(test, added), name)
        except (DataError, OSError) as error:
            return str(error)
        return ""

    def _error(self, test: PreparedTest, added: tuple[str, ...]) -> ModelError:
        if added not in self._errors:
            self._errors[added] = error_of(test, self._model(test, added), added)
        return self._errors[added]

    def _model(self, test: PreparedTest, added: tuple[str, ...]) -> Model:
        return named_model(self._setup.model, added, by_hand(test))

    def _opened(self, until_ns: int | None) -> PreparedTest:
        """Open the data up to a stamp, unless they are those of the last request; everything is read anew."""
        if self._test is None or until_ns is None or self._test[0] != until_ns:
            self._test, self._errors = None, {}
            raw = read_journal(self._setup.journal)
            raw = raw if until_ns is None else until(raw, until_ns)
            self._reached_ns = int(raw.ns.max(initial=0))
            if len(raw.ns) <= NOMINAL_FROM:
                raise DataError("too few samples have come")
            opened = open_test(in_order(raw), self._setup.options)
            self._test = until_ns, PreparedTest(opened.recording, opened.imu, opened.site)
        return self._test[1]


DIAGNOSIS, REPORT = "diagnosis.json", "report.html"
"""Names of the files."""


def leave_report(folder: Path, test: PreparedTest, model: Model, name: str) -> None:
    """Write diagnosis.json and report.html of a test that has ended.

    They come beside the result.json of the node, which stays as it is: write it first.

    `model`: with what was added to it; `name`: of the model, for the page. Raises DataError where the test cannot be
    diagnosed.
    """
    found = climb(solve(test, model))
    more = report_extras(found)
    summary = summarise(held_to_use(found, more))
    result = outcome(found.fit, refuse=False)
    with written_together(folder) as part:
        write_diagnosis(part / DIAGNOSIS, summary, in_use=in_use_entry(more))
        title = f"Live test, model {name}"
        write_report(part / REPORT, result, title=title, summary=summary, more=more, trace=traced(model=name))


def work(pipe: Connection) -> None:
    """Answer requests until the pipe breaks.

    `pipe`: brings a `WorkerSetup`, then each `WorkerRequest`; takes each `Answer`, and where the setup wants it a
    `Picture`, which need not be waited for.
    """
    # Ctrl-C reaches every process of a terminal; this one ends with its node.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        setup = pipe.recv()
        os.nice(0 if setup.awaited else _NICE)
        diagnoser = Diagnoser(setup)
        while True:
            answer = diagnoser.answer(pipe.recv())
            pipe.send(answer)
            if setup.pictures:
                pipe.send(picture(answer))
    except (EOFError, OSError):
        # The node has left.
        return


def main() -> None:
    """Work at the pipe whose number is the argument."""
    work(Connection(int(sys.argv[1])))
