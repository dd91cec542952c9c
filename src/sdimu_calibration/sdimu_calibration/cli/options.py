"""Options that several verbs have, each declared once: with them a user states a `StatedOpening` and a `FitRequest`."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer.models import OptionInfo

from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.core.effect_key import read_quantity
from sdimu_calibration.core.units import ABSOLUTE_ZERO_DEGC

_OF_SETS = "Several recordings of one unit"
_MOST_DEGC = 1e4
"""Highest temperature (degC) that is taken for one: nothing that measures is as hot."""
WORKERS = 2
"""Number of processes by default: the cores of a small machine."""

BagArgument = Annotated[Path, typer.Argument(metavar="BAG", help="rosbag2 folder, .mcap or .db3 file, ROS 1 .bag.")]
BagsArgument = Annotated[
    list[Path] | None,
    typer.Argument(
        metavar="BAG...",
        help="rosbag2 folder, .mcap or .db3 file, ROS 1 .bag; several are fitted together as one unit.",
    ),
]
FoldersArgument = Annotated[list[Path], typer.Argument(metavar="FOLDER ...", help="Every result.json below is taken.")]
ModelOption = Annotated[str, typer.Option(help="Model to estimate: name in config/model or path.")]
ChosenModelOption = Annotated[
    str | None, typer.Option(help="Model to estimate: name in config/model or path; baseline (handheld: hand).")
]
ImuNameOption = Annotated[str, typer.Option(help="Specification of the IMU: name in config/imu or path.")]
DomainOption = Annotated[
    int | None,
    typer.Option(metavar="N", help="ROS domain of the nodes; that of ROS_DOMAIN_ID, or a free one, when left out."),
]
EachStopOption = Annotated[bool, typer.Option(help="Publish a diagnosis at the end of each stop.")]
OwnEffectOption = Annotated[
    list[str] | None,
    typer.Option(metavar="FILE", help="Effect of your own (YAML) that the result has; may be repeated."),
]
SerialOption = Annotated[
    str | None, typer.Option(metavar="NUMBER", help="Serial number of the unit; taken from the bag where it says it.")
]
SetOption = Annotated[
    Path | None,
    typer.Option("--set", metavar="FILE", help="Set of recordings (sdimu set init).", rich_help_panel=_OF_SETS),
]
ReplaceOption = Annotated[bool, typer.Option("--replace", help="Overwrite the bag if it exists.")]
PdfOption = Annotated[
    bool, typer.Option("--pdf", help="Also print the page beside it (needs Chromium, Chrome or Edge).")
]
JsonOption = Annotated[
    bool, typer.Option("--json", help="Print the answer as JSON, as its file has it; words go to stderr.")
]


def results_in(default: str) -> OptionInfo:
    """Declare ``--out`` of a verb that leaves several files."""
    text = f"Folder of the {default} by default."
    option: OptionInfo = typer.Option(file_okay=False, callback=outside_recordings, help=text)
    return option


def outside_recordings(folder: Path | None) -> Path | None:
    """Return the folder of ``--out``, before any work is done; a recording is refused."""
    if folder is None:
        return None
    from sdimu_calibration.storage.bags.file_room import results_folder

    return results_folder(folder)


def _read(metavar: str, text: str) -> OptionInfo:
    """Declare an option of how samples are to be read; its panel says that none is needed."""
    panel = "How the recording is to be read (recognised when left out)"
    option: OptionInfo = typer.Option(metavar=metavar, help=text, rich_help_panel=panel)
    return option


@dataclass(frozen=True)
class Place:
    """Where and with what a recording was made."""

    site: Annotated[
        str | None, typer.Option(help="Where the test was: name in config/site or path; daejeon when left out.")
    ] = None
    imu: Annotated[
        str | None, typer.Option(help="Specification of the IMU: name in config/imu or path; proposed when left out.")
    ] = None

    @property
    def specification(self) -> ImuSpecification | None:
        """The IMU's file, read."""
        from sdimu_calibration.storage.files.config import load_imu

        return None if self.imu is None else load_imu(self.imu)


@dataclass(frozen=True)
class Reading:
    """How samples are to be read, where that is not to be recognised."""

    imu_topic: Annotated[str | None, _read("TOPIC", "sensor_msgs/Imu.")] = None
    status_topic: Annotated[str | None, _read("TOPIC", "diagnostic_msgs/DiagnosticArray with a phase.")] = None
    joint_topic: Annotated[str | None, _read("TOPIC", "sensor_msgs/JointState.")] = None
    temperature_topic: Annotated[str | None, _read("TOPIC", "sensor_msgs/Temperature.")] = None
    accel_unit: Annotated[str | None, _read("UNIT", "Of linear_acceleration, such as g.")] = None
    gyro_unit: Annotated[str | None, _read("UNIT", "Of angular_velocity, such as deg/s.")] = None
    accel_sign: Annotated[int | None, _read("SIGN", "-1: the negative of the specific force.")] = None
    gyro_sign: Annotated[int | None, _read("SIGN", "-1: the negative of the body rate.")] = None

    @property
    def source(self) -> Source:
        """Topics, units and signs together."""
        from sdimu_calibration.storage.bags.topic_choice import TopicChoice
        from sdimu_calibration.storage.opening import Source

        topics = TopicChoice(self.imu_topic, self.status_topic, self.joint_topic, self.temperature_topic)
        return Source(topics, self.accel_unit, self.gyro_unit, self.accel_sign, self.gyro_sign)


@dataclass(frozen=True)
class Recorded(Reading, Place):
    """A recording of which verbs ask no more than its place and how it is read."""


@dataclass(frozen=True)
class Stated(Place):
    """What else is stated of a recording."""

    site: Annotated[
        str | None, typer.Option(help="Where the test was: name in config/site or path; daejeon (handheld: none).")
    ] = None
    noise: Annotated[
        str | None, typer.Option(help="estimated: white noise from the rests of the recording, not from --imu.")
    ] = None
    whole_turns: Annotated[
        str | None,
        typer.Option(
            metavar="ANGLE", help="By hand: turns of about 360 deg about the vertical are whole to this, such as 1 deg."
        ),
    ] = None
    rests: Annotated[
        str | None,
        typer.Option(
            metavar="SPANS", help="By hand: when the IMU rested, in s: 10-13,15.5-18 or a file of begin and end a line."
        ),
    ] = None
    exclude_stops: Annotated[
        str | None, typer.Option(metavar="STOPS", help="Stops the fit does not see, such as 4,7; not the first.")
    ] = None
    exclude_times: Annotated[
        str | None, typer.Option(metavar="SPANS", help="Spans of s in which nothing is measured: 812-815,900-910.")
    ] = None
    serial: SerialOption = None
    power_on: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Which switch-on of the unit, of all recordings of a set; taken from the bag where it says it.",
        ),
    ] = None
    reference_temperature: Annotated[
        str | None,
        typer.Option(
            metavar="T", help="From which temperature effects count, such as 20 degC.", rich_help_panel=_OF_SETS
        ),
    ] = None

    @property
    def measured_noise(self) -> bool:
        """White noise is that of the rests."""
        if self.noise not in {None, "estimated"}:
            raise DataError(f"--noise {self.noise}: expected 'estimated' (or leave it out: the noise of --imu)")
        return self.noise is not None

    @property
    def whole_turns_rad(self) -> float:
        """How well turns by hand are whole (rad); 0 where nobody says it."""
        if self.whole_turns is None:
            return 0.0
        whole = read_quantity("--whole-turns", self.whole_turns, "deg")
        if whole <= 0.0:
            raise DataError(f"--whole-turns {self.whole_turns}: expected an angle above zero")
        return whole

    @property
    def reference_degc(self) -> float | None:
        """Temperature from which effects count (deg C); None is that at the start."""
        if self.reference_temperature is None:
            return None
        return checked_degc(
            "--reference-temperature", read_quantity("--reference-temperature", self.reference_temperature, "degC")
        )


@dataclass(frozen=True)
class StatedOpening(Reading, Stated):
    """How a recording is opened, as the options state it."""

    def read(self, handheld: bool | None) -> Opening:
        """Read all of it, so that a wrong option is told before a long recording is read."""
        from sdimu_calibration.storage.files.config import load_site
        from sdimu_calibration.storage.opening import Opening

        if self.site is not None:
            load_site(self.site)
        return Opening(
            site=self.site,
            imu=self.specification,
            source=self.source,
            handheld=handheld,
            measured_noise=self.measured_noise,
            whole_turns=self.whole_turns_rad,
            exclude_stops=() if self.exclude_stops is None else read_stops(self.exclude_stops),
            rests=() if self.rests is None else read_rests(self.rests),
            exclude_times=() if self.exclude_times is None else read_spans(self.exclude_times),
            serial=self.serial,
            power_on=self.power_on,
            reference_degc=self.reference_degc,
            imu_file=self.imu,
        )


@dataclass(frozen=True)
class Fitted:
    """What is fitted, and how."""

    model: ChosenModelOption = None
    estimator: Annotated[str, typer.Option(help="filter, handheld, batch; auto chooses one of the first two.")] = "auto"
    hand: Annotated[bool, typer.Option("--hand", help="Moved by hand: the same as --estimator handheld.")] = False
    add: Annotated[
        list[str] | None,
        typer.Option(
            metavar="EFFECT",
            help="Effect to add to the model: a name, one of its coefficients, or a YAML file; may be repeated.",
        ),
    ] = None

    @property
    def asked_estimator(self) -> str:
        """One of the names of estimators, ``auto`` included."""
        from sdimu_calibration.core.estimation.solve import AUTO
        from sdimu_calibration.storage.files.model_choice import HANDHELD, named_estimator

        named = named_estimator(self.estimator, "--estimator")
        if self.hand and named not in (AUTO, HANDHELD):
            raise typer.BadParameter(f"is not {HANDHELD}: leave out one of both", param_hint="--hand, --estimator")
        return HANDHELD if self.hand else named

    @property
    def handheld(self) -> bool | None:
        """Moved by hand, so far as the estimator says it; None leaves it to the data."""
        from sdimu_calibration.core.estimation.solve import AUTO
        from sdimu_calibration.storage.files.model_choice import HANDHELD

        asked = self.asked_estimator
        return None if asked == AUTO else asked == HANDHELD


@dataclass(frozen=True)
class FitRequest(Fitted):
    """What is asked of a recording, or of a set."""

    set_file: SetOption = None
    workers: Annotated[
        int, typer.Option(min=1, help="Processes that read recordings of a set.", rich_help_panel=_OF_SETS)
    ] = WORKERS
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="dask scheduler that reads them instead.", rich_help_panel=_OF_SETS),
    ] = None
    out: Annotated[Path | None, results_in("results; BAG_calibration")] = None
    pdf: PdfOption = False
    as_json: JsonOption = False


def checked_degc(option: str, value: float) -> float:
    """Refuse what is no temperature. `option`: for the message; `value`: degrees Celsius."""
    if not ABSOLUTE_ZERO_DEGC <= value <= _MOST_DEGC:
        raise DataError(f"{option} {value:g}: expected a temperature in degC from {ABSOLUTE_ZERO_DEGC:g}")
    return value


def read_stops(text: str) -> tuple[int, ...]:
    """Read numbers of stops, such as ``4,7``."""
    words = [word.strip() for word in text.split(",")]
    if not all(word.isdecimal() for word in words):
        raise DataError(f"--exclude-stops {text}: expected numbers of stops such as 4,7")
    return tuple(sorted({int(word) for word in words}))


Spans = tuple[tuple[float, float], ...]
_SPAN = re.compile(r"\s*(\d+(?:\.\d+)?)\s*-\s*(\d+(?:\.\d+)?)\s*")
_PAIR = re.compile(r"\s*(\d+(?:\.\d+)?)(?:\s*[,;-]\s*|\s+)(\d+(?:\.\d+)?)\s*[,;]?\s*")


def read_spans(text: str, option: str = "--exclude-times") -> Spans:
    """Read spans of time (s), such as ``812-815,900-910``, in ascending order."""
    found = [_SPAN.fullmatch(word) for word in text.split(",")]
    if not all(found):
        raise DataError(f"{option} {text}: expected spans of seconds such as 812-815,900-910")
    return _ascending([(float(match[1]), float(match[2])) for match in found if match], f"{option} {text}")


def read_rests(text: str) -> Spans:
    """Read the rests of a run by hand (s): spans, or the path of a file with begin and end of one on each line."""
    if _SPAN.fullmatch(text.split(",", maxsplit=1)[0]):
        return read_spans(text, "--rests")
    from sdimu_calibration.storage.files.bounded_file import read_text
    from sdimu_calibration.storage.files.config import LONGEST_FILE

    path = Path(text)
    try:
        lines = read_text(path, LONGEST_FILE, "utf-8-sig").splitlines()
    except (DataError, UnicodeDecodeError) as error:
        raise DataError(
            f"--rests {text}: expected spans of seconds such as 10-13,15.5-18, or a text file with begin and end of a "
            "rest on each line"
        ) from error
    spans: list[tuple[float, float]] = []
    for number, line in enumerate(lines, start=1):
        words = line.partition("#")[0]
        if not words.strip():
            continue
        match = _PAIR.fullmatch(words)
        if match is None:
            if not spans and not any(c.isdigit() for c in words):
                continue
            raise DataError(f"{path}: line {number}: '{line.strip()}': expected begin and end of a rest (s)")
        spans.append((float(match[1]), float(match[2])))
    if not spans:
        raise DataError(f"{path}: no rest in it: expected begin and end of one (s) on each line")
    return _ascending(spans, str(path))


def _ascending(spans: list[tuple[float, float]], where: str) -> Spans:
    for begin, end in spans:
        if end <= begin:
            raise DataError(f"{where}: the span {begin:g}-{end:g} ends before it begins")
    return tuple(sorted(spans))


if TYPE_CHECKING:
    from sdimu_calibration.core.specification import ImuSpecification
    from sdimu_calibration.storage.opening import Opening, Source
