"""What a test cannot show is named, and only that."""

from dataclasses import replace

import numpy as np

from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.planning.nominal import nominal_recording
from sdimu_calibration.core.planning.observability import unobservable
from sdimu_calibration.core.planning.predict import predict
from sdimu_calibration.storage.files.config import load_plan


def test_only_the_three_turns_of_the_body_frame_stay_unseen_on_the_papers_plan(imu, model, site):
    found = predict(load_plan("kim18"), site, imu, model).unobservable
    assert [c.text.rsplit(":", 1)[1].split(",")[0] for c in found] == [
        f" rotation of the body frame about {axis}" for axis in "xyz"
    ]
    for axis, combination in zip("xyz", found, strict=True):
        names = {name for name, _ in combination.weights}
        others = {a for a in "xyz" if a != axis}
        assert names == {f"{triad}_misalignment_{a}{axis}" for triad in ("gyro", "accel") for a in others}
        # Alike in both triads: all weights have one sign.
        assert len({np.sign(weight) for _, weight in combination.weights}) == 1


def test_azimuth_is_named_at_the_poles_and_only_there(imu, model, site):
    plan = load_plan("kim18")
    for latitude_deg, expected in ((90.0, True), (-90.0, True), (80.0, False), (-80.0, False), (0.0, False)):
        found = predict(plan, replace(site, latitude_rad=np.radians(latitude_deg)), imu, model).unobservable
        assert any("azimuth" in c.text for c in found) == expected, latitude_deg


def test_rest_in_one_attitude_leaves_scale_and_bias_together(imu, model, site):
    found = predict(Plan("rest", (600.0,), (), 1.0), site, imu, replace(model, effects=("accel_bias", "accel_scale")))
    # One mean force fixes the length of f alone: bias z against scale z, and nothing of x and y beyond their attitude.
    text = [c.text for c in found.unobservable]
    assert any("accel_bias_z" in t and "accel_scale_z" in t for t in text)
    assert any(t == "accel_scale_x" for t in text)
    assert nominal_recording(Plan("rest", (600.0,), (), 1.0), site).t[-1] > 599.0


def test_sum_that_was_not_seen_is_named_with_its_sign():
    prior = np.array([1.0, 2.0, 3.0])
    # a - b/2 (in units of the prior: a against b) unseen, everything else seen.
    direction = np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    covariance = np.outer(prior, prior) * (1e-6 * np.eye(3) + np.outer(direction, direction))
    (only,) = unobservable(("a", "b", "c"), prior, covariance)
    assert only.text in ("a against b", "b against a")
    assert only.left > 0.99


def test_nothing_is_named_when_everything_was_seen():
    assert unobservable(("a", "b"), np.ones(2), 1e-4 * np.eye(2)) == ()
