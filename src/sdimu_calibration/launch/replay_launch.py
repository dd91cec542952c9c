"""Play a recording into the live calibration.

For example:

    ros2 launch sdimu_calibration replay_launch.py bag:=my_bag speed:=10.0
"""

from launch.actions import DeclareLaunchArgument, RegisterEventHandler, Shutdown
from launch.event_handlers import OnProcessExit
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

ARGUMENTS = (
    ("bag", None, "rosbag2 folder or .mcap file"),
    ("namespace", "", "of the nodes"),
    ("speed", "0.0", "times real time; 0: as fast as the calibration follows"),
    ("imu", "", "data sheet of the IMU: name in config/imu or path; learned from the rests when empty"),
    ("site", "", "place of the test: name in config/site or path"),
    ("model", "", "model to estimate: name in config/model or path; baseline (by hand: hand) when empty"),
    ("out", "out/replay", "folder of result.json, diagnosis.json and report.html"),
)


def argument(name, kind=str):
    """Return the value of a launch argument as a parameter of that type."""
    return ParameterValue(LaunchConfiguration(name), value_type=kind)


def ended(event, _):
    """End the others, which would wait for a node that has failed."""
    return [Shutdown(reason=f"{event.process_name} has failed")] if event.returncode else []


def generate_launch_description():
    """Declare the arguments and start player and calibration."""
    namespace = LaunchConfiguration("namespace")
    calibrating = {name: argument(name) for name in ("imu", "site", "model")} | {"out": LaunchConfiguration("out")}
    playing = {"bag": argument("bag"), "speed": argument("speed", float), "consumers": 1}
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, default, text in ARGUMENTS
            ),
            RegisterEventHandler(OnProcessExit(on_exit=ended)),
            Node(
                package="sdimu_calibration",
                executable="calibration_node",
                name="calibration",
                namespace=namespace,
                parameters=[calibrating | {"report": True}],
                output="screen",
            ),
            Node(
                package="sdimu_calibration",
                executable="replay_node",
                name="replay",
                namespace=namespace,
                parameters=[playing],
                output="screen",
            ),
        ]
    )
