"""The ROS domain of a run: stated, from the environment, or free; never shared with another run."""

from __future__ import annotations

import os

import pytest

from sdimu_calibration.cli.processes import DOMAINS, own_domain
from sdimu_calibration.core.recording import DataError


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
