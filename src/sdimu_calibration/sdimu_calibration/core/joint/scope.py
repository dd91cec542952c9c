"""What is common to all recordings of a unit, and what is of one power-on or one recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sdimu_calibration.core.effects.effect import OF_ONE_TIME, Effect
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.evidence.candidate import OF_RECORDING, OWN
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Model

SCOPES = ("unit", "power-on")
"""Scopes that a set can give an effect of its model."""


def tagged(label: str, recording: str) -> str:
    """Put the name of a recording behind a coefficient that is of this recording alone."""
    return f"{label}{OF_RECORDING}{recording}"


def split_tag(label: str) -> tuple[str, str]:
    """Part a coefficient from the recording that it is of; empty where it is of all."""
    name, _, recording = label.partition(OF_RECORDING)
    return name, recording


def is_local(effect: Effect) -> bool:
    """Whether an effect may be in one recording and not in the next: a fault of the data, a drift of a power-on."""
    return effect.scope in {"recording", "power-on"} and "span" not in effect.options


def is_shared(effect: Effect) -> bool:
    """Whether an effect may be the same in all recordings: neither a fault of the data nor an event."""
    return effect.scope != "recording" and not OF_ONE_TIME & effect.options.keys()


def by_name(effect: Effect | str) -> Effect | str:
    """Name an effect of the catalogue, so that another process knows it; one of the user's own stands for itself."""
    return effect if isinstance(effect, str) or effect.file or effect.title == OWN else effect.key


def varying_effects(model: Model, scopes: Mapping[str, str], names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Effects of the model that differ from power-on to power-on, with their coefficients.

    Parameters
    ----------
    scopes : mapping of str to str
        Scopes by name of effect, in place of those of their traits.
    names : sequence of str
        Coefficients that the estimator has.
    """
    effects = {e.family or e.name: e for e in map(resolve, model.effects)}
    for name, scope in scopes.items():
        if name not in effects or scope not in SCOPES:
            raise DataError(
                f"scope of '{name}': '{scope}': expected one of {', '.join(SCOPES)}, and an effect of the model "
                f"({', '.join(effects)})"
            )
    varying = {
        name: tuple(p.name for p in effect.parameters if p.name in names)
        for name, effect in effects.items()
        if scopes.get(name, effect.scope) == "power-on"
    }
    return {name: own for name, own in varying.items() if own}
