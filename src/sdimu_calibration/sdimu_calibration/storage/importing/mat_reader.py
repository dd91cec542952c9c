"""Program that turns a MAT file into plain arrays (NPZ), in a process of its own: see `own_process`.

Arguments: the MAT file, and the file to write.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

PREFIX = "="
"""Before the names in the file that is written."""
OBJECT = "@"
"""Before the names of objects of MATLAB, whose class is what is written."""


def main() -> None:
    """Read, flatten, write; one line on stderr and exit 1 when it cannot be read."""
    from scipy.io import loadmat  # noqa: PLC0415 (the module is imported by those who start it)
    from scipy.io.matlab import MatlabOpaque  # noqa: PLC0415

    source, target = sys.argv[1:]
    try:
        content = loadmat(source, squeeze_me=True, struct_as_record=False)
        arrays: dict[str, NDArray[Any]] = {}
        for name, value in content.items():
            _flatten(name, value, arrays)
            if isinstance(value, MatlabOpaque):
                # Of an object of MATLAB scipy reads its name and its class alone.
                words = [bytes(value[0][field]).decode("utf-8", "replace") for field in ("s0", "s2")]
                arrays[OBJECT + words[0]] = np.array(words[1])
        # A name may be anything, that of an argument too.
        np.savez(target, **{PREFIX + name: array for name, array in arrays.items()})  # type: ignore[arg-type]
    except Exception as error:  # scipy answers damage with errors of every kind
        sys.stderr.write(f"{' '.join(str(error).split()) or type(error).__name__}\n")
        sys.exit(1)


def _flatten(name: str, value: Any, arrays: dict[str, NDArray[Any]]) -> None:
    """Name the fields of structures ``struct.field``; what is not numbers keeps its name and nothing else."""
    fields = getattr(value, "_fieldnames", None)
    if fields is not None:
        for field in fields:
            _flatten(f"{name}.{field}", getattr(value, field, None), arrays)
        return
    array = np.asarray(value)
    arrays[name] = array if array.dtype.kind in "iuf" else np.empty(0, "U1")


if __name__ == "__main__":
    main()
