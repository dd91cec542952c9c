"""Lines of a data sheet: their intervals hold the truth, limits are judged by the whole interval."""

from __future__ import annotations

import math

import numpy as np
import pytest

import sdimu_calibration.core.effects  # noqa: F401  (fills the registry)
from sdimu_calibration.core.fleet.datasheet import NoiseOfUnit, Sample, datasheet, known_terms
from sdimu_calibration.core.fleet.sheet import FAIL, NOT_MEASURED, PASS, UNDECIDED, Line
from sdimu_calibration.core.noise import Terms
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.results import Calibration, SetSummary, TurnOn, no_history
from sdimu_calibration.core.units import to_si

NAMES = tuple(f"gyro_{kind}_{axis}" for kind in ("bias", "scale") for axis in "xyz")
DEG_H, PPM = to_si(1.0, "deg/h"), to_si(1.0, "ppm")
SIZES = np.array([DEG_H] * 3 + [100 * PPM] * 3)


def result(values: np.ndarray, sigmas: np.ndarray, power_on: str = "", **more: object) -> Calibration:
    origin = Origin("A", power_on, temperature_low_degc=20.0, temperature_high_degc=30.0, rate_rad_s=0.1, site="lab")
    return Calibration(
        "accelerometer_triad",
        ("gyro_bias", "gyro_scale"),
        NAMES,
        ("rad/s",) * 3 + ("1",) * 3,
        ("deg/h",) * 3 + ("ppm",) * 3,
        values,
        np.diag(sigmas**2),
        {},
        {},
        (),
        no_history(6),
        origin=origin,
        **more,
    )


def sheet_of(results: list[Calibration], **more: object) -> dict[str, Line]:
    return {line.term: line for line in datasheet([Sample("A", one) for one in results], **more)}


def power_ons(rng: np.random.Generator, number: int, turn_on: float = 0.3) -> tuple[np.ndarray, list[Calibration]]:
    """Truth of a unit, and its results over power-ons."""
    truth, sigmas = SIZES * rng.standard_normal(6), 0.1 * SIZES
    jump = turn_on * SIZES * (np.arange(6) < 3)
    return truth, [
        result(truth + jump * rng.standard_normal(6) + sigmas * rng.standard_normal(6), sigmas, str(k))
        for k in range(number)
    ]


@pytest.mark.parametrize("number", [1, 3, 8])
def test_the_largest_size_is_in_its_interval_as_often_as_stated(number):
    seeds, hits = 150, np.zeros(2)
    for seed in range(seeds):
        truth, results = power_ons(np.random.default_rng(seed), number, 0.0 if number == 1 else 0.3)
        lines = sheet_of(results)
        for k, term in enumerate(("gyro bias", "gyro scale-factor error")):
            largest = np.abs(truth[3 * k : 3 * k + 3]).max()
            hits[k] += lines[term].low <= largest <= lines[term].high
    assert (hits / seeds >= 0.95 - 3.0 * math.sqrt(0.95 * 0.05 / seeds)).all()


@pytest.mark.parametrize("number", [2, 8])
def test_repeatability_is_in_its_interval_as_often_as_stated(number):
    seeds, hits = 150, 0
    for seed in range(seeds):
        line = sheet_of(power_ons(np.random.default_rng(seed), number)[1])["gyro bias repeatability"]
        hits += line.low <= 0.3 * DEG_H <= line.high
    assert abs(hits / seeds - 0.95) < 3.0 * math.sqrt(0.95 * 0.05 / seeds)


def test_recordings_of_one_power_on_are_no_repeats():
    rng = np.random.default_rng(1)
    results = [result(SIZES + 0.1 * SIZES * rng.standard_normal(6), 0.1 * SIZES, "1") for _ in range(3)]
    line = sheet_of(results)["gyro bias repeatability"]
    assert math.isnan(line.value)
    assert "--power-on" in line.missing


def test_a_joint_fit_says_the_repeatability_itself():
    turn_on = TurnOn("gyro_bias", 0.2 * DEG_H, 0.1 * DEG_H, 0.4 * DEG_H, 9, "rad/s", "deg/h")
    joint = result(SIZES, 0.1 * SIZES, of_set=SetSummary((), (turn_on,), (), np.zeros(6), ()))
    line = sheet_of([joint])["gyro bias repeatability"]
    assert (line.value, line.low, line.high, line.recordings) == (0.2 * DEG_H, 0.1 * DEG_H, 0.4 * DEG_H, 9)


def test_the_composite_is_the_root_sum_square_of_what_was_measured():
    lines = sheet_of(power_ons(np.random.default_rng(2), 4)[1])
    parts = [lines["gyro bias"].value, lines["gyro bias repeatability"].value]
    assert lines["gyro bias, composite"].value == pytest.approx(np.hypot(*parts))


def test_every_line_says_where_it_was_measured_and_what_would_measure_the_others():
    lines = sheet_of([result(SIZES, 0.1 * SIZES)])
    assert set(lines) == set(known_terms())
    assert lines["gyro bias"].condition == "lab; 20 to 30 deg C; rates to 5.73 deg/s"
    assert all(math.isfinite(line.value) or line.missing for line in lines.values())
    asymmetry = lines["gyro scale-factor asymmetry"].missing
    assert "--add gyro_scale_asymmetry" in asymmetry
    assert "turns in both senses" in asymmetry


def test_noise_comes_from_rests_first_then_from_what_was_learned_then_from_a_file():
    term = "gyro bias in-run stability"
    learned = result(SIZES, 0.1 * SIZES, noise=(NoiseTerm("gyro", "flicker", 0.0, 2e-8, 1e-8, 3e-8),))
    stated = NoiseOfUnit("dtg.yaml", stated={("gyro", "instability"): 5e-8})
    rests = NoiseOfUnit(
        "still",
        {
            f"gyro_{axis}": Terms(np.array([0.0, 1e-7, size, 0.0]), np.array([1e-9, 1e-9, 1e-9, 1e-10]))
            for axis, size in zip("xyz", (6e-8, 7e-8, 0.0), strict=True)
        },
    )
    assert sheet_of([learned], noise=[stated, rests])[term].value == 7e-8
    assert sheet_of([learned], noise=[stated])[term].value == 2e-8
    alone = sheet_of([result(SIZES, 0.1 * SIZES)], noise=[stated])[term]
    assert alone.value == 5e-8
    # No interval, no pass.
    assert alone.against(1.0).verdict == UNDECIDED
    # What the rests do not show is bounded from above.
    walk = sheet_of([learned], noise=[rests])["gyro rate random walk"]
    assert (walk.value, walk.low) == (0.0, 0.0)
    assert 1e-10 < walk.high < 4e-10


@pytest.mark.parametrize(
    ("low", "high", "limit", "verdict"),
    [(1.0, 2.0, 3.0, PASS), (1.0, 2.0, 1.5, UNDECIDED), (1.0, 2.0, 0.5, FAIL), (1.0, 2.0, 2.0, PASS)],
)
def test_a_limit_is_kept_only_by_the_whole_interval(low, high, limit, verdict):
    assert Line("gyro bias", "rad/s", "deg/h", 1.5, low, high).against(limit).verdict == verdict


def test_what_was_not_measured_does_not_pass():
    assert Line("gyro bias", "rad/s", "deg/h").against(1.0).verdict == NOT_MEASURED


def test_one_coefficient_is_not_told_as_the_largest_of_one():
    sigmas = 0.1 * SIZES
    sigmas[4:] = 0.0  # known
    lines = sheet_of([result(SIZES, sigmas)])
    assert lines["gyro scale-factor error"].method == "the one coefficient"
    assert lines["gyro bias"].method == "largest of 3 coefficients"
