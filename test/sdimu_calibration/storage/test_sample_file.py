"""Samples that lie in a file are those that lie in memory."""

from __future__ import annotations

import mmap

import numpy as np
import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags import imu_messages
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.bags.imu_messages import SampleFile


@pytest.fixture
def bag(tmp_path):
    rng = np.random.default_rng(2)
    ns = np.arange(1, 20_001) * 10_000_000
    write_recording(
        tmp_path / "bag",
        BagContent(
            start_ns=10**18,
            imu_ns=ns,
            omega_ib_b=rng.standard_normal((20_000, 3)),
            f_ib_b=rng.standard_normal((20_000, 3)),
        ),
    )
    return tmp_path / "bag"


def is_mapped(array: object) -> bool:
    while isinstance(array, np.ndarray):
        array = array.base
    return isinstance(array.obj if isinstance(array, memoryview) else array, mmap.mmap)


def test_a_long_recording_lies_in_a_file_and_is_the_same(bag, monkeypatch):
    short = read_recording(bag)
    monkeypatch.setattr(imu_messages, "_IN_MEMORY", 3000)
    long = read_recording(bag)
    assert not is_mapped(short.omega_ib_b)
    assert is_mapped(long.omega_ib_b)
    assert is_mapped(long.f_ib_b)
    for name in ("t", "omega_ib_b", "f_ib_b"):
        np.testing.assert_array_equal(getattr(short, name), getattr(long, name))
    assert short.start_ns == long.start_ns


def test_a_full_temporary_folder_is_one_line(monkeypatch):
    class Full:
        def write(self, _: object) -> int:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(imu_messages, "TemporaryFile", lambda **_: Full())
    with pytest.raises(DataError, match="TMPDIR"):
        SampleFile().append([(np.zeros(1, np.int64), np.zeros((1, 3)), np.zeros((1, 3)))])
