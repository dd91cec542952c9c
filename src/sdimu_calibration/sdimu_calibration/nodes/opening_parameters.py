"""Parameters of a node that say how a test is to be opened: those of the command line, with its words in errors."""

from __future__ import annotations

from rclpy.node import Node

from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.nodes.parameters import Declare
from sdimu_calibration.storage.bags.topic_choice import Topics
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.opening import Source, opening_options


def declare_opening(node: Node) -> tuple[OpeningOptions, Topics]:
    """Declare site, imu, accel_unit, gyro_unit, accel_sign, gyro_sign and the names of the topics.

    ROS parameters keep their type: nothing stated is an empty string, or a sign of 0.
    """
    declare = Declare(node)

    def topic(name: str, default: str, of: str) -> str:
        return declare.text(name, default.lstrip("/"), f"topic of the {of}")

    def unit(name: str, of: str) -> str | None:
        return declare.text(name, "", f"unit of the {of} in the messages; recognised when empty") or None

    def sign(name: str, of: str) -> int | None:
        text = f"sign of the {of}: expected 1 or -1, or 0 to recognise it"
        return declare.integer(name, 0, text, least=-1, most=1) or None

    own = Topics()
    topics = Topics(
        imu=topic("imu_topic", own.imu, "samples"),
        status=topic("status_topic", own.status, "phases of the table"),
        temperature=topic("temperature_topic", own.temperature, "temperature"),
    )
    source = Source(
        accel_unit=unit("accel_unit", "specific force"),
        gyro_unit=unit("gyro_unit", "body rate"),
        accel_sign=sign("accel_sign", "specific force"),
        gyro_sign=sign("gyro_sign", "body rate"),
    )
    imu = declare.text("imu", "", "data sheet of the IMU: name in config/imu or path; its grade is learned when empty")
    site = declare.text("site", "", "place of the test: name in config/site or path; daejeon when empty")
    return opening_options(site or None, load_imu(imu) if imu else None, source), topics


def declare_frames(declare: Declare) -> tuple[str, str]:
    """Declare the frames of calibration/navigation; the names of local-level frame and body frame, empty by default."""
    level = declare.text("level_frame_id", "ned", "frame_id of the navigation: North, East, Down at the site")
    body = declare.text("body_frame_id", "", "child_frame_id of the navigation; empty: imu_ and the body frame")
    return level, body
