"""When an epoch may be processed: decided by stamps, so that no order of arrival changes a result."""

from __future__ import annotations

from dataclasses import dataclass

from sdimu_calibration.core.data.stray_stamps import FAR_NS, NEVER

LAPSE_DATA_NS = 10_000_000_000
OTHER_CLOCK_NS = 60_000_000_000
"""Distance behind the samples (ns) from which a topic is on another clock: nothing can wait for it."""
LAPSE_WALL_S = 1.0
GREETING_S = 2.0


@dataclass
class Companion:
    """A topic that goes with the IMU: status or temperature."""

    latest_ns: int | None = None
    """Newest stamp of its messages, but for those of no time of the test."""
    heard: float | None = None
    """Wall time at which that came."""

    def take(self, ns: int, now: float, imu_ns: int = NEVER) -> None:
        """Note a message of stamp `ns` that came at wall time `now`, when `imu_ns` was the newest sample."""
        self.heard = now
        if _stray(ns, imu_ns):
            return
        stuck = self.latest_ns is None or _stray(self.latest_ns, imu_ns)
        self.latest_ns = ns if stuck else max(ns, self.latest_ns or NEVER)

    def allows(self, first_ns: int, imu_ns: int, published: bool, now: float, born: float) -> tuple[int, bool]:
        """Stamp up to which this topic lets the IMU be processed, and whether the topic is known up to there.

        Parameters
        ----------
        first_ns, imu_ns : int
            Stamps of the first and of the newest IMU sample.
        published : bool
            The topic has a publisher now.
        now, born : float
            Wall times: now, and when listening began.

        Returns
        -------
        until_ns : int
            `NEVER` while nothing may be processed.
        known : bool
            False when the topic does not exist or has fallen silent.
        """
        if self.latest_ns is None:
            # Discovery takes a moment: a publisher that is not seen yet may still be there.
            absent = not published and now - born > GREETING_S
            silent = now - born > GREETING_S + LAPSE_WALL_S and imu_ns - first_ns > LAPSE_DATA_NS
            return (imu_ns if absent or silent else NEVER), False
        if imu_ns <= self.latest_ns:
            return imu_ns, True
        heard = self.heard if self.heard is not None else now
        behind = imu_ns - self.latest_ns
        if behind > OTHER_CLOCK_NS:
            return imu_ns, False
        lapsed = behind > LAPSE_DATA_NS and now - heard > LAPSE_WALL_S
        return (imu_ns, False) if lapsed or not published else (self.latest_ns, True)

    def reaches(self, imu_ns: int, speaks: bool) -> tuple[int, bool]:
        """Answer as `allows` does, for messages of the past: whether the topic has any is known."""
        if not speaks or (self.latest_ns is not None and imu_ns - self.latest_ns > LAPSE_DATA_NS):
            return imu_ns, False
        return min(imu_ns, NEVER if self.latest_ns is None else self.latest_ns), True


def _stray(ns: int, imu_ns: int) -> bool:
    """Whether a stamp is of no time of the test; nobody knows before there are samples."""
    return imu_ns != NEVER and abs(ns - imu_ns) > FAR_NS
