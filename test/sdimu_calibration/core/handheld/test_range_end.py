"""Readings at the end of a range are saturation; what a logger writes several times is none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.handheld.range_end import at_range_end
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.files.config import load_imu
from sdimu_sim.core.by_hand import ByHand, by_hand_recording


@pytest.fixture(scope="module")
def recording():
    run = ByHand(6, load_imu("mems_by_hand"), Site(np.radians(45.0)), seed=1)
    return by_hand_recording(run)[0]


def held(recording, times):
    """The recording of a logger that writes each measurement several times."""
    step = np.diff(recording.t, prepend=0.0)[:, None] * np.arange(times)[::-1] / times
    omega, force = (np.repeat(x, times, axis=0) for x in (recording.omega_ib_b, recording.f_ib_b))
    return replace(recording, t=(recording.t[:, None] - step).ravel(), omega_ib_b=omega, f_ib_b=force)


def saturated(recording, share):
    """The recording of an IMU whose gyro x ends at a share of its largest rate."""
    omega = recording.omega_ib_b.copy()
    end = share * omega[:, 0].max()
    clipped = omega[:, 0] >= end
    omega[clipped, 0] = end
    return replace(recording, omega_ib_b=omega), clipped


@pytest.mark.parametrize("times", [1, 2, 4, 10])
def test_measurements_that_are_written_several_times_are_no_end_of_a_range(recording, times):
    assert not at_range_end(held(recording, times)).any()


@pytest.mark.parametrize("times", [1, 4])
def test_a_gyro_at_the_end_of_its_range_is_seen(recording, times):
    clipped, rows = saturated(recording, 0.8)
    found = at_range_end(held(clipped, times))
    assert not found[:, 1:].any()
    assert found[:, 0].any()
    assert not found[~np.repeat(rows, times), 0].any()
    assert found[:, 0].sum() > 0.8 * times * rows.sum()


def test_a_channel_of_one_number_has_no_end(recording):
    dead = recording.omega_ib_b * np.array([0.0, 1.0, 1.0])
    assert not at_range_end(replace(recording, omega_ib_b=dead)).any()
