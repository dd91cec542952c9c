"""Program that turns a MAT file into plain arrays (NPZ), in a process of its own: see `own_process`.

Arguments: the MAT file, and the file to write. Objects and files of version 7.3 are read where matio is installed.
"""

from __future__ import annotations

import sys
import warnings
from importlib.util import find_spec
from typing import Any

import numpy as np

from sdimu_calibration.storage.importing.mat_objects import HEAD, Content, has_objects, is_newest, read_objects

PREFIX = "="
"""Before the names in the file that is written."""
OBJECT = "@"
"""Before the names of objects of MATLAB, whose class is what is written."""
UNIT = "%"
"""Before the names of arrays whose unit is what is written."""
CLOCK = "&"
"""Before the names of arrays, for which the name of the array with their times is written."""


def main() -> None:
    """Read, flatten, write; one line on stderr and exit 1 when it cannot be read."""
    source, target = sys.argv[1:]
    # What a library has to say of a part that it leaves out is no reason to refuse the rest.
    warnings.simplefilter("ignore")
    try:
        with open(source, "rb") as file:  # noqa: PTH123 (a program that starts fast)
            head = file.read(HEAD)
        by_matio = is_newest(head) or (has_objects(head) and find_spec("matio"))
        found = read_objects(source) if by_matio else _read_plain(source)
        # A name may be anything, that of an argument too.
        marked = {OBJECT: found.objects, UNIT: found.units, CLOCK: found.clocks}
        words = {mark + name: np.array(word) for mark, those in marked.items() for name, word in those.items()}
        np.savez(target, **{PREFIX + name: array for name, array in found.arrays.items()}, **words)  # type: ignore[arg-type]
    except Exception as error:  # scipy answers damage with errors of every kind
        sys.stderr.write(f"{' '.join(str(error).split()) or type(error).__name__}\n")
        sys.exit(1)


def _read_plain(source: str) -> Content:
    """Read a file without objects."""
    from scipy.io import loadmat  # noqa: PLC0415 (the module is imported by those who start it)
    from scipy.io.matlab import MatlabOpaque  # noqa: PLC0415

    found = Content()
    for name, value in loadmat(source, squeeze_me=True, struct_as_record=False).items():
        _flatten(name, value, found)
        if isinstance(value, MatlabOpaque):
            # Of an object of MATLAB scipy reads its name and its class alone.
            words = [bytes(value[0][field]).decode("utf-8", "replace") for field in ("s0", "s2")]
            found.objects[words[0]] = words[1]
    return found


def _flatten(name: str, value: Any, found: Content) -> None:
    """Name the fields of structures ``struct.field``; what is neither numbers nor words keeps its name alone."""
    fields = getattr(value, "_fieldnames", None)
    if fields is not None:
        for field in fields:
            _flatten(f"{name}.{field}", getattr(value, field, None), found)
        return
    array = np.asarray(value)
    if array.dtype.kind == "O" and all(isinstance(one, str) for one in array.flat):
        # A cell array of words.
        array = array.astype(str)
    found.arrays[name] = array if array.dtype.kind in "iufbU" else np.empty(0, "U1")


if __name__ == "__main__":
    main()
