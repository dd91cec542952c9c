"""Scoring by name, the figures made of scores, and one whole run in which an effect must be found."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_study.cli.hidden_campaign import check_options
from sdimu_study.hidden import Hidden, run, scenario_of, score
from sdimu_study.hidden_draw import Draw
from sdimu_study.hidden_page import confusion, outside_passed, page, share, summarise
from sdimu_study.score import same_effect
from sdimu_study.worlds import Truth

STOPS = ((0, 0.0, 100.0), (1, 145.0, 245.0), (2, 290.0, 390.0))


def _truth(name: str, option: tuple[str, float] | None = None) -> Truth:
    return Truth(name, name.rpartition("_")[0], option, 1.0, 10.0, "")


@pytest.mark.parametrize(
    ("label", "truth", "same"),
    [
        ("accel_quadratic_x", _truth("accel_quadratic_x"), True),
        ("accel_quadratic_y", _truth("accel_quadratic_x"), False),
        ("accel_scale_asymmetry_x", _truth("accel_quadratic_x"), False),
        ("gyro_bias_warm_up_x(tau=600 s)", _truth("gyro_bias_warm_up_x", ("tau", 400.0)), True),
        ("gyro_bias_warm_up_x(tau=600 s)", _truth("gyro_bias_warm_up_x", ("tau", 250.0)), False),
        ("gyro_bias_warm_up_x(tau=300 s)", _truth("gyro_bias_warm_up_x", ("tau", 650.0)), False),
        # Inside the dwell from 145 to 245 s: anywhere in it, nowhere else.
        ("accel_bias_step_z(t0=222.5 s)", _truth("accel_bias_step_z", ("t0", 200.0)), True),
        ("accel_bias_step_z(t0=145 s)", _truth("accel_bias_step_z", ("t0", 200.0)), True),
        ("accel_bias_step_z(t0=245 s)", _truth("accel_bias_step_z", ("t0", 200.0)), True),
        ("accel_bias_step_z(t0=290 s)", _truth("accel_bias_step_z", ("t0", 200.0)), False),
        ("gyro_lost_data(turn=2, at=122 s)", _truth("gyro_lost_data", ("turn", 2.0)), True),
        ("gyro_lost_data(turn=3, at=260 s)", _truth("gyro_lost_data", ("turn", 2.0)), False),
    ],
)
def test_a_label_names_an_effect_when_parameter_and_option_agree(label: str, truth: Truth, same: bool) -> None:
    assert same_effect(label, truth, STOPS) is same


def _row(kind: str, **more: Any) -> dict[str, Any]:
    base: dict[str, Any] = {
        "seed": 1,
        "kind": kind,
        "plan": "kim18",
        "verdict": "one effect",
        "named": ["accel_quadratic_x"],
        "own": False,
        "steps": [],
        "rms_z_before": 4.0,
        "rms_z_after": 1.0,
        "held_out_before": 1.3,
        "held_out_after": 1.0,
        "stops_before": 1.2,
        "stops_after": 1.0,
        "scan_z2": 400.0,
        "scan_count": 400,
        "truths": [
            {
                "name": "accel_quadratic_x",
                "family": "accel_quadratic",
                "option": None,
                "in_class": True,
                "best": True,
                "realised": 12.0,
                "error_sigmas": 0.5,
                "share": 0.99,
                "text": "accel_quadratic_x=1",
            }
        ],
    }
    return base | more


def _figure(summary: dict[str, Any], start: str) -> dict[str, Any]:
    return next(f for f in summary["figures"] if f["name"].startswith(start))


def test_figures_count_what_happened() -> None:
    missed = _row("strong", named=[], verdict="consistent")
    missed["truths"] = [dict(missed["truths"][0], in_class=False, best=False)]
    small = _row("strong")
    small["truths"] = [dict(small["truths"][0], realised=3.0, in_class=False)]
    found_nothing = _row("clean", verdict="consistent", named=[], truths=[])
    summary = summarise([*[_row("strong") for _ in range(3)], missed, small, found_nothing, _row("clean", truths=[])])
    strong = _figure(summary, "one effect of 8 to 30 sigma")
    # What turned out smaller than 8 sigma in its own test does not count as strong.
    assert (strong["count"], strong["of"], strong["reached"]) == (3, 4, False)
    assert _figure(summary, "nothing hidden: something found")["count"] == 1
    assert _figure(summary, "nothing hidden: RMS z")["value"] == pytest.approx(1.0)
    before = _figure(summary, "right effect added: RMS z of the baseline coefficients before")
    assert before["value"] == pytest.approx(4.0)
    assert len(summary["misses"]) == 2
    assert "accel_quadratic" in page(summary)


def test_the_confusion_table_counts_every_single_effect_once() -> None:
    wrong = _row("weak", named=["accel_scale_asymmetry_x"])
    wrong["truths"] = [dict(wrong["truths"][0], best=False)]
    nothing = _row("weak", named=[], verdict="consistent")
    (entry,) = confusion([_row("strong"), wrong, nothing, _row("clean", truths=[])])
    assert entry["draws"] == 3
    assert entry["named_first"] == {"accel_quadratic": 1, "accel_scale_asymmetry": 1, "nothing": 1}


@pytest.mark.parametrize(
    ("verdict", "own", "taken", "passed"),
    [
        ("unexplained", False, 0.2, True),
        ("own equation", True, 0.95, True),
        ("own equation", True, 0.6, False),
        ("several effects", False, 0.95, True),
        ("several effects", False, 0.6, False),
        ("consistent", False, 0.0, False),
    ],
)
def test_outside_the_catalogue_only_unexplained_or_what_takes_the_signature_passes(
    verdict: str, own: bool, taken: float, passed: bool
) -> None:
    assert outside_passed(_row("outside", verdict=verdict, own=own, truths=[{"share": taken}])) is passed


def test_intervals_of_shares_hold_the_share_and_end_at_certainty() -> None:
    all_hit, none_hit = share("", [True] * 20, 0.9), share("", [False] * 20, 0.9)
    some = share("", [True, False] * 50, 0.9)
    assert all_hit["high"] == 1.0
    assert none_hit["low"] == 0.0
    # Clopper and Pearson for no hit in n: 1 - 0.025^(1/n).
    assert none_hit["high"] == pytest.approx(1.0 - 0.025 ** (1.0 / 20.0))
    assert some["low"] < 0.5 < some["high"]


def test_an_unknown_kind_is_refused_with_the_known_ones() -> None:
    with pytest.raises(DataError, match="--kind loud: expected one of weak"):
        check_options(["loud"], ["weak", "strong"], 3, 1)


def test_a_hidden_quadratic_term_is_found_by_name_and_the_baseline_is_mended() -> None:
    from sdimu_sim.core.scenario import imu_truth
    from sdimu_study.worlds import simulate

    # 40 ug/g^2 are some 40 sigma on this plan: one failure in 1e9 runs if the filter is right.
    truth = Truth("accel_quadratic_x", "accel_quadratic", None, 40e-6 * 9.80665, 40.0, "accel_quadratic_x=40 ug/g^2")
    drawn = Draw("strong", "kim18_signed", 45.0, (truth,))
    scenario = scenario_of(drawn, load_imu("dtg"), 31)
    sensor = imu_truth(scenario)
    recording = simulate(scenario, sensor)
    world = Hidden(drawn, recording, scenario.site, load_imu("dtg"), load_model("baseline"), sensor)
    found = run(world)
    row = score(world, found)
    assert row["truths"][0]["in_class"]
    assert abs(row["truths"][0]["error_sigmas"]) < 5.0
    # 27 coefficients: RMS z of 1 +- 0.14; five sigma.
    assert row["rms_z_after"] < 1.7 < row["rms_z_before"]
    # The truth hidden under another name is not found.
    other = Draw("strong", "kim18_signed", 45.0, (Truth("gyro_delay_x", "gyro_delay", None, 1e-3, 10.0, ""),))
    assert not score(replace(world, drawn=other), found)["truths"][0]["in_class"]
