"""The live diagnosis in a process of its own, so that no sample waits for a fit."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from multiprocessing import Pipe

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.diagnosis_worker import Answer, Picture, WorkerRequest, WorkerSetup

_PROGRAM = "from sdimu_calibration.nodes.diagnosis_worker import main; main()"
"""Not ``-m``: what goes through the pipe is of the classes of a module by its real name."""


class Worker:
    """A process that answers one request at a time; the newest one waits, those before it are forgotten.

    A process that was ended from outside in the middle of a request (killed, out of memory) is started anew, and gets
    the request again, once.

    Parameters
    ----------
    warn : callable, optional
        Tells that a process is started anew.
    """

    def __init__(self, setup: WorkerSetup, warn: Callable[[str], None] = lambda _: None) -> None:
        self._setup, self._warn = setup, warn
        self._last = Picture if setup.pictures else Answer
        self._busy: WorkerRequest | None = None
        self._next: WorkerRequest | None = None
        self._answered = self._again = False
        self._start()

    def _start(self) -> None:
        self._pipe, far = Pipe()
        # A new interpreter, not a fork: the threads of DDS do not survive one.
        self._process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM, str(far.fileno())],
            pass_fds=[far.fileno()],
            stdin=subprocess.DEVNULL,
            env=dict(os.environ),
        )
        # The only other end is the worker's: it reads the end of the pipe when this process is gone.
        far.close()
        self._pipe.send(self._setup)

    @property
    def idle(self) -> bool:
        """Whether every request that still counts is answered."""
        return self._busy is None and self._next is None

    def ask(self, request: WorkerRequest) -> None:
        """Take a request in place of the one that waits; a report that was asked for stays asked for."""
        waits = self._next is not None and self._next.report
        self._next = replace(request, until_ns=None, report=True) if waits else request
        self._send()

    def _send(self) -> None:
        if self._busy is None and self._next is not None:
            self._busy, self._next = self._next, None
            self._answered = self._again = False
            self._hand_over()

    def _hand_over(self) -> None:
        # A process that has ended is noticed where its answer is awaited.
        with suppress(OSError):
            self._pipe.send(self._busy)

    def answer(self) -> Answer | Picture | None:
        """Return what has come: an answer, then the picture of it where the setup wants one.

        Raises
        ------
        DataError
            A process has ended, and so has the one that was started in its place.
        """
        try:
            if self._busy is None or not self._pipe.poll():
                return None
            answer: Answer | Picture = self._pipe.recv()
        except (EOFError, OSError) as error:
            self._go_on(error)
            return None
        self._answered = True
        if isinstance(answer, self._last):
            self._busy = None
            self._send()
        return answer

    def _go_on(self, error: Exception) -> None:
        """Start another process in the place of one that has ended; it reads everything from the journal."""
        self.close()
        if self._again:
            self._busy = self._next = None
            raise DataError("the process of the live diagnosis has ended twice; the test goes on without it") from error
        self._warn("the process of the live diagnosis has ended before its answer was there; another one begins anew")
        self._start()
        if self._answered:
            # The picture alone is lost.
            self._busy = None
            self._send()
        else:
            self._again = True
            self._hand_over()

    def close(self) -> None:
        """End the process; a fit that it works on is not wanted any more."""
        self._pipe.close()
        self._process.kill()
        self._process.wait()
