"""Samples that the transport has made are dropped and told; what is large everywhere, or for longer, stays."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.data.arrival import RawTest, in_order
from sdimu_calibration.core.data.sample_screening import sound
from sdimu_calibration.core.recording import Recording

N = 20_000
INTERVAL_S = 0.01


@pytest.fixture(scope="module")
def raw():
    """Noise of a good IMU at rest, and a turn of 10 s at 10 deg/s."""
    rng = np.random.default_rng(3)
    omega, force = 1e-5 * rng.normal(size=(N, 3)), 1e-4 * rng.normal(size=(N, 3)) + np.array([0.0, 0.0, 9.8])
    omega[8000:9000, 0] += np.radians(10.0)
    return RawTest((INTERVAL_S * 1e9 * np.arange(1, N + 1)).astype(np.int64), omega, force)


def changed(raw, name, rows, value):
    new = getattr(raw, name).copy()
    new[rows, 1] = value
    return replace(raw, **{name: new})


@pytest.mark.parametrize("factor", [1.0, 180.0 / np.pi, 1.0 / 9.80665, 1000.0, 2.0**20])
@pytest.mark.parametrize(("name", "size"), [("omega_ib_b", 1e4), ("f_ib_b", -1e5), ("f_ib_b", 1e300)])
@pytest.mark.parametrize("row", [0, 500, 8500, N - 1])
def test_one_corrupt_sample_is_dropped_in_any_unit_and_told_with_its_time(raw, name, size, row, factor):
    whole = replace(raw, omega_ib_b=factor * raw.omega_ib_b, f_ib_b=factor * raw.f_ib_b)
    recording = in_order(changed(whole, name, row, factor * size))
    assert recording.rejected == 1
    np.testing.assert_array_equal(recording.f_ib_b, np.delete(whole.f_ib_b, row, axis=0))
    (note,) = recording.notes
    assert note.startswith("1 sample was far beyond all others and dropped")
    assert f"at {INTERVAL_S * row:.2f} s" in note
    assert re.search("angular_velocity.y" if name == "omega_ib_b" else "linear_acceleration.y", note)


def test_corrupt_samples_of_different_sizes_do_not_hide_each_other(raw):
    rows = np.arange(50, N, 401)
    sizes = 10.0 ** np.linspace(4, 12, len(rows))
    recording = in_order(changed(raw, "f_ib_b", rows, sizes))
    assert recording.rejected == len(rows)
    assert recording.notes[0].startswith(f"{len(rows)} samples were far beyond all others")


@pytest.mark.parametrize("factor", [1e-6, 1.0, 180.0 / np.pi, 1e6])
def test_nothing_is_dropped_of_a_sound_recording_in_any_unit(raw, factor):
    for rate, force in ((factor, 1.0), (1.0, factor), (factor, factor)):
        recording = in_order(replace(raw, omega_ib_b=rate * raw.omega_ib_b, f_ib_b=force * raw.f_ib_b))
        assert (recording.rejected, recording.notes) == (0, ())


def test_what_lasts_is_a_motion_and_what_is_frequent_belongs_to_the_recording(raw):
    assert in_order(changed(raw, "f_ib_b", slice(700, 704), 1e5)).rejected == 0
    assert in_order(changed(raw, "f_ib_b", np.arange(0, N, 50), 1e5)).rejected == 0


def test_turns_of_one_slow_sample_are_turns(raw):
    """Once a second, a quarter turn may fall into one sample."""
    rows = np.arange(1000, N, 1000)
    rested = replace(raw, ns=100 * raw.ns, omega_ib_b=1e-3 * raw.omega_ib_b)
    assert in_order(changed(rested, "omega_ib_b", rows, np.pi / 2)).rejected == 0


def test_a_reading_that_is_not_yet_far_is_a_spike_in_a_quiet_channel(raw):
    """One large reading does not make the noise of a good IMU small enough to be none."""
    large = changed(raw, "omega_ib_b", 700, 200.0)
    recording = Recording(start_ns=0, t=1e-9 * large.ns, omega_ib_b=large.omega_ib_b, f_ib_b=large.f_ib_b)
    mended, (fault,) = sound(recording)
    assert (fault.kind, fault.count, len(mended.t)) == ("spike", 1, N - 1)
