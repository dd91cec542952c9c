"""Pages that are made at each build, below doc/generated: the command line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from command_line import page


def write(path: Path, text: str) -> None:
    """Write a page where it changed: what did not is not read again."""
    path.parent.mkdir(exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def make(app: Any) -> None:
    """Make all pages."""
    write(Path(app.srcdir) / "generated" / "cli.md", page())


def setup(app: Any) -> dict[str, bool]:
    """Make the pages before the sources are looked for."""
    app.connect("builder-inited", make)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
