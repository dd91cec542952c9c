"""Code blocks of the pages, as a reader would run them: in the order of the page, in one empty folder."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DEADLINE_S = 580.0
_FENCED = re.compile(r"^```(bash|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_COMMAND = re.compile(r"^    (sdimu .*?)(?:\s+# .*)?$|^\|[^|]*\| `(sdimu [^`]*)` \|", re.MULTILINE)

FORKED = Path(__file__).with_name("forked.py")

_PROGRAM = """#!/bin/sh
said=$(mktemp)
{sdimu} "$@" 2>"$said"
status=$?
cat "$said" >&2
if [ $status -eq 3 ] && grep -q "^sdimu: not to be trusted: " "$said"; then status=0; fi
rm -f "$said"
exit $status
"""
"""`sdimu` as the pages type it. A reader goes on where a command is done and says why its estimate is not to be
trusted: a page about a missing effect begins so."""


class Processes:
    """Start a process for each command, as a reader's shell does."""

    def __call__(self, program: str) -> list[str]:
        """Words before the arguments of ``sdimu``, or before the text of ``python``."""
        return [sys.executable, *{"sdimu": ("-m", "sdimu_calibration.cli.main"), "python": ("-c",)}[program]]


@dataclass(frozen=True)
class Fork(Processes):
    """Fork a process that has loaded everything (`forked`)."""

    where: Path
    """Its socket."""

    def __call__(self, program: str) -> list[str]:
        """Without `site`, who asks starts in a fiftieth of a second."""
        return [sys.executable, "-IS", str(FORKED), "ask", str(self.where), program]


@dataclass(frozen=True)
class Block:
    """One block: its language, and its text."""

    language: str
    text: str


def fenced(page: Path) -> list[Block]:
    """Blocks between fences that say their language; output has none, or ``text``."""
    return [Block(*found.groups()) for found in _FENCED.finditer(page.read_text(encoding="utf-8"))]


def commands(page: Path) -> list[str]:
    """Commands of a page in its order: lines of indented blocks, without their remarks, and cells of tables."""
    return [line or cell for line, cell in _COMMAND.findall(page.read_text(encoding="utf-8"))]


def run(blocks: Iterable[Block], folder: Path, call: Processes | None = None) -> str:
    """Run blocks one after the other; return what they printed.

    Parameters
    ----------
    blocks : iterable of Block
        In the order of the page.
    folder : Path
        Empty folder in which they run.
    call : Processes, optional
        How ``sdimu`` and Python are called; by default each as a process that starts anew.

    Raises
    ------
    AssertionError
        When a block ends with an error: the block, and what it said.
    """
    call = call or Processes()
    tools = folder / "tools"
    tools.mkdir()
    program = tools / "sdimu"
    program.write_text(_PROGRAM.format(sdimu=shlex.join(call("sdimu"))), encoding="utf-8")
    program.chmod(0o755)
    environment = os.environ | {"PATH": f"{tools}:{os.environ['PATH']}", "COLUMNS": "80"}
    said = []
    for block in blocks:
        shell = ["bash", "-eu", "-c"] if block.language == "bash" else call("python")
        done = subprocess.run(
            [*shell, block.text],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=DEADLINE_S,
            check=False,
        )
        assert done.returncode == 0, f"{block.text}\n{done.stdout}{done.stderr}"
        said.append(done.stdout)
    return "\n".join(said)
