"""Formulas written by a user, read without running code: arithmetic and a few functions, nothing else."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.expression import DEEPEST, refuse_nested
from sdimu_calibration.core.recording import DataError

_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_FUNCTIONS: dict[str, tuple[int, Callable[..., Any]]] = {
    "sin": (1, np.sin),
    "cos": (1, np.cos),
    "tan": (1, np.tan),
    "exp": (1, np.exp),
    "log": (1, np.log),
    "abs": (1, np.abs),
    "sign": (1, np.sign),
    "sqrt": (1, np.sqrt),
    "tanh": (1, np.tanh),
    "min": (2, np.minimum),
    "max": (2, np.maximum),
}
_LONGEST = 2000
_AROUND = 20
"""Operations that are put around a formula of the user at most: its coefficient, numbers in the place of names."""


@dataclass(frozen=True)
class Expression:
    """A formula that has been checked."""

    text: str
    tree: ast.expr
    names: frozenset[str]
    """Variables it reads."""

    def evaluate(self, values: Mapping[str, Floats | float]) -> Any:
        """Value for given variables, elementwise; a number when no array is in it."""
        # The same digits whatever the length of the arrays: elementwise operations only.
        with np.errstate(all="ignore"):
            return _evaluate(self.tree, values)


def parse_expression(text: str, known: Collection[str]) -> Expression:
    """Read a formula.

    `text`: numbers, the `known` names, ``+ - * / **`` and sin, cos, tan, exp, log, abs, sign, sqrt, tanh, min, max;
    `known`: names that may be used.
    """
    if len(text) > _LONGEST:
        raise DataError(f"expression is longer than {_LONGEST} characters")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise DataError(
            f"cannot read expression '{text}' (expected SI numbers, powers as **, such as "
            "'1e-6*ax*ay**2 + 1e-7*sin(t/400)')"
        ) from error
    refuse_nested(tree, DEEPEST + _AROUND)
    names: set[str] = set()
    _check(tree, text, known, names)
    return Expression(text, tree, frozenset(names))


def with_values(expression: Expression, values: Mapping[str, float | str]) -> Expression:
    """Put numbers, or other names, in the place of some names of a formula."""

    class Replace(ast.NodeTransformer):
        def visit_Name(self, node: ast.Name) -> ast.expr:
            new = values.get(node.id, node.id)
            return ast.Name(new, node.ctx) if isinstance(new, str) else ast.Constant(float(new))

        def visit_Call(self, node: ast.Call) -> ast.expr:
            # The name of a function is no variable.
            return ast.Call(node.func, [self.visit(argument) for argument in node.args], [])

    tree = Replace().visit(ast.parse(expression.text.strip(), mode="eval").body)
    names = {values.get(name, name) for name in expression.names}
    return Expression(ast.unparse(tree), tree, frozenset(name for name in names if isinstance(name, str)))


def _check(node: ast.expr, text: str, known: Collection[str], names: set[str]) -> None:
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return
    if isinstance(node, ast.Name):
        if node.id not in known:
            raise DataError(f"unknown variable '{node.id}' in expression '{text}' (known: {', '.join(sorted(known))})")
        names.add(node.id)
        return
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        _check(node.left, text, known, names)
        _check(node.right, text, known, names)
        return
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        _check(node.operand, text, known, names)
        return
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        function = _FUNCTIONS.get(node.func.id)
        if function and function[0] == len(node.args):
            for argument in node.args:
                _check(argument, text, known, names)
            return
    raise DataError(
        f"'{ast.unparse(node)}' is not allowed in expression '{text}' "
        f"(allowed: numbers, + - * / **, {', '.join(sorted(_FUNCTIONS))})"
    )


def _evaluate(node: ast.expr, values: Mapping[str, Floats | float]) -> Any:
    if isinstance(node, ast.Constant):
        # Floats only: a power of integers could grow without limit.
        return np.float64(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        return values[node.id]
    if isinstance(node, ast.BinOp):
        return _OPERATORS[type(node.op)](_evaluate(node.left, values), _evaluate(node.right, values))
    if isinstance(node, ast.UnaryOp):
        value = _evaluate(node.operand, values)
        return -value if isinstance(node.op, ast.USub) else value
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        return _FUNCTIONS[node.func.id][1](*(_evaluate(argument, values) for argument in node.args))
    raise AssertionError("checked when it was parsed")
