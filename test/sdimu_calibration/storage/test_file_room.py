"""A file that is written never takes the place of what is read, of a recording, or of a file nobody gave up."""

from __future__ import annotations

import os

import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.bags.file_room import check_file_room, check_own_file


def test_a_free_place_is_free_in_a_folder_that_is_not_there_yet_too(tmp_path):
    check_file_room(tmp_path / "new" / "plan.yaml", "--out", kind="sdimu-plan")


@pytest.mark.parametrize("make", ["write_text", "symlink_to"])
def test_what_is_there_asks_for_replace(tmp_path, make):
    path = tmp_path / "mine.yaml"
    getattr(path, make)("nowhere")  # a link to nothing is somebody's, too
    with pytest.raises(DataError, match=r"mine\.yaml: is there already; --replace replaces it, or .* with --priors"):
        check_file_room(path, "--priors", kind="sdimu-plan")
    check_file_room(path, "--priors", kind="sdimu-plan", replace=True)


@pytest.mark.parametrize("link", [None, os.symlink, os.link])
def test_what_is_read_is_never_replaced_by_links_either(tmp_path, link):
    source = tmp_path / "result.json"
    source.write_text("{}")
    path = source
    if link:
        path = tmp_path / "out.txt"
        link(source, path)
    with pytest.raises(DataError, match=r"is read from .*result\.json; name another file with --out"):
        check_file_room(path, "--out", kind="sdimu-plan", replace=True, sources=[source])


@pytest.mark.parametrize("name", ["metadata.yaml", "small_0.mcap", "new.yaml"])
def test_the_folder_of_a_recording_is_left_alone(bag, name):
    with pytest.raises(DataError, match=f"{name}: stands in the recording"):
        check_file_room(bag / name, "--out", kind="sdimu-plan", replace=True)


def test_a_link_into_a_recording_and_a_recording_that_is_read_are_left_alone(bag, tmp_path):
    (tmp_path / "link.yaml").symlink_to(bag / "metadata.yaml")
    with pytest.raises(DataError, match="stands in the recording"):
        check_file_room(tmp_path / "link.yaml", "--out", kind="sdimu-plan", replace=True)
    with pytest.raises(DataError, match="is read from"):
        check_file_room(bag / "new.yaml", "--out", kind="sdimu-plan", replace=True, sources=[bag])


@pytest.mark.parametrize("name", ["one.mcap", "one.db3", "one.bag", "one.mcap.zstd"])
def test_a_recording_without_a_folder_is_left_alone(tmp_path, name):
    (tmp_path / name).touch()
    with pytest.raises(DataError, match=f"{name}: is a recording"):
        check_file_room(tmp_path / name, "--out", kind="sdimu-plan", replace=True)


def test_a_pipe_and_a_folder_are_no_place_for_a_file(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(DataError, match="device or a pipe"):
        check_file_room(tmp_path / "pipe", "--out", kind="sdimu-plan", replace=True)
    with pytest.raises(DataError, match="is a folder"):
        check_file_room(tmp_path, "--out", kind="sdimu-plan", replace=True)


def test_a_file_with_a_fixed_name_is_replaced_where_the_verb_left_it(tmp_path):
    path = tmp_path / "imu.yaml"
    check_own_file(path, ("# ours",))
    path.write_text("# ours, of a bag\nname: x\n")
    check_own_file(path, ("# other", "# ours"))
    with pytest.raises(DataError, match=r"imu\.yaml: would replace the file that is read"):
        check_own_file(path, ("# ours",), [path])
    path.write_text("name: x\n")
    with pytest.raises(DataError, match=r"imu\.yaml: is there already and of another origin"):
        check_own_file(path, ("# ours",))


@pytest.mark.parametrize(
    "text",
    [
        '{\n  "format": "sdimu-result/1",\n  "verdict": ""\n}',
        '{"format": "sdimu-plan-search/1"}',
        "# a remark\nformat: sdimu-imu/1\n",
    ],
)
def test_a_file_of_another_kind_is_not_replaced(tmp_path, text):
    path = tmp_path / "result.json"
    path.write_text(text)
    with pytest.raises(
        DataError, match=r"result\.json: is a file of another kind \(sdimu-[a-z-]+\); name another file"
    ):
        check_file_room(path, "--out", kind="sdimu-plan", replace=True)
    path.write_text("# a remark\nname: mine\nformat: sdimu-plan/1\n")
    check_file_room(path, "--out", kind="sdimu-plan", replace=True)
