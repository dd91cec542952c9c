"""The frames of the simulated table, for RViz: its axes one inside the other, or one frame when it has no gimbals."""

from __future__ import annotations

from rclpy.node import Node

from rate_table_sim.core import TableMotion, TableSpecification
from sdimu_calibration.core.table.gimbals import unit
from sdimu_calibration.nodes.credits import HISTORY, LATCHED
from sdimu_calibration.nodes.transform_type import transform_class
from sdimu_calibration.nodes.transforms import (
    BASE,
    IDENTITY,
    NED,
    NED_IN_ENU,
    PLATFORM,
    SITE,
    STATIC,
    TRANSFORMS,
    TransformMessage,
    about,
)

_AXES = ("table_outer", "table_middle", "table_inner")
_AT_REST = 10
"""At rest one of so many joint states is followed by a transform: nothing moves."""


class TableFrames:
    """Publish the frames; nothing is published where the type TFMessage cannot be had."""

    def __init__(self, node: Node, table: TableSpecification) -> None:
        self._axes = None if table.axes is None else [unit(letter) for letter in table.axes]
        chain = (
            [(BASE, PLATFORM)]
            if table.axes is None
            else [*zip((BASE, *_AXES[:2]), _AXES, strict=True), (_AXES[2], PLATFORM)]
        )
        self._message = TransformMessage(chain)
        self._count, self._moved = 0, True
        self._publisher = None
        try:
            kind = transform_class()
        except ImportError as error:
            node.get_logger().warning(f"no transforms for RViz: {error}")
            return
        self._publisher = node.create_publisher(kind, TRANSFORMS, HISTORY)
        self._static = node.create_publisher(kind, STATIC, LATCHED)

    def begin(self, stamp_ns: int) -> None:
        """Say where the table stands: its base is level and looks North."""
        if self._publisher is not None:
            fixed = TransformMessage([(SITE, NED), (NED, BASE)])
            self._static.publish(fixed.encode(stamp_ns, [NED_IN_ENU, IDENTITY]))

    def send(self, stamp_ns: int, motion: TableMotion, k: int) -> None:
        """Say how the axes stand at sample `k` of a block of motion: always while they move, seldom at rest."""
        moves = bool(motion.rate[k].any())
        self._count += 1
        if self._publisher is None or not (moves or self._moved or self._count % _AT_REST == 0):
            return
        self._moved = moves
        if self._axes is None:
            rotations = [motion.q_nt[k]]
        else:
            angles = motion.encoder_angle[k]
            rotations = [about(axis, angle) for axis, angle in zip(self._axes, angles, strict=True)]
            rotations.append(IDENTITY)
        self._publisher.publish(self._message.encode(stamp_ns, rotations))
