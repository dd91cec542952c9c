"""The verb simulate: a bag and a truth file that agree with each other."""

import shutil

import numpy as np
import pytest
import typer
from truth_reader import read_truth
from typer.testing import CliRunner

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.bag_metadata import custom_data
from sdimu_calibration.storage.bags.bag_reader import read_recording
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_sim.cli.options import World, mount_rad
from sdimu_sim.cli.simulate import simulate
from sdimu_sim.core import Scenario, generate

PLAN = """
dwell: 5 s
rate: 10 deg/s
acceleration: 20 deg/s^2
turns: [{axis: Y, angle: 90 deg}, {axis: Z, angle: -90 deg}]
"""


@pytest.fixture
def run(tmp_path):
    (tmp_path / "short.yaml").write_text(PLAN)
    app = typer.Typer()
    app.command()(simulate)

    def invoke(*options):
        given = ["--out", str(tmp_path / "bag"), "--plan", str(tmp_path / "short.yaml"), *options]
        return CliRunner().invoke(app, given, catch_exceptions=False)

    return invoke


def test_the_bag_holds_what_the_scenario_generates(run, tmp_path):
    assert run("--seed", "3", "--rate", "50", "--temperature", "warm-up").exit_code == 0
    recording = read_recording(tmp_path / "bag")
    truth = read_truth(tmp_path / "bag.truth.yaml")
    plan = load_plan(tmp_path / "short.yaml")
    expected, true = generate(Scenario(plan, load_imu("dtg"), load_site("daejeon"), rate_hz=50.0, seed=3))
    assert truth.imu == true.imu
    np.testing.assert_array_equal(recording.omega_ib_b, expected.omega_ib_b)
    np.testing.assert_array_equal(recording.f_ib_b, expected.f_ib_b)
    np.testing.assert_allclose(recording.t, expected.t, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(recording.phase.dwell, expected.phase.dwell)
    np.testing.assert_array_equal(recording.phase.stop, expected.phase.stop)
    assert recording.temperature is not None


def test_the_mount_is_taken_in_degrees(run, tmp_path):
    assert run("--mount", "1,-2,3", "--truth", str(tmp_path / "t.yaml")).exit_code == 0
    assert np.degrees(read_truth(tmp_path / "t.yaml").imu.mount_rad) == pytest.approx([1, -2, 3])


@pytest.mark.parametrize("text", ["1,2", "a,b,c", "1,2,nan"])
def test_a_mount_that_is_not_three_angles_is_refused(text):
    with pytest.raises(DataError, match=r"three .*angles"):
        mount_rad(text)


@pytest.mark.parametrize(
    ("effect", "options", "example"),
    [
        ("gyro_bias_warm_up_y=0.03 deg/h", "tau", "gyro_bias_warm_up_y(tau=1200 s)=0.03 deg/h"),
        ("accel_play_x", "r", "accel_play_x(r=0.3 g)=1 ug"),
        ("gyro_lost_data=10 ms", "turn and at", "gyro_lost_data(turn=1, at=120 s)=10 ms"),
    ],
)
def test_an_option_that_is_left_out_is_named_with_that_of_the_catalogue(run, tmp_path, effect, options, example):
    with pytest.raises(DataError) as caught:
        run("--effect", effect)
    assert str(caught.value).endswith(f": state {options}, such as '{example}' (as in the catalogue)")
    assert not (tmp_path / "bag").exists()
    # The example is one that is read.
    assert World(effect=[example]).effects == (example,)


def test_an_unknown_effect_leaves_no_bag(run, tmp_path):
    with pytest.raises(DataError, match="unknown effect"):
        run("--effect", "nothing=1")
    assert not (tmp_path / "bag").exists()


def test_the_bag_says_of_which_unit_and_power_on_it_is(run, tmp_path):
    assert run("--serial", "SN9", "--power-on", "2").exit_code == 0
    assert custom_data(tmp_path / "bag") == {"serial": "SN9", "power_on": "2"}


@pytest.mark.parametrize("option", ["--seed", "--unit"])
def test_a_negative_seed_is_wrong_usage(run, option):
    refused = run(option, "-1")
    assert refused.exit_code == 2
    assert option in refused.output


def test_a_truth_replaces_no_other_file_and_a_truth_only_where_asked(run, tmp_path):
    plan = tmp_path / "short.yaml"
    assert run("--rate", "20", "--truth", str(tmp_path / "t.yaml")).exit_code == 0
    (mcap,) = (tmp_path / "bag").glob("*.mcap")
    for path, words in (
        (plan, "another file than a truth"),
        (mcap, "stands in the bag"),
        (tmp_path / "bag", "is a folder"),
    ):
        before = path.read_bytes() if path.is_file() else b""
        with pytest.raises(DataError, match=words):
            run("--replace", "--truth", str(path))
        assert before == (path.read_bytes() if path.is_file() else b"")
    with pytest.raises(DataError, match="a bag is already there"):
        run("--truth", str(tmp_path / "u.yaml"))
    assert not (tmp_path / "u.yaml").exists()
    with pytest.raises(DataError, match=r"t\.yaml: a truth file is already there; --replace"):
        run("--truth", str(tmp_path / "t.yaml"), "--out", str(tmp_path / "other"))
    assert not (tmp_path / "other").exists()
    assert run("--rate", "20", "--seed", "4", "--replace", "--truth", str(tmp_path / "t.yaml")).exit_code == 0
    assert read_truth(tmp_path / "t.yaml").seed == 4


def test_the_truth_of_a_bag_that_is_gone_may_go(run, tmp_path):
    assert run("--rate", "20").exit_code == 0
    shutil.rmtree(tmp_path / "bag")
    assert run("--rate", "20", "--seed", "5").exit_code == 0
    assert read_truth(tmp_path / "bag.truth.yaml").seed == 5


@pytest.mark.parametrize(
    "given", [("--plan", "kim18_signed"), ("--temperature", "cycle"), ("--mount", "1,2,3"), ("--table", "two_axis")]
)
def test_what_belongs_to_a_table_is_refused_of_a_run_by_hand(given, tmp_path):
    app = typer.Typer()
    app.command()(simulate)
    with pytest.raises(DataError, match=rf"{given[0]}: a run by hand \(--by-hand\) does not take it"):
        CliRunner().invoke(app, ["--out", str(tmp_path / "bag"), "--by-hand", "3", *given], catch_exceptions=False)
    assert not (tmp_path / "bag").exists()
