"""The page on missing physics, doc/missing.md: is it seen that something is missing, and do the sigmas hold then."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sdimu_calibration.core.verdict import Verdict

Rows = Sequence[Mapping[str, Any]]

_HEAD = """# Physics that the catalogue lacks

`sdimu study missing` hides one effect of 15 to 30 sigma in a test of `{imu}` (white noise; plans kim18, kim18_signed,
recommended and latitudes of 50 S to 60 N drawn) and diagnoses the test twice: with the whole catalogue, and as if the
catalogue lacked the effect. {runs} runs each, seeds from {first}; draws that the plan cannot show are left out.

- named: the effect is in a class that was named
- seen: without the effect in the catalogue the verdict is not `consistent`
- noise: of these, the verdict is that the noise has a memory and nothing physical is missing
- RMS z: error over sigma of all coefficients, with the effect in the catalogue and without

| effect | named | RMS z | seen without it | noise | RMS z without it | largest |
|---|---|---|---|---|---|---|
"""


def page(imu: str, results: Mapping[str, Rows], first: int) -> str:
    """Make the page.

    Parameters
    ----------
    imu : str
    results : mapping of family to rows of `MissingRun`
    first : int
        Smallest seed.
    """
    runs = max(len(rows) for rows in results.values())
    lines = [_line(family, [row for row in rows if "error" not in row]) for family, rows in results.items()]
    everything = [row for rows in results.values() for row in rows if "error" not in row]
    return _HEAD.format(imu=imu, runs=runs, first=first) + "\n".join([*lines, _line("**all**", everything)]) + "\n"


def _line(name: str, rows: Rows) -> str:
    known, lacking = [row["with"] for row in rows], [row["without"] for row in rows]
    named = sum(bool(row["in_class"]) for row in known)
    seen = [row for row in lacking if row["verdict"] != Verdict.CONSISTENT]
    noise = sum(row["verdict"] == Verdict.NOISE_MODEL_WRONG for row in seen)
    largest = max((row["largest_z"] for row in lacking), default=float("nan"))
    return (
        f"| {name} | {named} of {len(known)} | {_rms(known)} | {len(seen)} of {len(lacking)} | {noise} | "
        f"{_rms(lacking)} | {largest:.1f} |"
    )


def _rms(rows: Rows) -> str:
    z2, count = sum(row["z2"] for row in rows), sum(row["count"] for row in rows)
    return f"{np.sqrt(z2 / count):.2f}" if count else ""
