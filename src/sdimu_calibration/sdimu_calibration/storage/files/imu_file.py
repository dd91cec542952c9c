"""A specification of an IMU written as YAML, with measured noise in place of the data sheet's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from sdimu_calibration.core.noise import TERMS, Terms, WhiteNoise
from sdimu_calibration.core.noise.white import white_beside
from sdimu_calibration.core.noise_term import TRIADS
from sdimu_calibration.storage.files.imu_text import imu_text
from sdimu_calibration.storage.files.whole_file import write_whole

_MEMORY = {"quantisation": "quantisation", "instability": "bias_instability", "random_walk": "random_walk"}
"""Keys of an IMU file, of the terms beside white noise."""
_SHORT = ("quantisation",)
"""Terms that are believed where the terms do not explain the deviation: they show in times shorter than any rocking."""


def write_measured_imu(
    path: Path, base: str, measured: WhiteNoise, terms: Mapping[str, Terms], remarks: Sequence[str]
) -> None:
    """Write an IMU file that ``--imu`` takes: grade and priors of `base`, the noise as measured.

    Parameters
    ----------
    base : str
        IMU by name or path.
    measured : WhiteNoise
        The noise of means over a second: what is left of it without quantisation is written as white noise.
    terms : mapping of str to Terms
        By channel; of each triad the root mean square of the axes that show a term is written.
    remarks : sequence of str
        Comments for the head of the file.
    """
    noise = {}
    for triad in TRIADS:
        found = memory_of(terms, triad)
        noise[triad] = white_of(measured, terms, triad, found.get("quantisation", 0.0))
        noise |= {f"{triad}_{_MEMORY[term]}": size for term, size in found.items()}
    own = f"Grade and priors are those of '{base}': they are not measured here."
    write_whole(path, imu_text(base, path.stem, [*remarks, own], noise))


def white_of(measured: WhiteNoise, terms: Mapping[str, Terms], triad: str, residue: float) -> float:
    """White noise (SI) of a triad as a file states it: that of means over a second, at most what the terms allow.

    On a base that rocks means over a second scatter by its motion, too. Where the terms do not explain the deviation of
    an axis, its upper bound of white noise is the most that the IMU itself may have.

    Parameters
    ----------
    terms : mapping of str to Terms
        By channel.
    triad : str
        ``gyro`` or ``accel``.
    residue : float
        Quantisation of the triad (rad or m/s).
    """
    at_a_second = measured.gyro if triad == "gyro" else measured.accel
    own = measured.channels[:3] if triad == "gyro" else measured.channels[3:]
    k, bounds = TERMS.index("white"), []
    for axis, density in zip("xyz", own, strict=True):
        found = terms.get(f"{triad}_{axis}")
        bounds.append(min(density, float(found.upper[k])) if found is not None and found.misfit else density)
    return min(white_beside(at_a_second, residue), float(np.sqrt(np.mean(np.square(bounds)))))


def memory_of(terms: Mapping[str, Terms], triad: str) -> dict[str, float]:
    """Sizes (SI) of the terms beside white noise that a triad shows, root mean square of its axes.

    `terms`: by channel; `triad`: ``gyro`` or ``accel``.
    """
    axes = [t for channel, t in terms.items() if channel.startswith(triad)]
    out = {}
    for name in _MEMORY:
        k = TERMS.index(name)
        # A base that rocks looks like a wandering bias.
        shown = [float(t.value[k]) if t.seen[k] and (not t.misfit or name in _SHORT) else 0.0 for t in axes]
        if any(shown):
            out[name] = float(np.sqrt(np.mean(np.square(shown))))
    return out
