"""What a person watching a test wants to know, taken from its topics."""

from __future__ import annotations

from dataclasses import dataclass, field

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

from sdimu_calibration.nodes.credits import LATCHED, NS, to_ns
from sdimu_calibration.nodes.diagnosis_messages import seen_diagnosis, seen_heat_map
from sdimu_calibration.report.live_text import SeenDiagnosis
from sdimu_calibration.storage.bags.status_message import first_entry, phase_entry, stamp_ns

# Watching must never hold up what is watched.
GLANCE = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


@dataclass
class Progress:
    """How far a test is.

    Attributes
    ----------
    table_s, filter_s : float
        Data time that table and filter have reached (s after the first status).
    sigmas : dict of str to float
        Sigma (SI) by coefficient, as last published.
    first : dict of str to float
        The first sigma published.
    nis : dict of str to float
        Mean squared innovation per degree of freedom at the present stop, by channel.
    diagnosis : SeenDiagnosis
        The newest one; of stop -1 before the first.
    heard : bool
        Any message has come.
    """

    stop: int = 0
    phase: str = "starting"
    table_s: float = 0.0
    filter_s: float = 0.0
    sigmas: dict[str, float] = field(default_factory=dict)
    first: dict[str, float] = field(default_factory=dict)
    nis: dict[str, float] = field(default_factory=dict)
    verdict: str = ""
    diagnosis: SeenDiagnosis = field(default_factory=SeenDiagnosis)
    heard: bool = False


class Monitor:
    """Listens to a running test inside the process that shows it; close it after use."""

    def __init__(self) -> None:
        self.progress = Progress()
        self._start_ns: int | None = None
        self._context = Context()
        # Ctrl-C belongs to the command line.
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node("monitor", context=self._context)
        self._node.create_subscription(DiagnosticArray, "rate_table/status", self._take_status, GLANCE)
        self._node.create_subscription(JointState, "calibration/coefficients", self._take_coefficients, GLANCE)
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._take_diagnostics, GLANCE)
        self._node.create_subscription(DiagnosticArray, "calibration/diagnosis", self._take_diagnosis, LATCHED)
        self._node.create_subscription(Float64MultiArray, "calibration/heat_map", self._take_heat_map, LATCHED)
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._never = Future()

    def listen(self, seconds: float) -> Progress:
        """Listen for a while; the progress now."""
        self._executor.spin_until_future_complete(self._never, seconds)
        return self.progress

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
        if not self.progress.first:
            self.progress.first = dict(self.progress.sigmas)

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        self.progress.heard = True
        for status in message.status:
            values = {entry.key: entry.value for entry in status.values}
            if status.name == "calibration" and "verdict" in values:
                self.progress.verdict = values["verdict"]
                nis = {key: value for key, value in values.items() if key.startswith(_NIS)}
                self.progress.nis = {key.removeprefix(_NIS): float(value) for key, value in nis.items()}

    def _take_heat_map(self, message: Float64MultiArray) -> None:
        self.progress.heard = True
        self.progress.diagnosis = seen_heat_map(message, self.progress.diagnosis)

    def _take_diagnosis(self, message: DiagnosticArray) -> None:
        self.progress.heard = True
        self.progress.diagnosis = seen_diagnosis(message, self.progress.diagnosis)


_NIS = "stop_nis_"
