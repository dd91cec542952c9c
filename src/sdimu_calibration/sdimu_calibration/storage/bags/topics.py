"""Names of the topics of a test; they are fixed, but a recording made elsewhere may use others."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Topics:
    """Topics of a recording.

    Attributes
    ----------
    imu : str
        sensor_msgs/Imu; the only one that must be there.
    status : str
        diagnostic_msgs/DiagnosticArray of the rate table.
    joint_states : str
        sensor_msgs/JointState of the rate table.
    temperature : str
        sensor_msgs/Temperature of the IMU.
    """

    imu: str = "/imu/data_raw"
    status: str = "/rate_table/status"
    joint_states: str = "/rate_table/joint_states"
    temperature: str = "/imu/temperature"
