"""Install lock files, and say how far it is: pip is silent for a minute, and its own bars need a terminal.

``python requirements/install.py run test`` installs run.lock and test.lock, every file by its hash.

On a new machine three things take their time: what is fetched and unpacked, modules that become bytecode, and loops
that become machine code. The first waits for network and disk, the others for a processor, so they go on at once: first
comes what the loops need, then the rest, while `kernels.py` compiles.
"""

from __future__ import annotations

import re
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from threading import Thread
from typing import IO

FOLDER = Path(__file__).resolve().parent
PURELIB = Path(sysconfig.get_path("purelib"))
EVERY_S = 5.0
"""Seconds between two lines."""
ROS = "ros-"
"""How the names of the packages begin that no loop needs: three of four."""


def entries(name: str) -> list[str]:
    """Read what a lock file asks for: each a name, a version and hashes."""
    text = (FOLDER / f"{name}.lock").read_text(encoding="utf-8").replace("\\\n", " ")
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def present() -> int:
    """Count the packages that are installed here."""
    return len(list(PURELIB.glob("*.dist-info")))


class Followed(Thread):
    """What pip says, kept for the case that it fails, and how many packages it has fetched."""

    def __init__(self, stream: IO[str]) -> None:
        super().__init__(daemon=True)
        self._stream = stream
        self.lines: list[str] = []
        self.fetched = 0
        self.unpacking = False

    def run(self) -> None:
        """Read to the end."""
        for line in self._stream:
            self.lines.append(line)
            self.fetched += line.startswith(("Collecting ", "Requirement already satisfied"))
            self.unpacking |= line.startswith("Installing collected packages")


def install(wanted: Sequence[str]) -> int:
    """Install entries of lock files without bytecode; return the exit status of pip."""
    before, begun = present(), time.monotonic()
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile("w+", encoding="utf-8") as errors:
        names = Path(folder) / "wanted.txt"
        names.write_text("\n".join(wanted), encoding="utf-8")
        command = [sys.executable, "-m", "pip", "install", "--disable-pip-version-check", "--no-deps", "--no-compile"]
        command += ["--require-hashes", "--no-color", "--progress-bar", "off", "-r", str(names)]
        pip = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True)
        assert pip.stdout is not None
        followed = Followed(pip.stdout)
        followed.start()
        while True:
            try:
                status = pip.wait(EVERY_S)
                break
            except subprocess.TimeoutExpired:
                done = f"{present() - before} unpacked" if followed.unpacking else f"{followed.fetched} fetched"
                print(f"  {done} of {len(wanted)}, {time.monotonic() - begun:.0f} s", flush=True)  # noqa: T201
        followed.join()
        if status:
            errors.seek(0)
            sys.stderr.write("".join(followed.lines) + errors.read())
    return status


def to_bytecode() -> None:
    """Make bytecode of what is installed, on all cores: pip takes one, and the tests of numpy and scipy besides."""
    tests = f"^{re.escape(str(PURELIB))}/.*/tests?/"
    subprocess.run([sys.executable, "-m", "compileall", "-qq", "-j", "0", "-x", tests, str(PURELIB)], check=False)


def start_kernels() -> None:
    """Begin to compile loops, beside all else; what it does not come to is compiled when it is used first."""
    command = [sys.executable, str(FOLDER / "kernels.py")]
    subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def main(names: Sequence[str]) -> int:
    """Install lock files by name; return an exit status."""
    wanted = [entry for name in names for entry in entries(name)]
    print(f"installing {len(wanted)} packages ({', '.join(names)}) into {sys.prefix}", flush=True)  # noqa: T201
    ros = [entry for entry in wanted if entry.startswith(ROS)]
    status = install([entry for entry in wanted if entry not in ros])
    if ros and not status:
        start_kernels()
        status = install(ros)
    if not status:
        to_bytecode()
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
