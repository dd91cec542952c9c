"""What every node that drives a table through a test does: wait for the table, act while it rests, leave."""

from __future__ import annotations

import time
from collections.abc import Callable

from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.parameters import Declare
from sdimu_calibration.nodes.table_driver import JOINT_STATES, TableDriver
from sdimu_calibration.nodes.ticking import Ticker
from sdimu_calibration.storage.files.table_file import load_rate_table

FINISH = "rate_table/finish"
PATIENCE_S = 300.0
"""Wall time (s) in which joint states must come at the start, and an answer at the end: a simulated table waits for its
consumers, which compile for minutes where they have never run."""


class Driving:
    """Drives a table from its first joint states to the end of a test.

    Parameters
    ----------
    node : rclpy.node.Node
        Gets the parameters `table`, `finish`, and those of `TableDriver`.
    act : function of ndarray, shape (3,)
        Called again and again while no move is under way, with the angles of the joints (rad): it moves the table by
        `driver`, or calls `end` or `fail`.

    Attributes
    ----------
    done : Future
        Of the node.
    """

    def __init__(self, node: Node, act: Callable[[Floats], None]) -> None:
        declare = Declare(node)
        self.table = load_rate_table(declare.text("table", "ideal", "the table: name in config/table or path"))
        self._finish = declare.flag("finish", False, "end the streams of a simulated table after the test")
        ticker = Ticker(node)
        self.driver = TableDriver(node, ticker, self.table)
        self.done = Future()
        self._act = act
        self._client = node.create_client(Trigger, FINISH)
        self._waiting_since = time.monotonic()
        self._farewell: Future | None = None
        ticker.every(0.05, self._tick)

    def end(self) -> None:
        """Leave, once a simulated table has ended its streams if it is to."""
        self._waiting_since = time.monotonic()
        self._farewell = self._client.call_async(Trigger.Request()) if self._finish else Future()

    def fail(self, reason: str) -> None:
        """Leave with a reason."""
        if not self.done.done():
            self.done.set_exception(DataError(reason))

    def _tick(self) -> None:
        if self.done.done() or self.driver.busy:
            return
        late = time.monotonic() - self._waiting_since > PATIENCE_S
        if self._farewell is not None:
            if self._farewell.done() or not self._finish:
                self.done.set_result(None)
            elif late:
                self.fail(f"{self._client.srv_name}: no answer (only a simulated table has an end)")
        elif (angles := self.driver.angles) is not None:
            self._act(angles)
        elif late:
            self.fail(f"{JOINT_STATES}: nothing has come for {PATIENCE_S:.0f} s (is the table on?)")
