"""Messages of a side topic whose stamp is of no time of the test: zero, a year ago, a year ahead.

One of them would stretch everything that is laid out by time from the first status to the last: 1970 to today is 64 GB.
A topic whose own clock is another one is no stray: it is kept whole, and `status_clock` compares it with the motion.
"""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.arrays import Bools, Ints
from sdimu_calibration.core.plain_text import counted

FAR_NS = 86_400_000_000_000
"""Distance from the samples (ns) from which a message is of another time: a day, longer than a table stands still."""


def strays(ns: Ints, samples_ns: Ints) -> Bools:
    """Find messages far from all samples, or from each other where most are far from the samples.

    Parameters
    ----------
    ns : ndarray of int, shape (m,)
        Stamps of the messages (ns), ascending.
    samples_ns : ndarray of int, shape (n,)
        Stamps of the samples (ns), ascending; at least two.

    Returns
    -------
    ndarray of bool, shape (m,)
    """
    far = _distance(ns, samples_ns) > FAR_NS
    if 2 * np.count_nonzero(far) <= len(ns):
        return far
    # Another clock: a day more than the test lasts, about the middle of its messages.
    length = len(samples_ns) * float(np.median(np.diff(samples_ns)))
    return np.asarray(np.abs((ns - ns[len(ns) // 2]).astype(np.float64)) > FAR_NS + length)


def strays_note(topic: str, strays_ns: Ints) -> str:
    """Say which messages of a side topic are left out.

    Parameters
    ----------
    topic : str
        Name of the topic.
    strays_ns : ndarray of int, shape (m,)
        Their stamps (ns), at least one.
    """
    what = counted(len(strays_ns), "message has a stamp", "messages have stamps")
    return f"{topic}: {what} outside the test (the first {stamp_text(int(strays_ns[0]))}): ignored"


def _distance(ns: Ints, samples_ns: Ints) -> Ints:
    """Distance of each stamp from the nearest sample (ns), shape (m,)."""
    after = np.minimum(np.searchsorted(samples_ns, ns), len(samples_ns) - 1)
    before = np.maximum(after - 1, 0)
    return np.asarray(np.minimum(np.abs(samples_ns[after] - ns), np.abs(ns - samples_ns[before])))


def stamp_text(ns: int) -> str:
    """Stamp (ns) as date and time, UTC."""
    return f"{np.datetime64(ns, 'ns').astype('datetime64[s]')}Z"
