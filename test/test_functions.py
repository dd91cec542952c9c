"""Functions stay small enough to call and to read: how many arguments they take, how deep they nest."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = (*(ROOT / "src").iterdir(), ROOT / "study")
"""Packages that are read: those that users install, and the studies."""
MOST_ARGUMENTS = 8
DEEPEST = 4
LONGEST = 60
BLOCKS = (ast.For, ast.While, ast.If, ast.With, ast.Try, ast.Match, ast.AsyncFor, ast.AsyncWith)
Function = ast.FunctionDef | ast.AsyncFunctionDef
Place = tuple[str, str]

MANY_ARGUMENTS: dict[Place, str] = {
    ("sdimu_calibration/api/functions.py", "open"): "keyword arguments of doc/python.md",
    ("sdimu_calibration/api/functions.py", "plan"): "keyword arguments of doc/python.md",
    ("sdimu_calibration/report/page.py", "write_report"): "keyword arguments of doc/report.md",
    ("sdimu_calibration/core/data/resting_cycles.py", "_join"): "compiled",
    ("sdimu_calibration/core/filter/filter_pass.py", "_navigate_epoch"): "compiled",
    ("sdimu_calibration/core/navigation/track.py", "_seen"): "compiled",
}
"""Functions with more arguments, and why."""
DEEP: dict[Place, str] = {}
"""Functions that nest deeper, and why."""
LONG: dict[Place, str] = {
    ("sdimu_calibration/core/joint/set_search.py", "search_set"): "not yet split: the search is being designed anew",
    ("sdimu_calibration/core/filter/filter_pass.py", "run_pass"): "compiled: one loop",
    ("sdimu_calibration/core/navigation/strapdown.py", "_reduce"): "compiled: one loop",
}
"""Functions with more lines, and why."""


@cache
def functions() -> list[tuple[str, Function]]:
    return [
        (path.relative_to(folder).as_posix(), node)
        for folder in FOLDERS
        for path in sorted(folder.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, Function)
    ]


def count_arguments(function: Function) -> int:
    a = function.args
    named = [one.arg for one in (*a.posonlyargs, *a.args, *a.kwonlyargs, a.vararg, a.kwarg) if one is not None]
    return sum(name not in {"self", "cls"} for name in named)


def lines(function: Function) -> int:
    """Lines of a function without its docstring."""
    first = function.body[0]
    documented = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    told = (first.end_lineno or 0) - first.lineno + 1 if documented else 0
    return (function.end_lineno or 0) - function.lineno + 1 - told


def depth(node: ast.AST) -> int:
    """Blocks inside each other; an ``elif`` is as deep as its ``if``, a function inside is counted by itself."""
    deepest = 0
    for field, value in ast.iter_fields(node):
        children = value if isinstance(value, list) else [value]
        for child in children:
            if not isinstance(child, ast.AST) or isinstance(child, Function | ast.ClassDef | ast.Lambda):
                continue
            is_elif = (
                isinstance(node, ast.If) and field == "orelse" and len(children) == 1 and isinstance(child, ast.If)
            )
            deepest = max(deepest, depth(child) + (isinstance(child, BLOCKS) and not is_elif))
    return deepest


@pytest.mark.parametrize(
    ("measure", "most", "exempt"),
    [(count_arguments, MOST_ARGUMENTS, MANY_ARGUMENTS), (depth, DEEPEST, DEEP), (lines, LONGEST, LONG)],
    ids=["arguments", "nesting", "lines"],
)
def test_functions_stay_within_the_limits(measure, most, exempt):
    found = {(name, one.name, one.lineno): measure(one) for name, one in functions()}
    assert {where: size for where, size in found.items() if size > most and where[:2] not in exempt} == {}


@pytest.mark.parametrize(
    ("text", "arguments", "nested"),
    [
        ("def f(self, a, *b, c=1, **d): pass", 4, 0),
        ("def f(a, /, b):\n if a:\n  pass\n elif b:\n  pass\n else:\n  for _ in a:\n   pass", 2, 2),
        ("def f():\n with a:\n  try:\n   pass\n  except E:\n   while b:\n    pass\n def g():\n  if c:\n   pass", 0, 3),
    ],
)
def test_arguments_and_blocks_are_counted(text, arguments, nested):
    (function,) = ast.parse(text).body
    assert isinstance(function, Function)
    assert (count_arguments(function), depth(function)) == (arguments, nested)
