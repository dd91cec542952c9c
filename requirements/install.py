"""Install lock files, and say how far it is: pip is silent for a minute, and its own bars need a terminal.

``python requirements/install.py run test`` installs run.lock and test.lock, every file by its hash.

On a new machine three things take their time: what is fetched and unpacked, modules that become bytecode, and loops
that become machine code. The first waits for network and disk, the others for a processor, so they go on at once: the
packages of ROS are fetched beside the others, and as soon as these are there, `kernels.py` compiles, beyond the end of
this script, too.
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


class Pip(Thread):
    """Installs entries of lock files, without bytecode; keeps what pip says for the case that it fails."""

    def __init__(self, wanted: Sequence[str]) -> None:
        super().__init__(daemon=True)
        self._wanted = wanted
        self.said: list[str] = []
        self.fetched = 0
        # Until pip has said otherwise: what ends before is no success.
        self.status = 1

    def run(self) -> None:
        """Install, and count what is fetched."""
        if not self._wanted:
            self.status = 0
            return
        with tempfile.TemporaryDirectory() as folder:
            names = Path(folder) / "wanted.txt"
            names.write_text("\n".join(self._wanted), encoding="utf-8")
            command = [sys.executable, "-m", "pip", "install", "--disable-pip-version-check", "--no-deps"]
            command += ["--no-compile", "--require-hashes", "--no-color", "--progress-bar", "off", "-r", str(names)]
            pip = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            assert pip.stdout is not None
            for line in pip.stdout:
                self.said.append(line)
                self.fetched += line.startswith(("Collecting ", "Requirement already satisfied"))
            self.status = pip.wait()


class Loops:
    """Compiles loops beside all else. What it does not come to, or fails at, is compiled when it is used first."""

    def __init__(self) -> None:
        self._parts: dict[Path, subprocess.Popen[bytes]] = {}

    def start(self) -> None:
        """Begin; nobody waits for the end."""
        for part in ("filter", "others"):
            said = Path(sys.prefix) / f".loops-{part}.log"
            with said.open("wb") as file:
                command = [sys.executable, str(FOLDER / "kernels.py"), part]
                self._parts[said] = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=file)

    def tell(self) -> None:
        """Say what goes on, and what has failed so far: a failure is no reason not to install."""
        for said, process in self._parts.items():
            if process.poll():
                lines = said.read_text(encoding="utf-8", errors="replace").splitlines() or [
                    f"exit {process.returncode}"
                ]
                print(f"  loops are not compiled ahead ({lines[-1]}; {said}): their first use does so", flush=True)  # noqa: T201
        going_on = sum(process.poll() is None for process in self._parts.values())
        if going_on:
            print("  numerical loops go on being compiled in the background", flush=True)  # noqa: T201


def install(first: Sequence[str], then: Sequence[str], loops: Loops) -> int:
    """Install two lists of packages side by side, compile loops as soon as the first is there; return a status."""
    before, begun = present(), time.monotonic()
    pips = [Pip(first), Pip(then)]
    for pip in pips:
        pip.start()
    compiling = not then
    while any(pip.is_alive() for pip in pips):
        until = time.monotonic() + EVERY_S
        while any(pip.is_alive() for pip in pips) and time.monotonic() < until:
            time.sleep(0.1)
            if not compiling and not pips[0].is_alive():
                compiling = True
                if not pips[0].status:
                    loops.start()
        done = f"{sum(pip.fetched for pip in pips)} fetched, {present() - before} unpacked"
        print(f"  {done} of {len(first) + len(then)}, {time.monotonic() - begun:.0f} s", flush=True)  # noqa: T201
    for pip in pips:
        if pip.status:
            sys.stderr.write("".join(pip.said))
    return max(pip.status for pip in pips)


def to_bytecode() -> None:
    """Make bytecode of what is installed, on all cores: pip takes one.

    Without what a run hardly reads: the tests of numpy and scipy, the installers, code for graphics cards, and grammars
    of languages to be coloured.
    """
    unread = "|".join([".*/tests?", "pip", "setuptools", "pkg_resources", "numba/cuda", "pygments/(lexers|styles)"])
    left_out = f"^{re.escape(str(PURELIB))}/({unread})/"
    subprocess.run([sys.executable, "-m", "compileall", "-qq", "-j", "0", "-x", left_out, str(PURELIB)], check=False)


def main(names: Sequence[str]) -> int:
    """Install lock files by name; return an exit status."""
    wanted = [entry for name in names for entry in entries(name)]
    print(f"installing {len(wanted)} packages ({', '.join(names)}) into {sys.prefix}", flush=True)  # noqa: T201
    ros = [entry for entry in wanted if entry.startswith(ROS)]
    loops = Loops()
    status = install([entry for entry in wanted if entry not in ros], ros, loops)
    if not status:
        to_bytecode()
        loops.tell()
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
