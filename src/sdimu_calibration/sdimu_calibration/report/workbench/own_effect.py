"""Effects that a page names or writes: from their text to a model that has them."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from sdimu_calibration.core.effect_key import parse_key, read_quantity
from sdimu_calibration.core.effects import imu_model
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Model, StatedPrior
from sdimu_calibration.report.workbench.setting import Prior
from sdimu_calibration.storage.files.effect_file import find_effects, load_effect, new_parts


def added_effects(model: Model, added: Sequence[str], imu: ImuSpecification) -> tuple[Effect, ...]:
    """Effects that a page adds to a model: by name, or by the text of an effect file."""
    effects = list(imu_model.build(model.effects, imu).effects)
    given = len(effects)
    for text in added:
        effects += new_parts(read_effect(text), effects, named(text))
    return tuple(effects[given:])


def stated_priors(
    given: Sequence[StatedPrior], changed: Sequence[Prior], units: Mapping[str, str]
) -> tuple[StatedPrior, ...]:
    """Put the priors of a page over those of the model that it started from.

    `changed`: coefficient, mean and sigma as a page holds them; `units`: customary unit of each coefficient of the
    model.
    """
    names = {name for name, _, _ in changed}
    return (*(one for one in given if one.name not in names), *(_stated(*one, units) for one in changed))


def _stated(name: str, mean: str, sigma: str, units: Mapping[str, str]) -> StatedPrior:
    if name not in units:
        raise DataError(f"prior of {name}: the model has no such coefficient (choose one of the table)")
    unit = units[name]
    value, spread = _field(f"value of {name}", mean, unit), _field(f"sigma of {name}", sigma, unit)
    if spread < 0.0:
        raise DataError(f"sigma of {name}: '{sigma}' is below zero (write a larger one; 0 fixes the coefficient)")
    return StatedPrior(name, value, spread, unit)


def _field(what: str, text: str, unit: str) -> float:
    """Read a field of a prior (SI); what it says of a wrong one has an example in the unit of the coefficient."""
    if not text.strip():
        raise DataError(f"{what}: it is empty (write a number with its unit, such as '1 {unit}')")
    return read_quantity(what, text, unit)


def read_effect(text: str) -> tuple[Effect, ...]:
    """Read an effect by name or by the text of an effect file (several lines)."""
    if "\n" not in text.strip():
        if parse_key(text.strip()).file:
            raise DataError("an effect file is given by its text: use the button for files, or paste it")
        return find_effects(text.strip())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "effect.yaml"
        path.write_text(text, encoding="utf-8")
        try:
            return load_effect(path)
        except DataError as error:
            raise DataError(str(error).replace(f"{path}: ", "")) from error


def named(text: str) -> str:
    """Name of an added effect; an own one says it on its line ``name:``."""
    lines = [line.partition(":")[2].strip() for line in text.splitlines() if line.startswith("name:")]
    return lines[0] if lines else text
