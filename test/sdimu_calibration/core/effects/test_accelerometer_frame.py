"""Priors in the accelerometers' frame: what was independent in the frame of the case shares the turn."""

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.effects import body_frame, imu_model
from sdimu_calibration.core.effects.accelerometer_frame import FRAME, accelerometer_frame_model
from sdimu_calibration.core.effects.imu_model import restate, with_references
from sdimu_calibration.core.effects.references import stated_references
from sdimu_calibration.core.specification import StatedPrior
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site

DRAWS = 10_000
SHARED = ("gyro_misalignment_xz", "gyro_misalignment_yz", "accel_misalignment_yz")
"""Misalignments that a turn about Z is in."""


def model(imu="mems_consumer", priors=()):
    asked = imu_model.build(list(load_model("baseline").effects), load_imu(imu))
    return accelerometer_frame_model(restate(asked, priors), load_imu(imu))


@pytest.mark.parametrize("imu", ["mems_consumer", "mems_industrial"])
def test_sensors_drawn_in_the_frame_of_the_case_are_as_the_turned_prior_says(imu):
    built = model(imu)
    names = built.asked.names
    drawn = np.random.default_rng(7).normal(size=(DRAWS, len(names))) * built.asked.prior
    turned = body_frame.values_in_frame(names, drawn, FRAME)
    both = [n for n in names if n in built.inner.names]
    values = turned[:, [names.index(n) for n in both]]
    at = [built.inner.names.index(n) for n in both]
    stated = built.inner.prior_covariance[np.ix_(at, at)]
    sigma = np.sqrt(np.diag(stated))
    # Of 10,000 draws five sigma of a variance are .07, and the square of an angle of .6 deg is .01 of its sigma.
    correlation = stated / np.outer(sigma, sigma)
    np.testing.assert_allclose(np.cov(values.T) / np.outer(sigma, sigma), correlation, atol=0.08)
    shared = [both.index(n) for n in SHARED]
    np.testing.assert_allclose(correlation[np.ix_(shared, shared)], 0.5 + 0.5 * np.eye(3), atol=1e-9)


def test_the_information_of_the_prior_is_the_inverse_of_its_covariance():
    inner = model().inner
    product = inner.prior_information @ inner.prior_covariance
    np.testing.assert_allclose(product, np.eye(len(inner.prior)), atol=1e-9)


def test_a_prior_that_is_stated_in_this_frame_has_no_part_in_the_turn():
    name = SHARED[0]
    inner = model(priors=(StatedPrior(name, 0.001, 0.002, "rad"),)).inner
    k = inner.names.index(name)
    assert inner.prior[k] == 0.002
    np.testing.assert_array_equal(inner.correlation[k], np.eye(len(inner.prior))[k])
    assert inner.correlation[inner.names.index(SHARED[1]), inner.names.index(SHARED[2])] == pytest.approx(0.5)


def test_what_serves_is_independent_of_it():
    inner = model().inner
    references = stated_references(replace(load_site("daejeon"), latitude_sigma_rad=1e-4))
    assert references
    more = with_references(inner, references)
    before, count = len(inner.prior), len(references)
    assert len(more.prior) == before + count
    np.testing.assert_array_equal(more.correlation[:before, :before], inner.correlation)
    np.testing.assert_array_equal(more.correlation[before:], np.eye(before + count)[before:])
