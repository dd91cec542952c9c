"""Effects by the words that people write: a name, one of its parameters, with options in brackets.

``accel_quadratic`` takes all three axes, ``accel_quadratic_x`` one, ``gyro_bias_warm_up_x(tau=300 s)`` one with its
own time constant.
"""

from __future__ import annotations

import re
from difflib import get_close_matches

from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import UnitError, parse_quantity

_FORM = re.compile(r"\s*([A-Za-z0-9_]+)\s*(?:\((.*)\))?\s*")


def resolve(text: str) -> Effect:
    """Find the effect that `text` names.

    Raises
    ------
    DataError
        When the name or an option is unknown.
    """
    form = _FORM.fullmatch(text)
    if not form:
        raise DataError(f"cannot read effect '{text}' (expected NAME or NAME(option=value, ...))")
    name, options = form.group(1), form.group(2)
    effect, parameter = _find(name)
    if options:
        effect = _with_options(effect, options)
    return effect.only((parameter,)) if parameter else effect


def _find(name: str) -> tuple[Effect, str | None]:
    if name in registry.names():
        return registry.get(name), None
    for stem in registry.names():
        effect = registry.get(stem)
        if name in {p.name for p in effect.parameters}:
            return effect, name
    known = [*registry.names(), *(p.name for s in registry.names() for p in registry.get(s).parameters)]
    near = get_close_matches(name, known, n=3)
    hint = f"did you mean {', '.join(near)}?" if near else "sdimu effects lists them"
    raise DataError(f"unknown effect '{name}' ({hint})")


def _with_options(effect: Effect, text: str) -> Effect:
    if effect.with_options is None:
        raise DataError(f"effect '{effect.name}' takes no options")
    given = dict(part.split("=", 1) for part in text.split(",") if "=" in part)
    given = {k.strip(): v.strip() for k, v in given.items()}
    if set(given) != set(effect.options):
        raise DataError(f"effect '{effect.name}' takes the options {', '.join(effect.options)}: '({text})'")
    try:
        values = {k: parse_quantity(v, _unit_of(effect.options[k])) for k, v in given.items()}
    except UnitError as error:
        raise DataError(f"effect '{effect.name}': {error}") from error
    return effect.with_options(**values)


def _unit_of(example: str) -> str:
    return example.partition(" ")[2] or "1"
