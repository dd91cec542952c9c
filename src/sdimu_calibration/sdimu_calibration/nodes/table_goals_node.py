"""Node that carries out a plan on a table that takes trajectories, simulated or real (nodes/table_driver).

Parameters: see ``ros2 param describe table_goals``. Nothing moves unless allow_motion is true; with ask each move waits
for ``ros2 service call /table_goals/confirm std_srvs/srv/SetBool "{data: true}"``. When the plan is done, or a move has
failed, the node leaves; with `finish` it ends the streams of a simulated table before.
"""

from __future__ import annotations

import time

from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table import joints_of, steps_of
from sdimu_calibration.nodes.parameters import Declare
from sdimu_calibration.nodes.spinning import run_node
from sdimu_calibration.nodes.table_driver import Arrival, TableDriver
from sdimu_calibration.nodes.ticking import Ticker
from sdimu_calibration.storage.config import load_plan
from sdimu_calibration.storage.table_file import load_rate_table

FINISH = "rate_table/finish"
PATIENCE_S = 300.0
"""Wall time (s) in which joint states must come at the start, and an answer at the end: a simulated table waits for its
consumers, which compile for minutes where they have never run."""


class TableGoalsNode:
    """Carries out a plan; see the module."""

    def __init__(self) -> None:
        self.node = Node("table_goals")
        self.done = Future()
        declare = Declare(self.node)
        self._plan = load_plan(declare.text("plan", "kim18", "plan to carry out: name in config/plan or path"))
        self._table = load_rate_table(declare.text("table", "ideal", "the table: name in config/table or path"))
        self._finish = declare.flag("finish", False, "end the streams of a simulated table after the plan")
        ticker = Ticker(self.node)
        self._driver = TableDriver(self.node, ticker, self._table)
        self._steps = list(enumerate(steps_of(self._plan)))
        self._axes: tuple[tuple[int, float] | None, ...] | None = None
        self._born = time.monotonic()
        self._farewell: Future | None = None
        self._client = self.node.create_client(Trigger, FINISH)
        ticker.every(0.05, self._tick)

    def close(self) -> None:
        """Leave no table in motion."""
        self._driver.stop("the node was stopped")

    def _tick(self) -> None:
        if self.done.done() or self._driver.busy:
            return
        if self._axes is None:
            self._begin()
        elif self._steps:
            number, step = self._steps.pop(0)
            future = self._driver.move(step, f"step {number} of plan {self._plan.name}", self._axes[number])
            future.add_done_callback(lambda done: self._take(done.result()))
        else:
            self._leave()

    def _begin(self) -> None:
        """Choose the joints of the whole plan once it is known where the table stands."""
        if self._driver.angles is None:
            if time.monotonic() - self._born > PATIENCE_S:
                self._fail(f"rate_table/joint_states: nothing has come for {PATIENCE_S:.0f} s (is the table on?)")
            return
        try:
            self._axes = joints_of(self._table, self._driver.angles, self._plan)
        except DataError as error:
            self._fail(str(error))

    def _take(self, arrival: Arrival) -> None:
        if not arrival.ok:
            self._fail(arrival.reason)

    def _leave(self) -> None:
        if not self._finish:
            self.done.set_result(None)
        elif self._farewell is None:
            self._farewell, self._born = self._client.call_async(Trigger.Request()), time.monotonic()
        elif self._farewell.done():
            self.done.set_result(None)
        elif time.monotonic() - self._born > PATIENCE_S:
            self._fail(f"{self._client.srv_name}: no answer (only a simulated table has an end)")

    def _fail(self, reason: str) -> None:
        if not self.done.done():
            self.done.set_exception(DataError(reason))


def main() -> None:
    """Run the node."""
    run_node(TableGoalsNode)


if __name__ == "__main__":
    main()
