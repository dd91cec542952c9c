"""Node that calibrates while the test runs.

Parameters: `ros2 param describe` tells them; `add` may be set while a test runs. With `stay`, what comes after the end
of a stream belongs to the same test until ~/reset, and the next end is answered again.
Subscriptions (relative, remap them at will): imu/data_raw, rate_table/status, imu/temperature. Publications once a
second of data: calibration/coefficients, calibration/covariance, calibration/navigation, /diagnostics; every ten
seconds calibration/estimates, each coefficient with its sigma in customary units; at the end of each stop those of
`nodes.diagnosing`. Services: ~/save writes result.json from everything that has come, ~/reset forgets it.

A header stamp decides what happens, never the order of arrival. At the end of the stream the whole test is opened and
calibrated once more as `sdimu calibrate` does it; the last coefficients and covariance are that result. On the way
the filter waits until the first turns tell unit and sign of the gyros; with both stated it starts at once.

Samples, status and temperatures go into a journal before they are acknowledged. A node that is started in the folder of
one that was killed goes on with its journal; what it missed in between is a gap, unless the producer kept it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from sensor_msgs.msg import Imu, JointState, Temperature
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from sdimu_calibration.core.arrays import Ints
from sdimu_calibration.core.data.axes_and_units import Stated
from sdimu_calibration.core.effects.imu_model import prior_sigmas
from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.core.live import NS, EpochEstimate, LiveCalibration
from sdimu_calibration.core.live_model import live_model
from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import Model
from sdimu_calibration.nodes import calibration_messages as messages
from sdimu_calibration.nodes.credits import BLOCK, STREAM, Consumer, Producer, publish
from sdimu_calibration.nodes.diagnosing import Diagnosing
from sdimu_calibration.nodes.diagnosis_worker import WorkerSetup
from sdimu_calibration.nodes.feed import Feed
from sdimu_calibration.nodes.heartbeat import Heartbeat
from sdimu_calibration.nodes.listening import Listener
from sdimu_calibration.nodes.opening_parameters import declare_frames, declare_opening
from sdimu_calibration.nodes.parameters import Declare
from sdimu_calibration.nodes.spinning import run_node
from sdimu_calibration.nodes.ticking import Ticker
from sdimu_calibration.report.live_text import model_name
from sdimu_calibration.report.progress_text import falling, light, sigma_words
from sdimu_calibration.storage.bags.status_message import first_entry, phase_entry, stamp_ns
from sdimu_calibration.storage.files.config import load_model
from sdimu_calibration.storage.files.effect_file import effect_files
from sdimu_calibration.storage.files.journal import JOURNAL, Journal, digest
from sdimu_calibration.storage.files.model_choice import model_word, named_model
from sdimu_calibration.storage.files.result_file import write_result
from sdimu_calibration.storage.files.whole_file import written_together

SETTLE_S = 5.0
"""Time (s) after the end of the samples for which the last status is awaited: a lost packet is sent again after 3 s."""
FAREWELL_S = 10.0
CATCH_UP_S = 0.025
"""Time (s) between two ticks for a filter that is made anew: half of it, the other half is for samples."""
DIAGNOSIS_S = 120.0
"""Time (s) after the result for which the last diagnosis is awaited: minutes are a day of data."""
REPORT_S = 900.0
"""Time (s) after the result for which its files are awaited: the diagnosis is made twice, the second time in full."""
GRAVITY = 9.8
_NEARLY_NS = 1_000
"""A status this much before the last sample is the one that belongs to it (ns)."""


class CalibrationNode:
    """Calibrates live; see the module for its parameters."""

    def __init__(self) -> None:
        self.node = Node("calibration")
        self.done = Future()
        declare = Declare(self.node)
        self._options, self._topics = declare_opening(self.node)
        self._base = model = declare.text(
            "model", "", "model to estimate: name in config/model or path; empty: baseline (handheld: hand)"
        )
        added = tuple(declare.texts("add", [], "effects beyond the model's: names, equations or files", live=True))
        self._models = self._checked = _models(model, added)
        self._out = Path(declare.text("out", ".", "folder of result.json and of the journal"))
        self._stay = declare.flag("stay", False, "do not leave at the end of the stream")
        _warm_up(self._options, self._models[0])
        # The text of an effect file too: its name says little of what it computes.
        texts = [file.read_text() for file in effect_files(added)]
        options = digest(self._options, load_model(model_word(model, handheld=False)), added, texts)
        checkpoint = declare.flag("checkpoint", True, "keep a journal with which a successor goes on")
        self._frames = declare_frames(declare)
        beat_s = declare.number("heartbeat_s", 1.0, "wall time between heartbeats (s); 0: none", least=0.0)
        self._journal = Journal(self._out / JOURNAL, options, lasting=checkpoint)
        if aside := self._journal.set_aside:
            self.node.get_logger().warning(f"{self._out / JOURNAL}: {self._journal.why_aside}; kept as {aside}")
        self._first: dict[str, float] = {}
        self._feed = Feed(self._make, self._journal)
        resumed = self._feed.resumed_ns
        self._ended: float | None = None
        self._result: Calibration | None = None
        self._concluded = 0.0
        self._departed: float | None = None
        self._last = ""

        ticker = Ticker(self.node)
        node = self.node
        self._coefficients = Producer(node, ticker, JointState, "calibration/coefficients")
        self._covariance = node.create_publisher(Float64MultiArray, "calibration/covariance", STREAM)
        self._navigation = node.create_publisher(Odometry, "calibration/navigation", STREAM)
        self._estimates = node.create_publisher(DiagnosticArray, "calibration/estimates", STREAM)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", STREAM)
        self._save = node.create_service(Trigger, "~/save", self._answer_save)
        self._reset = node.create_service(Trigger, "~/reset", self._answer_reset)
        self._stream = Consumer(node, ticker, self._topics.imu, on_end=self._take_end)
        self._listeners = (
            Listener(node, ticker, DiagnosticArray, self._topics.status, self._take_status, late=bool(resumed)),
            Listener(node, ticker, Temperature, self._topics.temperature, self._take_temperature, late=bool(resumed)),
            Listener(node, ticker, Imu, self._topics.imu, self._take_imu, raw=True, late=bool(resumed)),
        )
        diagnose = declare.flag("diagnose", True, "publish a diagnosis at the end of each stop")
        report = declare.flag("report", False, "with diagnose: leave diagnosis.json and report.html at the end")
        self._patience_s = REPORT_S if report else DIAGNOSIS_S
        place = self._out if report else None
        setup = WorkerSetup(self._journal.place, self._options, model, report=place) if diagnose else None
        self._diagnosing = Diagnosing(node, setup, added, self._warn)
        node.add_on_set_parameters_callback(self._check_added)
        node.add_post_set_parameters_callback(self._take_added)
        if resumed:
            self._catch_up(resumed)
        ticker.every(0.05, self._tick)
        self._heartbeat = Heartbeat(node, ticker, self._diagnostics, beat_s, lambda: self._feed.imu_ns)
        self._stream.ready()

    def close(self) -> None:
        """Leave the journal to a successor, unless the test is over: then there is nothing to go on with."""
        self._diagnosing.close()
        if self._departed is None and self._result is None:
            self._journal.close()
        else:
            self._journal.remove()

    def _catch_up(self, resumed_ns: int) -> None:
        """Bring the filter to where its predecessor was; what that published is not published again."""
        count = self._feed.resumed_s + sum(1 for _ in self._feed.process(True, False))
        self._stream.reached(resumed_ns, 0)
        self.node.get_logger().info(f"goes on after {count} s from {self._out / JOURNAL}")

    def _make(self) -> LiveCalibration:
        # What was there before an effect is added stays measured against the start of the test.
        model = self._models[0]
        self._first = {**prior_sigmas(live_model(self._options, model).asked, model.body_frame), **self._first}
        return LiveCalibration(self._options, *self._models)

    def _check_added(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse effects that cannot be added, with the line that the command line says."""
        try:
            for parameter in parameters:
                if parameter.name == "add":
                    models = _models(self._base, _effects(parameter))
                    LiveCalibration(self._options, *models)
                    self._checked = models
        except Exception as error:
            # Whatever is asked, the test goes on.
            what = str(error) if isinstance(error, DataError) else f"add: {type(error).__name__}: {error}"
            return SetParametersResult(successful=False, reason=one_line(what))
        return SetParametersResult(successful=True)

    def _take_added(self, parameters: list[Parameter]) -> None:
        """Go on with other effects in the model."""
        for parameter in parameters:
            if parameter.name == "add":
                added = _effects(parameter)
                # As it was checked: its files may have changed since.
                self._models = self._checked
                self._feed.begin_again()
                self._diagnosing.change_model(added)
                self.node.get_logger().info(f"model {model_name(added)}: the filter begins again from the journal")

    def _take_imu(self, message: bytes) -> None:
        if self._stay and self._departed is not None:
            self._ended = self._departed = self._result = None  # the test goes on
        self._feed.take_imu(message)
        if self._feed.waiting >= BLOCK:
            self._work()

    def _take_status(self, message: DiagnosticArray) -> None:
        entry = phase_entry(stamp_ns(message), *first_entry(message))
        if entry is None:
            text = f"{self._topics.status}: a message that says neither dwell nor rotating is ignored"
            self.node.get_logger().warning(text, once=True)
            return
        self._feed.take_status(*entry)

    def _take_temperature(self, message: Temperature) -> None:
        self._feed.take_temperature(stamp_ns(message), float(message.temperature))

    def _work(self) -> None:
        """Decode, process, publish, and grant a credit for what has been taken."""
        count = self._feed.waiting
        reached = self._feed.decode()
        published = self._published(self._topics.status), self._published(self._topics.temperature)
        for estimate in self._feed.process(*published):
            self._publish(estimate)
        self._tell_notes()
        if reached and count:
            self._stream.reached(reached, count)

    def _published(self, topic: str) -> bool:
        # Counting does not follow remappings by itself.
        return bool(self.node.count_publishers(self.node.resolve_topic_name(topic)))

    def _publish(self, e: EpochEstimate) -> None:
        self._diagnosing.take(e)
        self._publish_coefficients(e.ns, e.body_frame, e.names, e.coefficients, e.covariance)
        publish(self._navigation, messages.navigation(e.ns, e, *self._frames))
        publish(self._diagnostics, messages.diagnostics(e.ns, e, self._heartbeat.name))
        if e.ns // NS % messages.ESTIMATES_EVERY_S == 0:
            publish(self._estimates, messages.estimates(e.ns, e.names, e.coefficients, e.covariance, e.display_units))
        self._tell(e)

    def _tell_notes(self) -> None:
        """Log and publish what the filter on the way waits for, recognised or gave up."""
        for note in self._feed.notes():
            self._warn(note)

    def _warn(self, text: str) -> None:
        self.node.get_logger().warning(text)
        # Before the first sample there is no stamp.
        publish(self._diagnostics, messages.notice(max(self._feed.imu_ns, 0), text, self._heartbeat.name))

    def _tell(self, e: EpochEstimate) -> None:
        """Log one line at the end of each stop: how far the sigmas have fallen, and the innovations."""
        sigmas = dict(zip(e.names, np.sqrt(np.diag(e.covariance)).tolist(), strict=True))
        if e.used:
            units = dict(zip(e.names, e.display_units, strict=True))
            effects = [effect if isinstance(effect, str) else effect.key for effect in self._models[0].effects]
            words = sigma_words(falling(self._first, sigmas, units, effects))
            self._last = f"stop {e.stop} after {e.t:.0f} s; {words}; {light(e.stop_nis, e.verdict)}"
        elif self._last and not e.dwell:
            self.node.get_logger().info(self._last)
            self._last = ""

    def _publish_coefficients(self, stamp: int, frame: str, names: tuple[str, ...], values: Any, P: Any) -> None:
        # Covariance first: the end of the coefficients is the end of everything.
        publish(self._covariance, messages.covariance_matrix(stamp, names, P))
        self._coefficients.publish(messages.coefficients(stamp, frame, names, values, P), stamp)

    def _tick(self) -> None:
        self._work()
        self._take_model(CATCH_UP_S)
        self._diagnosing.tick(self._feed.imu_ns)
        if self._result is not None and self._departed is None:
            if self._diagnosing.idle or time.monotonic() - self._concluded > self._patience_s:
                self._depart(self._result)
        elif self._ended is not None and self._departed is None:
            status = self._feed.status
            complete = status.heard is None or (status.latest_ns or 0) >= self._feed.imu_ns - _NEARLY_NS
            if complete or time.monotonic() - self._ended > SETTLE_S:
                self._conclude()
        if self._departed is not None and not self._stay and not self.done.done():
            late = time.monotonic() - self._departed > FAREWELL_S
            if self._coefficients.acknowledged or late:
                self.done.set_result(None)

    def _take_model(self, seconds: float = math.inf) -> None:
        """Work for so long (s) on the filter with a model that was changed; go on with it once it is there."""
        if self._feed.catch_up(seconds):
            self.node.get_logger().info("the filter on the way has the new model")

    def _take_end(self) -> None:
        self._ended, self._departed, self._result = time.monotonic(), None, None

    def _conclude(self) -> None:
        """Calibrate on the whole test, and write that; meanwhile its diagnosis is made."""
        self._take_model()
        for estimate in self._feed.process(False, False, final=True):
            self._publish(estimate)
        self._tell_notes()
        try:
            self._result, self._concluded = self._write_result(), time.monotonic()
        except DataError as error:
            # The journal stays: it is all that there is of a test whose result could not be made.
            if self._stay:
                self._departed = time.monotonic()
                self.node.get_logger().error(str(error))
            elif not self.done.done():
                self.done.set_exception(error)
        # A report is of the result beside it.
        self._diagnosing.end()

    def _depart(self, result: Calibration) -> None:
        """Publish the result as the last word."""
        stamp = self._feed.imu_ns
        units = result.display_units
        publish(self._estimates, messages.estimates(stamp, result.names, result.values, result.covariance, units))
        self._publish_coefficients(stamp, result.body_frame, result.names, result.values, result.covariance)
        self._coefficients.end(stamp)
        self._departed = time.monotonic()

    def _write_result(self) -> Calibration:
        result = self._feed.finish()
        with written_together(self._out) as part:
            write_result(part / "result.json", result)
        return result

    def _answer_save(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        try:
            self._take_model()
            self._write_result()
            self._diagnosing.report()
            response.success, response.message = True, str(self._out / "result.json")
        except (DataError, OSError) as error:
            response.success, response.message = False, str(error)
        return response

    def _answer_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._journal.restart()
        self._feed = Feed(self._make, self._journal)
        self._stream.restart()
        self._diagnosing.restart()
        self._ended = self._departed = self._result = None
        self._last = ""
        response.success = True
        return response


def _effects(parameter: Parameter) -> tuple[str, ...]:
    """Effects that the parameter `add` names."""
    return tuple(str(effect) for effect in parameter.value or () if effect)


def _models(word: str, added: Sequence[str]) -> tuple[Model, Model]:
    """Read the model of the filter on the way, and that of the end where it finds a run by hand."""
    return named_model(word, added), named_model(word, added, handheld=True)


def _warm_up(options: OpeningOptions, model: Model) -> None:
    """Compile, or load from the cache, everything that a test at rest uses."""
    live = LiveCalibration(replace(options, stated=Stated(1.0, 1.0, 1, 1)), model)
    ns: Ints = np.arange(1, 401) * (NS // 10)
    live.add_phase(0, True, 0)
    live.add_samples(ns, np.full((len(ns), 3), 4e-5), np.tile([0.0, 0.0, -GRAVITY], (len(ns), 1)))
    live.advance(int(ns[-1]), True)


def main() -> None:
    """Run the node."""
    run_node(CalibrationNode)


if __name__ == "__main__":
    main()
