"""What is known of a test that runs: what is watched of it, what was known before, and where it is in words.

`nodes.monitor` fills it; terminal and page show it and know no ROS.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

from sdimu_calibration.core.plain_text import listing, three
from sdimu_calibration.report.live_text import Rows, SeenChoice, SeenDiagnosis


@dataclass
class Progress:
    """How far a test is."""

    stop: int = 0
    phase: str = "starting"
    table_s: float = 0.0
    filter_s: float = 0.0
    """`table_s`, `filter_s`: data time that table and filter have reached (s after the first status)."""
    sigmas: dict[str, float] = field(default_factory=dict)
    """Sigma (SI) by coefficient, as last published."""
    first: dict[str, float] = field(default_factory=dict)
    """Sigma (SI) by coefficient at the begin of the test; of one that nobody knew before, the first published."""
    nis: dict[str, float] = field(default_factory=dict)
    """Mean squared innovation per degree of freedom at the present stop, by channel."""
    verdict: str = ""
    diagnosis: SeenDiagnosis = field(default_factory=SeenDiagnosis)
    """The newest one; of stop -1 before the first."""
    heard: bool = False
    """Any message has come."""
    nis_by_stop: dict[int, dict[str, float]] = field(default_factory=dict)
    """As `nis`, of every stop that was heard of."""
    ladders: dict[int, Rows] = field(default_factory=dict)
    """Models and their errors, by the stop that the diagnosis is of."""
    choices: list[SeenChoice] = field(default_factory=list)
    """Of a test that chooses its turns, the newest last."""

    @property
    def is_test(self) -> bool:
        """Whether what was heard comes from a table or a calibration: /diagnostics has every robot."""
        return self.phase != "starting" or bool(self.sigmas)


@dataclass(frozen=True)
class Outline:
    """What is known of a test before it runs."""

    duration_s: float
    """0 where nobody knows."""
    stops: int
    """0 where nobody knows."""
    effects: Sequence[str]
    units: Mapping[str, str]
    """Customary unit by coefficient."""
    diagnosed: bool = True
    """At the end of each stop."""

    @property
    def not_yet(self) -> str:
        """What stands in the place of a diagnosis before there is one."""
        if self.diagnosed:
            return "No diagnosis so far; one is made at the end of each stop."
        return "No diagnosis while this test runs: it was begun with --no-diagnose."

    @property
    def at_most(self) -> str:
        """What stands before its length: a test that chooses its turns knows the longest only, and no stops."""
        return "" if self.stops else "at most "


def place_words(test: Outline, seen: Progress) -> str:
    """Say at which stop a test is, and whether it turns."""
    of = f" of {test.stops - 1}" if test.stops else ""
    return f"stop {seen.stop}{of} {seen.phase}"


def time_words(test: Outline, seen: Progress) -> str:
    """Say how far a test is, in seconds of its data."""
    of = f" of {test.at_most}{test.duration_s:.0f}" if test.duration_s else ""
    return f"{seen.table_s:.0f}{of} s"


def left_words(test: Outline, seen: Progress, wall_s: float) -> str:
    """Say how long a test will take at the pace so far. `wall_s`: wall time since the first sample (s)."""
    if not test.duration_s or wall_s < 1.0 or seen.table_s <= 0.0:
        return "time left unknown"
    pace = seen.table_s / wall_s
    rest = max(0.0, test.duration_s - seen.table_s) / pace
    words = f"{rest:.0f} s" if rest < 100.0 else f"{rest / 60.0:.0f} min"
    return f"{test.at_most}{words} left at {three(pace)} times real time"


class Estimated:
    """Coefficients that a filter estimates. `awaited`: those that it was asked to add before anybody watched it."""

    def __init__(self, awaited: Collection[str] = ()) -> None:
        self._awaited, self._before = frozenset(awaited), frozenset[str]()

    def added(self, now: Collection[str]) -> list[str]:
        """Take what it estimates now; what came to that since the last time, in order of the names."""
        known = frozenset(now)
        new = known - (self._before or known - self._awaited)
        self._before = known
        return sorted(new)


def adding_words(effects: Sequence[str]) -> str:
    """Say what a test does that was asked for effects more, until `in_the_model`."""
    return f"the test adds {listing(effects)}: its filter goes through all samples so far again"


def in_the_model(effects: Sequence[str]) -> str:
    """Say that a filter estimates what was added."""
    return f"{listing(effects)} {'is' if len(effects) == 1 else 'are'} in the model"
