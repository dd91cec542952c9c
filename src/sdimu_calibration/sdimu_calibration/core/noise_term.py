"""One term of the noise of a triad that has a memory."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from sdimu_calibration.core.note import Topic, topic_of

RANDOM_WALK = "random_walk"
FLICKER = "flicker"
MARKOV = "markov"
STOP = "stop"
TURN = "turn"
SHIFT = "shift"
ATTITUDE = "attitude"
RATE = "rate"
TEMPERATURE = "temperature"
FOLLOWS = (ATTITUDE, RATE, TEMPERATURE)
"""Kinds that are an unknown function: the same where what it follows is the same."""
KINDS = (RANDOM_WALK, FLICKER, MARKOV, STOP, TURN, SHIFT, *FOLLOWS)
"""Kinds of noise with a memory."""
DRAWN = frozenset({STOP, TURN, SHIFT, *FOLLOWS})
"""Kinds of noise that any cause may hide behind that depends on attitude or rate."""
WORDS = {
    RANDOM_WALK: "rate random walk",
    FLICKER: "bias instability (flicker)",
    MARKOV: "Gauss-Markov noise",
    STOP: "bias drawn anew at each stop",
    TURN: "bias drawn anew in each turn",
    SHIFT: "bias shifted in each turn for good",
    ATTITUDE: "error that follows the attitude",
    RATE: "error that follows the rate",
    TEMPERATURE: "error that follows the temperature",
}
_ACCEL_WALK = "acceleration random walk"
TRIADS = ("gyro", "accel")
AXES = (0, 1, 2)
"""Sensors of a triad, by axis."""
Identity: TypeAlias = tuple[str, str, float, tuple[int, ...]]
"""What a term is, its size aside: triad, kind, time constant (s), sensors."""


@dataclass(frozen=True)
class NoiseTerm:
    """One term of the noise of a triad.

    Attributes
    ----------
    triad : str
        ``gyro`` or ``accel``.
    kind : str
        One of `KINDS`.
    tau : float
        Time constant of Markov noise (s); 0 for the other kinds.
    size : float
        SI: sigma of the wandering bias; of a random walk per root second; of flicker the bias instability B.
    low, high : float
        Bounds of the size, 95 %.
    gain : float
        Log-likelihood that the term adds.
    alike : tuple of str
        Kinds that the data cannot tell from it.
    axes : tuple of int
        Sensors of the triad that have it, each a draw of its own, ascending: all but of an unknown function, which may
        be of some.
    """

    triad: str
    kind: str
    tau: float = 0.0
    size: float = 0.0
    low: float = 0.0
    high: float = 0.0
    gain: float = 0.0
    alike: tuple[str, ...] = ()
    axes: tuple[int, ...] = AXES

    @property
    def identity(self) -> Identity:
        """What the term is, its size aside."""
        return self.triad, self.kind, self.tau, self.axes

    @property
    def where(self) -> str:
        """Name of the triad, or of its sensors that have the noise."""
        return sensors_of(self.triad, self.axes)

    @property
    def sensors(self) -> frozenset[str]:
        """Names of the sensors that have the noise, as of the channels of effects: ``accel_x``."""
        return frozenset(f"{self.triad}_{'xyz'[axis]}" for axis in self.axes)

    @property
    def is_drawn(self) -> bool:
        """Whether the noise is drawn anew at stops or turns, and nothing that wanders looks the same."""
        return DRAWN.issuperset((self.kind, *self.alike))

    @property
    def words(self) -> str:
        """Name the term as people do."""
        word = _ACCEL_WALK if (self.triad, self.kind) == ("accel", RANDOM_WALK) else WORDS[self.kind]
        return f"{self.where} {word}" + (f" of {self.tau:.0f} s" if self.tau else "")

    @property
    def unit(self) -> str:
        """Unit of the size (SI)."""
        return ("rad/s" if self.triad == "gyro" else "m/s^2") + ("/sqrt(s)" if self.kind == RANDOM_WALK else "")

    @property
    def display_unit(self) -> str:
        """Unit in which people read the size."""
        return ("deg/h" if self.triad == "gyro" else "ug") + ("/sqrt(h)" if self.kind == RANDOM_WALK else "")


def may_be_an_effect(terms: Sequence[NoiseTerm]) -> bool:
    """Whether a missing effect may be taken for one of these terms.

    What is drawn anew at each stop or turn explains any error that depends on attitude or rate, and Markov noise as
    long as a stop takes the sensitivity of a gyro to force. Bias instability and random walk are in data sheets.
    """
    return any(term.kind not in {FLICKER, RANDOM_WALK} for term in terms)


def unexplained(
    terms: Sequence[NoiseTerm], fault_kinds: Iterable[str] = (), notes: Iterable[str] = ()
) -> tuple[NoiseTerm, ...]:
    """Return the terms that no sensor has by itself: a cause that the model lacks is behind them.

    A calibration and a diagnosis judge the noise of their model by this alone. Wrong samples in turns leave noise that
    looks drawn anew in each turn, so that where single samples were wrong nothing follows. So does a clock: what a
    stamp is late by turns the IMU by its rate, and of the gyros nothing follows where the stamps jitter.

    Parameters
    ----------
    terms : sequence of NoiseTerm
        That were learned beside the model.
    fault_kinds : iterable of str
        Kinds of the faults of the recording, as in `DataFault`.
    notes : iterable of str
        Of the recording.
    """
    if "spike" in fault_kinds:
        return ()
    jitters = any(topic_of(note) == Topic.JITTER for note in notes)
    clock = {("gyro", TURN)} if jitters else set()
    return tuple(term for term in terms if term.is_drawn and (term.triad, term.kind) not in clock)


def sensors_of(triad: str, axes: tuple[int, ...]) -> str:
    """Name some sensors of a triad; the triad where it is all of them."""
    return triad if axes == AXES else f"{triad} {' and '.join('xyz'[axis] for axis in axes)}"
