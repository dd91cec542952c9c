"""Program that converts a bag of ROS 1 to one of ROS 2, in a process of its own: see `own_process`.

Arguments: the bag, and the folder to make; it is not made when no topic of an IMU is there. The standard messages
differ in nothing that is used here.
"""

from __future__ import annotations

import sys
from pathlib import Path

KINDS = (
    "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/Temperature",
    "diagnostic_msgs/msg/DiagnosticArray",
)


def main() -> None:
    """Convert; one line on stderr and exit 1 when it cannot be read."""
    from rosbags.convert.converter import convert  # noqa: PLC0415 (those who start it import nothing of it)
    from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415

    source, target = map(Path, sys.argv[1:])
    try:
        typestore = get_typestore(Stores.ROS2_JAZZY)
        convert([source], target, "sqlite3", 9, None, "", None, typestore, [], [], [], list(KINDS))
    except Exception as error:  # rosbags answers damage with errors of its own, of struct and of the decompressors
        sys.stderr.write(f"{' '.join(str(error).split()) or type(error).__name__}\n")
        sys.exit(1)


if __name__ == "__main__":
    main()
