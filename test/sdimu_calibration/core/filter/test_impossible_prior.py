"""A prior that no sensor error can have is named with its file, key and what it cannot be told from."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sdimu_calibration.core.estimation.solve import extend, solve
from sdimu_calibration.core.filter import passes
from sdimu_calibration.core.filter.impossible_prior import impossible_prior, possible
from sdimu_calibration.core.recording import DataError, DivergedError
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_model
from sdimu_calibration.storage.files.effect_file import find_effects, load_effect

EFFECT = """
format: sdimu-effect/1
name: own
expressions: {{gyro_x: k1 * {formula}}}
parameters: {{k1: {{unit: {unit}, prior: {prior} {unit}}}}}
"""


def refused(fit, tmp_path, formula, unit, prior):
    path = tmp_path / "own.yaml"
    path.write_text(EFFECT.format(formula=formula, unit=unit, prior=prior))
    with pytest.raises(DataError) as error:
        extend(fit, load_effect(path))
    text = str(error.value)
    assert text.startswith(f"{path}: parameters.k1.prior: ")
    assert "\n" not in text
    return text


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("prior", ["1e10", "1e20", "1e24"])
def test_an_addition_with_an_impossible_prior_is_told_with_what_it_is(bench, tmp_path, prior):
    text = refused(bench.fit(), tmp_path, "1.0", "deg/h", prior)
    assert "no sensor has" in text
    assert "own_k1 cannot be told from gyro_bias_x" in text


@pytest.mark.parametrize("prior", ["1e30", "1e100", "1e300"])
def test_a_prior_beyond_all_quantities_is_refused_when_it_is_read(bench, tmp_path, prior):
    assert "larger than any quantity" in refused(bench.fit(), tmp_path, "1.0", "deg/h", prior)


def test_an_impossible_prior_of_what_nothing_else_shows_is_told_alone(bench, tmp_path):
    text = refused(bench.fit(), tmp_path, "ax * wz * wy", "deg/h/g*s^2/deg^2", "1e18")
    assert "no sensor has" in text
    assert "cannot be told" not in text


def test_of_an_imu_file_its_own_key_is_named(bench):
    test = bench.fit().test
    wide = replace(test.imu, prior={**test.imu.prior, "gyro_bias": to_si(1e10, "deg/h")}, file="mine.yaml")
    with pytest.raises(DataError, match=r"^mine.yaml: prior.gyro_bias: 1e\+10 deg/h allows errors of 4.8e\+04 rad/s"):
        solve(replace(test, imu=wide), load_model("baseline"))


def test_usual_priors_are_blamed_for_nothing(bench):
    fit = bench.fit()
    sensors = fit.setup.sensors
    assert impossible_prior(sensors, sensors.regressors(fit.known.seen), "mine.yaml") == ""


def test_a_motion_that_an_earlier_pass_made_of_it_blames_no_prior(bench):
    motion = bench.fit().bare.seen
    assert possible(motion)
    assert not possible(replace(motion, f=motion.f * 1e9))


def test_what_an_earlier_pass_made_of_the_motion_is_no_matter_of_the_prior(bench, monkeypatch):
    test = bench.fit().test
    wide = replace(test.imu, prior={**test.imu.prior, "gyro_bias": to_si(1e10, "deg/h")}, file="mine.yaml")
    monkeypatch.setattr(passes, "possible", lambda _: False)
    with pytest.raises(DivergedError, match="add to the model what is far larger than its priors"):
        solve(replace(test, imu=wide), load_model("baseline"))


def test_a_wide_prior_that_the_filter_bears_is_not_refused(bench):
    (own,) = find_effects("gyro_x: 1")
    wide = replace(own, prior=dict.fromkeys(own.prior, to_si(1e5, "deg/h")))
    assert extend(bench.fit(), [wide]).names[-1] == "gyro_x: 1"


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_what_is_too_large_to_be_squared_is_told_without_a_warning(bench):
    fit = bench.fit()
    values = fit.setup.sensors.regressors(fit.known.seen) * 1e200
    assert "no sensor has" in impossible_prior(fit.setup.sensors, values, "mine.yaml")
