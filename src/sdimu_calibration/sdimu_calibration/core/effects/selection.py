"""Effects by their canonical key (`core.effect_key`): a name, one of its coefficients, with options in brackets."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from sdimu_calibration.core.effect_key import EffectKey, parse_key, read_options
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.wording import Work


def resolve(named: str | Effect) -> Effect:
    """Find the effect that `named` names; an effect, as of a file of the user's own, is itself."""
    if isinstance(named, Effect):
        return named
    key = parse_key(named)
    refuse_size(key)
    effect, parameters = _find(key.name)
    if key.options:
        effect = _with_options(effect, key)
    return effect.only(parameters) if parameters else effect


def of_catalogue(effects: Iterable[str | Effect]) -> tuple[Effect, ...]:
    """Effects of a registry among some: no equation that no physics names."""
    return tuple(e for e in map(resolve, effects) if (e.family or e.name) in registry.names())


def number_of(effects: Iterable[Effect]) -> int:
    """Count effects of a catalogue: coefficients that stand alone, and a whole effect as one."""
    return sum(1 if _is_whole(effect) else len(effect.parameters) for effect in effects)


def _is_whole(effect: Effect) -> bool:
    return len(effect.parameters) == len(registry.get(effect.family or effect.name).parameters)


def refuse_size(key: EffectKey) -> None:
    """Refuse a key with a size where the size is what is estimated."""
    if key.size:
        raise DataError(f"effect '{key}': only a simulation takes a size; leave '={key.size}' out to estimate it")


def _find(name: str) -> tuple[Effect, tuple[str, ...]]:
    """Effect and the coefficients asked for: none when it is the whole effect."""
    if name in registry.names():
        return registry.get(name), ()
    asked = tuple(name.split("+"))
    for stem in registry.names():
        effect = registry.get(stem)
        if set(asked) <= {p.name for p in effect.parameters}:
            return effect, asked
    known = [*registry.names(), *(p.name for s in registry.names() for p in registry.get(s).parameters)]
    near = get_close_matches(name, known, n=3)
    hint = f"did you mean {', '.join(near)}?" if near else f"{Work.EFFECTS} lists them"
    raise DataError(f"unknown effect '{name}' ({hint})")


def _with_options(effect: Effect, key: EffectKey) -> Effect:
    if effect.with_options is None:
        raise DataError(f"effect '{effect.name}' takes no options")
    return effect.with_options(**read_options(key, {k: _unit_of(v) for k, v in effect.options.items()}))


def _unit_of(example: str) -> str:
    return example.partition(" ")[2] or "1"
