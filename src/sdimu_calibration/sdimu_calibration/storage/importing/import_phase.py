"""Which rows of a file are at rest, as a column of words or numbers says it."""

from __future__ import annotations

from fnmatch import fnmatchcase

import numpy as np

from sdimu_calibration.core.arrays import Bools, Ints
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.importing.import_map import PhaseMap
from sdimu_calibration.storage.importing.import_stamps import Stamps, Table
from sdimu_calibration.storage.importing.text_table import TextTable

Status = tuple[Stamps, Bools, Ints]
"""Stamp (ns), True for a rest, index of the stop; each entry holds from its stamp on."""
_SHOWN = 8
"""Number of different words that an error shows."""


def read_phase(table: Table, part: PhaseMap, ns: Stamps) -> Status:
    """Read the changes between rest and motion.

    Parameters
    ----------
    ns : ndarray of int64, shape (n,)
        Stamps of the rows (ns).

    Returns
    -------
    Status
        A rest begins with the interval of its first row: at the stamp of the row before.
    """
    labels = _labels(table, part.column)
    if len(labels) != len(ns):
        raise DataError(f"{table.path}: column {part.column}: {len(labels)} labels for {len(ns)} samples")
    words = {label: _is_rest(label, part.rest) for label in np.unique(labels).tolist()}
    if not any(words.values()):
        there = ", ".join(f"'{word}'" for word in list(words)[:_SHOWN])
        raise DataError(
            f"{table.path}: column {part.column} says rest nowhere (there are {there}): name its words for a rest in "
            "the map, phase.rest"
        )
    rest = np.array([words[label] for label in labels.tolist()])
    # From one label of a rest to another is another rest.
    change = np.append(True, (rest[1:] != rest[:-1]) | (rest[1:] & (labels[1:] != labels[:-1])))
    at = np.flatnonzero(change)
    stop = np.maximum(np.cumsum(rest[at]) - 1, 0)
    return ns[np.maximum(at - 1, 0)], rest[at], stop.astype(np.int64)


def _is_rest(label: str, wanted: tuple[str, ...]) -> bool:
    return any(fnmatchcase(label.lower(), word.lower()) for word in wanted)


def _labels(table: Table, column: int | str) -> np.ndarray[tuple[int], np.dtype[np.str_]]:
    if isinstance(table, TextTable):
        return np.asarray(table.texts(column))
    return np.array([f"{value:g}" for value in table.floats([column])[:, 0].tolist()])
