"""Calibrate on your own IMU driver, with or without a rate table that takes trajectories.

    ros2 launch sdimu_calibration driver_launch.py imu_topic:=/my_imu/data site:=my_site.yaml imu:=my_imu.yaml
    ros2 launch sdimu_calibration driver_launch.py table:=my_table.yaml allow_motion:=true ask:=true \\
        joint_trajectory:=/table_controller/joint_trajectory joint_states:=/joint_states

The node leaves nothing on its own: ros2 service call /calibration/save std_srvs/srv/Trigger writes result.json, then
diagnosis.json and report.html.
"""

from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

ARGUMENTS = (
    ("namespace", "", "of the nodes: two IMUs in one graph have two"),
    ("imu_topic", "imu/data_raw", "samples of your driver"),
    ("status_topic", "rate_table/status", "phases of your table, if it says them"),
    ("temperature_topic", "imu/temperature", "temperature of your IMU, if there is one"),
    ("imu", "", "data sheet of the IMU: name in config/imu or path; learned from the rests when empty"),
    ("site", "", "place of the test: name in config/site or path"),
    ("model", "", "model to estimate: name in config/model or path; baseline (by hand: hand) when empty"),
    ("accel_unit", "", "unit of the specific force in the messages; recognised when empty"),
    ("gyro_unit", "", "unit of the body rate in the messages; recognised when empty"),
    ("accel_sign", "0", "sign of the specific force in the messages, 1 or -1; 0 recognises it"),
    ("gyro_sign", "0", "sign of the body rate in the messages, 1 or -1; 0 recognises it"),
    ("diagnose", "true", "diagnose at the end of each stop, and leave diagnosis.json and report.html with a result"),
    ("out", "out/driver", "folder of bag and results"),
    ("table", "", "a table to drive: name in config/table or path; none when empty"),
    ("drive", "plan", "plan: carry out the plan; adaptive: the test chooses its turns"),
    ("plan", "kim18", "plan to carry out on the table"),
    ("goals", "table33", "limits that an adaptive test is to reach: name in config/goal or path"),
    ("allow_motion", "false", "let trajectories be sent: nothing moves without"),
    ("ask", "true", "ask before each move"),
    ("joint_trajectory", "rate_table/joint_trajectory", "where the controller takes trajectories"),
    ("joint_states", "rate_table/joint_states", "where the angles of the table come from"),
)


def argument(name, kind=str):
    """Return the value of a launch argument as a parameter of that type."""
    return ParameterValue(LaunchConfiguration(name), value_type=kind)


def generate_launch_description():
    """Declare the arguments and start calibration and recorder, and what drives a table when one is named."""
    namespace, out = LaunchConfiguration("namespace"), LaunchConfiguration("out")
    opened = ("imu_topic", "status_topic", "temperature_topic", "imu", "site", "model", "accel_unit", "gyro_unit")

    reading = {name: argument(name) for name in opened}
    reading |= {name: argument(name, int) for name in ("accel_sign", "gyro_sign")}

    def driven(way):
        table, drive = LaunchConfiguration("table"), LaunchConfiguration("drive")
        return IfCondition(PythonExpression(["'", table, "' != '' and '", drive, f"' == '{way}'"]))

    driving = {"table": argument("table"), "allow_motion": argument("allow_motion", bool), "ask": argument("ask", bool)}
    joints = ("rate_table/joint_states", LaunchConfiguration("joint_states"))
    trajectory = ("rate_table/joint_trajectory", LaunchConfiguration("joint_trajectory"))
    samples = [
        ("imu/data_raw", LaunchConfiguration("imu_topic")),
        ("rate_table/status", LaunchConfiguration("status_topic")),
        ("imu/temperature", LaunchConfiguration("temperature_topic")),
    ]
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, default, text in ARGUMENTS
            ),
            Node(
                package="sdimu_calibration",
                executable="calibration_node",
                name="calibration",
                namespace=namespace,
                parameters=[
                    reading | {"out": out, "stay": True, "report": True, "diagnose": argument("diagnose", bool)}
                ],
                output="screen",
            ),
            Node(
                package="sdimu_calibration",
                executable="recorder_node",
                name="recorder",
                namespace=namespace,
                parameters=[{"out": PathJoinSubstitution([out, "bag"])}],
                remappings=[*samples, joints],
                output="screen",
            ),
            Node(
                package="sdimu_calibration",
                executable="table_goals",
                name="table_goals",
                namespace=namespace,
                parameters=[driving | {"plan": argument("plan")}],
                remappings=[joints, trajectory],
                output="screen",
                condition=driven("plan"),
            ),
            Node(
                package="sdimu_calibration",
                executable="adaptive",
                name="adaptive",
                namespace=namespace,
                parameters=[driving | reading | {"goals": argument("goals"), "out": out}],
                remappings=[joints, trajectory],
                output="screen",
                condition=driven("adaptive"),
            ),
        ]
    )
