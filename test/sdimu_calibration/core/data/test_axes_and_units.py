"""Units and senses are recognised from physics alone, for a table and for a hand; what it does not decide is asked for.

Nothing is tuned to a seed: a table with a navigation-grade IMU (seeds 21 to 24) and a hand with one whose errors are
percents and degrees (seeds 31 to 36), every combination of units and signs.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from sdimu_calibration.core.data.axes_and_units import DEGREE, Stated, recognise
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.rotation import rotation_matrix
from sdimu_calibration.core.units import STANDARD_GRAVITY, parse_unit
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_sim.core.by_hand import ByHand, by_hand_recording
from sdimu_sim.core.scenario import Scenario, generate

SITE, KIM18 = load_site("daejeon"), load_plan("kim18")
HURRIED = Plan(
    "kim18 in a hurry",
    (20.0,) * len(KIM18.dwell_s),
    tuple(replace(turn, rate_rad_s=np.radians(9.0)) for turn in KIM18.turns),
    np.radians(9.0),
)
SOURCES = [("table", seed) for seed in range(21, 25)] + [("hand", seed) for seed in range(31, 37)]
VARIANTS = list(product((1.0, STANDARD_GRAVITY), (1, -1), (1.0, DEGREE), (1, -1)))


@cache
def samples(kind: str, seed: int):
    if kind == "table":
        r, _ = generate(Scenario(HURRIED, load_imu("dtg"), SITE, rate_hz=20.0, seed=seed))
    else:
        r, _ = by_hand_recording(ByHand(20, load_imu("mems_by_hand"), SITE, seed=seed, rate_hz=50.0))
    return r.t, r.omega_ib_b, r.f_ib_b


def refusal(t, w, f, stated=None) -> str:
    with pytest.raises(DataError) as error:
        recognise(t, w, f, stated or Stated())
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(("accel", "accel_sign", "gyro", "gyro_sign"), VARIANTS)
def test_every_unit_and_sense_of_the_rate_is_recognised(source, accel, accel_sign, gyro, gyro_sign):
    t, w, f = samples(*source)
    found = recognise(t, w * gyro_sign / gyro, f * accel_sign / accel, Stated())
    assert found.accel == accel  # its sign is the Earth's to tell: see test_earth_seen
    assert found.gyro == gyro_sign * gyro
    assert len(found.notes) == (accel != 1.0) + (gyro != 1.0) + (gyro_sign < 0)


@pytest.mark.parametrize("source", SOURCES[::3])
def test_right_handed_axes_of_any_orientation_need_no_word(source):
    t, w, f = samples(*source)
    for phi in np.random.default_rng(4).uniform(-2.0, 2.0, (5, 3)):
        C = rotation_matrix(phi)
        assert recognise(t, w @ C, f @ C, Stated()).notes == ()


@pytest.mark.parametrize("source", SOURCES[::3])
def test_left_handed_axes_are_read_with_the_other_sense(source):
    t, w, f = samples(*source)
    mirror = np.array([1.0, -1.0, 1.0])
    assert recognise(t, w * mirror, f * mirror, Stated()).gyro == -1.0


@pytest.mark.parametrize("source", SOURCES[::3])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_one_gyro_of_the_wrong_sense_is_refused_and_named(source, axis):
    t, w, f = samples(*source)
    sign = np.ones(3)
    sign[axis] = -1.0
    named = ", ".join(("-" if k == axis else "") + "xyz"[k] for k in range(3))
    assert f"({named})" in refusal(t, w * sign, f)


@pytest.mark.parametrize("source", SOURCES[::3])
def test_exchanged_axes_are_refused_and_named(source):
    t, w, f = samples(*source)
    assert "(y, x, z)" in refusal(t, w[:, [1, 0, 2]], f)


def test_gyros_of_another_imu_are_refused():
    t, _, f = samples("hand", 31)
    other = samples("hand", 32)[1]
    n = min(len(t), len(other))
    assert "angular_velocity" in refusal(t[:n], other[:n], f[:n])


def test_a_unit_that_is_neither_is_asked_for_and_taken_when_stated():
    t, w, f = samples("table", 21)
    assert "--accel-unit" in refusal(t, w, f / STANDARD_GRAVITY * 1000.0)
    assert recognise(t, w, f / STANDARD_GRAVITY * 1000.0, Stated(accel=STANDARD_GRAVITY / 1000.0)).accel > 0.0
    assert "--gyro-unit" in refusal(t, w * 10.0, f)
    found = recognise(t, -w * 10.0, f, Stated(gyro=0.1))
    assert found.gyro == -0.1


def test_what_is_stated_against_physics_is_refused():
    t, w, f = samples("table", 21)
    assert "--accel-unit" in refusal(t, w, f, Stated(accel=STANDARD_GRAVITY))
    assert "angular_velocity" in refusal(t, w, f, Stated(gyro=DEGREE))
    assert "angular_velocity" in refusal(t, w, f, Stated(gyro_sign=-1))


def test_force_without_gravity_is_refused():
    t, w, f = samples("hand", 33)
    assert "no gravity in it" in refusal(t, w, f * 1e-3)


def test_a_recording_without_turns_says_that_the_gyros_are_not_checked():
    t = np.arange(1, 6001) * 0.01
    rng = np.random.default_rng(3)
    w = 1e-3 * rng.standard_normal((6000, 3))
    f = [0.0, 0.0, 9.8] + 1e-2 * rng.standard_normal((6000, 3))
    found = recognise(t, w, f, Stated())
    assert (found.accel, found.gyro) == (1.0, 1.0)
    assert "not checked" in found.notes[0]


@pytest.mark.parametrize("seed", [25, 26])
def test_a_slow_table_and_a_long_plan_are_recognised(seed):
    r, _ = generate(Scenario(KIM18, load_imu("dtg"), SITE, rate_hz=10.0, seed=seed))
    assert recognise(r.t, np.degrees(r.omega_ib_b), r.f_ib_b, Stated()).gyro == DEGREE


@pytest.mark.parametrize(
    ("factor", "unit"), [(1e3 / STANDARD_GRAVITY, "mg"), (1e6 / STANDARD_GRAVITY, "ug"), (1e3, "mm/s^2")]
)
def test_a_unit_is_advised_only_where_it_is_taken(factor, unit):
    t, w, f = samples("table", 21)
    assert f"--accel-unit {unit} makes it gravity" in refusal(t, w, f * factor)
    assert recognise(t, w, f * factor, Stated(accel=parse_unit(unit).factor)).accel == parse_unit(unit).factor


def test_counts_of_no_unit_are_told_with_the_map_that_reads_them():
    t, w, f = samples("table", 21)
    told = refusal(t, w, f * 41.5)
    # Gravity is the standard one to a part in a thousand, |f| to the errors of the IMU.
    assert re.search(r"41\.[3-7]\d* of which are 1 m/s\^2 \(counts_per_unit", told)
    assert "--accel-unit" not in told


def test_rates_beyond_measure_are_named_with_place_and_size():
    t, w, f = samples("table", 21)
    wild = w.copy()
    wild[4000, 1] = -1e30
    assert f"angular_velocity.y is -1e+30 at {t[4000]:.1f} s" in refusal(t, wild, f)
    assert "e+30 at" in refusal(t, 1e31 * w, f)
    assert "do not agree" in refusal(t, w[:, [1, 0, 2]] * 3.0, f)


@pytest.mark.parametrize("source", [SOURCES[0], SOURCES[4], SOURCES[5]])
@pytest.mark.parametrize(("true", "unit"), [(0.5, 1.0), (2.0, 1.0), (4.0, DEGREE), (0.25, DEGREE)])
def test_a_wrong_range_of_the_gyros_is_told_with_the_factor_that_closes_the_turns(source, true, unit):
    t, w, f = samples(*source)
    said = refusal(t, w / (true * unit), f)
    assert f"the turns close with {true:g} times the rates" in said
    name = "rad/s" if unit == 1.0 else "deg/s"
    assert f"gyro-unit '{true:g} {name}'" in said.replace("_", "-")
    # Stated so, the turns agree.
    assert recognise(t, w / (true * unit), f, Stated(gyro=true * unit)).gyro == pytest.approx(true * unit)


def test_a_wrong_range_beside_a_stated_unit_is_told():
    t, w, f = samples("hand", 33)
    assert "close with 2 times the rates" in refusal(t, np.degrees(w) / 2.0, f, Stated(gyro=DEGREE))
