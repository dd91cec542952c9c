"""The page on clean tests, doc/clean.md: what a diagnosis names where nothing is hidden."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sdimu_calibration.core.verdict import Verdict

Rows = Sequence[Mapping[str, Any]]

_HEAD = """# Clean tests

`sdimu study clean` simulates tests of every file of config/imu with nothing hidden in them, in white noise: on the
plans of config/plan, in six positions, in 24 attitudes at random, and on kim18 in ten minutes and in three hours; at
latitudes of 50 S to 60 N and sample rates of 20, 50 and 100 Hz (drawn). `mems_by_hand` makes runs by hand of 24
attitudes. Each test is diagnosed with nothing but the IMU file and the site. Seeds from {first}.

- effect: a physical effect was named
- noise: no effect, but a noise with a memory was named
- other: not consistent without a name (a misfit, an accused site or recording)
- refused: the test could not be calibrated
- RMS z: error over sigma of all coefficients

| IMU file | plan | runs | effect | noise | other | refused | RMS z | largest z |
|---|---|---|---|---|---|---|---|---|
"""


def page(results: Mapping[tuple[str, str], Rows], first: int) -> str:
    """Make the page.

    Parameters
    ----------
    results : mapping of (IMU file, plan) to rows of `CleanRun`
    first : int
        Smallest seed.
    """
    lines = [_line(imu, plan, rows) for (imu, plan), rows in results.items()]
    total = _line("**all**", "", [row for rows in results.values() for row in rows])
    refused = [
        f"- {imu} on {plan}, seed {row['seed']}: {row['error']}"
        for (imu, plan), rows in results.items() for row in rows if "error" in row
    ]  # fmt: skip
    why = ["", "Refused:", "", *refused] if refused else []
    return _HEAD.format(first=first) + "\n".join([*lines, total, *why]) + "\n"


def _line(imu: str, plan: str, rows: Rows) -> str:
    good = [row for row in rows if "error" not in row]
    effect = [row for row in good if row["named"]]
    noise = [row for row in good if not row["named"] and row["noise"]]
    other = [row for row in good if not row["named"] and not row["noise"] and row["verdict"] != Verdict.CONSISTENT]
    z2, count = sum(row["z2"] for row in good), sum(row["count"] for row in good)
    rms = f"{np.sqrt(z2 / count):.2f}" if count else ""
    largest = f"{max(row['largest_z'] for row in good):.1f}" if good else ""
    return (
        f"| {imu} | {plan} | {len(rows)} | {len(effect)} | {len(noise)} | {len(other)} | {len(rows) - len(good)} | "
        f"{rms} | {largest} |"
    )
