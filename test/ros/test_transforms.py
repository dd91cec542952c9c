"""Transforms of the simulators: one tree from the site to the IMU, under the type that RViz takes."""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from sdimu_calibration.core.rotation import quaternion_matrix
from sdimu_calibration.nodes.transform_type import HASH, TYPE_NAME
from sdimu_calibration.nodes.transforms import TransformMessage, about, stamp_of_first
from sdimu_calibration.storage.bags.bag_reader import read_recording

from .conftest import DWELL_S, TURN_S, Run

MOUNT_DEG = 3.0
"""The simulated IMU is mounted within this about each axis, and the transforms do not know it."""


def described(name: str) -> dict[str, Any]:
    package, message = name.split("/")
    path = Path(sys.prefix) / "share" / package / "msg" / f"{message}.json"
    return json.loads(path.read_text(encoding="utf-8"))


def rep2016_hash(main: dict[str, Any], used: list[dict[str, Any]]) -> str:
    """Hash of a type: SHA-256 of its description without comments and defaults (REP 2016)."""

    def bare(kind: dict[str, Any]) -> dict[str, Any]:
        places = ("type_id", "capacity", "string_capacity", "nested_type_name")
        fields = [{"name": f["name"], "type": {p: f["type"][p] for p in places}} for f in kind["fields"]]
        return {"type_name": kind["type_name"], "fields": fields}

    referenced = [bare(kind) for kind in sorted(used, key=lambda kind: kind["type_name"])]
    text = json.dumps({"type_description": bare(main), "referenced_type_descriptions": referenced})
    return hashlib.sha256(text.encode()).hexdigest()


def test_the_hash_of_the_stand_in_is_that_of_the_type() -> None:
    installed = described("geometry_msgs/TransformStamped")
    of_one = installed["type_description_msg"]
    main, used = of_one["type_description"], of_one["referenced_type_descriptions"]
    known = {entry["type_name"]: entry["hash_string"] for entry in installed["type_hashes"]}
    assert "RIHS01_" + rep2016_hash(main, used) == known[main["type_name"]]  # the way of hashing is right
    sequence_of_messages = 145  # FIELD_TYPE_NESTED_TYPE_UNBOUNDED_SEQUENCE
    kind = {"type_id": sequence_of_messages, "capacity": 0, "string_capacity": 0, "nested_type_name": main["type_name"]}
    transforms = {"type_name": TYPE_NAME, "fields": [{"name": "transforms", "type": kind}]}
    assert rep2016_hash(transforms, [main, *used]) == HASH.hex()


def test_what_is_encoded_is_read_by_others() -> None:
    frames = [("a", "bc"), ("def", "g" * 12)]
    turns = [about(np.array([0.6, 0.0, 0.8]), 0.7), (0.5, 0.5, -0.5, 0.5)]
    raw = TransformMessage(frames).encode(1_700_000_000_123_456_789, turns)
    message = get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(raw, TYPE_NAME)
    for transform, frame, turn in zip(message.transforms, frames, turns, strict=True):
        assert (transform.header.frame_id, transform.child_frame_id) == frame
        assert (transform.header.stamp.sec, transform.header.stamp.nanosec) == (1_700_000_000, 123_456_789)
        q = transform.transform.rotation
        np.testing.assert_array_equal([q.w, q.x, q.y, q.z], turn)
    assert stamp_of_first(raw) == 1_700_000_000_123_456_789


@pytest.mark.ros
def test_transforms_lead_from_the_site_to_an_imu_that_feels_gravity_upwards(whole_run: Run) -> None:
    bag = whole_run.folder / "bag"
    parent: dict[str, str] = {}
    turns: list[tuple[float, str, np.ndarray]] = []
    with AnyReader([bag]) as reader:
        start = read_recording(bag).start_ns
        for connection, _, raw in reader.messages([c for c in reader.connections if c.msgtype == TYPE_NAME]):
            for t in reader.deserialize(raw, connection.msgtype).transforms:
                assert parent.setdefault(t.child_frame_id, t.header.frame_id) == t.header.frame_id
                q = t.transform.rotation
                at = t.header.stamp.sec + 1e-9 * t.header.stamp.nanosec - 1e-9 * start
                turns.append((at, t.child_frame_id, quaternion_matrix(np.array([q.w, q.x, q.y, q.z]))))
    recording = read_recording(bag)
    for stop in range(3):
        middle = stop * (DWELL_S + TURN_S) + 0.5 * DWELL_S
        now = {frame: C for at, frame, C in turns if at <= middle}
        C, frame, length = np.eye(3), "imu_link", 0
        while frame != "site":
            C, frame, length = now[frame] @ C, parent[frame], length + 1
            assert length < 10
        f = recording.f_ib_b[np.abs(recording.t - middle) < 5.0].mean(axis=0)
        up = C @ f / np.linalg.norm(f)
        # East, North, Up; two of the three mounting angles tilt it.
        assert np.degrees(np.arccos(up[2])) < np.sqrt(2.0) * MOUNT_DEG + 0.1
