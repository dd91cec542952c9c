"""Node of the simulated IMU: true motion of the table in, samples out.

Parameters: imu, site, plan (for the truth file only), temperature (names or paths), mount ("X,Y,Z" in deg; empty
draws it up to mount_max_deg), seed, rate_hz, effects (list of NAME=VALUE), truth_file (written at the start), frame_id,
consumers (how many must have granted a credit on the IMU before this node grants one to the table), patience_s (a
consumer that was killed is waited for so long, and its successor gets the last `KEPT` samples again).
"""

from __future__ import annotations

import math
import time
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from sensor_msgs.msg import Imu, Temperature
from std_msgs.msg import Float64MultiArray

from rate_table_sim.nodes.motion_message import decode_motion
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.nodes.credits import LATCHED, NS, STREAM, Consumer, Producer, header, publish
from sdimu_calibration.nodes.parameters import Declare
from sdimu_calibration.nodes.spinning import run_node
from sdimu_calibration.nodes.ticking import Ticker
from sdimu_calibration.nodes.transform_type import transform_class
from sdimu_calibration.nodes.transforms import IDENTITY, PLATFORM, STATIC, TransformMessage
from sdimu_calibration.storage.bags.cdr import encode_imu
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site
from sdimu_sim.cli.options import mount_rad
from sdimu_sim.core.generator import ImuGenerator, ImuSamples
from sdimu_sim.core.platform import PlatformMotion
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.temperature import Thermometer
from sdimu_sim.core.truth import Truth
from sdimu_sim.temperature_file import load_temperature
from sdimu_sim.truth_file import write_truth

WINDOW_SAMPLES = 200
KEPT = 1000
PATIENT = QoSProfile(depth=KEPT, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Keeps more than a window: a successor finds all that its predecessor had not acknowledged."""
FAREWELL_S = 20.0
TRUE_MOTION = "rate_table/true_motion"


class SdimuNode:
    """Simulated IMU; see the module for its parameters."""

    def __init__(self) -> None:
        self.node = Node("sdimu")
        self.done = Future()
        declare = Declare(self.node)
        scenario = self._scenario(declare)
        truth_file = declare.text("truth_file", "", "file for the truth, written at the start; none when empty")
        self._needed = declare.integer("consumers", 0, "credits on the samples to wait for at the start", least=0)
        patience_s = declare.number("patience_s", 0.0, "wait so long for the successor of a killed consumer", least=0.0)
        stream = PATIENT if patience_s > 0.0 else STREAM
        self._frame = declare.text("frame_id", "imu_link", "frame_id of the samples")
        self._rate_hz = scenario.rate_hz
        profile = scenario.temperature
        self._thermometer = None if profile is None else Thermometer(profile, scenario.seed)
        imu = imu_truth(scenario)
        white = imu.gyro_white_noise, imu.accel_white_noise
        gyro, accel = (noise**2 * self._rate_hz * np.eye(3) for noise in white)
        self._covariances = gyro, accel
        self._generator = ImuGenerator(imu, scenario.site, self._rate_hz, scenario.seed, profile)
        _warm_up(ImuGenerator(imu, scenario.site, self._rate_hz, scenario.seed, profile))
        if truth_file:
            truth = Truth(
                imu,
                scenario.site,
                scenario.seed,
                self._rate_hz,
                scenario.plan.name,
                reference_degc=scenario.reference_degc,
            )
            write_truth(Path(truth_file), truth)

        self._ready: deque[tuple[int, Any, Any]] = deque()  # stamp, publisher, message: in the order of stamps
        self._motion_ns = self._last_ns = self._start_ns = 0
        self._next_temperature = 0
        self._over = False
        self._departed: float | None = None
        ticker = Ticker(self.node)
        window = round(WINDOW_SAMPLES / self._rate_hz * NS)
        self._imu = Producer(
            self.node,
            ticker,
            Imu,
            "imu/data_raw",
            window_ns=window,
            on_credit=self._pump,
            qos=stream,
            patience_s=patience_s,
        )
        # Without a profile there must be no publisher: the calibrator would wait for it.
        if self._thermometer is not None:
            self._temperature = self.node.create_publisher(Temperature, "imu/temperature", stream)
        self._place = self._transforms()
        # A message of motion is a block: each one is acknowledged.
        self._motion = Consumer(
            self.node, ticker, TRUE_MOTION, every=1, busy=lambda: bool(self._ready), on_end=self._take_end
        )
        self.node.create_subscription(Float64MultiArray, TRUE_MOTION, self._take_motion, STREAM)
        ticker.every(0.05, self._tick)

    def close(self) -> None:
        """Nothing to leave behind."""

    def _scenario(self, declare: Declare) -> Scenario:
        mount = declare.text("mount", "", "rotation of the IMU on the table: X,Y,Z (deg); drawn when empty")
        temperature = declare.text("temperature", "", "profile: name in config/temperature or path; none when empty")
        return Scenario(
            plan=load_plan(declare.text("plan", "kim18", "plan that the truth file names")),
            imu=load_imu(declare.text("imu", "dtg", "IMU from which the errors are drawn: name or path")),
            site=load_site(declare.text("site", "daejeon", "site: name in config/site or path")),
            rate_hz=declare.number("rate_hz", 100.0, "samples a second", least=1.0, most=10000.0),
            seed=declare.integer("seed", 1, "of errors, mount and noise", least=0),
            mount_rad=mount_rad(mount) if mount else None,
            mount_max_rad=math.radians(
                declare.number("mount_max_deg", 3.0, "largest drawn rotation of the IMU (deg)", least=0.0, most=180.0)
            ),
            effects=tuple(declare.texts("effects", [], "hidden effects: NAME=VALUE")),
            temperature=load_temperature(temperature) if temperature else None,
        )

    def _transforms(self) -> Any:
        """Offer where the IMU is on the table, for RViz; None where the type cannot be had."""
        try:
            return self.node.create_publisher(transform_class(), STATIC, LATCHED)
        except ImportError as error:
            self.node.get_logger().warning(f"no transform for RViz: {error}")
            return None

    def _take_motion(self, message: Float64MultiArray) -> None:
        """Make the samples of a block of motion and queue them."""
        self._start_ns, t, q_nt, omega_nt_t = decode_motion(message)
        if self._place is not None and not self._motion_ns:
            self._place.publish(TransformMessage([(PLATFORM, self._frame)]).encode(self._start_ns, [IDENTITY]))
        samples = self._samples(PlatformMotion(t, q_nt, omega_nt_t))
        stamps = self._start_ns + samples.ns
        encoded = encode_imu(stamps, samples.omega_ib_b, samples.f_ib_b, self._frame, self._covariances)
        queue: list[tuple[int, Any, Any]] = [
            (stamp, self._imu, raw) for stamp, raw in zip(stamps.tolist(), encoded, strict=True)
        ]
        queue.extend(self._temperatures(float(t[-1])))
        queue.sort(key=lambda entry: (entry[0], entry[1] is self._imu))
        self._ready.extend(queue)
        self._motion_ns = self._start_ns + round(float(t[-1]) * NS)
        self._pump()

    def _samples(self, motion: PlatformMotion) -> ImuSamples:
        """Make the samples of a block of motion; two tables in one domain are told by what they break."""
        try:
            return self._generator.advance(motion)
        except DataError as error:
            topic = self._motion.topic
            if self.node.count_publishers(topic) > 1:
                raise DataError(f"a second table publishes {topic}: end one, or use another ROS_DOMAIN_ID") from error
            raise

    def _temperatures(self, until_s: float) -> list[tuple[int, Any, Any]]:
        """Temperatures at 1 Hz up to a time."""
        if self._thermometer is None:
            return []
        seconds = np.arange(self._next_temperature, int(until_s + 1e-9) + 1)
        self._next_temperature += len(seconds)
        entries = []
        for second, value in zip(seconds.tolist(), self._thermometer.read(seconds.astype(float)).tolist(), strict=True):
            stamp = self._start_ns + second * NS
            message = Temperature(header=header(stamp, self._frame), temperature=value)
            entries.append((stamp, self._temperature, message))
        return entries

    def _pump(self) -> None:
        """Send what credits allow; the table gets its credit when all of its motion has become samples."""
        limit = self._imu.limit_ns
        while self._ready and self._ready[0][0] <= limit:
            stamp, target, message = self._ready.popleft()
            if target is self._imu:
                self._imu.publish(message, stamp)
                self._last_ns = stamp
            else:
                publish(target, message)
        if not self._ready and self._motion_ns > self._motion.reached_ns:
            self._motion.reached(self._motion_ns)

    def _take_end(self) -> None:
        self._over = True

    def _tick(self) -> None:
        if self._imu.heard_by(self._needed):
            self._motion.ready()
        if not self._over or self._ready:
            self._pump()
            return
        if self._departed is None:
            self._departed = time.monotonic()
            self._imu.end(self._last_ns)
        late = time.monotonic() - self._departed > FAREWELL_S
        if (self._imu.acknowledged or late) and not self.done.done():
            self.done.set_result(None)


def _warm_up(generator: ImuGenerator) -> None:
    """Compile what is compiled on its first use."""
    t = np.linspace(0.0, 0.5, 6)
    generator.advance(PlatformMotion(t, np.tile([1.0, 0.0, 0.0, 0.0], (6, 1)), np.zeros((6, 3))))


def main() -> None:
    """Run the node."""
    run_node(SdimuNode)


if __name__ == "__main__":
    main()
