"""A reader that trusts what a file says of itself, in a process of its own: it may end as it likes.

`run` starts `ros1_converter` or `mat_reader`, which import little, so that they start fast.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

from sdimu_calibration.core.recording import DataError

_OWN_BYTES = 512 << 20
"""Address space of a program without data: libraries and stacks of threads, hardly any of it touched."""


def run(program: Path, source: Path, target: Path, most: int, patience_s: float, failure: str) -> None:
    """Let a program read a file and write what is in it plainly.

    Parameters
    ----------
    program : Path
        File with the program.
    source, target : Path
        Its two arguments.
    most : int
        Bytes that may come out of the file; the program gets as much memory for its data.
    patience_s : float
        Time (s) that it may take.
    failure : str
        What to say when it fails, such as ``the bag cannot be read``.
    """
    command = [sys.executable, str(program), str(source), str(target)]

    def bound() -> None:
        memory = _OWN_BYTES + most
        for what, limit in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_FSIZE, 2 * most), (resource.RLIMIT_CORE, 0)):
            resource.setrlimit(what, (limit, limit))

    try:
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
            timeout=patience_s,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
            preexec_fn=bound,
        )
    except subprocess.TimeoutExpired as error:
        raise DataError(f"{source}: {failure} in {patience_s:.0f} s") from error
    if done.returncode:
        said = done.stderr.strip().rpartition("\n")[2] or f"its reader ended with {done.returncode}"
        raise DataError(f"{source}: {failure} ({said})")
