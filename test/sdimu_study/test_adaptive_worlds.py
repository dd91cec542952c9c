"""Wide adaptive tests: latitudes, sample rates and noise are drawn; limits are those of kim18 in the noise drawn."""

from __future__ import annotations

from dataclasses import replace

from sdimu_calibration.core.adaptive import Goals
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
from sdimu_sim.core.coloured import parse_noise
from sdimu_study.adaptive import WIDE_NOISE, WideCase, limits_of_kim18, page, scenario_of, wide_world
from sdimu_study.noise import RATES_HZ, WHITE, drawn_noise
from sdimu_study.worlds import LATITUDES_DEG, rng_of

IMU = load_imu("mems_industrial")


def test_wide_tests_draw_every_latitude_rate_and_noise_and_simulate_what_they_tell(monkeypatch):
    # Limits do not enter the draws; to predict them takes most of the time.
    monkeypatch.setattr("sdimu_study.adaptive.limits_of_kim18", lambda *_: Goals("none", {}, 1.0))
    worlds = [wide_world(WideCase("mems_industrial", hides=False), seed) for seed in range(1, 41)]
    kinds = {parse_noise(noise).kind for one in worlds for noise in one.scenario.noise}
    assert kinds == set(WIDE_NOISE) - {WHITE}
    assert any(not one.scenario.noise for one in worlds)
    assert {one.scenario.rate_hz for one in worlds} == set(RATES_HZ)
    assert {round(one.told["latitude_deg"], 1) for one in worlds} == set(LATITUDES_DEG)
    for one in worlds:
        assert one.told["rate_hz"] == one.scenario.rate_hz
        assert tuple(one.told["noise"]) == one.scenario.noise == one.sensor.noise


def test_limits_are_wider_where_a_bias_walks():
    still = scenario_of(IMU, load_site("daejeon"), 1, ())
    walks = replace(still, noise=drawn_noise(IMU, "random_walk", rng_of(1, "walks")))
    white, noisy = (limits_of_kim18(one, load_model("baseline")).limits for one in (still, walks))
    assert white.keys() == noisy.keys()
    for effect in ("gyro_bias", "accel_bias"):
        assert noisy[effect] > 1.2 * white[effect]


def test_the_page_tells_each_imu_file_apart_and_counts_what_was_refused():
    row = {"minutes": 30.0, "worst": 0.9, "z": [1.0], "errors": [0.5], "named": []}
    results = {("wide", "dtg"): [row, {"error": "no turn"}], ("wide", "fog_tactical"): [{**row, "minutes": 20.0}]}
    lines = page(results, {"kim18": {"kim18": 45.7}}, 7).splitlines()
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line.startswith("|")]
    assert len({len(line) for line in cells}) == 1
    by_goal = {line[1]: line for line in cells}
    assert by_goal["kim18 of dtg"][3:5] == ["30.0 (30.0-30.0)", "1"]
    assert by_goal["kim18 of dtg"][-1] == "1"
    assert by_goal["kim18 of fog_tactical"][-1] == "0"
