"""Configuration files: what is read is SI, and what is wrong is said in one line."""

import math
import os

import numpy as np
import pytest

from sdimu_calibration.core.alignment.prepared import set_up
from sdimu_calibration.core.effects.imu_model import build
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.storage.files.config import (
    config_folder,
    find_config,
    load_imu,
    load_model,
    load_plan,
    load_site,
)

PLAN = """
format: sdimu-plan/1
dwell: 100 s
rate: 2 deg/s
acceleration: 1 deg/s^2
turns:
  - {axis: Y, angle: 90 deg}
  - {axis: Z, angle: -180 deg, rate: 10 deg/s, dwell: 1 min}
"""
IMU = """
noise: {gyro: 0.1 deg/h/sqrt(Hz), accel: 10 ug/sqrt(Hz)}
prior: {gyro_bias: 1 deg/h, accel_scale: 150 ppm, gyro_mass_unbalance: 1 deg/h/g}
"""
MODEL = "effects: [gyro_bias, accel_bias]\nvelocity_sigma: 1 mm/s\n"
SITE = "latitude_deg: 36.4\nheight_m: 0\n"
LOADERS = {"plan": (load_plan, PLAN), "imu": (load_imu, IMU), "model": (load_model, MODEL), "site": (load_site, SITE)}


def written(tmp_path, text, name="mine.yaml"):
    path = tmp_path / name
    path.write_text(text)
    return path


def test_the_paper_plan_lasts_2980_s_in_19_stops():
    plan = load_plan("kim18")
    assert len(plan.dwell_s) == 19
    assert plan.duration_s == pytest.approx(2980.0, abs=1e-9)


@pytest.mark.parametrize("kind", LOADERS)
def test_every_file_that_comes_along_loads(kind):
    for path in (config_folder() / kind).glob("*.yaml"):
        LOADERS[kind][0](path)
        LOADERS[kind][0](path.stem)


def test_rate_and_dwell_of_a_turn_replace_the_plan_values_there_only(tmp_path):
    plan = load_plan(written(tmp_path, PLAN + "first_dwell: 300 s\n"))
    assert plan.dwell_s == (300.0, 100.0, 60.0)
    assert [math.degrees(t.rate_rad_s) for t in plan.turns] == pytest.approx([2.0, 10.0])
    assert math.degrees(plan.turns[1].angle_rad) == pytest.approx(-180.0)


def test_noise_and_priors_are_si(tmp_path):
    imu = load_imu(written(tmp_path, IMU))
    degph = math.pi / 180 / 3600
    assert imu.gyro_white_noise == pytest.approx(0.1 * degph)
    assert imu.accel_white_noise == pytest.approx(10e-6 * 9.80665)
    assert imu.prior["gyro_bias"] == pytest.approx(degph)
    assert imu.prior["accel_scale"] == pytest.approx(150e-6)
    # Coefficients per g stay per g.
    assert imu.prior["gyro_mass_unbalance"] == pytest.approx(degph)


def test_a_site_without_format_or_azimuth_is_enough(tmp_path):
    site = load_site(written(tmp_path, SITE))
    assert math.degrees(site.latitude_rad) == pytest.approx(36.4)
    assert site.gravity_m_s2 is None
    assert site.initial_azimuth_rad is None
    full = load_site(written(tmp_path, SITE + "initial_azimuth_deg: -30\ninitial_azimuth_sigma_deg: 0.5\n"))
    assert full.initial_azimuth_rad == pytest.approx(math.radians(-30))
    assert full.initial_azimuth_sigma_rad == pytest.approx(math.radians(0.5))


@pytest.mark.parametrize(
    ("key", "name", "text", "expected"),
    [
        ("latitude_sigma", "latitude_sigma_rad", "0.1 deg", math.radians(0.1)),
        ("latitude_sigma", "latitude_sigma_rad", "10 arcmin", math.radians(1.0 / 6.0)),
        ("gravity_sigma", "gravity_sigma_m_s2", "100 mgal", 1e-3),
        ("gravity_sigma", "gravity_sigma_m_s2", "30 ug", 30e-6 * 9.80665),
        ("gravity_sigma", "gravity_sigma_m_s2", "1e-4 m/s^2", 1e-4),
        ("gravity_sigma", "gravity_sigma_m_s2", "formula", 4.2e-4),
        ("deflection_sigma", "deflection_sigma_rad", "10 arcsec", 4.8481e-5),
        ("deflection_sigma", "deflection_sigma_rad", "formula", 4.8481e-5),
        ("deflection_sigma", "deflection_sigma_rad", "map", 6.3026e-6),
        ("latitude_sigma", "latitude_sigma_rad", "surveyed", 1.74533e-8),
        ("latitude_sigma", "latitude_sigma_rad", "map", 1.74533e-5),
        ("gravity_m_s2: 9.8\ngravity_sigma", "gravity_sigma_m_s2", "map", 5e-5),
        ("gravity_m_s2: 9.8\ngravity_sigma", "gravity_sigma_m_s2", "surveyed", 1e-6),
    ],
)
def test_a_site_states_how_well_it_is_known(tmp_path, key, name, text, expected):
    plain = load_site(written(tmp_path, SITE))
    assert getattr(plain, name) == 0.0
    assert getattr(load_site(written(tmp_path, SITE + f"{key}: {text}\n")), name) == pytest.approx(expected, 1e-4)


@pytest.mark.parametrize(
    ("kind", "old", "new", "message"),
    [
        ("plan", "rate: 2 deg/s", "rate: 2 deg", "rate: '2 deg' has the wrong unit"),
        ("site", "height_m: 0", "height_m: 0\nlatitude_sigma: 0.1 m", "latitude_sigma: '0.1 m' has the wrong unit"),
        ("site", "height_m: 0", "height_m: 0\nlatitude_sigma: 0.1", "latitude_sigma: '0.1' has no unit"),
        ("site", "height_m: 0", "height_m: 0\nlatitude_sigma: 9 deg", "'9 deg' is no sigma from 0 to 2 deg"),
        ("site", "height_m: 0", "height_m: 0\ngravity_sigma: -1 mgal", "'-1 mgal' is no sigma from 0 to 5000 mgal"),
        (
            "site",
            "height_m: 0",
            "height_m: 0\nlatitude_sigma: formula",
            "latitude_sigma: 'formula' is no sigma .expected surveyed or map, or something like '1 deg'",
        ),
        (
            "site",
            "height_m: 0",
            "height_m: 0\ngravity_sigma: gravimeter",
            "gravity_sigma: 'gravimeter' is no sigma .expected surveyed, map or formula, or something like '1 mgal'",
        ),
        (
            "site",
            "height_m: 0",
            "height_m: 0\ngravity_sigma: map",
            "gravity_sigma: 'map' says how gravity_m_s2 was found: state that, too, or write 'formula'",
        ),
        (
            "site",
            "height_m: 0",
            "height_m: 0\ndeflection_sigma: surveyed",
            "deflection_sigma: .*expected map or formula",
        ),
        (
            "site",
            "height_m: 0",
            "height_m: 0\ndeflection_sigma: 10 arcmin",
            "'10 arcmin' is no sigma from 0 to 360 arcsec",
        ),
        ("plan", "dwell: 100 s", "dwell: 100", "dwell: '100' has no unit"),
        ("plan", "axis: Y", "axis: Q", r"turns\.0\.axis: .*'X', 'Y' or 'Z'"),
        ("plan", "angle: 90 deg", "angel: 90 deg", r"turns\.0\.ang"),
        ("plan", "angle: 90 deg", "angle: 0 deg", "turn 1: angle is zero"),
        ("plan", "rate: 2 deg/s", "rate: -2 deg/s", "rate: .*greater than 0"),
        ("plan", "acceleration: 1 deg/s^2", "", "acceleration: missing key"),
        ("plan", "dwell: 100 s", "dwel: 100 s", "dwel: unknown key"),
        ("plan", "dwell: 100 s", "dwell: 100 day", "unknown unit 'day'"),
        ("plan", "dwell: 100 s", "dwell: 1e6 s", "more than 168 h"),
        ("plan", "dwell: 100 s", "dwell: 100 s\ndwell: 1 s", "key 'dwell' is there twice"),
        ("plan", "sdimu-plan/1", "sdimu-plan/9", "format: .*'sdimu-plan/1'"),
        ("plan", "turns:", "turns: [", "line .*not valid YAML"),
        ("imu", "gyro: 0.1 deg/h/sqrt(Hz)", "gyro: 0.1 deg/h", "noise.gyro: .*wrong unit"),
        ("imu", "1 deg/h,", "1 dog/h,", "prior.gyro_bias: unknown unit 'dog'"),
        ("imu", "1 deg/h,", "-1 deg/h,", "prior.gyro_bias: .*below zero"),
        ("imu", "prior:", "priors:", r"priors: unknown key; did you mean prior\? \(known keys: .*prior"),
        ("model", "velocity_sigma: 1 mm/s", "velocity_sigma: 1 mm", "velocity_sigma: .*wrong unit"),
        ("model", "[gyro_bias, accel_bias]", "[]", "effects: .*at least 1"),
        ("model", "accel_bias]", "gyro_bias]", "'gyro_bias' is there twice"),
        ("site", "36.4", "136.4", "latitude_deg: .*less than or equal to 90"),
        ("site", "36.4", "36.4 m", "latitude_deg: .*wrong unit .*1 deg"),
        ("site", "36.4", "north", "latitude_deg: 'north' is not a number"),
        ("site", "height_m: 0", "", "height_m: missing key"),
        ("imu", "1 deg/h,", "1e300 deg/h,", "prior.gyro_bias: .*larger than any quantity"),
        ("imu", "1 deg/h,", ".nan,", "prior.gyro_bias: 'nan' is not a number with a unit .*40 ppm"),
        ("site", "height_m: 0", "height_m: -7e6", "height_m: .*greater than or equal to -5000"),
        ("site", "36.4", ".nan", "latitude_deg: "),
        ("site", SITE, "", "found nothing"),
        ("imu", "1 deg/h,", "1e-300 deg/h,", "prior.gyro_bias: .*smaller than any sigma"),
        ("site", "36.4", "yes", "latitude_deg: expected a number, found 'True'"),
        ("site", "height_m: 0", "height_m: 0\nmagnetic_field_nt: [yes, 0, 0]", "magnetic_field_nt: expected a number"),
        (
            "plan",
            "turns:",
            "turns:" + "\n  - {axis: X, angle: 1 deg}" * 2001,
            "turns: 200[0-9] of them, more than 2000",
        ),
    ],
)
def test_a_wrong_file_gives_one_line_with_file_and_key(tmp_path, kind, old, new, message):
    load, text = LOADERS[kind]
    assert old in text
    path = written(tmp_path, text.replace(old, new))
    with pytest.raises(DataError, match=message) as caught:
        load(path)
    assert str(caught.value).startswith(f"{path}:")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("1 deg/h,", "150 ppm,", r"prior\.gyro_bias: 'ppm' is a wrong unit .*deg/h"),
        ("gyro_bias", "gyro_bais", r"prior\.gyro_bais: no effect of this name \(did you mean gyro_bias\?"),
    ],
)
def test_a_prior_that_no_effect_reads_is_refused_by_the_model(tmp_path, old, new, message):
    build(["gyro_bias", "accel_scale"], load_imu(written(tmp_path, IMU)))
    path = written(tmp_path, IMU.replace(old, new))
    with pytest.raises(DataError, match=message) as caught:
        build(["gyro_bias", "accel_scale"], load_imu(path))
    assert str(caught.value).startswith(f"{path}: prior.")


@pytest.mark.parametrize("load", [load_plan, load_imu, load_model, load_site])
def test_a_pipe_in_the_place_of_a_configuration_is_told_as_such(tmp_path, load):
    os.mkfifo(tmp_path / "pipe.yaml")
    with pytest.raises(DataError, match=r"pipe\.yaml: is a device or a pipe"):
        load(tmp_path / "pipe.yaml")


def test_an_unknown_name_lists_the_names_there_are():
    with pytest.raises(DataError, match=r"no plan named 'kim17'.*kim18"):
        load_plan("kim17")


def test_a_missing_path_is_named(tmp_path):
    with pytest.raises(DataError, match="no such site file"):
        load_site(tmp_path / "nowhere.yaml")


def test_the_environment_names_another_config_folder(tmp_path, monkeypatch):
    (tmp_path / "plan").mkdir()
    written(tmp_path / "plan", PLAN, "short.yaml")
    monkeypatch.setenv("SDIMU_CONFIG", str(tmp_path))
    assert find_config("plan", "short") == tmp_path / "plan" / "short.yaml"
    monkeypatch.setenv("SDIMU_CONFIG", str(tmp_path / "none"))
    with pytest.raises(DataError, match="SDIMU_CONFIG"):
        find_config("plan", "short")


def test_a_copy_that_is_installed_reads_the_files_that_it_brings(tmp_path, monkeypatch):
    (tmp_path / "config" / "plan").mkdir(parents=True)
    monkeypatch.delenv("SDIMU_CONFIG", raising=False)
    monkeypatch.setattr("sdimu_calibration.storage.files.config._PACKAGE", tmp_path)
    assert config_folder() == tmp_path / "config"
    monkeypatch.setattr("sdimu_calibration.storage.files.config._PACKAGE", tmp_path / "without")
    monkeypatch.setattr("sdimu_calibration.storage.files.config._REPOSITORY", tmp_path / "without")
    with pytest.raises(DataError, match="SDIMU_CONFIG"):
        config_folder()


def test_of_a_file_of_another_kind_the_format_is_told_and_not_its_keys(tmp_path):
    with pytest.raises(DataError, match=r"mine.yaml: format: .*'sdimu-effect/1'"):
        load_plan(written(tmp_path, "format: sdimu-effect/1\nname: bent\nexpressions: {}\n"))


@pytest.mark.parametrize("prior", ["gyro_bias", "accel_quadratic"])
def test_a_prior_of_zero_is_refused_by_every_estimate(tmp_path, prior):
    """Of a coefficient of the model, and of one that a diagnosis would try."""
    size = {"gyro_bias": "0 deg/h", "accel_quadratic": "0 ug/g^2"}[prior]
    whole = IMU.replace("gyro_bias: 1 deg/h, ", "")
    imu = load_imu(written(tmp_path, whole.replace("prior: {", f"prior: {{{prior}: {size}, ")))
    message = rf"prior\.{prior}: 0 leaves nothing to estimate"
    with pytest.raises(DataError, match=message):
        set_up(load_site("daejeon"), imu, load_model("baseline"))
    nothing = Recording(0, np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3)))
    with pytest.raises(DataError, match=message):
        solve(PreparedTest(nothing, imu), load_model("hand"), "handheld")


@pytest.mark.parametrize("latitude", ["36.4 deg", "0.6353 rad", '"36.4"', "2184 arcmin"])
def test_a_latitude_may_have_its_unit_behind_it(tmp_path, latitude):
    site = load_site(written(tmp_path, SITE.replace("36.4", latitude)))
    assert np.degrees(site.latitude_rad) == pytest.approx(36.4, abs=1e-3)


def test_a_bare_name_is_a_file_of_the_working_directory_where_config_has_none(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("mine.map", "kim18"):
        (tmp_path / name).write_text("format: sdimu-plan/1\n")
    assert find_config("plan", "mine.map").resolve() == tmp_path / "mine.map"
    assert find_config("plan", "kim18").name == "kim18.yaml"  # what the documentation names is not hidden by a file
