"""Options that say how a recording is to be read; every verb that reads one has them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from sdimu_calibration.storage.opening import Source

_PANEL = "How the recording is to be read (recognised when left out)"


def _option(name: str, metavar: str, text: str) -> typer.models.OptionInfo:
    option: typer.models.OptionInfo = typer.Option(name, metavar=metavar, help=text, rich_help_panel=_PANEL)
    return option


ImuTopic = Annotated[str | None, _option("--imu-topic", "TOPIC", "sensor_msgs/Imu.")]
StatusTopic = Annotated[str | None, _option("--status-topic", "TOPIC", "diagnostic_msgs/DiagnosticArray with a phase.")]
JointTopic = Annotated[str | None, _option("--joint-topic", "TOPIC", "sensor_msgs/JointState.")]
TemperatureTopic = Annotated[str | None, _option("--temperature-topic", "TOPIC", "sensor_msgs/Temperature.")]
AccelUnit = Annotated[str | None, _option("--accel-unit", "UNIT", "Of linear_acceleration, such as g.")]
GyroUnit = Annotated[str | None, _option("--gyro-unit", "UNIT", "Of angular_velocity, such as deg/s.")]
AccelSign = Annotated[int | None, _option("--accel-sign", "SIGN", "-1: the negative of the specific force.")]
GyroSign = Annotated[int | None, _option("--gyro-sign", "SIGN", "-1: the negative of the body rate.")]


def source(
    imu_topic: str | None,
    status_topic: str | None,
    joint_topic: str | None,
    temperature_topic: str | None,
    accel_unit: str | None,
    gyro_unit: str | None,
    accel_sign: int | None,
    gyro_sign: int | None,
) -> Source:
    """Put the options together."""
    from sdimu_calibration.storage.bags.topic_choice import TopicChoice
    from sdimu_calibration.storage.opening import Source

    topics = TopicChoice(imu_topic, status_topic, joint_topic, temperature_topic)
    return Source(topics, accel_unit, gyro_unit, accel_sign, gyro_sign)
