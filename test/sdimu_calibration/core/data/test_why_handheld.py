"""A run by hand is recognised by its turns, and the IMU of a recording by its rests."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sdimu_calibration.core.data.attitudes import one_attitude, turned_unseen
from sdimu_calibration.core.data.imu_class import propose, shown_at_rest
from sdimu_calibration.core.data.why_handheld import looks_handheld, why_handheld
from sdimu_calibration.core.front_door import OpeningOptions, open_test
from sdimu_calibration.core.handheld.handheld import prepare_run
from sdimu_calibration.core.recording import DataError, PhaseLog, Recording
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_calibration.storage.opening import CLASSES, Source, opening_options
from sdimu_sim.core.by_hand import ByHand, by_hand_recording
from sdimu_sim.core.scenario import Scenario, generate

SITE = load_site("daejeon")
FILES = tuple(map(load_imu, CLASSES))
KIM18 = replace(load_plan("kim18"), dwell_s=(12.0,) * 19)
# Turns so brisk that the table speeds up half of the way and slows down the other half.
BRISK = replace(
    KIM18,
    turns=tuple(replace(turn, rate_rad_s=np.radians(28.0)) for turn in KIM18.turns),
    acceleration_rad_s2=np.radians(40.0),
)


@cache
def by_hand(imu="mems_consumer", seed=3):
    return by_hand_recording(ByHand(20, load_imu(imu), SITE, seed=seed))[0]


@cache
def on_table(imu="dtg", brisk=True):
    plan = BRISK if brisk else KIM18
    return replace(generate(Scenario(plan, load_imu(imu), SITE, rate_hz=50.0, seed=9))[0], phase=None)


@pytest.mark.parametrize("imu", ["dtg", "fog_tactical", "mems_industrial", "mems_consumer"])
def test_a_hand_and_a_table_are_told_apart_whatever_the_imu(imu):
    assert looks_handheld(by_hand(imu))
    assert not looks_handheld(on_table(imu))
    assert not looks_handheld(on_table(imu, brisk=False))


def test_a_status_that_names_a_dwell_is_of_a_table():
    recording = by_hand()
    said = PhaseLog(np.array([0.0, 3.0]), np.array([True, False]), np.array([0, 0]))
    assert not looks_handheld(replace(recording, phase=said))


def test_an_imu_that_never_turns_was_not_moved_by_hand():
    recording = by_hand()
    still = replace(recording, omega_ib_b=1e-4 * np.sin(np.arange(3 * len(recording.t)).reshape(-1, 3)))
    assert not looks_handheld(still)


def test_a_good_imu_in_a_hand_is_not_navigated():
    assert "axis of its turns" in why_handheld(by_hand("dtg"), load_imu("dtg"))
    assert why_handheld(on_table("dtg"), load_imu("dtg")) == ""


@pytest.mark.parametrize(
    ("imu", "proposed"),
    [
        ("dtg", "dtg"),
        ("rlg_navigation", "dtg"),
        ("fog_tactical", "fog_tactical"),
        ("mems_industrial", "mems_by_hand"),
        ("mems_consumer", "mems_by_hand"),
    ],
)
def test_the_grade_of_the_gyros_is_that_of_their_noise(imu, proposed):
    for recording in (by_hand(imu), on_table(imu)):
        found, note = propose(recording, FILES)
        assert found.name == proposed
        assert note.startswith(f"no --imu: {proposed} is assumed")


def test_a_bias_beyond_a_file_gives_the_next_coarser_one_with_the_noise_of_the_rests():
    recording = on_table("dtg")
    biased = replace(recording, omega_ib_b=recording.omega_ib_b + np.radians([0.3, 0.0, 0.0]))
    found, _ = propose(biased, FILES)
    assert found.name == "mems_by_hand"
    assert found.gyro_white_noise == shown_at_rest(biased).gyro_noise
    # 0.1 deg/h in the mean of a second, from a minute or so of rest.
    assert found.gyro_white_noise == pytest.approx(load_imu("dtg").gyro_white_noise, rel=0.3)


def test_a_run_by_hand_opens_without_any_option():
    recording, imu, site = open_test(by_hand(), opening_options(None, None, Source()))
    assert site is None
    assert imu.name == "mems_by_hand"
    assert any("no --imu" in note for note in recording.notes)


def test_an_imu_that_was_stated_is_taken_as_it_is():
    stated = load_imu("fog_tactical")
    recording, imu, _ = open_test(on_table("dtg"), OpeningOptions(stated, SITE))
    assert imu is stated
    assert not any("--imu" in note and "assumed" in note for note in recording.notes)


def pieces(angles_deg, pause_s=60.0):
    """Rests of 10 s at tilts about x, with pauses between them."""
    t, f = [], []
    for k, angle in enumerate(np.radians(angles_deg)):
        t.append(k * pause_s + np.arange(1, 501) * 0.02)
        f.append(np.tile(9.8 * np.array([0.0, np.sin(angle), np.cos(angle)]), (500, 1)))
    force = np.concatenate(f) + 0.01 * np.random.default_rng(2).standard_normal((500 * len(angles_deg), 3))
    return Recording(0, np.concatenate(t), np.full_like(force, 1e-6), force)


def test_attitudes_without_the_turns_between_them_are_not_navigated():
    assert turned_unseen(pieces([0, 90, 180]))
    assert not turned_unseen(pieces([0, 0.5, 0.2]))
    assert not turned_unseen(pieces([0, 90, 180], pause_s=10.0))
    assert not turned_unseen(by_hand())
    assert not turned_unseen(on_table())
    assert "no turn between" in why_handheld(pieces([0, 90, 180]), load_imu("dtg"))


def test_two_attitudes_without_their_turn_are_refused_with_what_would_help():
    with pytest.raises(DataError, match=r"2 rests in different attitudes, and no turn.*sdimu calibrate A B"):
        prepare_run(pieces([0, 90]), load_imu("mems_by_hand"))
    with pytest.raises(DataError, match="1 rest; a handheld calibration needs 6 and more"):
        prepare_run(pieces([0]), load_imu("mems_by_hand"))


def test_one_attitude_is_told_from_a_turn_about_the_vertical():
    assert one_attitude(pieces([0, 0.5, 0.2, 0.4], pause_s=10.0))
    assert not one_attitude(pieces([0, 90, 0, 90], pause_s=10.0))
    turned = pieces([0, 0, 0, 0], pause_s=10.0)
    assert one_attitude(turned)
    w = np.where(np.abs(turned.t - 20.0)[:, None] < 2.0, [0.0, 0.0, np.radians(20.0)], 0.0)
    assert not one_attitude(replace(turned, omega_ib_b=w))


def test_priors_of_a_proposal_allow_the_biases_of_the_rests():
    recording = by_hand("mems_consumer")
    biased = replace(recording, f_ib_b=recording.f_ib_b + np.array([0.9, 0.0, 0.0]))
    found, note = propose(biased, FILES)
    assert found.prior["accel_bias"] > 0.9
    assert found.prior["accel_scale"] == FILES[-1].prior["accel_scale"]
    assert "priors for such biases" in note


def test_a_proposal_in_more_noise_than_the_default_has_that_of_the_rests():
    as_filed, _ = propose(on_table("dtg"), FILES)
    assert as_filed == FILES[0]
    noisier, note = propose(on_table("rlg_navigation"), FILES)
    assert noisier.name == "dtg"
    assert noisier.gyro_white_noise == pytest.approx(load_imu("rlg_navigation").gyro_white_noise, rel=0.1)
    assert "with this noise" in note


def test_the_noise_of_the_rests_is_not_the_least_of_several_by_chance():
    imu, ratios = load_imu("mems_consumer"), []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        white = rng.standard_normal((2, 4000, 3)) * np.sqrt(20.0)
        rate = imu.gyro_white_noise * white[0]
        force = [0.0, 0.0, 9.8] + imu.accel_white_noise * white[1]
        shown = shown_at_rest(Recording(0, 0.05 * np.arange(1, 4001), rate, force))
        ratios.append([shown.gyro_noise / imu.gyro_white_noise, shown.accel_noise / imu.accel_white_noise])
    # 400 differences of three axes give the noise to 2.5 %, sixty of them its mean to 0.3 %.
    assert abs(np.mean(ratios) - 1.0) < 0.015
