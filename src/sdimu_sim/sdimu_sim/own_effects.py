"""Effect files for the simulator: from ``my.yaml:k=0.3 deg/h`` to formulas that the truth keeps.

The calibrator's reader checks the file; what its formulas come to is evaluated by the simulator alone, on true motion.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from sdimu_calibration.core.effect_key import EffectKey, parse_key, read_quantity
from sdimu_calibration.core.expression import VARIABLES
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.effect_schema import EffectFile, constants_of, read_effect_file, si_unit
from sdimu_sim.core.expression import parse_expression, with_values
from sdimu_sim.core.hidden import canonical, parse_effects


def simulated_effects(texts: Iterable[str]) -> tuple[str, ...]:
    """Effects as the simulator takes them: canonical, files put in as equations that name their coefficient.

    `texts`: keys with sizes. An effect file with one parameter is named by its path, else ``PATH:PARAMETER``.
    """
    out = tuple(text for given in texts for text in _written(given))
    parse_effects(out)
    return out


def _written(text: str) -> tuple[str, ...]:
    key = parse_key(text)
    return _of_file(key, *key.file) if key.file else (canonical(text),)


def _of_file(key: EffectKey, path: str, parameter: str) -> tuple[str, ...]:
    file = read_effect_file(Path(path))
    if not parameter and len(file.parameters) == 1:
        (parameter,) = file.parameters
    if parameter not in file.parameters:
        raise DataError(f"effect '{key}': say which parameter, {path}:{' or :'.join(file.parameters)}")
    unit = file.parameters[parameter].display_unit or file.parameters[parameter].unit
    if not key.size:
        raise DataError(f"effect '{key}' has no size (expected something like '{key}=1 {unit}')")
    size = read_quantity(f"effect '{key.name}'", key.size, unit)
    si = f"{size!r} {si_unit(unit)}"
    return tuple(
        str(EffectKey(f"{sensor}: {formula}", {"name": f"{file.name}_{parameter}"}, si))
        for sensor, formula in _formulas(file, parameter).items()
    )


def _formulas(file: EffectFile, parameter: str) -> dict[str, str]:
    """Write the formula of every sensor that `parameter` acts on: it at one, the others at zero, constants put in."""
    numbers = {**constants_of(file), **{name: float(name == parameter) for name in file.parameters}}
    out: dict[str, str] = {}
    for sensor, text in file.expressions.items():
        formula = parse_expression(text, (*VARIABLES, *numbers))
        if parameter in formula.names:
            out[sensor] = with_values(formula, numbers).text
    return out
