"""The ROS domain of a run: stated, from the environment, or free; never shared with another run."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.cli.processes import DOMAINS, RunningTest, is_held, own_domain, running_tests
from sdimu_calibration.cli.watch_verb import Pace, opening_words, outlined, watched
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import to_si


@pytest.fixture(autouse=True)
def _no_domain_in_the_environment(monkeypatch, tmp_path):
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))  # locks of this test alone


def test_without_a_word_the_domain_is_free_and_two_runs_have_two(tmp_path):
    with own_domain(tmp_path) as one:
        assert os.environ["ROS_DOMAIN_ID"] == str(one)
        del os.environ["ROS_DOMAIN_ID"]
        with own_domain(tmp_path) as other:
            assert {one, other} <= set(DOMAINS)
            assert one != other
        os.environ["ROS_DOMAIN_ID"] = str(one)


def test_the_environment_and_before_it_the_option_state_the_domain(tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "0")
    with own_domain(tmp_path) as domain:
        assert domain == 0
    with own_domain(tmp_path, 23) as domain:
        assert domain == 23
        assert os.environ["ROS_DOMAIN_ID"] == "23"
    assert os.environ["ROS_DOMAIN_ID"] == "0"


def test_a_stated_domain_that_holds_a_run_is_refused(tmp_path):
    refused = pytest.raises(DataError, match="ROS domain 23 holds another run of sdimu")
    with own_domain(tmp_path, 23), refused, own_domain(tmp_path, 23):
        pytest.fail("two runs in one domain")


@pytest.mark.parametrize("text", ["-1", "233", "one"])
def test_what_is_no_domain_is_refused(tmp_path, monkeypatch, text):
    monkeypatch.setenv("ROS_DOMAIN_ID", text)
    with pytest.raises(DataError, match="expected 0 to 232"), own_domain(tmp_path):
        pytest.fail("that is no domain")


ABOUT = RunningTest(
    "/out/run", 900.0, 19, "baseline", "dtg", 1_700_000_000 * 10**9, course="plan kim18", site="daejeon"
)


def test_a_run_tells_those_that_watch_it_where_it_is_and_what_it_makes(tmp_path, monkeypatch):
    with own_domain(tmp_path, 31, ABOUT), own_domain(tmp_path, 32):
        monkeypatch.delenv("ROS_DOMAIN_ID")  # the shell of one that watches
        assert running_tests() == (replace(ABOUT, domain=31),)
        assert watched(None) == replace(ABOUT, domain=31)
        assert not outlined(replace(ABOUT, diagnosed=False), None, ())[0].diagnosed
        assert watched(31) == replace(ABOUT, domain=31)
        assert ABOUT.words == "/out/run \N{MIDDLE DOT} plan kim18 \N{MIDDLE DOT} IMU dtg \N{MIDDLE DOT} daejeon"
        assert watched(32) is None  # nodes without a run say nothing of their test
        assert is_held(31)
    assert running_tests() == ()
    assert not is_held(31)
    assert watched(None) is None


def test_of_several_runs_one_must_be_stated(tmp_path, monkeypatch):
    with own_domain(tmp_path, 31, ABOUT), own_domain(tmp_path, 34, ABOUT):
        monkeypatch.delenv("ROS_DOMAIN_ID")
        with pytest.raises(DataError, match=r"2 tests run on this machine; state one: --domain 31 .*--domain 34"):
            watched(None)
        assert watched(34) == replace(ABOUT, domain=34)


def test_a_file_that_says_nothing_of_use_is_no_test(tmp_path):
    with own_domain(tmp_path, 31, ABOUT):
        for text in ("", "[]", '{"folder": 1}', "no json"):
            (tmp_path / "sdimu-domain-31.lock").write_text(text)
            assert running_tests() == ()


def test_the_time_that_is_left_follows_from_the_pace_since_it_is_watched():
    """Joined 600 s into a test that runs at 10 times real time: it has taken 61 s after another second."""
    pace = Pace()
    assert pace.wall(0.0, 5.0) == 0.0
    assert pace.wall(600.0, 7.0) == 0.0
    assert pace.wall(610.0, 8.0) == pytest.approx(61.0)


def test_sigmas_at_the_begin_are_those_that_the_node_publishes_first():
    """In the body frame misalignments of the two triads add up: 1 arcmin of each are 1.4 there."""
    _, first = outlined(ABOUT, None, ())
    assert first["gyro_bias_x"] == pytest.approx(to_si(1.0, "deg/h"))
    assert first["gyro_misalignment_xy"] == pytest.approx(np.sqrt(2.0) * to_si(1.0, "arcmin"))
    assert outlined(None, None, ())[1] == {}


def test_an_effect_that_somebody_adds_later_begins_at_the_prior_of_the_imus_file():
    """80 % of its sigma seemed left of an asymmetry known to 4 %: the first sigma heard was taken for the begin."""
    outline, first = outlined(ABOUT, None, ())
    assert "gyro_scale_asymmetry_y" not in outline.units
    assert first["gyro_scale_asymmetry_y"] == pytest.approx(to_si(25.0, "ppm"))


def test_without_a_run_watch_says_at_once_what_it_waits_for_and_how_one_is_started():
    what, waits = opening_words(None, 7, 0.0)
    assert what == "watching ROS domain 7; ends with the test, or with Ctrl-C"
    assert "waiting for the topics of a test" in waits
    assert waits.endswith("sdimu run --domain 7")  # a domain of its own choice would not be heard here
    assert opening_words(ABOUT, 7, 5.0) == (f"watching ROS domain 7, the run into {ABOUT.folder}; ends after 5 s",)
