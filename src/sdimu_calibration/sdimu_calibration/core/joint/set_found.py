"""What was found in a set: effects of all recordings and of single ones, functions of the attitude, noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np

from sdimu_calibration.core.diagnosis.search import CERTAIN_NOISE, Search
from sdimu_calibration.core.effects import selection
from sdimu_calibration.core.effects.effect import CHANNELS
from sdimu_calibration.core.evidence.candidate import Candidate, split
from sdimu_calibration.core.evidence.known import Standing
from sdimu_calibration.core.joint.scope import split_tag
from sdimu_calibration.core.joint.set_evidence import SetEvidence
from sdimu_calibration.core.joint.set_fit import SetFit
from sdimu_calibration.core.joint.set_noise import SetNoise
from sdimu_calibration.core.noise_term import ATTITUDE, DRAWN, TRIADS, NoiseTerm
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.core.posterior.posterior import PROBABLE, Posterior
from sdimu_calibration.core.posterior.told import Share


@dataclass(frozen=True)
class Find:
    """An effect that was found, in all recordings or in one."""

    candidate: Candidate
    z: float
    """Score beside what was found before it."""
    alike: tuple[str, ...]
    """What the set cannot tell from it; not told of what is of one recording."""
    probability: float
    """That it or something of its class is there (1)."""
    may_be: tuple[Share, ...]
    """Coefficients of its class with the probability of each."""


@dataclass(frozen=True)
class FunctionShare:
    """How probable an unknown function of the attitude is."""

    recording: str
    """That which has it alone; empty where all share it."""
    probability: float
    sensors: tuple[str, ...]
    """Those that more likely than not have it, else the likeliest one."""

    @property
    def is_common(self) -> bool:
        """Whether all recordings share it."""
        return not self.recording

    @property
    def likely(self) -> bool:
        """Whether it is more likely than not."""
        return self.probability > PROBABLE


@dataclass(frozen=True)
class SetSearch:
    """What was found in a set."""

    before: SetFit
    after: SetFit
    """`before`, `after`: with the model as given, and with what was found."""
    finds: tuple[Find, ...]
    """Effects in all recordings, the largest share of the misfit first; then those of single ones."""
    first: Search[SetEvidence]
    """Of the first round: its scan."""
    standing: Standing
    """What the set knows of the unit."""
    posterior: Posterior[SetEvidence]
    """The models that all recordings together leave probable."""
    stood: bool
    """The choice stood at the end; False where the search went to and fro, and the window chooses something else."""
    alone: SetFit
    """Without a function of the attitude: where the search asked for one, as it stood before that, else `after`."""

    @property
    def told(self) -> tuple[Candidate, ...]:
        """What was found, in all recordings or in one."""
        return tuple(find.candidate for find in self.finds)

    @property
    def chosen(self) -> tuple[Candidate, ...]:
        """What was found in all recordings."""
        return tuple(candidate for candidate in self.told if not candidate.recording)

    @property
    def any_function(self) -> float:
        """Probability of an unknown function of the attitude, in all recordings or in one (1)."""
        return self._of_noise(lambda noise: any(noise.function) or any(map(any, noise.own_functions)))

    @property
    def function_is_likely(self) -> bool:
        """Whether it is more likely than not that all recordings or one have an unknown function of the attitude."""
        return self.any_function > PROBABLE

    @cached_property
    def functions(self) -> tuple[FunctionShare, ...]:
        """The function that all recordings share, and that of each alone; empty where none was looked for."""
        if self.after.function is None:
            return ()
        own = [self._share(report.name, r) for r, report in enumerate(self.after.reports)]
        return (self._share("", None), *own)

    @property
    def told_functions(self) -> tuple[FunctionShare, ...]:
        """Those that are likely; where one is, and it is open whose, the likeliest."""
        likely = tuple(one for one in self.functions if one.likely)
        if likely or not self.function_is_likely:
            return likely
        return (max(self.functions, key=lambda one: one.probability),)

    def drawn_in(self, place: int) -> tuple[NoiseTerm, ...]:
        """Noise that hangs on attitude, rate or turns, nearly certain in a recording, by its place among the reports.

        What wanders and looks the same has its own probability.
        """
        of_each: dict[NoiseTerm, float] = {}
        for noise, p in self.posterior.noises:
            for term in noise.own[place].terms if isinstance(noise, SetNoise) else ():
                if term.kind in DRAWN:
                    of_each[term] = of_each.get(term, 0.0) + p

        def certain(triad: str) -> bool:
            return self._of_noise(lambda noise: bool(noise.own[place].drawn_in(triad))) > CERTAIN_NOISE

        likely = [[term for term in of_each if term.triad == triad] for triad in TRIADS if certain(triad)]
        return tuple(max(own, key=of_each.__getitem__) for own in likely)

    def _share(self, recording: str, place: int | None) -> FunctionShare:
        """Say how probable the function of a recording is, by its place among the reports; None: that of all."""
        sensors = () if self.after.function is None else self.after.function.sensors

        def of(k: int) -> float:
            return self._of_noise(lambda noise: bool(noise.sizes_of(place)[k]))

        each = [of(k) for k in range(len(sensors))]
        likely = tuple(s for s, p in zip(sensors, each, strict=True) if p > PROBABLE)
        together = self._of_noise(lambda noise: any(noise.sizes_of(place)))
        return FunctionShare(recording, together, likely or (sensors[int(np.argmax(each))],))

    def _of_noise(self, holds: Callable[[SetNoise], bool]) -> float:
        return self.posterior.of_any_noise(lambda noise: isinstance(noise, SetNoise) and holds(noise))


def following(window: Posterior[SetEvidence], least: float) -> tuple[str, ...]:
    """List the sensors of which some recording may have an error that follows the attitude, as its noise.

    Parameters
    ----------
    least : float
        Probability of it (1) above which a sensor counts.
    """

    def holds(channel: str, noise: NoiseModel) -> bool:
        return any(term.kind == ATTITUDE and channel in term.sensors for term in noise.terms)

    return tuple(c for c in CHANNELS if window.of_any_noise(partial(holds, c)) > least)


def likeliest_alone(window: Posterior[SetEvidence]) -> SetNoise | None:
    """Find the likeliest noise in which recordings have functions of the attitude of their own, and none is common."""
    alone = [
        (p, noise)
        for noise, p in window.noises
        if isinstance(noise, SetNoise) and any(map(any, noise.own_functions)) and not any(noise.function)
    ]
    return max(alone, key=lambda one: one[0])[1] if alone else None


def of_one_recording(label: str) -> Candidate:
    """Make the candidate of one recording, by its label."""
    key, recording = split_tag(label)
    return replace(_by_key(key), label=label, recording=recording)


@lru_cache(maxsize=4096)
def _by_key(key: str) -> Candidate:
    """Candidate of a key of one parameter: every recording has the same."""
    (one,) = split(selection.resolve(key))
    return one
