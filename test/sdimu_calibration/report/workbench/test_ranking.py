"""Bars of the workbench: what looks the same shares one."""

from __future__ import annotations

from sdimu_calibration.report.data import Scored
from sdimu_calibration.report.may_be import MayBe
from sdimu_calibration.report.workbench import figures


def test_look_alikes_share_a_bar_that_tells_how_probable_its_effect_is():
    """The score alone puts the less probable first, and the first is what a key adds.

    Behind the bar stands the probability of the class, as the verdict has it, and never under the line of the noise.
    """
    scores = {"gyro_scale_quadratic_y": 46.1, "gyro_scale_asymmetry_y": 46.0, "accel_cubic_x": 5.0}
    entries = [Scored(name, "", "ppm", z, z, 1.0, 0.1, 1.0, 1.0, chosen=False) for name, z in scores.items()]
    shares = {"gyro_scale_asymmetry_y": "85 %", "gyro_scale_quadratic_y": "15 %"}
    classes = {"gyro_scale_asymmetry_y": MayBe("97 %", shares), "accel_cubic_x": MayBe("> 99 %")}
    assert figures.ranking(entries, 4.1).data[0]["y"][0] == "gyro_scale_quadratic_y"
    bars, words = figures.ranking(entries, 5.5, classes).data[:2]
    assert bars["y"] == words["y"] == ["gyro_scale_asymmetry_y", "accel_cubic_x"]
    assert "text" not in bars
    assert [text.strip() for text in words["text"]] == ["97 %", "&gt; 99 %"]
    assert words["x"] == [46.0, 5.5]
    assert words["textposition"] == "middle right"
    assert bars["customdata"][0].endswith("or gyro_scale_quadratic_y 15 %")


def test_a_bar_of_look_alikes_has_its_probability_whatever_time_constant_scores_most():
    label = "gyro_bias_warm_up_x(tau=2400 s)"
    entries = [Scored(label, "", "deg/h", 9.0, 9.0, 1.0, 0.1, 1.0, 1.0, chosen=False)]
    shares = {"gyro_bias_warm_up_x": "85 %", "gyro_bias_ramp_x": "15 %"}
    classes = {"gyro_bias_warm_up_x": MayBe("90 %", shares)}
    figure = figures.ranking(entries, 4.1, classes)
    assert figure.data[0]["y"] == [label]
    assert [text.strip() for text in figure.data[1]["text"]] == ["90 %"]
    assert "gyro_bias_ramp_x 15 %" in figure.data[0]["customdata"][0]


def test_what_was_found_has_a_bar_though_many_score_more():
    entries = [Scored(f"one_{k}", "", "ppm", 30.0 - k, 1.0, 1.0, 0.1, 1.0, 1.0, chosen=False) for k in range(29)]
    figure = figures.ranking(entries, 4.1, {"one_28": MayBe("96 %")})
    assert figure.data[0]["y"] == [*(f"one_{k}" for k in range(13)), "one_28"]


def test_the_words_behind_a_bar_grow_with_the_screen():
    """On a screen of 4K they had eleven pixels, beside names of eighteen."""
    label = "gyro_scale_asymmetry_y"
    entries = [Scored(label, "", "ppm", 9.0, 9.0, 1.0, 0.1, 1.0, 1.0, chosen=False)]
    figure = figures.ranking(entries, 4.1, {label: MayBe("97 %")})
    small, large = (figures.finished(figure, {"scale": scale}).data[1].textfont.size for scale in (1.0, 1.6))
    assert large == 1.6 * small
