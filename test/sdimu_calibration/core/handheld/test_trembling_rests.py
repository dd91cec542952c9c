"""Rests that tremble count, by their own scatter, as far as the coefficients are known better with them."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from sdimu_calibration.core.data.static_detection import detect_static
from sdimu_calibration.core.data.trembling_rests import relaxed, sway
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.handheld.handheld import prepare_run
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_calibration.storage.importing.import_map import ImportMap
from sdimu_calibration.storage.importing.importer import read_files
from sdimu_sim.core.by_hand import ByHand, by_hand_recording

IMU, MODEL = load_imu("mems_by_hand"), load_model("hand")


@pytest.fixture(scope="module")
def shaken():
    """Half of twelve rests tremble by 2 to 6 times the noise."""
    return by_hand_recording(ByHand(12, IMU, Site(np.radians(36.4)), seed=11, trembling=6))[0]


def test_trembling_rests_count_and_make_the_coefficients_better(shaken):
    fit = solve(PreparedTest(shaken, IMU), MODEL)
    quiet = detect_static(shaken)
    spans = tuple((float(shaken.t[a]), float(shaken.t[b - 1])) for a, b in zip(quiet.first, quiet.last, strict=True))
    before = solve(PreparedTest(shaken, IMU, rests=spans), MODEL)
    assert len(fit.rests()) >= 11
    sigma, without = (np.sqrt(np.diag(one.covariance)[fit.priors.kept]) for one in (fit, before))
    # Six attitudes more of twelve: of a sphere that six rests hardly fix, every coefficient is known better.
    assert np.mean(np.log(sigma / without)) < -np.log(1.5)
    assert any("rests tremble, by up to" in note for note in fit.notes())


def test_quiet_rests_stay_as_they_are(site):
    recording, _ = by_hand_recording(ByHand(15, IMU, site, seed=5))
    quiet, chosen = detect_static(recording), prepare_run(recording, IMU)
    assert np.array_equal(chosen.rests.first, quiet.first)
    assert np.array_equal(chosen.rests.last, quiet.last)
    assert not chosen.notes


def test_a_higher_step_keeps_the_rests_of_the_lower_ones(shaken):
    sets = relaxed(shaken)
    assert len(sets) > 1
    assert [len(one) for one in sets] == sorted(len(one) for one in sets)
    for less, more in pairwise(sets):
        covered = [np.any((more.first < b) & (a < more.last)) for a, b in zip(less.first, less.last, strict=True)]
        assert all(covered)
        assert np.all(more.first[1:] >= more.last[:-1])


def test_a_swing_is_measured_to_its_size():
    rng, dt, frequency, size = np.random.default_rng(3), 0.01, 9.0, np.radians(0.05)
    t = np.arange(1, 4001) * dt
    swing = np.where(t > 20.0, 2.0 * np.pi * frequency * size * np.cos(2.0 * np.pi * frequency * t), 0.0)
    w = 1e-3 * rng.standard_normal((4000, 3)) + swing[:, None]
    recording = Recording(0, t, w, np.tile([0.0, 0.0, -9.8], (4000, 1)))
    rests = replace(detect_static(recording), first=np.array([0, 2300]), last=np.array([300, 2600]))
    found = sway(recording, rests)
    assert found.angle[0] == 0.0
    # The square of the mean of a sine is half its own; the share of it about a chord is drawn, by a factor of 1.6.
    assert size / np.sqrt(2.0) / 1.6 < found.angle[1] < 1.6 * size / np.sqrt(2.0)
    # Force without noise or swing leaves rounding.
    assert np.all(found.speed < 1e-12)


def test_too_few_rests_are_refused_with_the_cause_and_the_option(site):
    few, _ = by_hand_recording(ByHand(4, IMU, site, seed=2))
    with pytest.raises(DataError, match=r"4 rests; a handheld .* needs 6 and more.*more than 8 times.*--rests"):
        prepare_run(few, IMU)


def test_the_recording_with_trembling_rests_gives_the_published_scales(recorded):
    chart = ImportMap.model_validate({
        "format": "sdimu-import/1",
        "time": {"rate_hz": 100},
        "accel": {"columns": ["ax", "ay", "az"], "unit": "g", "counts_per_unit": 16384},
        "gyro": {"columns": ["gx", "gy", "gz"], "unit": "deg/s", "counts_per_unit": 131},
    })  # fmt: skip
    found = read_files([recorded("tomi/calibration.csv")], chart)
    recording = Recording(0, (found.ns - found.ns[0]) * 1e-9 + 0.01, found.omega_ib_b, found.f_ib_b)
    assert len(detect_static(recording)) == 4
    fit = solve(PreparedTest(recording, IMU), MODEL)
    assert len(fit.rests()) >= 10
    value = dict(zip(fit.names, fit.values, strict=True))
    # The tool of its author, of ten rests: counts a g, and counts of the opposite sign. Its scatter is not published;
    # a milli-g is what the mean of a trembling second is good for.
    for axis, counts, bias in zip("xyz", (16290, 16431, 16737), (711, -358, -1840), strict=True):
        assert abs(value[f"accel_scale_{axis}"] - (counts / 16384 - 1.0)) < 1e-3
        assert abs(value[f"accel_bias_{axis}"] / STANDARD_GRAVITY - bias / 16384) < 1.5e-3
