"""How a result came about: files with their hashes, the command as it was typed, and what the user named."""

from __future__ import annotations

import hashlib
import shlex
from datetime import UTC, datetime

import pytest

from sdimu_calibration.storage.trace import program_version, traced


@pytest.fixture
def bag(tmp_path):
    folder = tmp_path / "a bag"
    folder.mkdir()
    (folder / "a.mcap").write_bytes(b"samples")
    return folder


def test_files_stand_with_the_hash_of_what_is_in_them(bag):
    ((path, digest),) = traced([bag]).files
    assert path.endswith("a.mcap")
    assert digest == hashlib.sha256(b"samples").hexdigest()


def test_the_command_can_be_typed_again(bag):
    words = ["calibrate", str(bag), "--add", "accel_quadratic(x=1 s)"]
    assert shlex.split(traced([bag], words).command) == ["sdimu", *words]


def test_from_python_there_is_no_command_and_what_was_left_out_is_not_named():
    trace = traced((), (), imu="dtg", site=None)
    assert trace.command == ""
    assert trace.stated == (("imu", "dtg"),)
    assert trace.files == ()


def test_it_says_when_and_by_which_program():
    trace = traced()
    made = datetime.strptime(trace.made, "%Y-%m-%d %H:%M UTC").replace(tzinfo=UTC)
    assert abs((datetime.now(UTC) - made).total_seconds()) < 120.0
    assert trace.program == f"sdimu {program_version()}"
