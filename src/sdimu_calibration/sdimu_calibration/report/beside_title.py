"""What stands beside the title of a page: which recording, or which running test, it is of."""

from __future__ import annotations

from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.plain_text import first_of
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.report.traceability import recorded

_NAMED = 4
"""Number of recordings of a set that stand beside the title: more do not fit into a line."""


def beside_title(origin: Origin, *, of: str = "", duration_s: float = 0.0, course: str = "") -> str:
    """Say what a page is of, in one line of text; nothing of what is unknown.

    Parameters
    ----------
    of : str
        Name in the place of that of the recording.
    duration_s : float
        Of the recording (s); 0 unknown.
    course : str
        What the table drives, such as ``plan kim18``.
    """
    words = [
        of or origin.recording,
        recorded(origin.start_ns),
        f"{duration_s / 60.0:.1f} min" if duration_s else "",
        course,
        f"IMU {origin.imu}" if origin.imu else "",
        *origin.words,
        origin.site,
    ]
    return " \N{MIDDLE DOT} ".join(word for word in words if word)


def of_calibration(calibration: Calibration, name: str = "") -> str:
    """Say which recording, or set of them, a calibration is of. `name`: of the recording, where a page has its own."""
    together = () if calibration.of_set is None else calibration.of_set.recordings
    names = name or calibration.origin.recording or first_of([one.name for one in together], _NAMED)
    return beside_title(calibration.origin, of=names, duration_s=calibration.data.get("duration_s", 0.0))
