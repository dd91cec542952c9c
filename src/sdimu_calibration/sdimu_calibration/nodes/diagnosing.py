"""The live diagnosis on its topics: asked at the end of each stop, published and logged when it is there.

Publications: calibration/diagnosis (verdict, where, ranking and ladder for people), calibration/ranking (every
candidate with all digits), calibration/heat_map (channel by stop), calibration/picture (all of it, drawn).
"""

from __future__ import annotations

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from sensor_msgs.msg import CompressedImage, JointState
from std_msgs.msg import Float64MultiArray

from sdimu_calibration.core.live import EpochEstimate
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.nodes import diagnosis_messages as messages
from sdimu_calibration.nodes.credits import HISTORY, LATCHED, publish
from sdimu_calibration.nodes.diagnosis_worker import DIAGNOSIS, REPORT, Answer, WorkerRequest, WorkerSetup
from sdimu_calibration.nodes.live_diagnosis import Worker
from sdimu_calibration.report.live_text import diagnosis_line


class Diagnosing:
    """Diagnoses a running test: at the end of each stop, and again when the model has changed.

    Parameters
    ----------
    setup : WorkerSetup or None
        None where nothing is to be diagnosed.
    added : tuple of str
        Effects beyond the model that the test begins with.
    warn : callable
        Tells the user that there will be no more diagnoses, and why.
    """

    def __init__(
        self, node: Node, setup: WorkerSetup | None, added: tuple[str, ...], warn: Callable[[str], None]
    ) -> None:
        self._node, self._warn = node, warn
        self._worker = Worker(setup, node.get_logger().warning) if setup else None
        self._report = setup.report if setup else None
        self._models = [added]
        self._stop, self._rest_ns = 0, 0
        self._last: tuple[int, int | None] | None = None
        # Few and telling: who comes late gets them all.
        self._diagnosis = node.create_publisher(DiagnosticArray, "calibration/diagnosis", HISTORY)
        self._ranking = node.create_publisher(JointState, "calibration/ranking", HISTORY)
        self._heat_map = node.create_publisher(Float64MultiArray, "calibration/heat_map", HISTORY)
        self._picture = node.create_publisher(CompressedImage, "calibration/picture", LATCHED)

    @property
    def idle(self) -> bool:
        """Whether nothing is asked that is not answered."""
        return self._worker is None or self._worker.idle

    def take(self, e: EpochEstimate) -> None:
        """Note an epoch of the filter on the way; the first one of a turn ends the stop before it."""
        if e.used:
            self._stop, self._rest_ns = e.stop, e.ns
        elif not e.dwell and self._rest_ns:
            self._ask(self._stop, self._rest_ns)
            self._rest_ns = 0

    def end(self) -> None:
        """Ask for the diagnosis of everything, and for its files: ask once result.json is written."""
        self._rest_ns = 0
        self._ask(self._stop, None, report=True)

    def report(self) -> None:
        """Ask for the files of what there is, where the setup names a folder; result.json stands already."""
        if self._report is not None:
            self.end()

    def change_model(self, added: tuple[str, ...]) -> None:
        """Ask for the last diagnosis again, with other effects added; the ladder gets a rung."""
        self._models = [*(model for model in self._models if model != added), added]
        if self._last is not None:
            self._ask(*self._last)

    def restart(self) -> None:
        """Forget the test."""
        self._models, self._last = self._models[-1:], None
        self._stop, self._rest_ns = 0, 0

    def _ask(self, stop: int, until_ns: int | None, report: bool = False) -> None:
        self._last = stop, until_ns
        if self._worker is not None:
            self._worker.ask(WorkerRequest(stop, until_ns, tuple(self._models), report=report))

    def tick(self, newest_ns: int) -> None:
        """Publish a diagnosis once it is there; `newest_ns` is the stamp of one of everything."""
        if self._worker is None:
            return
        try:
            answer = self._worker.answer()
        except DataError as error:
            missing = f"; {self._report} gets no {DIAGNOSIS} and no {REPORT}" if self._report else ""
            self._warn(f"{error}{missing}")
            self.close()
            return
        if answer is None:
            return
        stamp_ns = newest_ns if answer.request.until_ns is None else answer.request.until_ns
        if isinstance(answer, Answer):
            self._publish(answer, stamp_ns)
        elif answer.png:
            publish(self._picture, messages.picture(stamp_ns, answer.png))

    def _publish(self, answer: Answer, stamp_ns: int) -> None:
        found = answer.diagnosis
        if found.verdict != Verdict.WAITING:
            publish(self._ranking, messages.ranking(stamp_ns, found))
            publish(self._heat_map, messages.heat_map(stamp_ns, found))
        publish(self._diagnosis, messages.diagnosis(stamp_ns, found))
        line = diagnosis_line(found)
        self._node.get_logger().info(f"diagnosis of {line} ({answer.seconds:.1f} s after it was asked)")
        if self._report is None or not answer.request.report:
            return
        if answer.unreported:
            self._warn(f"{self._report}: no {DIAGNOSIS} and {REPORT}: {answer.unreported}")
        else:
            self._node.get_logger().info(f"{self._report}: {DIAGNOSIS} and {REPORT} are there")

    def close(self) -> None:
        """End the process that diagnoses."""
        if self._worker is not None:
            self._worker.close()
            self._worker = None
