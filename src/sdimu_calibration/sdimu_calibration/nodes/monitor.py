"""What a person watching a test wants to know, taken from its topics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from sdimu_calibration.nodes.adding import ANSWER_S, ask_to_add
from sdimu_calibration.nodes.credits import HISTORY, LATCHED, NS, to_ns
from sdimu_calibration.nodes.diagnosis_messages import seen_diagnosis, seen_heat_map
from sdimu_calibration.report.live_seen import Progress
from sdimu_calibration.report.live_text import SeenChoice
from sdimu_calibration.storage.bags.status_message import first_entry, phase_entry, stamp_ns

# Watching must never hold up what is watched.
GLANCE = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class Monitor:
    """Listens to a running test inside the process that shows it; close it after use.

    Parameters
    ----------
    start_ns : int, optional
        Stamp of the begin of the test; without it that of the first status that is heard.
    first : mapping of str to float, optional
        Sigma (SI) by coefficient at the start of the test; without it the first that is published.
    """

    def __init__(self, start_ns: int | None = None, first: Mapping[str, float] | None = None) -> None:
        self.progress = Progress(first=dict(first or {}))
        self._start_ns = start_ns
        self._context = Context()
        # Ctrl-C belongs to the command line.
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node("monitor", context=self._context)
        self._node.create_subscription(DiagnosticArray, "rate_table/status", self._take_status, GLANCE)
        self._node.create_subscription(JointState, "calibration/coefficients", self._take_coefficients, GLANCE)
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._take_diagnostics, GLANCE)
        self._node.create_subscription(DiagnosticArray, "calibration/diagnosis", self._take_diagnosis, HISTORY)
        self._node.create_subscription(Float64MultiArray, "calibration/heat_map", self._take_heat_map, LATCHED)
        self._node.create_subscription(DiagnosticArray, "adaptive/choice", self._take_choice, HISTORY)
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._never = Future()

    def listen(self, seconds: float) -> Progress:
        """Listen for a while; the progress now."""
        self._executor.spin_until_future_complete(self._never, seconds)
        return self.progress

    def left(self) -> bool:
        """Tell whether a test that was heard has nodes no more."""
        topics = ("rate_table/status", "calibration/coefficients")
        return self.progress.heard and not any(self._node.count_publishers(topic) for topic in topics)

    def add(self, effects: Sequence[str], seconds: float = ANSWER_S) -> str:
        """Let the calibration node take effects into the model; why it did not, empty when it did.

        As `ask_to_add`.
        """
        for answer in ask_to_add(self._node, effects, seconds):
            if answer is not None:
                return answer
            self.listen(0.05)
        return ""

    def close(self) -> None:
        """Leave the domain."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def _take_status(self, message: DiagnosticArray) -> None:
        self.progress.heard = True
        entry = phase_entry(stamp_ns(message), *first_entry(message))
        if entry is None:
            return
        stamp, dwell, stop = entry
        if self._start_ns is None:
            self._start_ns = stamp
        self.progress.phase = "dwell" if dwell else "rotating"
        self.progress.stop = max(stop, 0)
        self.progress.table_s = (stamp - self._start_ns) / NS

    def _take_coefficients(self, message: JointState) -> None:
        self.progress.heard = True
        if self._start_ns is not None:
            self.progress.filter_s = (to_ns(message.header.stamp) - self._start_ns) / NS
        self.progress.sigmas = dict(zip(message.name, message.effort, strict=True))
        for name, sigma in self.progress.sigmas.items():
            # Those of an effect that is added come later than the others.
            self.progress.first.setdefault(name, sigma)

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        self.progress.heard = True
        for status in message.status:
            values = {entry.key: entry.value for entry in status.values}
            if status.name == "calibration" and "verdict" in values:
                self.progress.verdict = values["verdict"]
                nis = {key: value for key, value in values.items() if key.startswith(_NIS)}
                self.progress.nis = {key.removeprefix(_NIS): float(value) for key, value in nis.items()}
                if self.progress.nis and "stop" in values:
                    self.progress.nis_by_stop[int(values["stop"])] = self.progress.nis

    def _take_heat_map(self, message: Float64MultiArray) -> None:
        self.progress.heard = True
        self.progress.diagnosis = seen_heat_map(message, self.progress.diagnosis)

    def _take_diagnosis(self, message: DiagnosticArray) -> None:
        self.progress.heard = True
        self.progress.diagnosis = found = seen_diagnosis(message, self.progress.diagnosis)
        if found.ladder:
            self.progress.ladders[found.stop] = found.ladder

    def _take_choice(self, message: DiagnosticArray) -> None:
        for status in message.status:
            values = {entry.key: entry.value for entry in status.values}
            choice = SeenChoice(status.message, float(values["minutes"]), float(values["worst"]))
            self.progress.choices.append(choice)


_NIS = "stop_nis_"
