"""`sdimu` in a process of its own, without the second of its start: a server that has loaded libraries forks for each.

A command of a page has folder, environment and streams of its own, and a process, as a reader starts it; but half of a
short one is to load and to take down libraries that every verb uses. The server loads these, once, and nothing of this
repository but how many threads it takes: what a verb takes from it, it imports itself. Not for commands that are sent
signals.
"""

from __future__ import annotations

import atexit
import gc
import json
import os
import socket
import subprocess
import sys
import threading
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path

LIBRARIES = (
    "mcap.reader",
    "numba",
    "numpy",
    "pydantic",
    "rich.console",
    "scipy.linalg",
    "scipy.optimize",
    "scipy.signal",
    "scipy.sparse",
    "scipy.special",
    "scipy.stats",
    "typer.main",
    "yaml",
)
"""What verbs load of other projects."""
_BLOCK = 1 << 16
"""Most bytes (1) taken at once of a request."""

_CLIENT = """import array, json, os, socket, sys
with socket.socket(socket.AF_UNIX) as server:
    server.connect({place!r})
    streams = (socket.SOL_SOCKET, socket.SCM_RIGHTS, array.array("i", [0, 1, 2]))
    request = json.dumps([sys.argv[1:], os.getcwd(), dict(os.environ)]).encode()
    server.sendmsg([len(request).to_bytes(4, "little")], [streams])
    server.sendall(request)
    status = server.recv(1)
sys.exit(status[0] if status else "the server of warm.py has gone")
"""


@contextmanager
def warm_program(folder: Path) -> Iterator[list[str]]:
    """Give the words of a command that does what `sdimu` does, as long as the server in a folder lives."""
    place, client = folder / "warm.socket", folder / "warm_client.py"
    client.write_text(_CLIENT.format(place=str(place)), encoding="utf-8")
    with subprocess.Popen([sys.executable, __file__, place], stdout=subprocess.PIPE) as server:
        assert server.stdout is not None
        try:
            assert server.stdout.readline() == b"ready\n"
            yield [sys.executable, "-IS", str(client)]
        finally:
            server.terminate()


def _request(client: socket.socket) -> tuple[list[str], str, dict[str, str], list[int]]:
    """Receive arguments, folder, environment and the three streams."""
    head, rights, *_ = client.recvmsg(4, socket.CMSG_SPACE(3 * 4))
    streams = array("i")
    streams.frombytes(rights[0][2])
    content = b""
    while len(content) < int.from_bytes(head, "little"):
        content += client.recv(_BLOCK)
    arguments, folder, environment = json.loads(content)
    return arguments, folder, environment, list(streams)


def _become(client: socket.socket) -> None:
    """Take over what a client asks for in a process of its own, which alone returns; tell its exit status."""
    arguments, folder, environment, streams = _request(client)
    child = os.fork()
    if child:
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        client.sendall(bytes([status & 255]))
        os._exit(0)
    client.close()
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.argv = ["sdimu", *arguments]


def _listen(place: str) -> None:
    """Wait for clients; return in the process of a command."""
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(place)
        server.listen()
        os.write(1, b"ready\n")
        while True:
            client, _ = server.accept()
            if not os.fork():
                server.close()
                _become(client)
                return
            client.close()
            with suppress(ChildProcessError):
                while os.waitpid(-1, os.WNOHANG)[0]:
                    pass


def _run(main: Callable[[], None]) -> None:
    """Run a command to its end, with all that it asked to be done then, but without taking each module down."""
    status = 0
    try:
        main()
    except SystemExit as ending:
        status = int(ending.code or 0)
    threading._shutdown()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


if __name__ == "__main__":
    sys.path.pop(0)  # the folder of the tests
    import sdimu_calibration  # noqa: F401  (before numpy: one thread of linear algebra)

    for library in LIBRARIES:
        import_module(library)
    # What is there by now is never garbage: looking through it would copy its memory into every process.
    gc.freeze()
    _listen(sys.argv[1])
    from sdimu_calibration.cli.main import main

    _run(main)
