"""Node that takes the errors out of samples: imu/data_raw to imu/data.

Parameters: result (result.json or its folder), imu (name or path: its white noise goes into the covariances), effects
(YAML files of effects of one's own that the result has), frame_id (imu_ and the body frame by default), same_start
(functions of time hold because the IMU was switched on as in the calibration), start_temperature (deg C, where the
result does not say it; NaN: as the result says), stay (do not leave at the end of the stream).
Service ~/reload (std_srvs/Trigger) reads the result again, by the parameters as they are then; when it cannot be used
the answer says why and the result in use stays.

Every sample that comes goes out, with its stamp, but those whose stamp is of no time of the test. The first ones wait
for the fourth: their stamps tell that time, and the sample interval.
"""

from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node
from rclpy.task import Future
from sensor_msgs.msg import Imu, Temperature
from std_srvs.srv import Trigger

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.compensation import Compensator, compensate, compensator, heat_since
from sdimu_calibration.core.data.recent_log import RecentLog
from sdimu_calibration.core.data.stray_stamps import Block, StampSieve, stray_note
from sdimu_calibration.core.recording import NOMINAL_FROM, DataError, TemperatureLog
from sdimu_calibration.nodes.credits import NS, Consumer, Producer, to_ns
from sdimu_calibration.nodes.listening import Listener
from sdimu_calibration.nodes.parameters import Declare
from sdimu_calibration.nodes.spinning import run_node
from sdimu_calibration.nodes.ticking import Ticker
from sdimu_calibration.storage.bags.cdr import LayoutError, Stamps, decode_imu
from sdimu_calibration.storage.bags.compensated_bag import encode_compensated, frame_of
from sdimu_calibration.storage.files.effect_file import effects_of_result
from sdimu_calibration.storage.files.result_file import noise_for, read_result

RAW, COMPENSATED, TEMPERATURE = "imu/data_raw", "imu/data", "imu/temperature"
FAREWELL_S = 10.0
START_TEMPERATURE = ParameterDescriptor(
    description="temperature from which changes count (deg C), where the result does not say it; NaN: as it says"
)
_REMEMBERED_NS = 300 * NS
"""Temperatures older than this no longer matter for value or rate."""


class CompensateNode:
    """Compensates live; see the module for its parameters."""

    def __init__(self) -> None:
        self.node = Node("compensate")
        self.done = Future()
        declare = Declare(self.node)
        # All but the last are live: ~/reload looks at them again.
        declare.text("result", "", "result.json or its folder", live=True)
        declare.text("imu", "", "IMU whose noise goes into the covariances; the calibrated one when empty", live=True)
        declare.texts("effects", [], "YAML files of effects of one's own that the result has", live=True)
        declare.text("frame_id", "", "frame_id of the samples; imu_ and the body frame when empty", live=True)
        declare.flag("same_start", False, "functions of time hold: switched on as in the calibration", live=True)
        self.node.declare_parameter("start_temperature", math.nan, START_TEMPERATURE)
        self._stay = declare.flag("stay", False, "do not leave at the end of the stream")
        self._start_ns: int | None = None
        self._stamps: list[int] = []
        self._interval = 0.0
        self._held: list[Block] = []
        self._sieve = StampSieve()
        self._heat = RecentLog(1)
        self._departed: float | None = None
        self._using, self._frame = self._load()
        ticker = Ticker(self.node)
        self._out = Producer(self.node, ticker, Imu, COMPENSATED)
        self._reload = self.node.create_service(Trigger, "~/reload", self._answer_reload)
        self._stream = Consumer(self.node, ticker, RAW, on_end=self._take_end)
        self._listeners = (
            Listener(self.node, ticker, Temperature, TEMPERATURE, self._take_temperature),
            Listener(self.node, ticker, Imu, RAW, self._take, raw=True),
        )
        ticker.every(0.1, self._leave)
        self._stream.ready()

    def close(self) -> None:
        """Nothing to leave behind."""

    def _load(self) -> tuple[Compensator, str]:
        """Read the result that the parameters name."""
        parameter = self.node.get_parameter
        path = str(parameter("result").value)
        if not path:
            raise DataError("compensate: parameter 'result' is empty (expected the path of a result.json)")
        calibration = read_result(Path(path))
        own = effects_of_result(calibration.model, [text for text in parameter("effects").value if text])
        start = float(parameter("start_temperature").value)
        specification, whose = noise_for(calibration, str(parameter("imu").value))
        using = compensator(
            calibration,
            specification,
            own=own,
            has_temperature=True,
            same_start=bool(parameter("same_start").value),
            start_temperature=None if math.isnan(start) else start,
        )
        logger = self.node.get_logger()
        logger.info(f"noise in the covariances is that of {whose}")
        for reason in using.left_out:
            logger.warning(f"not compensated: {reason}")
        return using, str(parameter("frame_id").value) or frame_of(calibration.body_frame)

    def _answer_reload(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            self._using, self._frame = self._load()
            response.success, response.message = True, str(self.node.get_parameter("result").value)
        except (DataError, OSError) as error:
            response.success, response.message = False, f"{error}; the result in use stays"
        return response

    def _take_temperature(self, message: Temperature) -> None:
        value = float(message.temperature)
        if not math.isfinite(value):
            return
        now = to_ns(message.header.stamp)
        self._heat.add(now, value)
        if self._heat.ns[0] < now - 2 * _REMEMBERED_NS:
            self._heat.keep(self._heat.ns > now - _REMEMBERED_NS)

    def _take(self, message: bytes) -> None:
        try:
            came = self._sieve.take(*decode_imu([message]))
        except LayoutError as error:
            self.node.get_logger().warning(f"{RAW}: a message cannot be read ({error}) and was dropped")
            return
        strays = self._sieve.strays()
        if len(strays):
            self.node.get_logger().warning(f"{RAW}: {stray_note(strays)}", once=True)
        self._held.append(came)
        if self._known_interval(came[0].tolist()):
            stamps, omega, force = (np.concatenate(part) for part in zip(*self._held, strict=True))
            self._held = []
            self._send_finite(stamps, omega, force)
        # Counted as they come, so that a credit means: taken and, but for what waits or is left out, sent on.
        self._stream.reached(self._reached_ns(), 1)

    def _reached_ns(self) -> int:
        """Newest stamp (ns) that was sent on; 0 while the first samples wait."""
        return 0 if self._held else max(self._sieve.newest_ns, 0)

    def _send_finite(self, stamps: Stamps, omega: Floats, force: Floats) -> None:
        finite = np.isfinite(omega).all(axis=1) & np.isfinite(force).all(axis=1)
        if not finite.all():
            self.node.get_logger().warning(f"{RAW}: samples that are not finite are dropped", once=True)
            stamps, omega, force = stamps[finite], omega[finite], force[finite]
        self._send(stamps, omega, force)

    def _known_interval(self, stamps: list[int]) -> bool:
        """Learn the nominal sample interval (s) from the first stamps (ns); False while there are too few."""
        if stamps and len(self._stamps) <= NOMINAL_FROM:
            self._stamps = [*self._stamps, *stamps][: NOMINAL_FROM + 1]
            steps = np.diff(self._stamps)
            if not (steps > 0).any():
                return False
            self._interval = float(np.median(steps[steps > 0])) / NS
        if self._start_ns is None and self._interval:
            self._start_ns = self._stamps[0] - round(self._interval * NS)
        return self._start_ns is not None

    def _send(self, stamps: Stamps, omega: Floats, force: Floats) -> None:
        assert self._start_ns is not None
        t: Floats = (stamps - self._start_ns).astype(np.float64) * 1e-9
        heat = None
        if self._using.start_temperature is not None and not len(self._heat.ns):
            text = f"no {TEMPERATURE} yet: taken to be the one from which the coefficients count"
            self.node.get_logger().warning(text, once=True)
        if len(self._heat.ns):
            log = TemperatureLog(self._heat.ns / NS, self._heat.values[:, 0])
            beyond = self._using.beyond(log.value[-1:])
            if beyond:
                self.node.get_logger().warning(beyond, throttle_duration_sec=60.0)
            middle = stamps / NS - 0.5 * self._interval
            heat = heat_since(log, middle, self._using.start_temperature, causal=True)
        try:
            done = compensate(self._using, t, self._interval, omega, force, heat)
        except DataError as error:
            self.node.get_logger().warning(f"sample dropped: {error}")
            return
        for stamp, message in zip(stamps.tolist(), encode_compensated(stamps, done, self._frame), strict=True):
            self._out.publish(message, stamp)

    def _take_end(self) -> None:
        self._departed = time.monotonic()
        self._out.end(self._stream.reached_ns)

    def _leave(self) -> None:
        if self._departed is None or self._stay or self.done.done():
            return
        if self._out.acknowledged or time.monotonic() - self._departed > FAREWELL_S:
            self.done.set_result(None)


def main() -> None:
    """Run the node."""
    run_node(CompensateNode)


if __name__ == "__main__":
    main()
