"""A page that a verb serves on this machine: options of the live page, its server, and the port of any page."""

from __future__ import annotations

import errno
import os
import socket
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.shell_words import quoted

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.report.live_page.record import End, LiveRecord
    from sdimu_calibration.report.live_page.visitors import Visitors

HOST, PORT = "127.0.0.1", 8050
"""Address and port of a page where none is stated."""
_TRIED = 20
"""Number of ports that are tried where none is stated: several tests may run at once."""
_TOLD_S = 6.0
"""Wall time (s) in which open pages are told the end: a page in front asks every second."""
_PANEL = "Live page"


@dataclass(frozen=True)
class PageOptions:
    """Whether and where a test that runs is shown in the browser."""

    live: Annotated[
        bool, typer.Option("--open", help="Show the test on a live page in the browser.", rich_help_panel=_PANEL)
    ] = False
    port: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=65535,
            help=f"With --open: port on this machine; a free one from {PORT} on.",
            rich_help_panel=_PANEL,
        ),
    ] = None
    host: Annotated[
        str | None,
        typer.Option(
            help="With --open: address to listen on; others than this machine only when asked.", rich_help_panel=_PANEL
        ),
    ] = None
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="With --open: only print the address.", rich_help_panel=_PANEL)
    ] = False

    def check(self) -> None:
        """Refuse options that would have no effect."""
        stated = {"--port": self.port is not None, "--host": self.host is not None, "--no-browser": self.no_browser}
        idle = [name for name, given in stated.items() if given]
        if idle and not self.live:
            raise DataError(f"{idle[0]}: only the live page takes it: state --open too, or leave it out")


def check_port(host: str, port: int) -> None:
    """Refuse a port that another program listens on, and an address that is none of this machine."""
    if _is_taken(host, port):
        raise DataError(f"port {port} is taken (choose another with --port)")


def _is_taken(host: str, port: int) -> bool:
    with socket.socket() as probe:
        # What a page that was closed leaves behind is no listener.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                return True
            raise DataError(f"--host {host}: {error.strerror or error}; name an address of this machine") from error
        return False


def _port(host: str, stated: int | None) -> int:
    """Port to listen on: the stated one, else the first that is free."""
    if stated is not None:
        check_port(host, stated)
        return stated
    for port in range(PORT, PORT + _TRIED):
        if not _is_taken(host, port):
            return port
    raise DataError(f"ports {PORT} to {PORT + _TRIED - 1} are taken (choose another with --port)")


@dataclass
class LivePage:
    """Serves a record, where `options` ask for it; a context manager around the test.

    The server listens from the begin of the block, so that a port that is taken is told before anything runs, and
    answers from `begin` on. At the end of the block the pages that are open are told how the test ended.
    """

    options: PageOptions
    record: LiveRecord
    console: Console
    _server: Any = None
    _visitors: Visitors | None = None
    _thread: threading.Thread | None = field(default=None, repr=False)

    def __enter__(self) -> LivePage:
        self.options.check()
        if not self.options.live:
            return self
        import logging

        # In front of everything else: where dash is missing, the error says what to install.
        from sdimu_calibration.report.live_page.app import build

        # isort: split
        from werkzeug.serving import make_server

        from sdimu_calibration.report.live_page.visitors import Visitors

        host = self.options.host or HOST
        port = _port(host, self.options.port)
        logging.getLogger("werkzeug").setLevel(logging.ERROR)
        self._visitors = Visitors()
        self._server = make_server(host, port, build(self.record, host, self._visitors).server, threaded=True)
        return self

    def begin(self) -> None:
        """Answer, and open the page, once all processes of the test are started: threads and forks do not mix."""
        if self._server is None:
            return
        self._thread = threading.Thread(target=self._server.serve_forever, name="live page", daemon=True)
        self._thread.start()
        address = f"http://{self._server.host}:{self._server.port}"
        self.console.print(f"live page at {address}", soft_wrap=True, highlight=False)
        if not self.options.no_browser and _has_screen():
            import webbrowser

            webbrowser.open(address)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._server is None:
            return
        if error is not None:
            self.record.end(_why(error))
        if self._thread is not None:
            self._wait_for_pages()
            self._server.shutdown()
        self._server.server_close()

    def _wait_for_pages(self) -> None:
        until = time.monotonic() + _TOLD_S
        while self._visitors is not None and self._visitors.unaware() and time.monotonic() < until:
            time.sleep(0.1)


def ended(folder: str, more: str = "") -> End:
    """Say that a test came to its end, where its results are and how its report is shown.

    `folder`: of the results; empty where nobody knows. `more`: what else is to be said, as it follows a semicolon.
    """
    from sdimu_calibration.report.live_page.record import End

    parts = ["the test has ended", *([f"results in {folder}"] if folder else []), *([more] if more else [])]
    words = "; ".join(parts)
    command = f"xdg-open {quoted(str(Path(folder) / 'report.html'))}" if folder else ""
    return End(True, f"{words[:1].upper()}{words[1:]}.", command)


def _why(error: BaseException) -> End:
    from sdimu_calibration.report.live_page.record import End

    said = " ".join(str(error).split())
    return End(False, f"The test was stopped{f': {said}' if said else ' by its user'}.")


def _has_screen() -> bool:
    """Whether a browser has a screen: without one it would take the terminal."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
