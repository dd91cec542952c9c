"""An IMU's file that states far too little noise is named where the fit fails, with what the rests show."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sdimu_calibration.core.data.imu_class import other_grade, understated_noise
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import DivergedError
from sdimu_calibration.storage.opening import known_imus

GYROS = "gyros show 0.1 deg/h/sqrt(Hz) at rest where quiet states 0.001"
REMEDY = "; take --noise estimated"


def quieter(imu, factor, accel_too=True):
    """Specification of an IMU with its noise divided."""
    accel = imu.accel_white_noise / (factor if accel_too else 1.0)
    return replace(imu, name="quiet", gyro_white_noise=imu.gyro_white_noise / factor, accel_white_noise=accel)


def test_a_filter_that_diverges_names_the_noise_with_both_sizes(bench):
    test = PreparedTest(bench.recording(), quieter(bench.imu, 100.0), bench.site)
    with pytest.raises(DivergedError, match=r"diverged.*likely cause is the noise") as error:
        solve(test, bench.model)
    assert GYROS in str(error.value)
    assert "ug/sqrt(Hz) at rest where quiet states 0.1" + REMEDY in str(error.value)


@pytest.fixture
def beside(bench):
    """Return a fit as it is, but for the noise that its file states of the gyros."""
    fit = bench.fit()
    return replace(fit, test=replace(fit.test, imu=quieter(bench.imu, 100.0, accel_too=False)))


def test_a_contradiction_and_a_misfit_name_it_too(beside):
    statistics = replace(beside.statistics(), nis_mean=5e3)
    assert beside.contradiction(statistics).endswith(GYROS + REMEDY)
    (told,) = (line for line in beside.warnings(statistics) if "does not fit" in line)
    assert f"{GYROS}{REMEDY}; run: sdimu diagnose" in told


def test_a_misfit_that_is_too_small_for_it_does_not(beside):
    (told,) = (line for line in beside.warnings(replace(beside.statistics(), nis_mean=2.0)) if "does not fit" in line)
    assert "noise in" not in told


@pytest.mark.parametrize("factor", [1.0, 1.5])
def test_noise_that_is_nearly_as_stated_is_no_cause(bench, factor):
    assert understated_noise(bench.recording(), quieter(bench.imu, factor)) == ""


def test_without_a_rest_nothing_is_said(bench):
    first = bench.recording()
    short = replace(first, t=first.t[:20], omega_ib_b=first.omega_ib_b[:20], f_ib_b=first.f_ib_b[:20])
    assert understated_noise(short, quieter(bench.imu, 100.0)) == ""


@pytest.mark.parametrize(("factor", "states"), [(50.0, "0.002"), (1.0 / 50.0, "5")], ids=["quieter", "noisier"])
def test_a_file_of_another_grade_is_told_with_the_one_that_fits(bench, factor, states):
    """A diagnosis advised a factor of the noise, which would have left the priors of another IMU."""
    known = (replace(bench.imu, name="near", gyro_white_noise=1.5 * bench.imu.gyro_white_noise), bench.imu)
    told = other_grade(bench.recording(), quieter(bench.imu, factor), lambda: known)
    assert f"gyros show 0.1 deg/h/sqrt(Hz) at rest where quiet states {states}" in told
    assert f"the IMU is probably of another grade: {bench.imu.name} fits (--imu {bench.imu.name})" in told


def test_noise_far_above_the_file_is_told_without_a_file_that_fits_and_noise_below_is_not(bench):
    none = (replace(bench.imu, name="far", gyro_white_noise=1e3 * bench.imu.gyro_white_noise),)
    recording = bench.recording()
    assert other_grade(recording, quieter(bench.imu, 50.0), lambda: none).endswith(REMEDY)
    assert other_grade(recording, quieter(bench.imu, 1.0 / 50.0), lambda: none) == ""
    assert other_grade(recording, bench.imu, lambda: (bench.imu,)) == ""


def test_a_bag_knows_the_files_that_may_be_named():
    assert {"dtg", "fog_tactical", "mems_consumer"} <= {imu.name for imu in known_imus()}
