"""One parameter that a model may lack."""

from __future__ import annotations

from dataclasses import dataclass

from sdimu_calibration.core.effects.effect import Effect, Parameter

OWN = "own equation"
"""Title of an equation that no registered effect has."""
OF_RECORDING = "@"
"""Stands between a coefficient of one recording alone and the name of the recording."""


@dataclass(frozen=True)
class Candidate:
    """One parameter that might be missing.

    Attributes
    ----------
    effect : Effect
        With this parameter alone.
    family : str
        Registry name of the effect, or ``own`` for an equation that no registered effect has.
    label : str
        Canonical key of the parameter; with the name of the recording behind it where it is of one alone.
    recording : str
        The only recording of a set in which it acts; empty where it acts in all.
    """

    effect: Effect
    family: str
    label: str
    recording: str = ""

    def __repr__(self) -> str:
        """Label: the equation of an effect is long, and is printed by the catalogue."""
        return self.label

    @property
    def parameter(self) -> Parameter:
        """The parameter."""
        return self.effect.parameters[0]

    @property
    def coefficient(self) -> str:
        """Name of the parameter, whatever its variant; an equation's is its label."""
        name = self.label if self.family == "own" else self.parameter.name
        return f"{name}{OF_RECORDING}{self.recording}" if self.recording else name

    @property
    def added(self) -> str:
        """What adds it to a model: the label, or the parameter of an effect file."""
        if not self.effect.file:
            return self.label
        return f"{self.effect.file}:{self.parameter.name.removeprefix(f'{self.effect.family}_')}"


def split(effect: Effect) -> list[Candidate]:
    """One candidate for each parameter of an effect."""
    family = "own" if effect.title == OWN else effect.family or effect.name
    singles = effect.singles if len(effect.parameters) > 1 else (effect.only((effect.parameters[0].name,)),)
    return [Candidate(one, family, label) for one, label in zip(singles, effect.labels, strict=True)]


def of_the_sensor(variant: Effect, name: str) -> str:
    """Name of a variant's parameter for the sensor of another one: that of an equation holds its numbers too."""
    names = [p.name for p in variant.parameters]
    sensor, _, _ = name.partition(":")
    return name if name in names else next(n for n in names if n.startswith(sensor + ":"))
