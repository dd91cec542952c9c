"""Samples of a long recording in a file without a name: in memory are those that are looked at."""

from __future__ import annotations

import mmap
from collections.abc import Sequence
from tempfile import TemporaryFile, gettempdir
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats, Ints
from sdimu_calibration.core.recording import DataError

Samples = tuple[Ints, Floats, Floats]
"""Stamps (n,) (ns), rates (n, 3) (rad/s), specific forces (n, 3) (m/s^2)."""


class SampleFile:
    """Takes samples block by block and gives them back as arrays that the system may leave on the disk."""

    def __init__(self) -> None:
        self._files = [TemporaryFile(prefix="sdimu-") for _ in range(3)]  # noqa: SIM115 (they last as long as the arrays)
        self._count = 0

    def append(self, blocks: Sequence[Samples]) -> None:
        """Append blocks of samples.

        Raises
        ------
        DataError
            When the temporary folder has no room.
        """
        try:
            for block in blocks:
                for file, column in zip(self._files, block, strict=True):
                    file.write(np.ascontiguousarray(column).data)
                self._count += len(block[0])
        except OSError as error:
            raise DataError(
                f"{gettempdir()}: no room for the samples of a long recording ({error.strerror or error}); set TMPDIR "
                "to a folder with 60 bytes a sample"
            ) from error

    def samples(self) -> Samples:
        """Return all samples; the files go with the arrays."""
        for file in self._files:
            file.flush()
        ns, omega, force = (
            self._mapped(file, dtype) for file, dtype in zip(self._files, (np.int64, float, float), strict=True)
        )
        return ns, omega.reshape(-1, 3), force.reshape(-1, 3)

    def _mapped(self, file: Any, dtype: type) -> Any:
        return np.frombuffer(mmap.mmap(file.fileno(), 0), dtype)
