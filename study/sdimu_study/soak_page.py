"""The study of soaks in tables: errors over sigma by power and by kind of coefficient, compensated ramps over noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.storage.files.config import load_model
from sdimu_sim.core.true_coefficients import POWERS

Rows = Sequence[Mapping[str, Any]]
_WIDE = 3.0
"""Errors that count as inside (sigma)."""
_WORDS = ("at T0", "first power", "second power", "third power", "rate terms")


def tables(kind: str, rows: Rows) -> list[list[tuple[str, ...]]]:
    """Sum the sets of one kind up: the whole, then each kind of coefficient; headings first, in both.

    Parameters
    ----------
    kind : str
        One of `soak_run.SOAK_KINDS`.
    rows : sequence of mapping
        Of `SoakRun`, or with ``error``.
    """
    return [[(kind, ""), *whole(rows)], by_coefficient(rows)]


def whole(rows: Rows) -> list[tuple[str, str]]:
    """Sum all coefficients and ramps up, a line each.

    Parameters
    ----------
    rows : sequence of mapping
        Of `SoakRun`, or with ``error``.
    """
    good = [row for row in rows if "error" not in row]
    z = np.array([value for row in good for value in row["z"].values()])
    pairs = [s for row in good for s in row["scatter"]]
    inside = sum(s["low"] <= s["true"] <= s["high"] for s in pairs)
    return [
        ("sets", f"{len(good)} of {len(rows)}"),
        ("coefficients", str(len(z))),
        ("RMS z", _rms(z)),
        ("inside 3 sigma", f"{100.0 * np.mean(np.abs(z) < _WIDE):.1f} %" if len(z) else ""),
        ("largest z", f"{np.max(np.abs(z), initial=0.0):.1f}"),
        ("true scatter inside its interval", f"{inside} of {len(pairs)}"),
        ("compensated ramp over its noise, the one of the set", _ratio(good, "ramp")),
        ("another ramp of the same power-on", _ratio(good, "other_ramp")),
        ("the same with the mean biases of the set", _ratio(good, "mean_bias")),
    ]


def by_coefficient(rows: Rows) -> list[tuple[str, ...]]:
    """RMS z of each kind of coefficient and power over all sets: heading, then a line each."""
    good = [row for row in rows if "error" not in row]
    bases = map(str, load_model("baseline").effects)
    lines = [(base, *(_rms(_of(good, place, base)) for place in range(len(_WORDS)))) for base in bases]
    return [("RMS z", *_WORDS), ("all", *(_rms(_of(good, place)) for place in range(len(_WORDS)))), *lines]


def place_of(name: str) -> tuple[str, int]:
    """Effect of the baseline that a coefficient is of, and which of `_WORDS` it is.

    Parameters
    ----------
    name : str
        Of the coefficient.
    """
    stem = name.rpartition("_")[0]
    bases = [base for base in map(str, load_model("baseline").effects) if f"{stem}_".startswith(f"{base}_")]
    if not bases:
        return stem, len(_WORDS) - 1
    rest = stem.removeprefix(bases[0]).removeprefix("_")
    known = ("", *POWERS)
    return bases[0], known.index(rest) if rest in known else len(_WORDS) - 1


def _of(rows: Rows, place: int, base: str | None = None) -> Floats:
    places = {name: place_of(name) for name in {n for row in rows for n in row["z"]}}
    return np.array([
        value for row in rows for name, value in row["z"].items()
        if places[name][1] == place and base in (None, places[name][0])
    ])  # fmt: skip


def _rms(z: Floats) -> str:
    return f"{np.sqrt(np.mean(z**2)):.2f}" if len(z) else ""


def _ratio(rows: Rows, key: str) -> str:
    """Median and largest ratio of a compensated ramp to its noise, gyros and accelerometers."""
    if not rows:
        return ""
    both = [(word, np.array([row[key][word] for row in rows])) for word in ("gyro", "accel")]
    return "; ".join(f"{word} {np.median(v):.2f} ({v.max():.2f})" for word, v in both)
