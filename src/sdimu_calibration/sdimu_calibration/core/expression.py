"""Formulas of a user's own effect: read without running code, checked for units, evaluated on whole arrays.

Allowed are numbers, names, ``+ - * / **`` with constant powers, and a few functions. An angle counts as a number, as
in ``v = w r``, so ``rad`` plays no part in the check of units.
"""

from __future__ import annotations

import ast
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import parse_unit

Dimension = dict[str, Fraction]
"""Powers of the base units; zero powers and ``rad`` left out."""

_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}
_OF_NUMBERS: dict[str, Callable[[Any], Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "exp": np.exp,
    "log": np.log,
    "tanh": np.tanh,
}
_ONE: dict[str, Callable[[Any], Any]] = {**_OF_NUMBERS, "abs": np.abs, "sqrt": np.sqrt, "sign": np.sign}
_TWO: dict[str, Callable[[Any, Any], Any]] = {"min": np.minimum, "max": np.maximum}
_LONGEST = 2000
"""Number of characters of a formula at most: a longer one is no formula, and would nest too deep for the parser."""
DEEPEST = 100
"""Number of operations in one another, as those of a sum are: each is a call in a call when a formula is read."""
_LARGEST = 1e300
"""Size (1) of a number in a formula at most: one beyond it overflows at the first product."""
_LARGEST_POWER = 12
"""Power (1) of a quantity with a unit at most: a higher one is a slip."""
_JOINED = re.compile(r"(?<=[\w)])\s+(?=[A-Za-z(])")
"""A blank between two factors stands for a product, as in the equations that a diagnosis proposes."""


@dataclass(frozen=True)
class Variable:
    """A physical quantity that a formula may name: its unit and what it is."""

    unit: str
    text: str


def _axes(stem: str, unit: str, text: str) -> dict[str, Variable]:
    return {stem + axis: Variable(unit, text.format(axis)) for axis in "xyz"}


VARIABLES: dict[str, Variable] = {
    **_axes("w", "rad/s", "body rate against inertial space, {}"),
    **_axes("wt", "rad/s", "rate of the table, {}; exactly zero at rest"),
    **_axes("alpha", "rad/s^2", "angular acceleration, {}"),
    **_axes("a", "g", "specific force in units of g, {}"),
    **_axes("f", "m/s^2", "specific force, {}"),
    **_axes("n", "1", "North component of body axis {}"),
    **_axes("e", "1", "East component of body axis {}"),
    **_axes("d", "1", "Down component of body axis {}"),
    **_axes("turned", "1", "sign of the last turn about {}"),
    **_axes("leant", "1", "sign of the last change of force along {}"),
    "moving": Variable("1", "1 while the table turns, 0 at rest"),
    "t": Variable("s", "time since the start"),
    "T": Variable("K", "temperature, change since the start"),
    "dTdt": Variable("K/s", "rate of the temperature"),
}
"""Names of a formula; their values: `core.effects.formula_variables`, and the simulator's own from true motion."""
TEMPERATURE_NAMES = frozenset({"T", "dTdt"})


@dataclass(frozen=True)
class Expression:
    """A formula that has been read: nothing in it but what is allowed."""

    text: str
    tree: ast.expr
    names: frozenset[str]

    def evaluate(self, values: Mapping[str, Any]) -> Any:
        """Value for given variables, elementwise."""
        with np.errstate(all="ignore"):
            return _evaluate(self.tree, values)

    def dimension(self, units: Mapping[str, Dimension]) -> Dimension:
        """Find the unit of the value, for given units of the names."""
        return _dimension(self.tree, units)


def dimension_of(unit: str) -> Dimension:
    """Powers of base units in a unit such as ``ug/g``; g alone is the dimension "per g", as of the variables a."""
    if unit == "g":
        return {"g": Fraction(1)}
    return {name: power for name, power in parse_unit(unit).dimension if name != "rad"}


def written(dimension: Dimension) -> str:
    """Write a dimension as people do, SI."""
    above = [f"{n}^{p}" if p != 1 else n for n, p in sorted(dimension.items()) if p > 0]
    below = [f"/{n}^{-p}" if p != -1 else f"/{n}" for n, p in sorted(dimension.items()) if p < 0]
    return ("*".join(above) or "1") + "".join(below)


def reciprocal_unit(dimension: Dimension) -> str:
    """Write the unit that takes a quantity of `dimension` away again, to stand behind another, such as ``/g*s^2``."""
    return "".join(
        ("/" if p > 0 else "*") + n + ("" if abs(p) == 1 else f"^{abs(p)}") for n, p in sorted(dimension.items())
    )


def equation_text(formula: str) -> str:
    """Write an equation as a diagnosis proposes it (``ax^2 wty``) with the operators of a formula."""
    return _JOINED.sub("*", formula.strip().replace("^", "**"))


def parse_expression(text: str, known: frozenset[str]) -> Expression:
    """Read a formula in the `known` names."""
    if len(text) > _LONGEST:
        raise DataError(f"expression is longer than {_LONGEST} characters")
    try:
        tree = ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise DataError(f"cannot read '{text}' (expected a formula such as 'k1 * ax * wz')") from error
    names: set[str] = set()
    refuse_nested(tree)
    _check(tree, text, known, names)
    return Expression(text, tree, frozenset(names))


def refuse_nested(tree: ast.expr, deepest: int = DEEPEST) -> None:
    """Refuse a formula whose operations stand more than `deepest` in one another; it is walked without recursion."""
    level: list[ast.AST] = [tree]
    for _ in range(deepest + 1):
        level = [child for node in level for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)]
        if not level:
            return
    raise DataError(f"expression joins more than {deepest} terms, factors or brackets (shorten it)")


def _check(node: ast.expr, text: str, known: frozenset[str], names: set[str]) -> None:
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        if abs(node.value) > _LARGEST:  # type: ignore[arg-type]
            raise DataError(f"a number in '{text}' is larger than any quantity")
        return
    if isinstance(node, ast.Name):
        if node.id not in known:
            raise DataError(f"unknown name '{node.id}' in '{text}' (known: {', '.join(sorted(known))})")
        names.add(node.id)
        return
    children = _children(node)
    if children is None:
        raise DataError(
            f"'{ast.unparse(node)}' is not allowed in '{text}' (allowed: numbers, names, + - * / **, "
            f"{', '.join(sorted({*_ONE, *_TWO}))})"
        )
    for child in children:
        _check(child, text, known, names)


def _children(node: ast.expr) -> list[ast.expr] | None:
    """Operands of an allowed node; None for everything else."""
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return [node.left, node.right]
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        return [node.operand]
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
        if node.func.id in _ONE and len(node.args) == 1:
            return list(node.args)
        if node.func.id in _TWO and len(node.args) == 2:
            return list(node.args)
    return None


def _evaluate(node: ast.expr, values: Mapping[str, Any]) -> Any:
    if isinstance(node, ast.Constant):
        # Floats only: a power of integers could grow without limit.
        return np.float64(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name):
        return values[node.id]
    parts = [_evaluate(child, values) for child in _children(node) or []]
    if isinstance(node, ast.BinOp):
        return _OPERATORS[type(node.op)](*parts)
    if isinstance(node, ast.UnaryOp):
        return -parts[0] if isinstance(node.op, ast.USub) else parts[0]
    name = node.func.id  # type: ignore[attr-defined]
    return (_ONE if name in _ONE else _TWO)[name](*parts)


def _dimension(node: ast.expr, units: Mapping[str, Dimension]) -> Dimension:
    if isinstance(node, ast.Constant):
        return {}
    if isinstance(node, ast.Name):
        return dict(units[node.id])
    parts = [_dimension(child, units) for child in _children(node) or []]
    if isinstance(node, ast.BinOp):
        return _of_operation(node, parts)
    if isinstance(node, ast.UnaryOp):
        return parts[0]
    name = node.func.id  # type: ignore[attr-defined]
    if name in _TWO:
        return _same(node, parts)
    if name == "sqrt":
        return {n: p / 2 for n, p in parts[0].items()}
    if name == "sign":
        return {}
    if name in _OF_NUMBERS and parts[0]:
        raise DataError(f"'{ast.unparse(node)}': {name} takes a number, not {written(parts[0])}")
    return parts[0]


def _of_operation(node: ast.BinOp, parts: list[Dimension]) -> Dimension:
    left, right = parts
    if isinstance(node.op, ast.Add | ast.Sub):
        return _same(node, parts)
    if isinstance(node.op, ast.Pow):
        return _of_power(node, left, right)
    sign = 1 if isinstance(node.op, ast.Mult) else -1
    out = {n: left.get(n, Fraction(0)) + sign * right.get(n, Fraction(0)) for n in {*left, *right}}
    return {n: p for n, p in out.items() if p}


def _of_power(node: ast.BinOp, base: Dimension, exponent: Dimension) -> Dimension:
    if exponent:
        raise DataError(f"'{ast.unparse(node)}': the power must be a number, not {written(exponent)}")
    if not base:
        return {}
    if any(isinstance(part, ast.Name) for part in ast.walk(node.right)):
        raise DataError(f"'{ast.unparse(node)}': the power of {written(base)} must be a constant")
    with np.errstate(all="ignore"):
        value = float(_evaluate(node.right, {}))
    if not abs(value) <= _LARGEST_POWER:
        raise DataError(f"'{ast.unparse(node)}': the power of {written(base)} must be {_LARGEST_POWER} at most")
    power = Fraction(value).limit_denominator(12)
    return {n: p * power for n, p in base.items() if p * power}


def _same(node: ast.expr, parts: list[Dimension]) -> Dimension:
    if parts[0] != parts[1]:
        raise DataError(f"'{ast.unparse(node)}' joins {written(parts[0])} and {written(parts[1])}, which are not alike")
    return parts[0]
