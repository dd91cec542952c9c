"""Latitude and gravity with a sigma are parameters of the fit; without one they are taken at their word, and told."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.core import earth
from sdimu_calibration.core.data.latitude_check import EarthRate, contradictions
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.diagnosis.found import found_effects
from sdimu_calibration.core.effects.references import stated_references, told_of
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import fit_about, solve
from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.core.joint.combine import Combination, Rows
from sdimu_calibration.core.joint.reduction import reduced
from sdimu_calibration.core.joint.set_order import check_one_site
from sdimu_calibration.core.live import LiveCalibration
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.site_reference import relative_line
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import from_si, to_si
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_calibration.storage.files.result_file import read_result, write_result
from sdimu_sim.core.by_hand import ByHand, by_hand_recording
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_study.score import baseline_z

SEED = 131
LATITUDE, GRAVITY = float(np.radians(0.5)), to_si(100.0, "mgal")
DEFLECTION = to_si(6.0, "arcmin")
"""More than there is on Earth: the DTG sees a latitude to about an arcminute."""
SCALES = ("accel_scale_x", "accel_scale_y", "accel_scale_z")


SIGMAS = {"latitude_sigma_rad": LATITUDE, "gravity_sigma_m_s2": GRAVITY}
IMU, MODEL, SITE = load_imu("dtg"), load_model("baseline"), Site(float(np.radians(36.4)), 80.0)


@cache
def recorded(effects=(), site=SITE):
    plan = load_plan("kim18_signed")
    plan = replace(plan, dwell_s=(60.0,) * len(plan.dwell_s))
    return generate(Scenario(plan, IMU, site, rate_hz=20.0, seed=SEED, effects=effects))


def off(**sigmas):
    """The site, wrong by one of the stated sigmas each."""
    gravity = float(earth.normal_gravity(SITE.latitude_rad, SITE.height_m))
    return replace(SITE, latitude_rad=SITE.latitude_rad + LATITUDE, gravity_m_s2=gravity - GRAVITY, **sigmas)


@cache
def fitted(effects=()):
    return solve(PreparedTest(recorded(effects)[0], IMU, off(**SIGMAS)), MODEL)


@cache
def under_a_deflection(sigma):
    """A test whose plumb line lies `DEFLECTION` north of the latitude that is told, calibrated with that sigma."""
    gravity = float(earth.normal_gravity(SITE.latitude_rad, SITE.height_m))
    true = replace(SITE, latitude_rad=SITE.latitude_rad + DEFLECTION, gravity_m_s2=gravity)
    recording, truth = recorded(site=true)
    site = replace(SITE, deflection_sigma_rad=sigma)
    return outcome(solve(PreparedTest(recording, IMU, site), MODEL, "filter"), held_out=False), truth.imu


@cache
def at_its_word():
    return solve(PreparedTest(recorded()[0], IMU, SITE), MODEL)


def test_coefficients_are_honest_at_a_site_that_is_off_by_what_it_states():
    result = outcome(fitted())
    z = baseline_z(result, recorded()[1].imu)
    # 27 errors over sigma: their RMS scatters by a seventh.
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.45
    assert result.fit["held_out_rms"] == pytest.approx(1.0, abs=0.1)
    assert not result.warnings
    assert all("reference" not in name for name in result.names)


def test_gravity_is_in_the_common_scale_factor_and_in_nothing_else():
    fit, told = fitted(), at_its_word()
    rows = [fit.names.index(name) for name in SCALES]
    C = fit.covariance[np.ix_(rows, rows)]
    apart = np.array([1.0, -1.0, 0.0])
    # Prior and stated sigma together: of three scale factors of 150 ppm and of 102 ppm that all share.
    gravity, prior = GRAVITY / 9.8, to_si(150.0, "ppm")
    expected = (gravity**-2 + 3.0 * prior**-2) ** -0.5
    assert np.sqrt(C[0, 0]) == pytest.approx(expected, rel=0.02)
    assert apart @ C @ apart == pytest.approx(apart @ told.covariance[np.ix_(rows, rows)] @ apart, rel=0.05)
    bias = fit.names.index("accel_bias_x")
    assert fit.covariance[bias, bias] == pytest.approx(told.covariance[bias, bias], rel=0.02)


def test_a_hidden_effect_is_named_beside_a_site_that_is_off():
    hidden = "accel_quadratic_x=25 ug/g^2"
    diagnosis = climb(fitted(effects=(hidden,)))
    (one,) = found_effects(diagnosis)
    assert one.candidate.label == "accel_quadratic_x"
    assert not {"reference_latitude", "reference_gravity"} & {c.label for c in diagnosis.evidence.candidates}


def test_a_site_at_its_word_says_what_is_relative_to_it():
    result = outcome(at_its_word(), held_out=False)
    latitude, gravity = result.references
    assert gravity.relative == SCALES
    assert gravity.origin == "normal"
    assert latitude.value == latitude.told == SITE.latitude_rad
    assert not any("was estimated, too" in note for note in result.notes)
    line = relative_line(result.references)
    assert "accel_scale_x, accel_scale_y, accel_scale_z to gravity 9.798288 m/s^2 (WGS-84" in line
    # The root of 1795 mgal^2, and over 979829 mgal.
    assert ", off by 42 mgal, scale factors by 43 ppm (root mean square over the Earth)" in line
    assert line.endswith(": state gravity_m_s2, or gravity_sigma: formula")
    assert "\n" not in line
    # What a diagnosis tells of gravity is read beside it, and beside the site's file.
    assert gravity.display_unit == resolve("reference_gravity").parameters[0].display_unit == "mgal"


def test_a_stated_gravity_is_not_said_to_be_that_of_a_formula():
    line = relative_line(told_of(replace(SITE, gravity_m_s2=9.8), SCALES))
    assert line == f"sigmas are relative to the site as told: {', '.join(SCALES)} to gravity 9.800000 m/s^2"


def test_a_deflection_of_the_vertical_is_found_as_the_latitude_of_the_plumb_line():
    (found, truth), (at_word, _) = under_a_deflection(DEFLECTION), under_a_deflection(0.0)
    latitude, gravity = found.references
    off = latitude.value - latitude.told - DEFLECTION
    assert abs(off) < 4.0 * latitude.value_sigma < DEFLECTION
    assert latitude.sigma == DEFLECTION
    (note,) = (note for note in found.notes if "was estimated, too" in note)
    assert "latitude 36.4000 deg (its sigma has the deflection of the vertical in it)" in note
    assert "from +- 6 arcmin" in note
    # 27 errors over sigma; with the latitude at its word the Earth's rate that is missing goes into the gyros.
    assert np.sqrt(np.mean(baseline_z(found, truth) ** 2)) < 1.45
    assert np.abs(baseline_z(at_word, truth)).max() > np.abs(baseline_z(found, truth)).max() + 1.0
    # Gravity of the formula is that of the ellipsoid: the plumb line has no part in it.
    assert gravity.value_sigma == 0.0
    rows = [found.names.index(name) for name in SCALES]
    assert np.diag(found.covariance)[rows] == pytest.approx(np.diag(at_word.covariance)[rows], rel=0.02)


def test_what_is_found_of_the_site_stands_in_the_result_and_its_file(tmp_path):
    result = outcome(fitted(), held_out=False)
    latitude, gravity = result.references
    assert abs(latitude.value - SITE.latitude_rad) < 4.0 * latitude.value_sigma < 0.2 * LATITUDE
    assert gravity.value_sigma > 0.5 * GRAVITY
    assert relative_line(result.references) == ""
    assert sum("was estimated, too" in note for note in result.notes) == 2
    write_result(tmp_path / "result.json", result)
    assert read_result(tmp_path / "result.json").references == result.references


def test_a_sigma_that_the_data_contradict_is_warned_of():
    site = replace(off(), latitude_sigma_rad=LATITUDE / 10.0)
    result = outcome(solve(PreparedTest(recorded()[0], IMU, site), MODEL, "filter"), held_out=False)
    (line,) = (line for line in result.warnings if "the latitude of the site, told with a sigma of" in line)
    # What the data say, whatever was told: the fit itself stays near what was told.
    said = float(line.partition("too large by ")[2].split(" arcmin")[0])
    off_by, sigma = from_si(LATITUDE, "arcmin"), from_si(LATITUDE, "arcmin") / 10.0
    assert abs(said - off_by) < 0.2 * off_by
    assert f"a sigma of {sigma:.3g} arcmin, contradicts the data" in line


def test_gravity_by_a_latitude_is_as_uncertain_as_that():
    ((effect, _),) = stated_references(replace(SITE, latitude_sigma_rad=1e-3))
    ((alone, _),) = stated_references(replace(SITE, latitude_sigma_rad=1e-3, gravity_m_s2=9.8))
    assert [term.channel for term in effect.terms] == [0, 1, 2, 3, 4, 5]
    assert [term.channel for term in alone.terms] == [0, 1, 2]
    seen = at_its_word().known.seen
    # Told less true: a latitude too far north makes gravity too large by 5.2e-2 sin(2 latitude) m/s^2/rad.
    down = seen.C_nb[:, 2, :]
    slope = effect.regressors(seen)[:, 3:] / down
    assert np.allclose(slope[np.abs(down) > 0.1], 5.16e-2 * np.sin(2.0 * SITE.latitude_rad), rtol=1e-2)


def test_gravity_goes_with_the_geodetic_part_of_a_latitude_alone():
    seen = at_its_word().known.seen
    down = seen.C_nb[:, 2, :]

    def slope_of(effect):
        return float(np.median((effect.regressors(seen)[:, 3:] / down)[np.abs(down) > 0.1]))

    ((whole, _),) = stated_references(replace(SITE, latitude_sigma_rad=3e-4))
    both = replace(SITE, latitude_sigma_rad=3e-4, deflection_sigma_rad=4e-4, gravity_sigma_m_s2=1e-6)
    (latitude, sigma), (gravity, left) = stated_references(both)
    assert (sigma, gravity.name) == (pytest.approx(5e-4), "reference_gravity")
    # Covariance of gravity with the sum is that with the geodetic part, its variance what that part alone gives.
    assert slope_of(latitude) * 25.0 == pytest.approx(slope_of(whole) * 9.0)
    assert (slope_of(latitude) * 5e-4) ** 2 + left**2 == pytest.approx((slope_of(whole) * 3e-4) ** 2 + 1e-12)
    # Without a sigma of its own gravity is taken at its word, and what is relative to it is told.
    ((_, _),) = stated_references(replace(both, gravity_sigma_m_s2=0.0))
    ((alone, size),) = stated_references(replace(SITE, deflection_sigma_rad=4e-4))
    assert ([term.channel for term in alone.terms], size) == ([0, 1, 2], 4e-4)
    surveyed = stated_references(replace(both, gravity_m_s2=9.8))
    assert [size for _, size in surveyed] == [pytest.approx(5e-4), 1e-6]


def test_the_batch_estimator_says_that_it_takes_the_site_at_its_word():
    test = PreparedTest(recorded()[0], IMU, off(**SIGMAS))
    with pytest.raises(DataError, match="estimator 'batch' cannot estimate the site: leave latitude_sigma out"):
        solve(test, MODEL, "batch")


def test_recordings_of_a_set_share_what_their_site_is_off_by():
    fit = fitted()
    rows = reduced(fit.evidence())
    assert rows.names[-2:] == ("reference_latitude", "reference_gravity")
    # Nine recordings know a coefficient three times as well as one, but for what all share.
    one = Rows(rows.A, rows.y)
    few, many = (
        np.sqrt(np.diag(Combination([one] * n, rows.weight, []).estimate(np.empty(0)).covariance)) for n in (1, 9)
    )
    ratio = dict(zip(rows.names, many / few, strict=True))
    assert ratio["accel_scale_x"] > 0.99
    assert ratio["accel_bias_x"] < 0.4
    about = fit_about(fit.test, fit.model, dict.fromkeys(fit.names, 0.0) | {"reference_gravity": 1e-3})
    assert about.estimate[-1] == 1e-3
    assert about.names == fit.names


def test_recordings_at_sites_of_which_one_states_a_sigma_are_no_set():
    known, other = SITE, replace(SITE, latitude_rad=0.5, deflection_sigma_rad=DEFLECTION)
    with pytest.raises(DataError, match=r"one and two are at different sites.* leave deflection_sigma out"):
        check_one_site([SimpleNamespace(name="one", site=known), SimpleNamespace(name="two", site=other)])
    check_one_site([SimpleNamespace(name=name, site=other) for name in ("one", "two")])


def test_the_filter_on_the_way_holds_the_site_to_be_as_uncertain():
    site = replace(off(), **SIGMAS)
    live = LiveCalibration(OpeningOptions(IMU, site), MODEL)
    assert live.setup.sensors.serving == 2
    assert live.setup.sensors.names[-1] == "reference_gravity"


def test_the_check_of_the_place_leaves_the_room_that_is_stated():
    rate = earth.RATE * float(np.sin(SITE.latitude_rad))
    seen = EarthRate(rate, 1e-4 * earth.RATE, 9.8, 1e-5, 20, 16.0)
    wrong = replace(SITE, latitude_rad=SITE.latitude_rad + LATITUDE, gravity_m_s2=9.8 + GRAVITY)
    assert len(contradictions(seen, wrong)) == 2
    assert contradictions(seen, replace(wrong, **SIGMAS)) == ()
    assert contradictions(seen, replace(wrong, gravity_m_s2=9.8, deflection_sigma_rad=LATITUDE)) == ()


def test_a_run_by_hand_takes_the_gravity_of_its_site_with_its_sigma():
    imu, site = load_imu("mems_by_hand"), Site(float(np.radians(36.4)))
    recording, _ = by_hand_recording(ByHand(20, imu, site, seed=3))
    told = solve(PreparedTest(recording, imu, site), load_model("hand"), "handheld")
    sigma = to_si(5000.0, "mgal")
    fit = solve(PreparedTest(recording, imu, replace(site, gravity_sigma_m_s2=sigma)), load_model("hand"), "handheld")
    rows = [fit.names.index(name) for name in SCALES]
    C = fit.covariance[np.ix_(rows, rows)]
    assert np.sqrt(np.diag(C)) == pytest.approx(np.full(3, sigma / 9.8), rel=0.15)
    apart = np.array([1.0, -1.0, 0.0])
    assert np.sqrt(apart @ C @ apart) < 0.05 * np.sqrt(C[0, 0])
    assert fit.names == told.names
    assert fit.evidence().coefficients == told.evidence().coefficients
    assert np.allclose(np.diag(fit.covariance_at_site), np.diag(told.covariance), rtol=0.05)
