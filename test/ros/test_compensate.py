"""The compensate node, in a process of its own: raw samples in, compensated ones out, results exchanged on the way."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import Imu, Temperature
from std_srvs.srv import Trigger

from sdimu_calibration.core.compensation import compensate, compensator
from sdimu_calibration.core.effects import imu_model, registry
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration, no_history
from sdimu_calibration.nodes.credits import STREAM, header, to_ns
from sdimu_calibration.storage.bags.cdr import encode_imu
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_calibration.storage.files.result_file import write_result

from .conftest import DEADLINE_S, FitSession

pytestmark = pytest.mark.ros

INTERVAL_NS = 10_000_000
START_NS = 1_700_000_000 * 10**9


def drawn(seed: int, *more: str, **data: float) -> Calibration:
    """Draw a result of the baseline and more effects from the specification of the default IMU."""
    imu, rng = load_imu("dtg"), np.random.default_rng(seed)
    effects = [registry.get(name) for name in (*load_model("baseline").effects, *more)]
    parameters = [p for e in effects for p in e.parameters]
    sigma = np.array([imu_model.prior_size(e, imu) for e in effects for _ in e.parameters])
    n = len(parameters)
    return Calibration(
        "accelerometer_triad",
        tuple(e.name for e in effects),
        tuple(p.name for p in parameters),
        tuple(p.unit for p in parameters),
        tuple(p.display_unit for p in parameters),
        sigma * rng.standard_normal(n),
        np.diag((0.01 * sigma) ** 2),
        {},
        dict(data),
        (),
        no_history(n),
    )


class Rig:
    """A driver of an IMU and a reader of what the node makes of it."""

    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("rig", context=self.context)
        self.executor = EventsExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.out: dict[int, Imu] = {}
        self.raw = self.node.create_publisher(Imu, "/imu/data_raw", STREAM)
        self.heat = self.node.create_publisher(Temperature, "/imu/temperature", STREAM)
        self.listener = self.node.create_subscription(Imu, "/imu/data", self._take, STREAM)
        self.reload = self.node.create_client(Trigger, "/compensate/reload")
        self.set = self.node.create_client(SetParameters, "/compensate/set_parameters")

    def _take(self, message: Imu) -> None:
        self.out[to_ns(message.header.stamp)] = message

    def spin_until(self, condition, what: str) -> None:
        begun = time.monotonic()
        while not condition():
            assert time.monotonic() - begun < DEADLINE_S, what
            self.executor.spin_until_future_complete(Future(), 0.02)

    def call(self, client, request):
        self.spin_until(client.service_is_ready, f"{client.srv_name} is there")
        answer = client.call_async(request)
        self.spin_until(answer.done, f"answer of {client.srv_name}")
        return answer.result()

    def use(self, path: Path):
        value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=str(path))
        self.call(self.set, SetParameters.Request(parameters=[Parameter(name="result", value=value)]))
        return self.call(self.reload, Trigger.Request())


@pytest.fixture
def rig(bench: FitSession) -> Iterator[Rig]:  # noqa: ARG001 (for its domain)
    rig = Rig()
    yield rig
    rig.executor.shutdown()
    rig.node.destroy_node()
    rig.context.try_shutdown()


def test_the_node_compensates_as_the_core_does_and_keeps_a_good_result(bench: FitSession, rig: Rig) -> None:
    first, second = drawn(1), drawn(2)
    for name, result in (("first", first), ("second", second)):
        write_result(bench.folder / name / "result.json", result)
    broken = bench.folder / "broken.json"
    broken.write_text('{"format": "sdimu-result/1"}', encoding="utf-8")
    bench.children.start(
        "compensate", "sdimu_calibration.nodes.compensate_node", {"result": str(bench.folder / "first")}
    )
    rng = np.random.default_rng(3)
    n = 90
    omega, force = rng.standard_normal((n, 3)), 10.0 * rng.standard_normal((n, 3))
    stamps = START_NS + INTERVAL_NS * np.arange(1, n + 1)
    messages = encode_imu(stamps, omega, force, "imu_link")

    def send(rows: range) -> None:
        for k in rows:
            rig.raw.publish(messages[k])
        rig.spin_until(lambda: int(stamps[rows[-1]]) in rig.out, "samples come back")

    rig.spin_until(lambda: rig.raw.get_subscription_count() > 0 and rig.listener is not None, "the node listens")
    rig.spin_until(lambda: rig.node.count_publishers("/imu/data") > 0, "the node offers")
    rig.executor.spin_until_future_complete(Future(), 1.0)  # both ends of a match are not made at once
    send(range(30))
    answer = rig.use(broken)
    assert not answer.success
    assert "broken.json" in answer.message
    assert "stays" in answer.message
    send(range(30, 60))
    assert rig.use(bench.folder / "second").success
    send(range(60, 90))

    assert sorted(rig.out) == stamps.tolist(), "every sample, with its stamp"
    imu, t = load_imu("dtg"), np.arange(1, n + 1) * 0.01
    for result, rows in ((first, range(60)), (second, range(60, 90))):
        expected = compensate(compensator(result, imu), t, 0.01, omega, force)
        for k in rows:
            found = rig.out[int(stamps[k])]
            rate, acceleration = found.angular_velocity, found.linear_acceleration
            np.testing.assert_allclose([rate.x, rate.y, rate.z], expected.omega_ib_b[k], rtol=1e-12)
            np.testing.assert_allclose([acceleration.x, acceleration.y, acceleration.z], expected.f_ib_b[k], rtol=1e-12)
            np.testing.assert_allclose(
                found.angular_velocity_covariance, expected.omega_covariance[k].ravel(), rtol=1e-9, atol=1e-25
            )
            np.testing.assert_allclose(
                found.linear_acceleration_covariance, expected.f_covariance[k].ravel(), rtol=1e-9, atol=1e-20
            )
            assert found.header.frame_id == "imu_accelerometer_triad"
            assert found.orientation_covariance[0] == -1.0


def test_samples_of_no_time_of_the_test_are_left_out(bench: FitSession, rig: Rig) -> None:
    """One stamped days ahead went out as it came, ended the stream at once, and moved all that hangs on time."""
    result = drawn(6)
    write_result(bench.folder / "result.json", result)
    bench.children.start("compensate", "sdimu_calibration.nodes.compensate_node", {"result": str(bench.folder)})
    rng = np.random.default_rng(7)
    n, day = 60, 86_400 * 10**9
    omega, force = rng.standard_normal((n, 3)), 10.0 * rng.standard_normal((n, 3))
    stamps = START_NS + INTERVAL_NS * np.arange(1, n + 1)
    sent = stamps.copy()
    # The first sample, one, and three in a row.
    strays = np.array([0, 20, 40, 41, 42])
    sent[strays] += np.array([-9, 3, 5, 5, 5]) * day
    rig.spin_until(lambda: rig.raw.get_subscription_count() > 0, "the node listens")
    rig.spin_until(lambda: rig.node.count_publishers("/imu/data") > 0, "the node offers")
    rig.executor.spin_until_future_complete(Future(), 1.0)  # both ends of a match are not made at once
    for message in encode_imu(sent, omega, force, "imu_link"):
        rig.raw.publish(message)
    rig.spin_until(lambda: int(stamps[-1]) in rig.out, "samples come back")
    kept = np.setdiff1d(np.arange(n), strays)
    assert sorted(rig.out) == stamps[kept].tolist()
    expected = compensate(compensator(result, load_imu("dtg")), np.arange(1, n + 1) * 0.01, 0.01, omega, force)
    for k in kept.tolist():
        rate = rig.out[int(stamps[k])].angular_velocity
        np.testing.assert_allclose([rate.x, rate.y, rate.z], expected.omega_ib_b[k], rtol=1e-12)


def test_the_node_follows_the_temperature_by_its_polynomial(bench: FitSession, rig: Rig) -> None:
    warm = (
        "gyro_scale_temperature",
        "gyro_bias_temperature_squared",
        "accel_misalignment_temperature_cubed",
        "accel_bias_temperature_rate",
    )
    result = drawn(4, *warm, start_temperature_degc=25.0)
    write_result(bench.folder / "warm" / "result.json", result)
    given = {"result": str(bench.folder / "warm")}
    bench.children.start("compensate", "sdimu_calibration.nodes.compensate_node", given)
    rng = np.random.default_rng(5)
    n, degc = 20, (-20.0, -16.0)
    omega, force = rng.standard_normal((n, 3)), 10.0 * rng.standard_normal((n, 3))
    stamps = START_NS + INTERVAL_NS * np.arange(1, n + 1)
    messages = encode_imu(stamps, omega, force, "imu_link")
    rig.spin_until(lambda: rig.raw.get_subscription_count() > 0, "the node listens")
    rig.spin_until(lambda: rig.heat.get_subscription_count() > 0, "the node listens to the temperature")
    rig.spin_until(lambda: rig.node.count_publishers("/imu/data") > 0, "the node offers")
    rig.executor.spin_until_future_complete(Future(), 1.0)  # both ends of a match are not made at once
    # A minute apart, so that the rate is their difference over it.
    for at, value in zip((START_NS - 60 * 10**9, START_NS), degc, strict=True):
        rig.heat.publish(Temperature(header=header(at, "imu_link"), temperature=value))
    rig.executor.spin_until_future_complete(Future(), 0.5)  # another topic: nothing orders it before the samples
    for message in messages:
        rig.raw.publish(message)
    rig.spin_until(lambda: int(stamps[-1]) in rig.out, "samples come back")

    using = compensator(result, load_imu("dtg"), has_temperature=True)
    assert not using.left_out
    heat = (np.full(n, degc[1] - 25.0), np.full(n, (degc[1] - degc[0]) / 60.0))
    expected = compensate(using, np.arange(1, n + 1) * 0.01, 0.01, omega, force, heat)
    for k, stamp in enumerate(stamps.tolist()):
        rate, acceleration = rig.out[stamp].angular_velocity, rig.out[stamp].linear_acceleration
        np.testing.assert_allclose([rate.x, rate.y, rate.z], expected.omega_ib_b[k], rtol=1e-12)
        np.testing.assert_allclose([acceleration.x, acceleration.y, acceleration.z], expected.f_ib_b[k], rtol=1e-12)


def test_the_node_leaves_with_one_line_when_its_first_result_is_no_good(bench: FitSession) -> None:
    bench.children.start("compensate", "sdimu_calibration.nodes.compensate_node", {"result": "nowhere.json"})
    said: list[str] = []

    def failed() -> bool:
        try:
            return not bench.children.running()
        except DataError as error:
            said.append(str(error))
            return True

    bench.wait(failed, "failure")
    assert "nowhere.json: no such file" in said[0]
