"""The file of a user's own effect (format ``sdimu-effect/1``): read, and held to names, units and linearity.

It says what is written, and nothing of what it means: the estimator makes regressors of it (`effect_file`), the
simulator a sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.expression import VARIABLES, Expression, dimension_of, parse_expression, written
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import LARGEST, UnitError, parse_quantity, parse_unit
from sdimu_calibration.storage.files.config import Schema, read_yaml

FORMAT = "sdimu-effect/1"
VARIABLE_UNITS = {name: dimension_of(variable.unit) for name, variable in VARIABLES.items()}
_SENSOR_UNIT = {"gyro": "rad/s", "accel": "m/s^2"}
LONGEST_EFFECT = 1 << 16
"""Bytes of an effect file at most: six of the longest formulas fill a fifth, and a live test waits while it is read."""
_MOST_PARAMETERS = 100
"""Parameters of an effect file at most: three times a whole model; the time of the filter grows with their square."""
_NAME = r"^[A-Za-z][A-Za-z0-9_]*$"


class ParameterFile(Schema):
    """A parameter of a user's own effect: quantities with their units."""

    unit: str
    display_unit: str | None = None
    prior: str


class EffectFile(Schema):
    """A user's own effect, format ``sdimu-effect/1``."""

    format: Literal["sdimu-effect/1"]
    name: str = Field(pattern=_NAME)
    title: str | None = None
    description: str = ""
    expressions: dict[Literal["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"], str] = Field(min_length=1)
    parameters: dict[str, ParameterFile] = Field(min_length=1, max_length=_MOST_PARAMETERS)
    constants: dict[str, str | float] = Field(default_factory=dict)


def read_effect_file(path: Path) -> EffectFile:
    """Read an effect of one's own and check it."""
    path = Path(path)
    if not path.is_file():
        raise DataError(
            f"{path}: is a folder; name an effect file" if path.is_dir() else f"{path}: no such effect file"
        )
    file = read_yaml(path, EffectFile, LONGEST_EFFECT)
    try:
        formulas_of(file)
    except (DataError, UnitError) as error:
        raise DataError(f"{path}: {error}") from error
    return file


def formulas_of(file: EffectFile) -> dict[str, Expression]:
    """Read the formula of each sensor, held to its unit and to linearity in the parameters."""
    _check_names(file)
    constants = constants_of(file)
    known = frozenset({*VARIABLES, *file.parameters, *constants})
    usual = {**constants, **{name: prior_of(file, name) for name in file.parameters}}
    formulas: dict[str, Expression] = {}
    for sensor, text in file.expressions.items():
        formulas[sensor] = _formula(file, sensor, text, known, usual)
    for name in file.parameters:
        if not any(name in formula.names for formula in formulas.values()):
            raise DataError(f"parameters.{name}: no expression uses it (use it in one, or leave it out)")
        alone = constants | {other: float(other == name) for other in file.parameters}
        if all(vanishes(formula, alone) for formula in formulas.values()):
            raise DataError(f"parameters.{name}: what it is multiplied by is zero, whatever the variables are")
    return formulas


def vanishes(formula: Expression, fixed: Mapping[str, float]) -> bool:
    """Whether a formula is exactly zero at random values of its variables, of both signs, with all others `fixed`."""
    rng = np.random.default_rng(8)
    with np.errstate(all="ignore"):
        found = formula.evaluate({name: rng.uniform(-1.5, 1.5, 16) for name in VARIABLES} | dict(fixed))
    return not np.any(found)


def _formula(file: EffectFile, sensor: str, text: str, known: frozenset[str], usual: Mapping[str, float]) -> Expression:
    """Read one formula and hold it to its unit and to linearity; `usual`: constants, priors of parameters."""
    try:
        formula = parse_expression(text, known)
        _check_unit(sensor, formula, file)
        _check_linear(formula, tuple(file.parameters), usual)
        _check_size(formula, usual)
    except DataError as error:
        raise DataError(f"expressions.{sensor}: {error}") from error
    return formula


def _check_names(file: EffectFile) -> None:
    for group, names in (("parameters", file.parameters), ("constants", file.constants)):
        for name in names:
            if name in VARIABLES or (group == "constants" and name in file.parameters):
                raise DataError(f"{group}.{name}: this name has a meaning already (choose another)")


def constants_of(file: EffectFile) -> dict[str, float]:
    """Constants of a user's own effect (SI)."""
    return {name: _constant(name, text) for name, text in file.constants.items()}


def prior_of(file: EffectFile, name: str) -> float:
    """Sigma (SI) of a parameter before the test."""
    about = file.parameters[name]
    try:
        prior = parse_quantity(about.prior, about.unit)
    except UnitError as error:
        raise DataError(f"parameters.{name}.prior: {error}") from error
    if not prior > 0.0:
        raise DataError(f"parameters.{name}.prior: expected more than zero")
    return prior


def _constant(name: str, text: str | float) -> float:
    unit = str(text).strip().partition(" ")[2] or "1"
    try:
        return parse_quantity(str(text), unit)
    except UnitError as error:
        raise DataError(f"constants.{name}: {error}") from error


def _check_unit(sensor: str, formula: Expression, file: EffectFile) -> None:
    units = VARIABLE_UNITS | {name: dimension_of(parameter.unit) for name, parameter in file.parameters.items()}
    units |= {name: dimension_of(str(text).strip().partition(" ")[2] or "1") for name, text in file.constants.items()}
    expected = _SENSOR_UNIT[sensor.partition("_")[0]]
    found = formula.dimension(units)
    if found != dimension_of(expected):
        # An angle counts as a number, so rad/s is 1/s here.
        raise DataError(f"'{formula.text}' comes to {written(found)}, but an error of {sensor} is in {expected}")


def _check_size(formula: Expression, usual: Mapping[str, float]) -> None:
    """Refuse an error that is beyond all numbers where variables are one and parameters as large as their priors."""
    error = abs(float(formula.evaluate({**dict.fromkeys(VARIABLES, 1.0), **usual})))
    if error > LARGEST:
        raise DataError(
            f"'{formula.text}' comes to {error:.2g} at ordinary values of its variables (check its numbers)"
        )


def _check_linear(formula: Expression, parameters: tuple[str, ...], usual: Mapping[str, float]) -> None:
    """Superposition at random values: f(a + b) = f(a) + f(b), f(3 a) = 3 f(a), so f(0) = 0."""
    rng = np.random.default_rng(7)
    at = {name: rng.uniform(0.5, 1.5, 16) for name in VARIABLES} | dict(usual)
    # Of both signs, or |k| would pass.
    a, b = ({name: sign * rng.uniform(0.5, 1.5) for name in parameters} for sign in (1.0, -1.0))

    def value(k: Mapping[str, float]) -> Floats:
        return np.asarray(formula.evaluate({**at, **k})) * np.ones(16)

    both = value({name: a[name] + b[name] for name in parameters})
    thrice = value({name: 3.0 * a[name] for name in parameters})
    fa, fb = value(a), value(b)
    size = 1e-9 * (np.abs(fa) + np.abs(fb))
    if not np.isfinite(both).all():
        raise DataError(f"'{formula.text}' is not finite at ordinary values of its variables")
    if np.any(np.abs(both - fa - fb) > size) or np.any(np.abs(thrice - 3.0 * fa) > 3.0 * size):
        raise DataError(f"'{formula.text}' is not linear in {', '.join(parameters)} (fix what is not as a constant)")


def si_unit(unit: str) -> str:
    """Write the SI unit of the kind of `unit`, as it stands in files."""
    parts = parse_unit(unit).dimension

    def power(name: str, n: Any) -> str:
        if n == 1:
            return name
        return f"sqrt({name})" if 2 * n == 1 else f"{name}^{n}"

    above = [power(name, n) for name, n in parts if n > 0]
    below = [power(name, -n) for name, n in parts if n < 0]
    return "/".join(["*".join(above) or "1", *below])
