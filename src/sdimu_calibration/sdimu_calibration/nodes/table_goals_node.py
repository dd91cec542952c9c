"""Node that carries out a plan on a table that takes trajectories, simulated or real (nodes/table_driver).

Parameters: see ``ros2 param describe table_goals``. Nothing moves unless allow_motion is true; with ask each move waits
for ``ros2 service call /table_goals/confirm std_srvs/srv/SetBool "{data: true}"``. When the plan is done, or a move has
failed, the node leaves; with `finish` it ends the streams of a simulated table before.
"""

from __future__ import annotations

from rclpy.node import Node

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table import Move, moves_of
from sdimu_calibration.nodes.driving import Driving
from sdimu_calibration.nodes.parameters import Declare
from sdimu_calibration.nodes.spinning import run_node
from sdimu_calibration.nodes.table_driver import Arrival
from sdimu_calibration.storage.files.config import load_plan


class TableGoalsNode:
    """Carries out a plan; see the module."""

    def __init__(self) -> None:
        self.node = Node("table_goals")
        plan = Declare(self.node).text("plan", "kim18", "plan to carry out: name in config/plan or path")
        self._plan = load_plan(plan)
        self._moves: list[tuple[int, Move]] | None = None
        self._driving = Driving(self.node, self._act)
        self.done = self._driving.done

    def close(self) -> None:
        """Leave no table in motion."""
        self._driving.driver.stop("the node was stopped")

    def _act(self, angles: Floats) -> None:
        if self._moves is None:
            self._begin(angles)
        elif self._moves:
            number, move = self._moves.pop(0)
            why = f"step {number} of plan {self._plan.name}"
            future = self._driving.driver.move(move.step, why, move.axis)
            future.add_done_callback(lambda done: self._take(done.result()))
        else:
            self._driving.end()

    def _begin(self, angles: Floats) -> None:
        """Make the whole plan once it is known where the table stands: what is impossible is said before it moves."""
        try:
            self._moves = list(enumerate(moves_of(self._driving.table, angles, self._plan)))
        except DataError as error:
            self._driving.fail(str(error))

    def _take(self, arrival: Arrival) -> None:
        if not arrival.ok:
            self._driving.fail(arrival.reason)


def main() -> None:
    """Run the node."""
    run_node(TableGoalsNode)


if __name__ == "__main__":
    main()
