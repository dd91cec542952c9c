"""The registry: every effect by its name, refused twice."""

from __future__ import annotations

from typing import Any

from sdimu_calibration.core.effects.effect import Effect, family
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.wording import Work

_EFFECTS: dict[str, Effect] = {}


def register(effect: Effect) -> Effect:
    """Add an effect. Raises ValueError when its name, or one of its parameters' names, is taken."""
    if effect.name in _EFFECTS:
        raise ValueError(f"effect '{effect.name}' is registered twice")
    taken = {p.name for e in _EFFECTS.values() for p in e.parameters}
    for parameter in effect.parameters:
        if parameter.name in taken:
            raise ValueError(f"parameter '{parameter.name}' of '{effect.name}' is registered twice")
    _EFFECTS[effect.name] = effect
    return effect


def register_family(*described: Any, **more: Any) -> Effect:
    """Add the effect that `effect.family` makes of the same arguments."""
    return register(family(*described, **more))


def names() -> tuple[str, ...]:
    """Names of all registered effects, in order of registration."""
    return tuple(_EFFECTS)


def find(name: str) -> Effect | None:
    """Look an effect up that may be in no catalogue: None for equations and effects of one's own."""
    return _EFFECTS.get(name)


def get(name: str) -> Effect:
    """Look an effect up."""
    if name not in _EFFECTS:
        raise DataError(f"unknown effect '{name}' ({Work.EFFECTS} lists them)")
    return _EFFECTS[name]
