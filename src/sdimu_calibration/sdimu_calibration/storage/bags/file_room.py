"""The place of a file that a user names for writing: free, or a file that may be replaced; never what is read."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.bag_file import BAG_SUFFIXES
from sdimu_calibration.storage.bags.bag_metadata import METADATA
from sdimu_calibration.storage.files.whole_file import same_file

_HEAD = 65_536
"""Length (bytes) of the beginning of a file in which it says its format: below remarks, and priors of an IMU."""
_FORMAT = re.compile(rb"""^[{ \t]*["']?format["']?[ \t]*:[ \t]*["']?(sdimu-[a-z0-9-]+)/""", re.MULTILINE)
"""How a file of the project says its format, in YAML or JSON."""


def check_file_room(path: Path, option: str, *, kind: str, replace: bool = False, sources: Iterable[Path] = ()) -> None:
    """Raise DataError unless a file can be made at `path`: nothing is there, or a file that is to be replaced.

    Parameters
    ----------
    path : Path
        File to make.
    option : str
        What names another one, for the message: ``--out``.
    kind : str
        Format of the file that is made, without its number: ``sdimu-plan``.
    replace : bool
        A file that is there may go; one that is read, is part of a recording, or says that it is of another format of
        the project, never.
    sources : iterable of Path
        Files and folders that are read; a link to one, of any kind, is that one.
    """
    check_no_source(path, option, sources)
    if os.path.lexists(path) and not replace:
        raise DataError(f"{path}: is there already; --replace replaces it, or name another file with {option}")
    found = _format_of(path)
    if found not in {"", kind}:
        raise DataError(f"{path}: is a file of another kind ({found}); name another file with {option}")


def _format_of(path: Path) -> str:
    """Format that a file says of itself, without its number; empty where it says none of the project."""
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        found = _FORMAT.search(file.read(_HEAD))
    return found[1].decode() if found else ""


def check_no_source(path: Path, option: str, sources: Iterable[Path] = ()) -> None:
    """Raise DataError where a file must not be made, whatever may be replaced: parameters as in `check_file_room`."""
    path = Path(path)
    if path.is_dir():
        raise DataError(f"{path}: is a folder; name a file to write with {option}")
    for source in sources:
        places = (path, *path.resolve().parents) if source.is_dir() else (path,)
        if any(same_file(place, source) for place in places):
            raise DataError(f"{path}: is read from {source}; name another file with {option}")
    for folder in dict.fromkeys((path.parent, path.resolve().parent)):
        if (folder / METADATA).is_file():
            raise DataError(f"{path}: stands in the recording {folder}; name a file outside it with {option}")
    if path.exists() and path.suffix in BAG_SUFFIXES:
        raise DataError(f"{path}: is a recording; name another file with {option}")
    if path.exists() and not path.is_file():
        raise DataError(f"{path}: is a device or a pipe; name a file to write with {option}")


def results_folder(folder: str | Path) -> Path:
    """Return a folder of results; a folder of a recording, or one in it, is refused."""
    folder = Path(folder)
    for place in (folder, *folder.resolve().parents):
        if _is_recording(place):
            raise DataError(f"{place}: is a recording; choose another folder for the results (--out)")
    return folder


def _is_recording(folder: Path) -> bool:
    """Whether a folder is a bag: metadata beside messages; other programs, too, have files of that name."""
    has_metadata = (folder / METADATA).is_file()
    return has_metadata and any(not {*one.suffixes}.isdisjoint(BAG_SUFFIXES) for one in folder.iterdir())


def check_own_file(path: Path, heads: tuple[str, ...], sources: Iterable[Path] = ()) -> None:
    """Raise DataError unless a file with a fixed name can be made in a folder of results.

    Parameters
    ----------
    path : Path
        File to make: nothing is there, or what the same verb left before.
    heads : tuple of str
        How the first line begins of a file that the verb leaves there.
    sources : iterable of Path
        Files that are read.
    """
    if any(same_file(path, source) for source in sources):
        raise DataError(f"{path}: would replace the file that is read; choose another folder with --out")
    if path.is_dir() or (os.path.lexists(path) and not _begins(path, heads)):
        raise DataError(f"{path}: is there already and of another origin; move it, or choose another folder with --out")


def _begins(path: Path, heads: tuple[str, ...]) -> bool:
    """Whether a file begins with one of some texts."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(max(map(len, heads))).startswith(tuple(head.encode() for head in heads))
