"""A recording of any units, signs, clocks and names opens as the one it was; what is assumed or wrong is told."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Site
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.bags.topic_choice import TopicChoice, Topics
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_calibration.storage.opening import Source, open_recording, open_test
from sdimu_sim.core.scenario import Scenario, generate

G = 9.80665
START_NS = 1_700_000_000_000_000_000
DTG, KIM18 = load_imu("dtg"), load_plan("kim18")
HURRIED = Plan(
    "kim18 in a hurry",
    (20.0,) * len(KIM18.dwell_s),
    tuple(replace(turn, rate_rad_s=np.radians(9.0)) for turn in KIM18.turns),
    np.radians(9.0),
)


@cache
def simulated():
    return recorded_at(36.4)


def recorded_at(latitude_deg):
    return generate(Scenario(HURRIED, DTG, Site(np.radians(latitude_deg)), rate_hz=20.0, seed=71))[0]


def write(path, w=1.0, f=1.0, late_s=0.0, warm_at_s=0.0, topics=None, r=None):
    r = r or simulated()

    def ns(t):
        return np.rint(t * 1e9).astype(np.int64)

    second = np.arange(0.0, r.t[-1])
    row = np.searchsorted(r.phase.t, second, side="right") - 1
    write_recording(
        path,
        BagContent(
            start_ns=START_NS,
            imu_ns=ns(r.t),
            omega_ib_b=r.omega_ib_b * w,
            f_ib_b=r.f_ib_b * f,
            status=(ns(second + late_s), r.phase.dwell[row], r.phase.stop[row]),
            temperature=(ns(second + warm_at_s), 20.0 + 0.0 * second),
        ),
        topics=topics,
    )
    return path


def test_si_on_one_clock_opens_without_a_word(tmp_path):
    r = open_recording(write(tmp_path / "b"))
    assert r.notes == ()
    assert np.array_equal(r.f_ib_b, simulated().f_ib_b)


def test_other_units_senses_names_and_clocks_open_the_same(tmp_path):
    topics = Topics("/x/imu", "/x/table", "/x/axes", "/x/warm")
    path = write(tmp_path / "b", w=-180.0 / np.pi, f=1.0 / G, late_s=12.0, topics=topics)
    r = open_recording(path)
    # Two multiplications by rounded factors.
    assert np.allclose(r.omega_ib_b, simulated().omega_ib_b, rtol=1e-15, atol=0)
    assert np.allclose(r.f_ib_b, simulated().f_ib_b, rtol=1e-15, atol=0)
    told = "\n".join(r.notes)
    for words in ("/x/imu", "/x/table", "in g", "in deg/s", "opposite sign", "against the motion"):
        assert words in told


def test_stated_units_are_taken_and_wrong_ones_refused(tmp_path):
    path = write(tmp_path / "b", f=1000.0 / G)
    with pytest.raises(DataError, match="--accel-unit mg"):
        open_recording(path)
    r = open_recording(path, Source(accel_unit="mg"))
    assert np.allclose(r.f_ib_b, simulated().f_ib_b, rtol=1e-14, atol=0)
    with pytest.raises(DataError, match="expected a unit such as m/s"):
        open_recording(path, Source(accel_unit="deg"))
    with pytest.raises(DataError, match=r"unknown unit .* such as rad/s, deg/s or deg/h\)"):
        open_recording(path, Source(gyro_unit="turns"))
    with pytest.raises(DataError, match="expected 1 or -1"):
        open_recording(path, Source(accel_sign=2))


def test_a_dead_axis_is_named(tmp_path):
    with pytest.raises(DataError, match=r"angular_velocity\.y is 0 in all .* samples: the axis is dead"):
        open_recording(write(tmp_path / "b", w=np.array([1.0, 0.0, 1.0])))


def test_the_topic_that_was_asked_for_is_read(tmp_path):
    path = write(tmp_path / "b", topics=Topics(imu="/x/imu"))
    assert len(open_recording(path, Source(TopicChoice(imu="/x/imu"))).t) == len(simulated().t)
    with pytest.raises(DataError, match="/imu/other"):
        open_recording(path, Source(TopicChoice(imu="/imu/other")))


def test_a_temperature_of_another_day_is_not_used_and_told(tmp_path):
    r = open_recording(write(tmp_path / "b", warm_at_s=86400.0))
    assert r.temperature is None
    assert "not used" in r.notes[0]


def test_a_place_that_nobody_stated_is_named_with_what_the_data_say(tmp_path):
    path = write(tmp_path / "b")
    opened = open_test(path, None, DTG)
    assert opened.site == load_site("daejeon")
    (note,) = opened.recording.notes
    assert "no --site: daejeon is assumed" in note
    assert re.search(r"that of latitude \S+ \+- \S+ deg", note)
    assert open_test(path, "daejeon", DTG).recording.notes == ()


def test_an_assumed_place_that_the_data_exclude_is_refused_and_yours_is_asked_for(tmp_path):
    path = write(tmp_path / "b", r=recorded_at(54.0))
    with pytest.raises(DataError) as refused:
        open_test(path, None, DTG)
    told = str(refused.value)
    latitude, sigma = map(float, re.search(r"latitude (\S+) \+- (\S+) deg", told).groups())
    assert abs(latitude - 54.0) < 4.0 * sigma
    for words in (str(path), "daejeon", "36.4 deg", "--site", "latitude_deg"):
        assert words in told
    (tmp_path / "here.yaml").write_text("format: sdimu-site/1\nlatitude_deg: 54\nheight_m: 0\n")
    assert open_test(path, str(tmp_path / "here.yaml"), DTG).recording.notes == ()


def test_a_place_that_contradicts_the_data_is_told(tmp_path):
    (tmp_path / "quito.yaml").write_text("format: sdimu-site/1\nlatitude_deg: -0.2\nheight_m: 2850\n")
    r = open_test(write(tmp_path / "b"), str(tmp_path / "quito.yaml"), DTG).recording
    (note,) = [note for note in r.notes if "Earth's rate" in note]
    latitude, sigma = map(float, re.search(r"latitude (\S+) \+- (\S+) deg", note).groups())
    assert abs(latitude - 36.4) < 4.0 * sigma
    assert "--site" in note
    assert any("|f| at rest" in note for note in r.notes)


def test_a_wrong_hemisphere_or_the_negative_of_the_force_is_asked_for_unless_stated(tmp_path):
    path = write(tmp_path / "b", f=-1.0)
    with pytest.raises(DataError, match=r"latitude \+36\.4 deg: either the site is in the other hemisphere.*-1\)"):
        open_test(path, "daejeon", DTG)
    turned = open_test(path, "daejeon", DTG, Source(accel_sign=-1)).recording
    assert np.array_equal(turned.f_ib_b, simulated().f_ib_b)
    assert turned.notes == ()
    left = open_test(path, "daejeon", DTG, Source(accel_sign=1)).recording
    assert np.array_equal(left.f_ib_b, -simulated().f_ib_b)
    assert any("--site" in note for note in left.notes)
    # Without a stated place the sign is not guessed from an assumed one: both are asked for.
    said = r"no site was stated.*only if it lies at latitude -?\d+ .* the sign of the force turned: .*--accel"
    with pytest.raises(DataError, match=said):
        open_test(path, None, DTG)
    assert np.array_equal(open_recording(path, Source(accel_sign=-1)).f_ib_b, simulated().f_ib_b)


def test_noise_is_measured_only_where_the_user_asks(tmp_path):
    path = write(tmp_path / "b")
    assert open_test(path, "daejeon", DTG).imu == DTG
    test = open_test(path, "daejeon", DTG, measured_noise=True)
    # A fifth of the hour's rests: the density of the simulation to some percents.
    assert 0.9 < test.imu.gyro_white_noise / DTG.gyro_white_noise < 1.1
    assert "as specified" in test.recording.notes[-1]


def test_by_hand_no_place_is_needed_and_a_stated_one_is_kept(tmp_path):
    path = write(tmp_path / "b")
    assert open_test(path, None, DTG, handheld=True).site is None
    assert open_test(path, "daejeon", DTG, handheld=True).site == load_site("daejeon")
    # Gyros as noisy as these do not see the Earth's rate in rests of 20 s: then the IMU is taken to be moved by hand.
    noisy = replace(DTG, gyro_white_noise=np.radians(0.1))
    assert open_test(path, None, noisy).site is None
    assert open_test(path, None, noisy, handheld=False).site == load_site("daejeon")


@pytest.mark.parametrize(
    ("text", "times"), [("2 deg/s", 2.0), ("0.25*deg/s", 0.25), ("deg/s", 1.0), ("1e-3 deg/s", 1e-3)]
)
def test_a_unit_may_be_a_multiple(text, times):
    assert Source(gyro_unit=text).stated.gyro == pytest.approx(times * np.pi / 180.0)


@pytest.mark.parametrize("text", ["2", "2 furlong", "2 m", "-2 deg/s"])
def test_a_multiple_without_a_unit_of_the_kind_is_refused(text):
    with pytest.raises(DataError, match="--gyro-unit"):
        _ = Source(gyro_unit=text).stated
