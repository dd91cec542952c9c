"""When an epoch may be processed: decided by stamps, so that no order of arrival changes a result."""

from __future__ import annotations

from dataclasses import dataclass

LAPSE_DATA_S = 10.0
LAPSE_WALL_S = 1.0
GREETING_S = 2.0


@dataclass
class Companion:
    """A topic that goes with the IMU: status or temperature.

    Attributes
    ----------
    latest_s : float or None
        Time of its newest message.
    heard : float or None
        Wall time at which that came.
    """

    latest_s: float | None = None
    heard: float | None = None

    def take(self, t: float, now: float) -> None:
        """Note a message of time `t` that came at wall time `now`."""
        self.latest_s = t if self.latest_s is None else max(t, self.latest_s)
        self.heard = now

    def allows(self, imu_s: float, published: bool, now: float, born: float) -> tuple[float, bool]:
        """Time up to which this topic lets the IMU be processed, and whether the topic is known up to there.

        Parameters
        ----------
        imu_s : float
            Time of the newest IMU sample (s).
        published : bool
            The topic has a publisher now.
        now, born : float
            Wall times: now, and when listening began.

        Returns
        -------
        until_s : float
        known : bool
            False when the topic does not exist or has fallen silent.
        """
        if self.latest_s is None:
            # Discovery takes a moment: a publisher that is not seen yet may still be there.
            absent = not published and now - born > GREETING_S
            silent = now - born > GREETING_S + LAPSE_WALL_S and imu_s > LAPSE_DATA_S
            return (imu_s if absent or silent else -1.0), False
        if imu_s <= self.latest_s:
            return imu_s, True
        heard = self.heard if self.heard is not None else now
        lapsed = imu_s - self.latest_s > LAPSE_DATA_S and now - heard > LAPSE_WALL_S
        return (imu_s, False) if lapsed or not published else (self.latest_s, True)
