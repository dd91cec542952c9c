"""Install lock files, and say how far it is: pip is silent for a minute, and its own bars need a terminal.

``python requirements/install.py run test`` installs run.lock and test.lock, every file by its hash.
"""

from __future__ import annotations

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
EVERY_S = 5.0
"""Seconds between two lines."""


def packages(files: Sequence[Path]) -> int:
    """Count what lock files ask for."""
    return sum(line[:1] not in " #" for file in files for line in file.read_text(encoding="utf-8").splitlines())


def present() -> int:
    """Count the packages that are installed here."""
    return len(list(Path(sysconfig.get_path("purelib")).glob("*.dist-info")))


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


def install(names: Sequence[str]) -> int:
    """Install lock files by name; return the exit status of pip."""
    files = [FOLDER / f"{name}.lock" for name in names]
    number, before, begun = packages(files), present(), time.monotonic()
    print(f"installing {number} packages ({', '.join(names)}) into {sys.prefix}", flush=True)  # noqa: T201
    command = [sys.executable, "-m", "pip", "install", "--disable-pip-version-check", "--no-deps", "--require-hashes"]
    command += ["--no-color", "--progress-bar", "off", *(word for file in files for word in ("-r", str(file)))]
    with tempfile.TemporaryFile("w+", encoding="utf-8") as errors:
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
                print(f"  {done} of {number}, {time.monotonic() - begun:.0f} s", flush=True)  # noqa: T201
        followed.join()
        if status:
            errors.seek(0)
            sys.stderr.write("".join(followed.lines) + errors.read())
    return status


if __name__ == "__main__":
    sys.exit(install(sys.argv[1:]))
