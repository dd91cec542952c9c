"""Correlations of many estimates as a text for JSON: a byte each, below the diagonal, packed by zlib."""

from __future__ import annotations

import zlib
from base64 import b64decode, b64encode

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.fleet.common import STEPS, Bytes

_MOST = 5000
"""Number of estimates at most: a catalogue has hundreds, and what is unpacked must be bounded."""


def packed(J: Floats) -> str:
    """Pack the correlations of estimates ``d_i / J_ii`` whose information is `J`, shape (k, k)."""
    unit = 1.0 / np.sqrt(np.diag(J))
    whole = np.rint(np.clip(J * np.outer(unit, unit), -1.0, 1.0) * STEPS).astype(np.int8)
    return b64encode(zlib.compress(whole[np.tril_indices(len(J), -1)].tobytes(), 9)).decode("ascii")


def unpacked(text: str, k: int) -> Bytes | None:
    """Unpack correlations of `k` estimates, times `STEPS`, shape (k, k); None for what is no such text."""
    if not 0 < k <= _MOST:
        return None
    count = k * (k - 1) // 2
    try:
        raw = zlib.decompressobj().decompress(b64decode(text), count + 1)
    except (ValueError, zlib.error):
        return None
    if len(raw) != count:
        return None
    out = np.zeros((k, k), np.int8)
    out[np.tril_indices(k, -1)] = np.frombuffer(raw, np.int8)
    out += out.T
    np.fill_diagonal(out, round(STEPS))
    return out
