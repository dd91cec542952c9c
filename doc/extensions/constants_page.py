"""The page on every constant of the diagnosis: what it is, its value, and why, from the docstrings of the code."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from pathlib import Path

HEAD = """# Every constant of the diagnosis

Made from the code at each build. [The constants that decide](../theory/priors.md) between models stand there with
their sources. Here are all: thresholds of alarms, limits of lists, bounds of the work, and what keeps arithmetic from
its rounding. To change one may change what is told: run the campaigns of `sdimu study` before and after.
"""
PARTS = {
    "posterior": "Probabilities of effects and noise",
    "diagnosis": "A diagnosis: rounds, alarms, verdict, advice",
    "joint": "Sets of recordings",
    "evidence": "What a recording says",
}
"""Packages below `core`, with the heading of each."""


def page(source: Path) -> str:
    """Write the page: a table for each package.

    Parameters
    ----------
    source : Path
        Folder of the package `sdimu_calibration`.
    """
    return HEAD + "".join(_table(source / "core" / part, heading) for part, heading in PARTS.items())


def _table(folder: Path, heading: str) -> str:
    rows = [
        f"| `{path.stem}.{name}` | {_cell(value)} | {_cell(doc.partition(':')[0])} | {_cell(doc.partition(':')[2])} |\n"
        for path in sorted(folder.glob("*.py"))
        for name, value, doc in numeric_constants(path)
    ]
    head = "| name | value | quantity | reason |\n|---|---|---|---|\n"
    return f"\n## {heading}\n\nBelow `core.{folder.name}`.\n\n{head}{''.join(rows)}"


def _cell(text: str) -> str:
    """Write a text in one line, as a table has it."""
    line = " ".join(text.split()).rstrip(".").replace("|", "\\|")
    return line[:1].lower() + line[1:] if line[1:2].islower() else line


def numeric_constants(path: Path) -> Iterator[tuple[str, str, str]]:
    """Name, value as it is written and docstring of each numeric constant of a module."""
    body: Sequence[ast.stmt] = ast.parse(path.read_text(encoding="utf-8")).body
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.Assign | ast.AnnAssign) and node.value and is_numeric(node.value):
            target = node.targets[0] if isinstance(node, ast.Assign) else node.target
            said = after.value if isinstance(after, ast.Expr) else None
            doc = str(said.value) if isinstance(said, ast.Constant) else ""
            yield ast.unparse(target), ast.unparse(node.value), doc


def is_numeric(value: ast.expr) -> bool:
    """Tell a number, a formula or an array of numbers from a row of indices that names columns."""
    if isinstance(value, ast.Dict):
        # Rows of several numbers name places and signs.
        return bool(value.values) and all(is_numeric(one) and not isinstance(one, ast.Tuple) for one in value.values)
    if isinstance(value, ast.Call) and not ast.unparse(value.func).startswith(("np.", "math.", "float")):
        return False
    if not isinstance(value, ast.Constant | ast.UnaryOp | ast.BinOp | ast.Tuple | ast.Call):
        return False
    parts = [part.value for part in ast.walk(value) if isinstance(part, ast.Constant)]
    indices = isinstance(value, ast.Tuple) and all(isinstance(part, int) for part in parts)
    return bool(parts) and not indices and all(isinstance(part, int | float) for part in parts)
