"""Node that lets a test choose its turns: it looks at what the calibration node keeps, chooses, and drives the table.

Parameters: see ``ros2 param describe adaptive``. Nothing moves unless allow_motion is true; with ask each turn waits
for ``ros2 service call /adaptive/confirm std_srvs/srv/SetBool "{data: true}"``: no ends the test.

Publications: ~/choice (diagnostic_msgs/DiagnosticArray: each choice with its reason, minutes, worst sigma over its
limit, what was found, what is open), also logged; ~/moves and ~/question as of every driver (nodes/table_driver). It
leaves choices.json in `out`.

What was recorded is read from the journal of the calibration node, in the folder `out` that both are given: the same
samples, opened by the same options, as the calibration at the end of the test. Where all limits hold, effects that are
sure to be missing are added to the parameter ``add`` of the calibration node, so that its result has them.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from sdimu_calibration.core.adaptive.choice import FIRST_STOP_S
from sdimu_calibration.core.adaptive.goals import aimed
from sdimu_calibration.core.adaptive.menu import Menu
from sdimu_calibration.core.adaptive.question import Decision, Situation, next_move
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table import Step
from sdimu_calibration.nodes.adding import ask_to_add
from sdimu_calibration.nodes.credits import HISTORY, NS, header
from sdimu_calibration.nodes.diagnosis_worker import Answer, WorkerRequest, WorkerSetup
from sdimu_calibration.nodes.driving import PATIENCE_S, Driving
from sdimu_calibration.nodes.live_diagnosis import Worker
from sdimu_calibration.nodes.opening_parameters import declare_opening
from sdimu_calibration.nodes.parameters import Declare
from sdimu_calibration.nodes.spinning import run_node
from sdimu_calibration.nodes.table_driver import Arrival
from sdimu_calibration.storage.files.goal_file import load_goals
from sdimu_calibration.storage.files.journal import JOURNAL
from sdimu_calibration.storage.files.json_file import write_json
from sdimu_calibration.storage.files.whole_file import put_aside

LATE_S = 1.5
"""Samples (s) that may still be on their way to the journal when a stop is looked at: an epoch and a block."""
CHOICES = "choices.json"
"""Name of the file with all choices."""
FORMAT = "sdimu-choices/1"
"""Format of that file."""
AGAIN_S = 0.3
"""Wall time (s) after which the journal is read again when the stop is not in it yet."""


class AdaptiveNode:
    """Chooses and drives; see the module."""

    def __init__(self) -> None:
        self.node = Node("adaptive")
        declare = Declare(self.node)
        options, _ = declare_opening(self.node)
        goals = load_goals(declare.text("goals", "table33", "limits to reach: name in config/goal or path"))
        tell = declare.texts("tell", [], "coefficients to tell apart, too: the first from the others")
        model = declare.text("model", "baseline", "model to estimate: name in config/model or path")
        added = tuple(declare.texts("add", [], "effects beyond the model's: names, equations or files"))
        self._out = Path(declare.text("out", ".", "folder of the calibration node, with its journal"))
        # The choices of another test, or of this one before its node was killed: no other file has them.
        if aside := put_aside(self._out / CHOICES):
            self.node.get_logger().warning(f"{self._out / CHOICES}: of an earlier test; kept as {aside}")
        self._goals, self._models, self._menu = aimed(goals, tell), (added,), Menu()
        setup = WorkerSetup(self._out / JOURNAL, options, model, next_move, pictures=False, awaited=True)
        self._worker = Worker(setup, self.node.get_logger().warning)
        self._driving = Driving(self.node, self._act)
        self.done = self._driving.done
        self._choices = self.node.create_publisher(DiagnosticArray, "~/choice", HISTORY)
        self._next: Step | None = Step(None, FIRST_STOP_S)
        self._why = "first stop"
        self._last = Decision(None, "", "", False, 0.0, math.inf, (), ())
        self._stop, self._begin_ns, self._end_ns = 0, 0, 0
        self._look_at, self._arrived, self._tries = 0.0, 0.0, 0
        self._made: list[dict[str, object]] = []
        self._adding: Iterator[None] | None = None

    def close(self) -> None:
        """Leave no table in motion and no process behind."""
        try:
            self._driving.driver.stop("the node was stopped")
        finally:
            self._worker.close()

    def _act(self, angles: Floats) -> None:
        if self._adding is not None:
            if next(self._adding, self) is self:
                self._adding = None
                self._driving.end()
            return
        if self._next is None:
            self._look(tuple(angles.tolist()))
            return
        step, self._next = self._next, None
        future = self._driving.driver.move(step, self._why)
        future.add_done_callback(lambda done: self._arrive(done.result(), step))

    def _arrive(self, arrival: Arrival, step: Step) -> None:
        if not arrival.ok:
            # A person said no, or the table cannot: what was measured until then is a test.
            text = f"the test ends: {arrival.reason}"
            self._carry_out(replace(self._last, step=None, text=text, reason=arrival.reason, reached=False))
            return
        self._begin_ns = self._begin_ns or arrival.start_ns
        self._stop += step.turn is not None
        self._end_ns, self._look_at, self._tries = arrival.end_ns, 0.0, 0
        self._arrived = time.monotonic()

    def _look(self, angles: tuple[float, ...]) -> None:
        """Ask for the next move until the answer is of everything that was recorded."""
        try:
            answer = self._worker.answer()
        except DataError as error:
            self._driving.fail(str(error))
            return
        if not isinstance(answer, Answer):
            if self._worker.idle and time.monotonic() > self._look_at:
                spent_s = (self._end_ns - self._begin_ns) / NS
                about = Situation(self._goals, self._menu, self._driving.table, angles, spent_s)
                # The worker keeps what it has read up to a stamp: another stamp lets it read the journal again.
                self._worker.ask(WorkerRequest(self._stop, self._end_ns + self._tries, self._models, about))
                self._tries += 1
            return
        lacking = (self._end_ns - answer.reached_ns) / NS
        if lacking > LATE_S:
            self._look_at = time.monotonic() + AGAIN_S
            if time.monotonic() - self._arrived > PATIENCE_S:
                self._driving.fail(
                    f"the journal lacks the last {lacking:.0f} s of the test (is the calibration node alive, and have "
                    "IMU and table one clock?)"
                )
            return
        self._take(answer)

    def _take(self, answer: Answer) -> None:
        if isinstance(answer.more, Decision):
            self._carry_out(answer.more)
        else:
            self._driving.fail(answer.diagnosis.sentence)

    def _carry_out(self, decision: Decision) -> None:
        """Tell a decision, keep it, and make it the next move or the end."""
        told = f"{decision.until_s / 60.0:.1f} min, worst sigma {decision.worst:.2f} of its limit; {decision.text}"
        self.node.get_logger().info(told)
        self._publish(decision)
        self._made.append(asdict(decision))
        write_json(self._out / CHOICES, {"format": FORMAT, "goals": self._goals.name, "choices": self._made})
        self._last, self._next, self._why = decision, decision.step, decision.reason
        if decision.step is not None:
            return
        if decision.reached and decision.decided:
            # The limits hold beside what was found: so the result has it.
            self._adding = self._added(decision.decided)
        else:
            self._driving.end()

    def _added(self, effects: Sequence[str]) -> Iterator[None]:
        """Let the calibration node take effects into the model, one after the other: one that it refuses is told."""
        for effect in effects:
            for answer in ask_to_add(self.node, [effect]):
                if answer:
                    self.node.get_logger().warning(f"{effect} was not added to the model of the result: {answer}")
                yield

    def _publish(self, decision: Decision) -> None:
        words = "" if decision.step is None else decision.step.words
        values = {
            "move": words,
            "reason": decision.reason,
            "minutes": f"{decision.until_s / 60.0:.2f}",
            "worst": f"{decision.worst:.3f}",
            "named": ", ".join(decision.named),
            "open": ", ".join(decision.alike),
            "reached": str(decision.reached).lower(),
        }
        status = DiagnosticStatus(level=DiagnosticStatus.OK, name="choice", message=decision.text)
        status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
        self._choices.publish(DiagnosticArray(header=header(self._end_ns), status=[status]))


def main() -> None:
    """Run the node."""
    run_node(AdaptiveNode)


if __name__ == "__main__":
    main()
