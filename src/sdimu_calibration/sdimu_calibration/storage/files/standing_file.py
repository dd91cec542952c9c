"""What is known of a unit after a diagnosis, as entry ``known`` of diagnosis.json and set.json (SI)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core.evidence.known import Known, Standing
from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.json_file import read_json

FILES = {"set.json": "sdimu-set-diagnosis/1", "diagnosis.json": "sdimu-diagnosis/1"}
"""Files that hold what is known, and their formats."""


def as_plain(standing: Standing) -> dict[str, Any]:
    """Give what is known as plain data: information of the data alone (1/SI^2), priors, changes at a power-on (SI)."""
    known = standing.known
    return {
        "names": list(known.names), "information": known.J, "prior": known.prior.tolist(),
        "scatter": known.scatter.tolist(), "added": list(standing.added), "open": [list(c) for c in standing.open],
        "imu": standing.imu, "site": standing.site,
    }  # fmt: skip


def holds_standing(path: Path) -> bool:
    """Whether a path is a folder of results of a diagnosis, or one of its files."""
    path = Path(path)
    return path.name in FILES if path.is_file() else any((path / name).is_file() for name in FILES)


def read_standing(path: Path) -> Standing:
    """Read what a diagnosis knows.

    Parameters
    ----------
    path : Path
        Folder of its results, or set.json or diagnosis.json in it.

    Raises
    ------
    DataError
        When there is none, or it was written by a version that did not keep it.
    """
    path = Path(path)
    file = path if path.is_file() else next((path / n for n in FILES if (path / n).is_file()), path / "diagnosis.json")
    content = read_json(file, FILES.get(file.name, "sdimu-diagnosis/1"))
    if not content.get("known"):
        raise DataError(f"{file}: does not say what is known of the unit; run sdimu diagnose again")
    try:
        return _standing(content["known"])
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{file}: known: damaged ({error}); run sdimu diagnose again") from error


def _standing(entry: Mapping[str, Any]) -> Standing:
    names = _words(entry["names"])
    k = len(names)
    prior = np.array([np.inf if v is None else float(v) for v in entry["prior"]])
    scatter, J = np.array(entry["scatter"], dtype=float), np.array(entry["information"], dtype=float)
    if J.shape != (k, k) or prior.shape != (k,) or scatter.shape != (k,) or not np.isfinite(J).all():
        raise ValueError(f"expected {k} finite rows and columns")
    return Standing(
        Known(names, J, prior, scatter), _words(entry["added"]), tuple(_words(c) for c in entry["open"]),
        one_line(str(entry["imu"])), one_line(str(entry["site"])),
    )  # fmt: skip


def _words(values: Any) -> tuple[str, ...]:
    return tuple(one_line(str(value)) for value in values)
