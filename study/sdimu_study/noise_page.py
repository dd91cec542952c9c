"""The page on noise with a memory, doc/noise.md: is the term named, is its size right, do the sigmas hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

Rows = Sequence[Mapping[str, Any]]

_HEAD = """# Noise with a memory

`sdimu study noise` simulates tests of IMU files in one kind of noise of the size that the file states as bias
instability, on the plans kim18, kim18_signed and recommended (drawn) at latitudes of 50 S to 60 N (drawn), and
diagnoses each with nothing but the IMU file and the site. {runs} runs each, seeds from {first}.

- seen: share of triads in which a term was found; what is below the white noise of a test cannot be
- class: of these, the true kind was named or said to look the same
- interval: of terms of the true kind, the true size inside the 95 % interval
- named: of the runs that hide an effect, those whose effect is in a class that was named
- effects: runs in which a physical effect was named that is not there; one that bears the name of the noise, as
  gyro_bias_random_walk in rate random walk, is the noise
- RMS z: error over sigma of all coefficients, biases in the mean over the dwells

| IMU file | noise | seen | class | interval | named | effects | RMS z | refused |
|---|---|---|---|---|---|---|---|---|
"""


def page(results: Mapping[tuple[str, str], Rows], first: int) -> str:
    """Make the page.

    Parameters
    ----------
    results : mapping of (IMU file, kind) to rows of `NoiseRun`
    first : int
        Smallest seed.
    """
    runs = max(len(rows) for rows in results.values())
    lines = [_line(imu, kind, rows) for (imu, kind), rows in results.items()]
    return _HEAD.format(runs=runs, first=first) + "\n".join(lines) + "\n"


def _line(imu: str, kind: str, rows: Rows) -> str:
    good = [row for row in rows if "error" not in row]
    terms = [term for row in good for term in row["terms"]]
    triads = 2 * len(good)
    seen = len({(k, t["triad"]) for k, row in enumerate(good) for t in row["terms"]})
    named = [t for t in terms if kind in (t["kind"], *t["alike"])]
    own = [t for t in terms if t["kind"] == kind]
    inside = sum(t["low"] <= t["true"] <= t["high"] for t in own)
    false = sum(any(f"_{kind}_" not in label for label in row["effects"]) for row in good)
    z2, count = sum(row["z2"] for row in good), sum(row["count"] for row in good)
    hidden = [row for row in good if row.get("hidden")]
    rms = f"{np.sqrt(z2 / count):.2f}" if count else ""
    return (
        f"| {imu} | {kind} | {seen} of {triads} | {len(named)} of {len(terms)} | {inside} of {len(own)} | "
        f"{sum(row['named'] for row in hidden)} of {len(hidden)} | "
        f"{false} of {len(good)} | {rms} | {len(rows) - len(good)} |"
    )
