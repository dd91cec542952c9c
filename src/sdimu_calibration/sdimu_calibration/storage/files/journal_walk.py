"""The records of a journal as bytes: where they end, and all of them as arrays."""

from __future__ import annotations

import zlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sdimu_calibration.core.compiled import compiled
from sdimu_calibration.core.data.arrival import RawStatus, RawTemperature, RawTest

Bytes = NDArray[np.uint8]

HEAD = 9
"""Bytes of the head of a record: kind, length of the content, CRC-32 of kind and content (little-endian)."""
SAMPLE, STATUS, TEMPERATURE = 56, 24, 16
"""Bytes of a sample (stamp, three rates, three forces), of a status (stamp, dwell, stop), of a temperature (stamp,
value)."""
_I, _S, _T = ord("I"), ord("S"), ord("T")


class Counts(NamedTuple):
    """How much is in a journal: samples, statuses, temperatures."""

    samples: int
    statuses: int
    temperatures: int


@compiled
def _length(content: Bytes, at: int) -> int:
    """Length of the content of the record at `at`; -1 where no whole record of a known kind stands."""
    if at + HEAD > content.shape[0]:
        return -1
    kind, length = content[at], 0
    for k in range(4):
        length += int(content[at + 1 + k]) << (8 * k)
    known = (
        (kind == _I and length > 0 and length % SAMPLE == 0)
        or (kind == _S and length == STATUS)
        or (kind == _T and length == TEMPERATURE)
    )
    return length if known and at + HEAD + length <= content.shape[0] else -1


_TABLE = np.array([zlib.crc32(bytes([byte ^ 0xFF])) ^ 0xFF000000 for byte in range(256)], dtype=np.uint32)
"""Remainders of all bytes by the polynomial of CRC-32: its own begins from ones, and ends with them."""


@compiled
def _whole(content: Bytes, at: int, length: int, table: NDArray[np.uint32]) -> bool:
    """Whether the record at `at` is as it was written."""
    rest = np.uint32(0xFFFFFFFF)
    rest = table[(rest ^ np.uint32(content[at])) & np.uint32(0xFF)] ^ (rest >> np.uint32(8))
    for k in range(at + HEAD, at + HEAD + length):
        rest = table[(rest ^ np.uint32(content[k])) & np.uint32(0xFF)] ^ (rest >> np.uint32(8))
    written = 0
    for k in range(4):
        written += int(content[at + 5 + k]) << (8 * k)
    return int(rest ^ np.uint32(0xFFFFFFFF)) == written


@compiled
def _walk(content: Bytes, at: int, table: NDArray[np.uint32]) -> tuple[int, int, int, int]:
    samples, statuses, temperatures = 0, 0, 0
    while True:
        length = _length(content, at)
        if length < 0 or not _whole(content, at, length, table):
            return at, samples, statuses, temperatures
        if content[at] == _I:
            samples += length // SAMPLE
        elif content[at] == _S:
            statuses += 1
        else:
            temperatures += 1
        at += HEAD + length


@compiled
def _collect(content: Bytes, at: int, ns: Bytes, omega: Bytes, force: Bytes, status: Bytes, temperature: Bytes) -> None:
    """Copy the records from `at` on, each kind into a table of bytes of its own, one row a sample or message."""
    i, j, k = 0, 0, 0
    while i < ns.shape[0] or j < status.shape[0] or k < temperature.shape[0]:
        length = _length(content, at)
        kind = content[at]
        at += HEAD
        if kind == _S:
            status[j] = content[at : at + STATUS]
            j += 1
        elif kind == _T:
            temperature[k] = content[at : at + TEMPERATURE]
            k += 1
        else:
            for row in range(length // SAMPLE):
                first = at + row * SAMPLE
                ns[i] = content[first : first + 8]
                omega[i] = content[first + 8 : first + 32]
                force[i] = content[first + 32 : first + SAMPLE]
                i += 1
        at += length


def _as_read(content: Bytes) -> Bytes:
    """Return the same bytes as may not be written: numba compiles a loop anew for those that may."""
    view = content.view()
    view.flags.writeable = False
    return view


def walk(content: Bytes, at: int) -> tuple[int, Counts]:
    """Find the end of the last whole record (a byte's place) and count what is before it.

    Parameters
    ----------
    content : ndarray of uint8, shape (n,)
    at : int
        Place of the first record.
    """
    end, *counts = _walk(_as_read(content), at, _TABLE)
    return int(end), Counts(*map(int, counts))


def raw_test(content: Bytes, at: int) -> RawTest:
    """All records from a place on, in the order of arrival.

    Parameters
    ----------
    content : ndarray of uint8, shape (n,)
    at : int
        Place of the first record.
    """
    _, counts = walk(content, at)
    ns, omega, force = (np.empty((counts.samples, width), np.uint8) for width in (8, 24, 24))
    status = np.empty((counts.statuses, STATUS), np.uint8)
    temperature = np.empty((counts.temperatures, TEMPERATURE), np.uint8)
    _collect(_as_read(content), at, ns, omega, force, status, temperature)
    said, warm = status.view("<i8"), temperature.view("<i8")
    return RawTest(
        ns.view("<i8")[:, 0],
        omega.view("<f8"),
        force.view("<f8"),
        RawStatus(said[:, 0].copy(), said[:, 1] != 0, said[:, 2].copy()) if len(said) else None,
        RawTemperature(warm[:, 0].copy(), temperature.view("<f8")[:, 1].copy()) if len(warm) else None,
    )
