"""The recordings that a page can choose from: the one that was asked for, and its neighbours in the same folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from threading import Lock

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.report.workbench.fit import FitSession
from sdimu_calibration.storage.bags.bag_folder import FileState, file_states

_MOST_OPEN = 3
"""Recordings that stay open: each holds some 100 MB of reduced samples."""


class RecordingCache:
    """Recordings by name; a bench is made when one is first asked for, and anew once its file was changed.

    Parameters
    ----------
    names : sequence of str
        The first is the one a fresh page shows.
    make : callable
        Opens the recording of a name; raises DataError.
    places : mapping of str to Path, optional
        Where they are; a command that is taken home names a recording without a place by its name.
    options : sequence of str
        Words of the command line that say how they are opened.
    """

    def __init__(
        self,
        names: Sequence[str],
        make: Callable[[str], FitSession],
        places: Mapping[str, Path] | None = None,
        options: Sequence[str] = (),
    ) -> None:
        self._names, self._make, self._places = tuple(names), make, places or {}
        self.options = tuple(options)
        self._open: dict[str, tuple[FitSession, tuple[FileState, ...]]] = {}
        self._lock = Lock()

    @property
    def names(self) -> list[str]:
        """All names, the first one shown first."""
        return list(self._names)

    def place(self, name: str) -> str:
        """Where the recording of a name is, as a command takes it; the first one's when no name is given."""
        wanted = name or self.names[0]
        return str(self._places.get(wanted, wanted))

    def bench(self, name: str = "") -> FitSession:
        """Return the bench of a recording; the first one's when no name is given."""
        wanted = name or self.names[0]
        if wanted not in self._names:
            raise DataError(f"no recording '{wanted}' here (choose one of: {', '.join(self.names)})")
        with self._lock:
            if wanted in self._open and self._open[wanted][1] != self._state(wanted):
                # What the page shows, and the command that is taken home, are of the file that is there now.
                del self._open[wanted]
            if wanted not in self._open:
                # Before it is read: what changes while it is read is read anew.
                state = self._state(wanted)
                bench = self._make(wanted)
                while len(self._open) >= _MOST_OPEN:
                    self._open.pop(next(iter(self._open)))
                self._open[wanted] = bench, state
            return self._open[wanted][0]

    def _state(self, name: str) -> tuple[FileState, ...]:
        """Return what tells that a recording was changed in place; empty where it has no place."""
        place = self._places.get(name)
        try:
            return () if place is None else file_states(place)
        except OSError:
            # It changes at this moment.
            return ()


def neighbours(path: Path) -> dict[str, Path]:
    """Find the recordings in the folder of `path`, by name: that one first, the others in the order of names."""
    path = path.resolve()
    try:
        around = sorted(p for p in path.parent.iterdir() if p != path and _is_recording(p))
    except OSError:
        around = []
    return {p.name: p for p in (path, *around)}


def _is_recording(path: Path) -> bool:
    return path.suffix in {".mcap", ".db3"} or (path / "metadata.yaml").is_file()
