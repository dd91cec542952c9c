"""Parameters of a node that say how a test is to be opened: those of the command line, with its words in errors."""

from __future__ import annotations

from rclpy.node import Node

from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.storage.config import load_imu
from sdimu_calibration.storage.opening import Source, opening_options
from sdimu_calibration.storage.topics import Topics


def declare_opening(node: Node) -> tuple[OpeningOptions, Topics]:
    """Declare site, imu, accel_unit, gyro_unit, accel_sign, gyro_sign and the names of the topics.

    ROS parameters keep their type: nothing stated is an empty string, or a sign of 0.

    Raises
    ------
    DataError
        When there is no such site or IMU, or a unit or sign is none.
    """

    def text(name: str, default: str = "") -> str:
        return str(node.declare_parameter(name, default).value)

    def sign(name: str) -> int | None:
        return int(node.declare_parameter(name, 0).value) or None

    own = Topics()
    topics = Topics(
        imu=text("imu_topic", own.imu), status=text("status_topic", own.status),
        temperature=text("temperature_topic", own.temperature),
    )  # fmt: skip
    source = Source(
        accel_unit=text("accel_unit") or None, gyro_unit=text("gyro_unit") or None, accel_sign=sign("accel_sign"),
        gyro_sign=sign("gyro_sign"),
    )  # fmt: skip
    imu = text("imu")
    return opening_options(text("site") or None, load_imu(imu) if imu else None, source), topics
