"""What a node does when DDS refuses its messages."""

from __future__ import annotations

import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes import credits as flow


class Refusing:
    """A publisher that refuses so many messages before it takes one."""

    topic_name = "/imu/data_raw"

    def __init__(self, refusals: int) -> None:
        self.refusals = refusals
        self.taken: list[object] = []

    def get_subscription_count(self) -> int:
        return 2

    def publish(self, message: object) -> None:
        if self.refusals:
            self.refusals -= 1
            raise rclpy_implementation.RCLError("Failed to publish: cannot publish data")
        self.taken.append(message)


def test_a_refused_message_is_sent_once_it_is_taken() -> None:
    publisher = Refusing(5)
    flow.publish(publisher, "a sample")
    assert publisher.taken == ["a sample"]
    assert publisher.refusals == 0


def test_a_subscriber_that_hangs_is_told_and_ends_the_wait(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(flow, "TELL_REFUSED_S", 0.001)
    monkeypatch.setattr(flow, "REFUSED_S", 0.05)
    publisher = Refusing(10**9)
    with pytest.raises(DataError, match="/imu/data_raw: one of its 2 subscribers has taken nothing for 0 s; end the"):
        flow.publish(publisher, "a sample")
    assert publisher.taken == []
    assert (
        capfd.readouterr().err.count("/imu/data_raw: one of its 2 subscribers has taken nothing for 0 s; waiting") == 1
    )
