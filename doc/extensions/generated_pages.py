"""What is made at each build, below doc/generated: command line, constants, catalogue, signature of every effect."""

from __future__ import annotations

import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

from command_line import page
from constants_page import page as constants

import sdimu_calibration
from sdimu_calibration.report.catalogue import page as catalogue

HEADING = re.compile(r"^### (\w+)\n", re.MULTILINE)
CATALOGUE = "generated/effects"
_CAPTION = "Signature of `{coefficient}` over the stops of `kim18`: red up, blue down, full at its largest. {rest}"


def write(path: Path, text: str) -> None:
    """Write a page where it changed: what did not is not read again."""
    path.parent.mkdir(exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def make(app: Any) -> None:
    """Make the pages of the command line, the catalogue and the constants, and the figures."""
    folder = Path(app.srcdir) / "generated"
    write(folder / "cli.md", page())
    write(folder / "effects.md", catalogue(typeset=True))
    write(folder / "constants.md", constants(Path(sdimu_calibration.__file__).parent))
    program = Path(__file__).with_name("signature_figures.py")
    # The compiler is switched off in this process, and the figures need what it compiles.
    kept = {name: value for name, value in os.environ.items() if name != "NUMBA_DISABLE_JIT"}
    subprocess.run([sys.executable, str(program), str(folder / "signatures")], check=True, env=kept)


def with_figures(app: Any, name: str, source: list[str]) -> None:
    """Put the figure of each effect below its heading."""
    if name != CATALOGUE:
        return
    told = json.loads((Path(app.srcdir) / "generated" / "signatures" / "signatures.json").read_text(encoding="utf-8"))

    def figure(found: re.Match[str]) -> str:
        effect = found.group(1)
        if effect not in told:
            return found.group()
        left = told[effect]["left"]
        rest = "" if math.isnan(left) else f"The coefficients of the baseline leave {100.0 * left:.0f} % of it."
        caption = _CAPTION.format(coefficient=told[effect]["coefficient"], rest=rest).strip()
        return f"{found.group()}\n![Signature of {effect}](signatures/{effect}.svg)\n\n*{caption}*\n"

    source[0] = HEADING.sub(figure, source[0])


def setup(app: Any) -> dict[str, bool]:
    """Make the pages before the sources are looked for."""
    app.connect("builder-inited", make)
    app.connect("env-get-outdated", lambda *_: [CATALOGUE])
    app.connect("source-read", with_figures)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
