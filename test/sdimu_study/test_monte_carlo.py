"""The verb and its report: what a person gets of a campaign."""

import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from sdimu_calibration.core.recording import DataError
from sdimu_study.cli.monte_carlo import monte_carlo
from sdimu_study.monte_carlo import FORMAT as WRITTEN
from sdimu_study.monte_carlo_page import FORMAT, cells, check_cells, page

PLAN = """
format: sdimu-plan/1
dwell: 12 s
rate: 15 deg/s
acceleration: 30 deg/s^2
turns: [{axis: Y, angle: 90 deg}, {axis: Z, angle: 90 deg}, {axis: X, angle: 90 deg}]
"""


@pytest.fixture
def run(tmp_path):
    (tmp_path / "short.yaml").write_text(PLAN)
    app = typer.Typer()
    app.command()(monte_carlo)

    def invoke(*options):
        given = ["--out", str(tmp_path / "mc"), "--plan", str(tmp_path / "short.yaml"), "--table", "free"]
        return CliRunner().invoke(
            app, [*given, "--rate", "20", "--scheduler", "here", *options], catch_exceptions=False
        )

    return invoke


def test_a_campaign_leaves_data_and_a_page_that_needs_no_network(run, tmp_path):
    done = run("-n", "3", "--seed", "5")
    assert done.exit_code == 0
    data = json.loads((tmp_path / "mc" / "monte-carlo.json").read_text())
    assert data["format"] == FORMAT == WRITTEN
    assert data["runs"] == 3
    assert len(data["nees"]["values"]) == 3
    text = (tmp_path / "mc" / "monte-carlo.html").read_text()
    assert "gyro_bias_x" in text
    assert 'src="http' not in text
    # The bound is a bound: no honest sigma is below it by more than linearisation can do.
    assert all(c["sigma"] > 0.99 * c["bound"] for c in data["coefficients"])
    assert "NEES" in done.stdout


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("-n", "1"), "at least 2"),
        (("-n", "3", "--seed", "-4"), "--seed -4"),
        (("-n", "3", "--rate", "5"), "10 to 1000"),
        (("-n", "3", "--workers", "0"), "--workers 0"),
        (("-n", "3", "--effect", "nothing=1"), "unknown effect"),
        (("-n", "3", "--effect", "gyro_bias_temperature_x=1 deg/h/degC"), "--temperature"),
    ],
)
def test_what_would_make_every_run_fail_is_refused_before_the_first(run, options, said, tmp_path):
    with pytest.raises(DataError, match=said):
        run(*options)
    assert not list((tmp_path / "mc").glob("runs-*/seeds-*"))


def content(failed=()):
    rng = np.random.default_rng(3)
    coefficient = {
        "name": "gyro_bias_x",
        "unit": "rad/s",
        "display_unit": "deg/h",
        "bias": 1e-9,
        "bias_error": 2e-9,
        "rms": np.radians(0.003) / 3600,
        "sigma": np.radians(0.002) / 3600,
        "bound": np.radians(0.0015) / 3600,
        "rms_z": 1.5,
    }
    check = {"name": "bias", "value": 1.0, "low": 0.0, "high": 3.0, "passed": True}
    return {
        "format": FORMAT,
        "runs": 10,
        "failed": list(failed),
        "body_frame": "accelerometer_triad",
        "level": 0.99,
        "bound_from": "<batch>",
        "checks": [check, {**check, "name": "lag", "passed": False}],
        "rms_z_interval": [0.6, 1.4],
        "coefficients": [coefficient],
        "nees": {"dof": 1, "values": rng.chisquare(1, 10).tolist()},
        "autocorrelation": [{"channel": "rate_x", "value": 0.0, "standard_errors": 0.0, "pairs": 100}],
        "time": {"cpu_s_per_run": 0.5},
    }


def test_numbers_stand_in_the_units_of_their_column():
    row = cells(content()["coefficients"][0])
    assert row[3:7] == ["0.003", "0.002", "0.0015", "deg/h"]
    assert row[-1] == "2.000"


def test_the_page_says_what_failed_and_escapes_what_others_wrote():
    text = page(content([{"seed": 4, "error": "DataError: <script>"}]))
    assert "1 of 2 checks failed" in text
    assert "seed 4: DataError: &lt;script&gt;" in text
    assert "&lt;batch&gt;" in text
    assert check_cells(content()["checks"][1])[-1] == "NO"
