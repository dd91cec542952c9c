"""Sets of recordings (format ``sdimu-set/1``): which bags are of one unit, and what is known of each."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Literal

import yaml
from pydantic import AfterValidator, Field

from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import AUTO
from sdimu_calibration.core.joint.member import Member
from sdimu_calibration.core.joint.set_fit import SetOptions
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.wording import Work
from sdimu_calibration.storage.bags.bag_folder import FileState, file_states
from sdimu_calibration.storage.bags.bag_metadata import METADATA, custom_data, read_metadata
from sdimu_calibration.storage.bags.file_room import check_file_room
from sdimu_calibration.storage.files.config import Schema, find_config, load_imu, read_yaml
from sdimu_calibration.storage.files.model_choice import HANDHELD, named_estimator, named_model
from sdimu_calibration.storage.files.quantities import quantity
from sdimu_calibration.storage.files.whole_file import write_whole
from sdimu_calibration.storage.opening import Source, open_test, with_imu_file

_FILES = frozenset({".mcap", ".db3", ".bag"})
"""Endings of files that are bags by themselves."""
_KEPT = 4
"""Number of recordings (1) that a process keeps in memory at most: each with its fit takes some hundred megabytes, and
six in two processes, which ask them three times and more, are all kept."""
_KEPT_SAMPLES = 1_200_000
"""Number of samples (1) of all of them: four recordings of fifty minutes at 100 Hz, half a gigabyte."""


@dataclass(frozen=True)
class BagSource:
    """Opens a bag of a set; another process can do so too."""

    bag: Path
    site: str | None = None
    imu: str | None = None
    """`site`, `imu`: as the options of the same names."""
    source: Source = field(default_factory=Source)
    handheld: bool | None = None
    measured_noise: bool = False
    reference_degc: float | None = None
    """Temperature from which temperature effects count (deg C); None is that at the start of the recording."""

    def __call__(self) -> PreparedTest:
        """Open the bag."""
        stated = (("imu", self.imu), ("site", self.site))
        files = (self.bag, *(find_config(kind, name) for kind, name in stated if name is not None))
        return _OPEN.of(self, tuple(state for file in files for state in file_states(file)))

    def opened(self) -> PreparedTest:
        """Open the bag anew."""
        imu = None if self.imu is None else load_imu(self.imu)
        test = open_test(self.bag, self.site, imu, self.source, self.handheld, self.measured_noise)
        return with_imu_file(test, self.imu).counted_from(self.reference_degc)


class KeptOpen:
    """Recordings that this process has opened, as many as memory holds: those that were asked for last."""

    def __init__(self, most: int, samples: int) -> None:
        """Keep so many recordings and samples at most, but one recording of any length."""
        self._most, self._samples = most, samples
        self._tests: OrderedDict[tuple[BagSource, tuple[FileState, ...]], PreparedTest] = OrderedDict()
        self._lock = threading.Lock()

    def of(self, source: BagSource, files: tuple[FileState, ...]) -> PreparedTest:
        """Give an opened bag whose files, and those of its IMU and site, are as they are now."""
        with self._lock:
            known = self._tests.pop((source, files), None)
        test = known or source.opened()
        with self._lock:
            self._tests[source, files] = test
            while len(self._tests) > 1 and self._is_too_much():
                self._tests.popitem(last=False)
        return test

    def _is_too_much(self) -> bool:
        return len(self._tests) > self._most or sum(len(t.recording.t) for t in self._tests.values()) > self._samples


_OPEN = KeptOpen(_KEPT, _KEPT_SAMPLES)
"""Those of the sets that this process works on."""


@dataclass(frozen=True)
class RecordingSet:
    """A set as it is written."""

    members: tuple[Member, ...]
    """Each opens a `BagSource`."""
    model: str | None = None
    """Name or path."""
    estimator: str = "auto"
    scopes: Mapping[str, str] = field(default_factory=dict)


def _path(text: str) -> str:
    """Refuse what is no path on any system."""
    if "\0" in text:
        raise ValueError("a path has no NUL in it")
    return text


class _Entry(Schema):
    bag: Annotated[str, AfterValidator(_path)]
    name: str = ""
    serial: str | int = ""
    power_on: str | int = ""
    imu: str | None = None
    site: str | None = None


class _SetFile(Schema):
    format: Literal["sdimu-set/1"] = "sdimu-set/1"
    serial: str | int = ""
    imu: str | None = None
    site: str | None = None
    model: str | None = None
    estimator: str = "auto"
    reference_temperature: Annotated[float, quantity("degC")] | None = None
    scopes: Annotated[dict[str, Literal["unit", "power-on"]], Field(default_factory=dict)]
    recordings: Annotated[list[_Entry], Field(min_length=1)]


def load_set(path: Path, like: BagSource) -> RecordingSet:
    """Read a set.

    `path`: bags are named from its folder. `like`: what the user states for all recordings; the file's own site and IMU
    come before it.
    """
    path = Path(path)
    file = read_yaml(path, _SetFile)
    estimator = named_estimator(file.estimator, f"{path}: estimator")
    if like.handheld is None and estimator != AUTO:
        like = replace(like, handheld=estimator == HANDHELD)
    members = []
    for entry in file.recordings:
        bag = (path.parent / entry.bag).resolve()
        source = replace(
            like,
            bag=bag,
            site=_named(path.parent, entry.site or file.site) or like.site,
            imu=_named(path.parent, entry.imu or file.imu) or like.imu,
            reference_degc=like.reference_degc if file.reference_temperature is None else file.reference_temperature,
        )
        serial = str(entry.serial) or str(file.serial)
        members.append(_member(source, entry.name or bag.name, serial, str(entry.power_on)))
    return RecordingSet(tuple(members), file.model, estimator, file.scopes)


def set_of(bags: Sequence[Path], like: BagSource) -> RecordingSet:
    """Make a set of bags; power-on and serial are those that the bags say.

    `like`: what the user states for all of them.
    """
    names = [bag.resolve().name for bag in bags]
    unique = len(set(names)) == len(names)
    members = [
        _member(replace(like, bag=bag.resolve()), name if unique else str(bag), "", "")
        for bag, name in zip(bags, names, strict=True)
    ]
    return RecordingSet(tuple(members))


def set_options(wanted: RecordingSet, model: str | None, add: Sequence[str], estimator: str) -> SetOptions:
    """Say how a set is to be fitted: what is asked for comes before what its file says.

    `model`: name or path; `add`: effects to add; `estimator`: ``auto`` is that of the file.
    """
    chosen = estimator if estimator != AUTO else wanted.estimator
    handheld = chosen == HANDHELD or (chosen == AUTO and _first_is_handheld(wanted.members))
    return SetOptions(named_model(model or wanted.model, add, handheld=handheld), chosen, scopes=wanted.scopes)


def _first_is_handheld(members: Sequence[Member]) -> bool:
    """Whether the first recording that can be opened was moved by hand; fitting tells of those that cannot.

    The first is the one that began first, whatever the order in which they are named.
    """
    for member in sorted(members, key=_began):
        with suppress(DataError):
            return bool(member.open().why_handheld)
    return False


def _began(member: Member) -> tuple[int, int]:
    """Start of a bag (ns) by its metadata, 0 where it says none, and its size (bytes): what is known without a look."""
    source = member.open
    if not isinstance(source, BagSource):
        return 0, 0
    bag = source.bag
    said = read_metadata(bag).get("starting_time") if bag.is_dir() else None
    start = said.get("nanoseconds_since_epoch") if isinstance(said, dict) else None
    files = bag.glob("*.mcap") if bag.is_dir() else [bag]
    return start if isinstance(start, int) else 0, sum(file.stat().st_size for file in files)


def _named(folder: Path, word: str | None) -> str | None:
    """Return a name of a configuration as it is; a path as seen from the folder of the set file."""
    beside = None if word is None else folder / word
    return str(beside.resolve()) if beside is not None and beside.is_file() else word


def _member(source: BagSource, name: str, serial: str, power_on: str) -> Member:
    if not source.bag.exists():
        raise DataError(f"{source.bag}: no such bag (recording '{name}' of the set)")
    if not (source.bag.is_dir() or source.bag.is_file()):
        raise DataError(f"{source.bag}: is a device or a pipe, and no bag (recording '{name}' of the set)")
    said = custom_data(source.bag)
    return Member(name, source, serial or said.get("serial", ""), power_on or said.get("power_on", ""))


@dataclass(frozen=True)
class Said:
    """What the user says of all recordings of a set; empty: what each bag says."""

    serial: str = ""
    power_on: str = ""


def is_bag(path: Path) -> bool:
    """Whether a path is a bag: a folder with its metadata, or a file of messages."""
    return (path / METADATA).is_file() or (path.is_file() and path.suffix in _FILES)


def bags_of(places: Sequence[Path]) -> list[Path]:
    """Bags among some paths as they come, and those in folders in the order of their names; each once."""
    found: list[Path] = []
    for place in map(Path, places):
        if not place.exists():
            raise DataError(f"{place}: no such bag or folder")
        if place.is_file() and not is_bag(place):
            raise DataError(
                f"{place}: no bag (a folder with {METADATA}, an .mcap or .db3 file, or a ROS 1 .bag); import it first"
            )
        found += [place] if is_bag(place) else bags_below(place)
    return list(dict.fromkeys(found))


def bags_below(folder: Path) -> list[Path]:
    """Bags in a folder and the folders in it, in the order of their names."""
    folder = Path(folder)
    found = {path.parent for path in folder.rglob(METADATA)}
    loose = {path for path in folder.rglob("*") if path.suffix in _FILES and path.is_file()}
    found |= {path for path in loose if path.parent not in found}
    if not found:
        raise DataError(
            f"{folder}: no bag in it (a folder with {METADATA}, an .mcap or .db3 file, or a ROS 1 .bag); columns are "
            f"imported first ({Work.IMPORT})"
        )
    return sorted(found)


_UNSAID = Said()


def write_set(path: Path, bags: Sequence[Path], stated: Said = _UNSAID, *, replace: bool = False) -> None:
    """Write a first set file of bags, with what they or the user say of unit and power-on, for the user to complete.

    `path`: file to make; bags are named from its folder. `replace`: a file that is there may go.
    """
    path = Path(path)
    check_file_room(path, "--out", kind="sdimu-set", replace=replace, sources=bags)
    base = path.resolve().parent
    entries = []
    names = [bag.resolve().name for bag in bags]
    for bag, name in zip(bags, names, strict=True):
        said = custom_data(bag)
        place = bag.resolve()
        shown = place.relative_to(base) if place.is_relative_to(base) else place
        called = {"name": str(shown)} if names.count(name) > 1 else {}
        known = {
            "power_on": stated.power_on or said.get("power_on", ""),
            "serial": stated.serial or said.get("serial", ""),
        }
        entries.append({"bag": str(shown), **called, **known})
    content = {"format": "sdimu-set/1", "recordings": entries}
    write_whole(path, _HEADER + yaml.safe_dump(content, sort_keys=False))


_HEADER = """\
# Recordings of one unit. Those with the same power_on share their biases; one without has a power-on of its own.
# For all recordings, or for one: serial, imu, site. For all: model, estimator, reference_temperature (such as 20 degC),
# scopes (effect: unit or power-on).
"""
