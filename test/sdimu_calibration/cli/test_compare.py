"""`sdimu compare` compares what can be compared, and refuses the rest in one line."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.api.comparison import Comparison
from sdimu_calibration.cli import main as cli
from sdimu_calibration.cli.calibrate import _other_temperature
from sdimu_calibration.core.diagnosis.ladder import moved_coefficients
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.results import START_TEMPERATURE, Calibration, History, Rest, no_history
from sdimu_calibration.core.units import to_si
from sdimu_calibration.report.comparison import comparison, headings
from sdimu_calibration.storage.files.result_file import write_result

_NONE = np.empty(0)
FIRST = Calibration(
    body_frame="prior",
    model=("accel_bias",),
    names=("accel_bias_x", "accel_bias_y"),
    units=("m/s^2",) * 2,
    display_units=("ug",) * 2,
    values=np.array([1e-4, 2e-4]),
    covariance=np.diag([1e-12, 4e-12]),
    fit={"log_likelihood": 100.0, "nis_mean": 1.5, "held_out_rms": 2.0},
    data={"samples": 10, "duration_s": 1.0, "checksum": 5.0, "conditions": 7.0},
    notes=(),
    history=History(
        _NONE,
        np.empty((0, 2)),
        np.empty((0, 2)),
        np.empty((0, 3)),
        _NONE.astype(int),
        _NONE.astype(bool),
        _NONE.astype(bool),
        np.empty((0, 4)),
    ),
)
SECOND = replace(
    FIRST,
    model=("accel_bias", "accel_quadratic_x"),
    values=np.array([1e-4 + 5e-6, 2e-4 + 2e-6]),
    fit={"log_likelihood": 160.0, "nis_mean": 1.0, "held_out_rms": 1.0},
)


@pytest.fixture
def run(monkeypatch, capsys, tmp_path):
    def compare(*results, more=()):
        folders = []
        for k, result in enumerate(results):
            write_result(tmp_path / f"run{k}" / "result.json", result)
            folders.append(str(tmp_path / f"run{k}"))
        monkeypatch.setattr(sys, "argv", ["sdimu", "compare", *folders, *more])
        monkeypatch.setenv("COLUMNS", "200")
        with pytest.raises(SystemExit) as ending:
            cli.main()
        captured = capsys.readouterr()
        return int(ending.value.code or 0), captured.out, captured.err

    return compare


def test_the_ladder_shows_what_was_added_and_how_far_the_error_fell(run):
    status, out, _ = run(FIRST, SECOND)
    assert status == 0
    line = next(text for text in out.splitlines() if "run1" in text)
    for word in ("+ accel_quadratic_x", "+60.0", "1.000", "(5.0 of its sigmas)"):
        assert word in line
    assert "accel_bias_y" not in line  # moved by one sigma only


def test_it_is_said_of_what_the_sigmas_behind_amounts_are(run):
    """A diagnosis states 1.5 ppm where a fit of the same model states 0.9, and both were called by one word."""
    told = "one sigma if the model of the line is right; of a diagnosis, one sigma over all models that the data leave"
    assert told in run(FIRST, SECOND)[1]
    assert told not in run(FIRST, replace(SECOND, values=FIRST.values))[1]


LARGER = replace(
    SECOND,
    names=(*FIRST.names, "accel_quadratic_x"),
    units=(*FIRST.units, "m/s^2/g^2"),
    display_units=(*FIRST.display_units, "ug/g^2"),
    values=np.array([1e-4 + 5e-6, 2e-4, 1e-6]),
    covariance=np.diag([1e-12, 4e-12, 1e-16]),
    history=no_history(3),
)


@pytest.mark.parametrize("turned", [False, True])
def test_the_simplest_model_is_first_in_whatever_order_they_are_named(run, turned):
    """The larger model named first was called the one without an effect, whose biases are wrong."""
    _, out, _ = run(*((LARGER, FIRST) if turned else (FIRST, LARGER)))
    small, large = (next(text for text in out.splitlines() if name in text) for name in (" 1 effect ", "+60.0"))
    assert out.index(small) < out.index(large)
    assert "run1" in (small if turned else large)
    assert "+ accel_quadratic_x" in large
    assert "accel_bias_x -0.5" in large
    assert ("models stand in the order of their numbers of coefficients" in out) == turned
    # In Python, too.
    shown = Comparison([SimpleNamespace(result=one) for one in ((LARGER, FIRST) if turned else (FIRST, LARGER))])
    assert [row[0] for row in shown.rows] == (["model 2", "model 1"] if turned else ["model 1", "model 2"])


def test_what_is_wrong_without_an_effect_has_a_sign_that_is_explained_and_keys(run):
    assert "wrong without it: coefficients of the model above; +: too large without it" in run(FIRST, LARGER)[1]
    content = json.loads(run(FIRST, LARGER, more=["--json"])[1])
    assert content["models"][0]["wrong_without_it"] == []
    (one,) = content["models"][1]["wrong_without_it"]
    assert (one["coefficient"], one["unit"], one["display_unit"]) == ("accel_bias_x", "m/s^2", "ug")
    assert [one[key] for key in ("amount", "sigma", "sigmas")] == [pytest.approx(v) for v in (-5e-6, 1e-6, -5.0)]


def test_movement_counts_in_sigmas_of_the_model_before():
    assert moved_coefficients(FIRST, SECOND, least=0.5) == (
        ("accel_bias_x", pytest.approx(5.0)),
        ("accel_bias_y", pytest.approx(1.0)),
    )


@pytest.mark.parametrize(
    ("other", "word"),
    [
        (replace(SECOND, body_frame="accelerometer_triad"), "body frame"),
        (replace(SECOND, data={"samples": 11, "duration_s": 1.0}), "another recording"),
        (replace(SECOND, data={**FIRST.data, "checksum": 6.0}), "another recording"),
    ],
)
def test_what_cannot_be_compared_is_refused_in_one_line(run, other, word):
    status, out, err = run(FIRST, other)
    assert (status, out) == (1, "")
    assert err.count("\n") == 1
    assert word in err


def test_another_site_or_noise_is_told_because_likelihoods_change_with_it(run):
    assert "site" not in run(FIRST, SECOND)[1]
    status, out, _ = run(FIRST, replace(SECOND, data={**FIRST.data, "conditions": 8.0}))
    assert status == 0
    assert "not with one site" in out


def by_hand(result, scatter, error):
    """A result by hand whose forces ahead err by `error`, three times what it learned them to scatter by: `scatter`."""
    rests = [
        Rest(0.0, 1.0, (0.0,) * 3, (0.0,) * 3, (0.0,) * 3, 1.0, 1.0, 1.0, (error, -error, error), (scatter,) * 3)
        for _ in range(6)
    ]
    fit = {**result.fit, "held_out_rms": error / scatter}
    return replace(result, estimator="handheld", rests=tuple(rests), fit=fit)


def test_held_out_errors_by_hand_are_in_one_scale(run):
    """Both are one of their own scatter: only in one scale the second is seen to be four times better."""
    _, out, _ = run(by_hand(FIRST, 8e-3, 8e-3), by_hand(SECOND, 2e-3, 2e-3))
    before, after = (next(text for text in out.splitlines() if f"run{k}" in text) for k in (0, 1))
    assert "4.000" in before
    assert "1.000" in after
    assert "in sigmas of the last model" in out
    assert "in sigmas of the last model" not in run(FIRST, SECOND)[1]


def test_results_of_before_that_do_not_say_it_have_no_error_by_hand(run):
    old = replace(by_hand(FIRST, 8e-3, 8e-3), rests=())
    before = next(text for text in run(old, by_hand(SECOND, 2e-3, 2e-3))[1].splitlines() if "run0" in text)
    assert " nan" in before


def test_a_run_by_hand_and_a_navigated_one_are_told_apart(run):
    assert "neither log-likelihoods nor held-out errors compare" in run(by_hand(FIRST, 1e-3, 1e-3), SECOND)[1]


def test_noise_that_was_learned_has_a_column(run):
    assert "noise learned" not in run(FIRST, SECOND)[1]
    flicker = NoiseTerm("gyro", "flicker", size=to_si(0.018, "deg/h"), low=1e-9, high=1e-6)
    _, out, _ = run(FIRST, replace(SECOND, noise=(flicker,)))
    assert "noise learned" in out
    before, after = (next(text for text in out.splitlines() if f"run{k}" in text) for k in (0, 1))
    assert "none" in before
    assert "gyro bias instability (flicker) 0.018 deg/h" in after


def test_errors_in_white_noise_are_said_to_be_that_beside_the_one_in_learned_noise(run):
    learned = {**SECOND.fit, "nis_in_noise": 1.02, "held_out_in_noise": 1.076}
    _, out, _ = run(FIRST, replace(SECOND, noise=(NoiseTerm("gyro", "flicker", size=1e-7),), fit=learned))
    after = next(text for text in out.splitlines() if "run1" in text)
    assert "held-out 1.076" in after
    assert "nis and held-out: in white noise" in out
    assert "log-likelihood: of each model in the noise that it learned itself" in out
    alone = run(FIRST, SECOND)[1]
    assert "log-likelihood, nis and held-out: in the white noise of the IMU's file" in alone
    assert "learned" not in alone


@pytest.mark.parametrize(
    ("name", "text"), [("report.html", "<html>"), ("plan.yaml", "a: 1"), ("a.json", '{"format": "sdimu-fleet/1"}')]
)
def test_a_file_that_is_no_result_is_named_with_what_is_expected(tmp_path, monkeypatch, capsys, name, text):
    """A page was called no JSON file, with the place where Python stopped to read it."""
    write_result(tmp_path / "one" / "result.json", FIRST)
    (tmp_path / name).write_text(text)
    monkeypatch.setattr(sys, "argv", ["sdimu", "compare", str(tmp_path / "one"), str(tmp_path / name)])
    with pytest.raises(SystemExit):
        cli.main()
    err = capsys.readouterr().err
    assert err.startswith(f"sdimu: {tmp_path / name}: ")
    assert "compare takes folders with a result.json" in err
    assert "Expecting value" not in err


def test_one_folder_is_not_enough(run):
    status, _, err = run(FIRST)
    assert status == 1
    assert "two" in err


def test_results_that_leave_out_different_stops_are_told_to_be_no_match(run):
    first = replace(FIRST, data={**FIRST.data, "stops": 19.0})
    assert "leave out different stops" in run(first, replace(SECOND, data={**SECOND.data, "stops": 18.0}))[1]
    assert "leave out different stops" not in run(first, replace(SECOND, data=first.data))[1]


def test_log_likelihoods_of_sets_are_not_compared():
    """They lack what the recordings hold of their own, each model in a noise of its own."""
    together = replace(FIRST, of_set=SimpleNamespace())
    second = replace(together, fit=FIRST.fit | {"log_likelihood": 4e6})
    at = headings([together, second]).index("log-likelihood")
    assert [line[at : at + 2] for line in comparison(("a", "b"), [together, second])] == [["", ""], ["", ""]]
    alone = comparison(("a", "b"), [FIRST, replace(FIRST, fit=second.fit)])
    assert [line[at : at + 2] for line in alone] == [["100.0", ""], ["4000000.0", "+3999900.0"]]


def test_a_truth_at_another_temperature_is_said_to_be_one(tmp_path):
    warm = replace(FIRST, names=("accel_bias_x", "accel_bias_temperature_x"), data={START_TEMPERATURE: 0.1})
    (told,) = _other_temperature(tmp_path / "truth.yaml", 25.0, warm)
    assert told.endswith("they differ by the temperature; to compare them: --reference-temperature '25 degC'")
    assert _other_temperature(tmp_path, 0.0, warm) == []
    assert _other_temperature(tmp_path, None, warm) == []
    assert _other_temperature(tmp_path, 25.0, replace(FIRST, data=warm.data)) == []
