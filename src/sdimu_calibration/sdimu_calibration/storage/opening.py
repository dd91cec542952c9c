"""A recording opened for an estimate: the file read, its topics chosen, then the front door of the core."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

from sdimu_calibration.core.data.arrival import RawTest, in_order
from sdimu_calibration.core.data.axes_and_units import Stated
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.front_door import OpeningOptions, in_si
from sdimu_calibration.core.front_door import open_test as open_recorded
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.specification import ImuSpecification
from sdimu_calibration.core.units import UnitError, parse_unit
from sdimu_calibration.storage.bags.bag_metadata import custom_data
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.topic_choice import TopicChoice
from sdimu_calibration.storage.files.config import load_imu, load_site, names_of, stated_path

DEFAULT_SITE = "daejeon"
CLASSES = ("dtg", "fog_tactical", "mems_by_hand")
"""IMU files to propose from where the user states none: one of each grade, that with the widest priors. A prior that is
too tight misleads, one that is too wide costs little."""


@dataclass(frozen=True)
class Source:
    """What the user says of a recording; everything left out is recognised.

    Attributes
    ----------
    accel_unit, gyro_unit : str or None
        Such as ``g`` and ``deg/s``, or a multiple such as ``2 deg/s``.
    accel_sign, gyro_sign : int or None
        -1 when the negative of the specific force, or of the rate, was recorded.
    """

    topics: TopicChoice = field(default_factory=TopicChoice)
    accel_unit: str | None = None
    gyro_unit: str | None = None
    accel_sign: int | None = None
    gyro_sign: int | None = None

    @property
    def stated(self) -> Stated:
        """The same in SI."""
        for option, sign in (("--accel-sign", self.accel_sign), ("--gyro-sign", self.gyro_sign)):
            if sign not in {None, 1, -1}:
                raise DataError(f"{option} {sign}: expected 1 or -1")
        return Stated(
            _factor("--accel-unit", self.accel_unit, "m/s^2"),
            _factor("--gyro-unit", self.gyro_unit, "deg/s"),
            self.accel_sign,
            self.gyro_sign,
        )


def _factor(option: str, unit: str | None, expected: str) -> float | None:
    if unit is None:
        return None
    match = _MULTIPLE.fullmatch(unit)
    assert match is not None  # both parts may be anything or empty
    try:
        parsed = parse_unit(match[2])
    except UnitError as error:
        raise DataError(f"{option}: {error} (expected a unit such as {_SUCH[expected]})") from error
    if parsed.dimension != parse_unit(expected).dimension:
        raise DataError(f"{option} {unit}: expected a unit such as {_SUCH[expected]}")
    return float(match[1] or 1.0) * parsed.factor


_SUCH = {"m/s^2": "m/s^2, g, mg or ug", "deg/s": "rad/s, deg/s or deg/h"}
"""Units that drivers send, by one of them."""
_MULTIPLE = re.compile(r"\s*(\d+\.?\d*(?:[eE][-+]?\d+)?)?\s*\*?\s*(.*)")
"""A unit, or a multiple of one such as ``2 deg/s``."""


def opening_options(
    site: str | None,
    imu: ImuSpecification | None,
    source: Source,
    handheld: bool | None = None,
    measured_noise: bool = False,
) -> OpeningOptions:
    """Put what the user says of a test together; command line and live node use this one function.

    Parameters
    ----------
    site : str or None
        Name or path; None takes `DEFAULT_SITE`, which a note then says.
    imu : ImuSpecification or None
        None proposes one of `CLASSES` from the rests, which a note then says.
    handheld : bool, optional
        Moved by hand; None decides by the turns and the noise of the gyros.
    measured_noise : bool
        Replace the white noise of the specification by that of the rests.
    """
    assumed = DEFAULT_SITE if site is None else ""
    classes = tuple(map(load_imu, CLASSES)) if imu is None else ()
    return OpeningOptions(
        imu or classes[0], load_site(site or DEFAULT_SITE), assumed, source.stated, handheld, measured_noise, classes
    )


@cache
def known_imus() -> tuple[ImuSpecification, ...]:
    """Read the files of config/imu; one that is none of an IMU is no candidate."""
    out = []
    for name in names_of("imu"):
        with suppress(DataError):
            out.append(load_imu(name))
    return tuple(out)


def open_test(
    path: Path,
    site: str | None,
    imu: ImuSpecification | None,
    source: Source | None = None,
    handheld: bool | None = None,
    measured_noise: bool = False,
) -> PreparedTest:
    """Read a bag and make it ready for an estimator.

    Parameters
    ----------
    site, imu, handheld, measured_noise
        As for `opening_options`.
    source : Source, optional
        Topics, units and signs; what is left out is recognised.

    Returns
    -------
    PreparedTest
        Its site is None where a handheld run states none.
    """
    source = source or Source()
    options = opening_options(site, imu, source, handheld, measured_noise)
    opened = open_recorded(read_recording(path, source.topics), options, str(path))
    assumed = options.assumed_site if opened.site else ""
    origin = said_of(Path(path), (site or DEFAULT_SITE) if opened.site else "")
    return PreparedTest(*opened, assumed_site=assumed, origin=origin, known_imus=known_imus)


@dataclass(frozen=True, kw_only=True)
class Opening:
    """How a recording is opened: what is stated of it, read; what is left out is recognised, assumed or in the bag."""

    site: str | None = None
    imu: ImuSpecification | None = None
    source: Source = field(default_factory=Source)
    handheld: bool | None = None
    measured_noise: bool = False
    """`site`, `imu`, `source`, `handheld`, `measured_noise`: as for `open_test`."""
    whole_turns: float = 0.0
    """By hand: how well turns of about 360 deg about the vertical are whole ones (rad); 0 for none."""
    rests: tuple[tuple[float, float], ...] = ()
    """By hand: begin and end of every rest (s after the first sample); without any they are found."""
    exclude_stops: tuple[int, ...] = ()
    """Stops that no fit sees."""
    exclude_times: tuple[tuple[float, float], ...] = ()
    """Spans of time (s) in which no fit takes a measurement."""
    serial: str | None = None
    power_on: str | None = None
    """`serial`, `power_on`: of the unit, in place of what the bag says."""
    reference_degc: float | None = None
    """Temperature from which temperature effects count (deg C); None is that at the start of the recording."""
    imu_file: str | None = None
    """Name or path that `imu` was read from."""

    def test(self, path: Path) -> PreparedTest:
        """Open a bag so."""
        return self._of(open_test(path, self.site, self.imu, self.source, self.handheld, self.measured_noise))

    def test_of(self, raw: RawTest) -> PreparedTest:
        """Open samples so that a program holds."""
        options = opening_options(self.site, self.imu, self.source, self.handheld, self.measured_noise)
        opened = open_recorded(in_order(raw), options, raw.where)
        site = (self.site or DEFAULT_SITE) if opened.site else ""
        origin = Origin(recording=raw.where, site=one_line(Path(site).stem), site_file=stated_path(site))
        assumed = options.assumed_site if opened.site else ""
        return self._of(PreparedTest(*opened, assumed_site=assumed, origin=origin, known_imus=known_imus))

    def _of(self, test: PreparedTest) -> PreparedTest:
        """Let a test have what is stated of it."""
        test = with_imu_file(test, self.imu_file)
        origin = test.origin.stated(self.serial, self.power_on)
        test = replace(test, whole_turns=self.whole_turns, rests=self.rests, origin=origin)
        test = test.counted_from(self.reference_degc)
        return test.without_stops(self.exclude_stops).without_times(self.exclude_times)


def said_of(path: Path, site: str) -> Origin:
    """Give unit and power-on as the bag says them, with its name and that of the site."""
    said = custom_data(path)
    return Origin(
        serial=one_line(said.get("serial", "")),
        power_on=one_line(said.get("power_on", "")),
        recording=one_line(Path(path).resolve().name),
        site=one_line(Path(site).stem),
        site_file=stated_path(site),
    )


def with_imu_file(test: PreparedTest, imu: str | None) -> PreparedTest:
    """Let a test remember where the IMU's file is, if `imu` is the path of one."""
    return replace(test, origin=replace(test.origin, imu_file=stated_path(imu)))


def open_recording(path: Path, source: Source | None = None) -> Recording:
    """Read a bag and bring it to SI, right-handed axes and one clock; no site is needed."""
    source = source or Source()
    stated = source.stated
    return in_si(read_recording(path, source.topics), stated, str(path))
