"""What a page of the workbench has done so far: plain data that lives in the page, and pure steps from one to the next.

Fits are functions of this state alone, so a reload of the page, two pages side by side, undo and redo, and a restart of
the server need nothing more.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any

from pydantic import TypeAdapter, ValidationError

from sdimu_calibration.report.workbench.setting import Setting

_MOST_STEPS = 100
"""Number of steps that undo goes back: each is sent with every click."""


@dataclass(frozen=True)
class State:
    """Where a page stands."""

    now: Setting = field(default_factory=Setting)
    """What is fitted."""
    cell: tuple[int, int] | None = None
    """Channel and stop that are looked at."""
    past: tuple[Setting, ...] = ()
    future: tuple[Setting, ...] = ()
    """`past`, `future`: what undo and redo go to; the last one is the next to go to."""
    seen: tuple[Setting, ...] = field(default=(), compare=False)
    """Everything that was fitted in this page, for comparison; an undo does not forget it."""
    recording: str = ""
    """Name of the recording; empty is the one a fresh page shows."""

    def as_json(self) -> dict[str, Any]:
        """Return it as the page keeps it."""
        return asdict(self)

    def then(self, setting: Setting) -> State:
        """Go on to a setting; the one that is left can be gone back to."""
        if setting == self.now:
            return self
        past = (*self.past, self.now)[-_MOST_STEPS:]
        return replace(self, now=setting, past=past, future=(), seen=self._seen())

    def add(self, effect: str) -> State:
        """Add an effect; one that is there already changes nothing."""
        return self if effect in self.now.added else self.then(replace(self.now, added=(*self.now.added, effect)))

    def drop(self, effect: str) -> State:
        """Take an effect out again, and the priors of its coefficients with it."""
        if effect not in self.now.added:
            return self
        others = tuple(e for e in self.now.added if e != effect)
        return self.then(replace(replace(self.now, added=(*others, effect)).rung(len(others)), added=others))

    def hold(self, stops: tuple[int, ...]) -> State:
        """Leave these stops out, and no others."""
        return self.then(replace(self.now, held=tuple(sorted(set(stops)))))

    def look(self, channel: int, stop: int) -> State:
        """Look at a channel and stop; no step to be undone."""
        return replace(self, cell=(channel, stop))

    def undo(self) -> State:
        """Go back one step."""
        if not self.past:
            return self
        return replace(self, now=self.past[-1], past=self.past[:-1], future=(*self.future, self.now), seen=self._seen())

    def redo(self) -> State:
        """Go forward again where an undo came from."""
        if not self.future:
            return self
        return replace(
            self, now=self.future[-1], past=(*self.past, self.now), future=self.future[:-1], seen=self._seen()
        )

    def open(self, recording: str) -> State:
        """Begin afresh with another recording."""
        return self if recording == self.recording else State(recording=recording)

    def _seen(self) -> tuple[Setting, ...]:
        return self.seen if self.now in self.seen else (*self.seen, self.now)


def from_json(kept: Any) -> State:
    """Read what the page kept; anything else is a fresh page."""
    try:
        return TypeAdapter(State).validate_python(kept)
    except ValidationError:
        return State()
