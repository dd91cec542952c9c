"""What a page of the workbench has done so far: plain data that lives in the page, and pure steps from one to the next.

Fits are functions of this state alone, so a reload of the page, two pages side by side and an undo need nothing more.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any


@dataclass(frozen=True)
class State:
    """Where a page stands.

    Attributes
    ----------
    added : tuple of str
        Effects added to the model, in order: what `sdimu calibrate --add` takes, or the text of an effect file.
    held : tuple of int
        Stops held out of the fit, ascending.
    cell : tuple of (int, int) or None
        Channel and stop that are looked at.
    past : tuple of (added, held)
        What undo goes back to, the last one first to go.
    seen : tuple of (added, held)
        Every model that was fitted in this page, for comparison; an undo does not forget them.
    recording : str
        Name of the recording; empty is the one a fresh page shows.
    """

    added: tuple[str, ...] = ()
    held: tuple[int, ...] = ()
    cell: tuple[int, int] | None = None
    past: tuple[tuple[tuple[str, ...], tuple[int, ...]], ...] = field(default=())
    seen: tuple[tuple[tuple[str, ...], tuple[int, ...]], ...] = field(default=(), compare=False)
    recording: str = ""

    def as_json(self) -> dict[str, Any]:
        """Return it as the page keeps it."""
        return asdict(self)

    def _then(self, **change: Any) -> State:
        here = (self.added, self.held)
        seen = self.seen if here in self.seen else (*self.seen, here)
        return replace(self, past=(*self.past, here), seen=seen, **change)

    def add(self, effect: str) -> State:
        """Add an effect; one that is there already changes nothing."""
        return self if effect in self.added else self._then(added=(*self.added, effect))

    def drop(self, effect: str) -> State:
        """Take an effect out again."""
        return self._then(added=tuple(e for e in self.added if e != effect)) if effect in self.added else self

    def hold(self, stops: tuple[int, ...]) -> State:
        """Hold these stops out, and no others."""
        wanted = tuple(sorted(set(stops)))
        return self if wanted == self.held else self._then(held=wanted)

    def look(self, channel: int, stop: int) -> State:
        """Look at a channel and stop; no step to be undone."""
        return replace(self, cell=(channel, stop))

    def undo(self) -> State:
        """Go back one step; the model that is left stays among those seen."""
        if not self.past:
            return self
        here, (added, held) = (self.added, self.held), self.past[-1]
        seen = self.seen if here in self.seen else (*self.seen, here)
        return replace(self, added=added, held=held, past=self.past[:-1], seen=seen)

    def open(self, recording: str) -> State:
        """Begin afresh with another recording."""
        return self if recording == self.recording else State(recording=recording)


def from_json(kept: Any) -> State:
    """Read what the page kept; anything else is a fresh page."""
    try:
        cell = kept.get("cell")
        return State(
            tuple(map(str, kept.get("added", ()))),
            tuple(map(int, kept.get("held", ()))),
            (int(cell[0]), int(cell[1])) if cell else None,
            _steps(kept.get("past", ())),
            _steps(kept.get("seen", ())),
            str(kept.get("recording", "")),
        )
    except (AttributeError, TypeError, ValueError, IndexError, KeyError, OverflowError):
        return State()


def _steps(kept: Any) -> tuple[tuple[tuple[str, ...], tuple[int, ...]], ...]:
    return tuple((tuple(map(str, a)), tuple(map(int, h))) for a, h in kept)
