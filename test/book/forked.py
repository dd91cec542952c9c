"""Commands and Python of the pages without a start for each: a process that has loaded everything forks itself.

A start and the first use of the compiled loops cost two to three seconds of a processor, most pages' commands half a
one. What a fork runs has arguments, folder, environment and streams of its own, as a process that was started anew.

    forked.py serve SOCKET          # says "ready", then runs what it is asked for
    forked.py ask SOCKET sdimu ...  # asks for a command; its exit status is that of the command
    forked.py ask SOCKET python TEXT
"""

# Who asks must start at once: what the other part needs is imported there.
from __future__ import annotations

import json
import os
import signal
import socket
import sys

_LARGEST = 1 << 17
"""Size (byte) of what is asked for: arguments and environment."""


def ask(where: str, words: list[str]) -> int:
    """Have a command run; return its exit status, 1 where it died without one."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as line:
        line.connect(where)
        said = json.dumps({"words": words, "environment": dict(os.environ)})
        socket.send_fds(line, [said.encode()], [0, 1, 2, os.open(".", os.O_RDONLY)])
        return int(line.recv(16) or b"1")


def serve(where: str) -> None:
    """Load what commands use, and fork for each that is asked for."""
    _load()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as door:
        door.bind(where)
        door.listen()
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        while True:
            line, _ = door.accept()
            if os.fork() == 0:
                door.close()
                _answer(line)
            line.close()


def _answer(line: socket.socket) -> None:
    """Run what was asked for in this process, and end it."""
    import traceback

    status = 1
    # Commands wait for the processes that they start.
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    said, (*streams, folder), _, _ = socket.recv_fds(line, _LARGEST, 4)
    os.fchdir(folder)
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
    for number in (*streams, folder):
        os.close(number)
    try:
        status = _run(json.loads(said))
    except BaseException:
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    line.sendall(str(status).encode())
    os._exit(status)


def _run(asked: dict) -> int:
    """Run a command as the main module of this process; return its exit status."""
    import types

    os.environ.clear()
    os.environ.update(asked["environment"])
    # Processes that a command starts import its main module: this one is none of theirs.
    sys.modules["__main__"] = main = types.ModuleType("__main__")
    program, *words = asked["words"]
    sys.argv = [program, *words]
    try:
        if program == "sdimu":
            from sdimu_calibration.cli.main import main as sdimu

            sdimu()
        else:
            sys.argv, sys.path[0] = ["-c"], ""
            exec(compile(words[0], "<string>", "exec"), main.__dict__)
    except SystemExit as ending:
        if isinstance(ending.code, str):
            sys.stderr.write(f"{ending.code}\n")
            return 1
        return int(ending.code or 0)
    return 0


def _load() -> None:
    """Import what the verbs import, and the compiled loops by a small test from samples to a diagnosis."""
    import gc
    import tempfile
    from contextlib import redirect_stderr, redirect_stdout, suppress
    from io import StringIO
    from pathlib import Path

    import sdimu_calibration as sdimu
    from sdimu_calibration.cli.main import main

    plan = (
        "format: sdimu-plan/1\ndwell: 10 s\nrate: 30 deg/s\nacceleration: 60 deg/s^2\n"
        "turns: [{axis: Y, angle: 90 deg}, {axis: Z, angle: 90 deg}, {axis: X, angle: 90 deg}]\n"
    )
    with tempfile.TemporaryDirectory() as name, redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        folder = Path(name)
        (folder / "plan.yaml").write_text(plan, encoding="utf-8")
        bag = sdimu.simulate(folder / "bag", plan=folder / "plan.yaml", rate=20, seed=1)
        for verb in ("calibrate", "diagnose"):
            sys.argv = ["sdimu", verb, str(bag), "--imu", "dtg", "--site", "daejeon", "--out", str(folder / verb)]
            # What is said of so short a test is no matter of the pages.
            with suppress(SystemExit):
                main()
    gc.freeze()


if __name__ == "__main__":
    if sys.argv[1] == "serve":
        serve(sys.argv[2])
    else:
        sys.exit(ask(sys.argv[2], sys.argv[3:]))
