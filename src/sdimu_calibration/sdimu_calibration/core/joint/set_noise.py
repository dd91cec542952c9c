"""Noise of a set as part of a model: that of each recording, and the functions of the attitude beside it."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

from sdimu_calibration.core.posterior.noise_models import NoiseModel


@dataclass(frozen=True)
class SetNoise(NoiseModel):
    """Noise of a set: that of each recording, and functions of the attitude, common or of one recording."""

    chosen: tuple[int, ...] = ()
    """What stands for it on its board; see `Layout`."""
    own: tuple[NoiseModel, ...] = ()
    """Of each recording, in the order of the reports."""
    function: tuple[int, ...] = ()
    """Place of the size of each sensor's common function; 0 is none."""
    own_functions: tuple[tuple[int, ...], ...] = ()
    """The same of the function of each recording alone."""
    log_prior_of_all: float = 0.0
    """Of all of them together, beside white noise in all and no function (1)."""

    def sizes_of(self, recording: int | None) -> tuple[int, ...]:
        """Places of the sizes of a recording's own function; None: of the common one."""
        return self.function if recording is None else self.own_functions[recording]

    @property
    def log_prior(self) -> float:
        """Log of the odds beside white noise in all recordings, of the share of the sizes too (1)."""
        return self.log_prior_of_all

    @property
    def wanders_alone(self) -> bool:
        """Whether nothing in it hangs on attitude, rate or turns, as a missing effect does."""
        return super().wanders_alone and not any(self.function) and not any(map(any, self.own_functions))

    @cached_property
    def sizes(self) -> Mapping[Hashable, float]:
        """Size of each term (SI), by its recording and what it is; of a function its place: its sizes count apart."""
        terms: dict[Hashable, float] = {
            (k, t.identity): t.size for k, noise in enumerate(self.own) for t in noise.terms
        }
        functions = [("function", k, size) for k, size in enumerate(self.function) if size]
        own = [(r, k, size) for r, one in enumerate(self.own_functions) for k, size in enumerate(one) if size]
        return terms | {key: float(key[2]) for key in (*functions, *own)}


@dataclass(frozen=True)
class Layout:
    """Where a choice has what: a place of each recording's noise, then sizes of the common function, then of each own.

    Attributes
    ----------
    recordings : int
        Number of recordings.
    sensors : int
        Number of sensors that may have a function.
    """

    recordings: int
    sensors: int

    def noises(self, chosen: Sequence[int]) -> tuple[int, ...]:
        """Places of the noises, one a recording."""
        return tuple(chosen[: self.recordings])

    def common(self, chosen: Sequence[int]) -> tuple[int, ...]:
        """Places of the sizes of the common function, one a sensor."""
        return tuple(chosen[self.recordings : self.recordings + self.sensors])

    def own(self, chosen: Sequence[int]) -> tuple[tuple[int, ...], ...]:
        """Places of the sizes of each recording's own function."""
        first = self.recordings + self.sensors
        return tuple(tuple(chosen[k : k + self.sensors]) for k in range(first, len(chosen), self.sensors or 1))

    def choice(self, noises: Sequence[int], common: Sequence[int], own: Sequence[Sequence[int]]) -> tuple[int, ...]:
        """Put a choice together; `own` are sizes of each recording's own function."""
        return (*noises, *common, *(size for sizes in own for size in sizes))
