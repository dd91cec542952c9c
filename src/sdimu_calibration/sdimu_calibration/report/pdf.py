"""A page as PDF, printed by a browser of this machine: the figures of a page are drawn by one."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from sdimu_calibration.core.recording import DataError

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "microsoft-edge")
"""Programs that print a page without a window, the first that is there is taken."""
_DRAWN_MS = 30000
"""Time of the page's own clock (ms) in which its figures are drawn: it is not waited for."""
_LONGEST_S = 300.0
"""Wall time (s) after which a browser is given up."""


def browser() -> str:
    """Path of a browser that prints; DataError where there is none."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise DataError(f"--pdf: no browser is here that prints ({', '.join(BROWSERS)}): open the page and print it")
    return found


def print_pdf(page: Path, program: str) -> Path:
    """Print a page beside itself. `program`: of `browser`. Gives the PDF."""
    target = page.with_suffix(".pdf")
    target.unlink(missing_ok=True)
    with tempfile.TemporaryDirectory() as own:
        command = [
            *(program, "--headless", "--disable-gpu", "--no-first-run", f"--user-data-dir={own}"),
            # The system's sandbox needs another user than root.
            *(["--no-sandbox"] if os.geteuid() == 0 else []),
            *(f"--virtual-time-budget={_DRAWN_MS}", "--no-pdf-header-footer", f"--print-to-pdf={target.resolve()}"),
            page.resolve().as_uri(),
        ]
        try:
            subprocess.run(command, check=False, capture_output=True, timeout=_LONGEST_S)
        except subprocess.TimeoutExpired:
            raise DataError(
                f"--pdf: {program} did not print {page} in {_LONGEST_S:.0f} s; open it and print it"
            ) from None
    if not target.is_file():
        raise DataError(f"--pdf: {program} did not print {page}; open it and print it")
    return target
