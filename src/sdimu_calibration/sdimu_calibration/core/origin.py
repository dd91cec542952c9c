"""Which unit a recording is of, when and how it was made: what results of many recordings are told apart by."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import Recording

_BLOCK_S = 1.0
"""Length of the means whose largest is the rate of a test (s): a spike of one sample is no rate."""


@dataclass(frozen=True)
class Origin:
    """Where a result is from; empty or NaN where nobody said it."""

    serial: str = ""
    """Serial number of the unit."""
    power_on: str = ""
    """Name or number of the time from switch-on to switch-off."""
    start_ns: int = 0
    """First stamp (ns since 1970); 0 unknown."""
    temperature_degc: float = math.nan
    """Mean over the recording (deg C)."""
    temperature_low_degc: float = math.nan
    temperature_high_degc: float = math.nan
    """`temperature_low_degc`, `temperature_high_degc`: lowest and highest in the recording (deg C)."""
    rate_rad_s: float = math.nan
    """Largest mean of the body rate over a second (rad/s)."""
    recording: str = ""
    """Name of the bag."""
    imu: str = ""
    site: str = ""
    """`imu`, `site`: names of their files."""
    imu_file: str = ""
    site_file: str = ""
    """`imu_file`, `site_file`: paths of these files where the user named a path; empty for a name in config/."""
    effect_files: tuple[str, ...] = ()
    """Paths of the user's own effects in the model: their equations stand there alone."""

    def stated(self, serial: str | None, power_on: str | None) -> Origin:
        """Return it with what the user states; None leaves what the bag says."""
        return replace(
            self,
            serial=self.serial if serial is None else serial,
            power_on=self.power_on if power_on is None else power_on,
        )

    @property
    def imu_stated(self) -> str:
        """The IMU's file as an option names it: path or name."""
        return self.imu_file or self.imu

    @property
    def site_stated(self) -> str:
        """The site's file as an option names it: path or name."""
        return self.site_file or self.site

    @property
    def words(self) -> tuple[str, ...]:
        """Unit, power-on and temperature for the head of a page; nothing that is unknown."""
        heat = self.temperature_degc
        return tuple(
            word
            for word in (
                self.serial and f"serial {self.serial}",
                self.power_on and f"power-on {self.power_on}",
                "" if math.isnan(heat) else f"{heat:.1f} deg C",
            )
            if word
        )


def measured(origin: Origin, recording: Recording, imu: str) -> Origin:
    """Add what the recording itself says: start, temperature, largest rate. `imu`: name of the specification."""
    log = recording.temperature
    heat = (math.nan,) * 3 if log is None else (log.value.mean(), log.value.min(), log.value.max())
    mean, low, high = map(float, heat)
    return replace(
        origin,
        start_ns=max(recording.start_ns, 0),
        temperature_degc=mean,
        temperature_low_degc=low,
        temperature_high_degc=high,
        rate_rad_s=_largest_rate(recording.omega_ib_b, recording.interval_s),
        imu=imu,
    )


def _largest_rate(omega: Floats, interval_s: float) -> float:
    """Largest mean of the body rate over a second (rad/s), of samples (n, 3)."""
    starts = np.arange(0, len(omega), max(1, round(_BLOCK_S / interval_s)))
    sums = np.add.reduceat(omega, starts, axis=0)
    counts = np.diff(np.append(starts, len(omega)))
    return float((np.linalg.norm(sums, axis=1) / counts).max())
