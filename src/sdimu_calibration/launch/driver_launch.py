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


def declared():
    """Return all arguments with their defaults."""
    return [DeclareLaunchArgument(name, default_value=default, description=text) for name, default, text in ARGUMENTS]


def remapped(topics):
    """Put yours, by the argument that names it, in the place of each topic of a node."""
    return [(own, LaunchConfiguration(name)) for own, name in topics.items()]


def reading():
    """Parameters by which samples are opened: topics, IMU, site, model, units and signs."""
    texts = ("imu_topic", "status_topic", "temperature_topic", "imu", "site", "model", "accel_unit", "gyro_unit")
    signs = {name: argument(name, int) for name in ("accel_sign", "gyro_sign")}
    return {name: argument(name) for name in texts} | signs


def node(executable, name, parameters, remappings=(), condition=None):
    """Return a node of this package in the namespace of all."""
    return Node(
        package="sdimu_calibration",
        executable=executable,
        name=name,
        namespace=LaunchConfiguration("namespace"),
        parameters=[parameters],
        remappings=list(remappings),
        output="screen",
        condition=condition,
    )


def calibrating():
    """Calibrate until the program is ended."""
    kept = {"out": LaunchConfiguration("out"), "stay": True, "report": True, "diagnose": argument("diagnose", bool)}
    return node("calibration_node", "calibration", reading() | kept)


def recording():
    """Record what the calibration reads, and the angles of the table."""
    topics = {
        "imu/data_raw": "imu_topic",
        "rate_table/status": "status_topic",
        "imu/temperature": "temperature_topic",
        "rate_table/joint_states": "joint_states",
    }
    bag = PathJoinSubstitution([LaunchConfiguration("out"), "bag"])
    return node("recorder_node", "recorder", {"out": bag}, remapped(topics))


def driving(executable, way, parameters):
    """Drive the table that is named, in one of the two ways of the argument `drive`."""
    table, drive = LaunchConfiguration("table"), LaunchConfiguration("drive")
    asked = IfCondition(PythonExpression(["'", table, "' != '' and '", drive, f"' == '{way}'"]))
    common = {"table": argument("table"), "allow_motion": argument("allow_motion", bool), "ask": argument("ask", bool)}
    topics = {"rate_table/joint_states": "joint_states", "rate_table/joint_trajectory": "joint_trajectory"}
    return node(executable, executable, common | parameters, remapped(topics), asked)


def generate_launch_description():
    """Declare the arguments and start calibration and recorder, and what drives a table when one is named."""
    goals = {"goals": argument("goals"), "out": LaunchConfiguration("out")}
    return LaunchDescription(
        [
            *declared(),
            calibrating(),
            recording(),
            driving("table_goals", "plan", {"plan": argument("plan")}),
            driving("adaptive", "adaptive", reading() | goals),
        ]
    )
