"""Effects that a page names or writes: from their text to a model that has them."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from sdimu_calibration.core.effect_key import parse_key
from sdimu_calibration.core.effects import imu_model
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Model, StatedPrior
from sdimu_calibration.core.units import UnitError, parse_quantity
from sdimu_calibration.report.workbench.setting import Prior
from sdimu_calibration.storage.files.effect_file import find_effects, load_effect, new_parts


def added_effects(model: Model, added: Sequence[str], imu: ImuSpecification) -> tuple[Effect, ...]:
    """Effects that a page adds to a model: by name, or by the text of an effect file."""
    effects = list(imu_model.build(model.effects, imu).effects)
    given = len(effects)
    for text in added:
        effects += new_parts(read_effect(text), effects, named(text))
    return tuple(effects[given:])


def stated_priors(given: Sequence[StatedPrior], changed: Sequence[Prior]) -> tuple[StatedPrior, ...]:
    """Put the priors of a page over those of the model that it started from.

    `changed`: coefficient, mean and sigma as a page holds them.
    """
    names = {name for name, _, _ in changed}
    return (*(one for one in given if one.name not in names), *(_stated(*one) for one in changed))


def _stated(name: str, mean: str, sigma: str) -> StatedPrior:
    try:
        unit = sigma.partition(" ")[2].strip()
        return StatedPrior(name, parse_quantity(mean, unit or "1"), parse_quantity(sigma, unit or "1"), unit)
    except UnitError as error:
        why = str(error) if unit else f"'{mean}' and '{sigma}': write numbers with a unit, as its row shows them"
        raise DataError(f"prior of {name}: {why}") from error


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
