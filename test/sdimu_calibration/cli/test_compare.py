"""`sdimu compare` compares what can be compared, and refuses the rest in one line."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.cli import main as cli
from sdimu_calibration.core.diagnosis.ladder import moved_coefficients
from sdimu_calibration.core.results import Calibration, History
from sdimu_calibration.storage.result_file import write_result

_NONE = np.empty(0)
FIRST = Calibration(
    body_frame="prior", model=("accel_bias",), names=("accel_bias_x", "accel_bias_y"), units=("m/s^2",) * 2,
    display_units=("ug",) * 2, values=np.array([1e-4, 2e-4]), covariance=np.diag([1e-12, 4e-12]),
    fit={"log_likelihood": 100.0, "nis_mean": 1.5, "held_out_rms": 2.0},
    data={"samples": 10, "duration_s": 1.0, "checksum": 5.0, "conditions": 7.0},
    notes=(),
    history=History(_NONE, np.empty((0, 2)), np.empty((0, 2)), np.empty((0, 3)), _NONE.astype(int), _NONE.astype(bool),
                    _NONE.astype(bool), np.empty((0, 4))),
)  # fmt: skip
SECOND = replace(
    FIRST,
    model=("accel_bias", "accel_quadratic_x"),
    values=np.array([1e-4 + 5e-6, 2e-4 + 2e-6]),
    fit={"log_likelihood": 160.0, "nis_mean": 1.0, "held_out_rms": 1.0},
)


@pytest.fixture
def run(monkeypatch, capsys, tmp_path):
    def compare(*results):
        folders = []
        for k, result in enumerate(results):
            write_result(tmp_path / f"run{k}" / "result.json", result)
            folders.append(str(tmp_path / f"run{k}"))
        monkeypatch.setattr(sys, "argv", ["sdimu", "compare", *folders])
        with pytest.raises(SystemExit) as ending:
            cli.main()
        captured = capsys.readouterr()
        return int(ending.value.code or 0), captured.out, captured.err

    return compare


def test_the_ladder_shows_what_was_added_and_how_far_the_error_fell(run):
    status, out, _ = run(FIRST, SECOND)
    assert status == 0
    line = next(text for text in out.splitlines() if "run1" in text)
    for word in ("+ accel_quadratic_x", "+60.0", "1.000", "accel_bias_x +5.0"):
        assert word in line
    assert "accel_bias_y" not in line  # moved by one sigma only


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


def test_one_folder_is_not_enough(run):
    status, _, err = run(FIRST)
    assert status == 1
    assert "two" in err
