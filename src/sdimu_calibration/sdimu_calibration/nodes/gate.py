"""When an epoch may be processed: decided by stamps, so that no order of arrival changes a result."""

from __future__ import annotations

from dataclasses import dataclass

from sdimu_calibration.core.data.intake import NEVER

LAPSE_DATA_NS = 10_000_000_000
LAPSE_WALL_S = 1.0
GREETING_S = 2.0


@dataclass
class Companion:
    """A topic that goes with the IMU: status or temperature.

    Attributes
    ----------
    latest_ns : int or None
        Stamp of its newest message.
    heard : float or None
        Wall time at which that came.
    """

    latest_ns: int | None = None
    heard: float | None = None

    def take(self, ns: int, now: float) -> None:
        """Note a message of stamp `ns` that came at wall time `now`."""
        self.latest_ns = ns if self.latest_ns is None else max(ns, self.latest_ns)
        self.heard = now

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
        lapsed = imu_ns - self.latest_ns > LAPSE_DATA_NS and now - heard > LAPSE_WALL_S
        return (imu_ns, False) if lapsed or not published else (self.latest_ns, True)
