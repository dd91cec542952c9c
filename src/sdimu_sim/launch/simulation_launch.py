"""A whole simulated test: table, IMU, calibration and recorder.

For example:

    ros2 launch sdimu_sim simulation_launch.py plan:=recommended out:=out/run
    ros2 launch sdimu_sim simulation_launch.py drive:=plan allow_motion:=true        # the plan by trajectories
    ros2 launch sdimu_sim simulation_launch.py drive:=adaptive allow_motion:=true    # the test chooses its turns
"""

from launch.actions import DeclareLaunchArgument, RegisterEventHandler, Shutdown
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessExit
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

ARGUMENTS = (
    ("namespace", "", "of all nodes: two tests in one graph have two"),
    ("plan", "kim18", "test plan: name in config/plan or path"),
    ("table", "ideal", "rate table: name in config/table or path"),
    ("imu", "dtg", "IMU: name in config/imu or path"),
    ("site", "daejeon", "site: name in config/site or path"),
    ("model", "baseline", "model to estimate: name in config/model or path"),
    ("seed", "1", "of errors, mount and noise"),
    ("speed", "0.0", "times real time; 0: as fast as nothing gets lost"),
    ("rate_hz", "100.0", "samples of the IMU a second"),
    ("out", "out/run", "folder of the results"),
    ("drive", "", "plan: by trajectories; adaptive: the test chooses its turns; empty: the table plays the plan"),
    ("goals", "table33", "limits that an adaptive test is to reach: name in config/goal or path"),
    ("allow_motion", "false", "let trajectories be sent"),
    ("ask", "false", "ask before each move"),
)


def argument(name, kind=str):
    """Return the value of a launch argument as a parameter of that type."""
    return ParameterValue(LaunchConfiguration(name), value_type=kind)


def ended(event, _):
    """End the others, which would wait for a node that has failed."""
    return [Shutdown(reason=f"{event.process_name} has failed")] if event.returncode else []


def declared():
    """Return all arguments with their defaults."""
    return [DeclareLaunchArgument(name, default_value=default, description=text) for name, default, text in ARGUMENTS]


def node(package, executable, name, parameters, *ways):
    """Return a node in the namespace of all; with `ways` only where the argument `drive` is one of them."""
    drive = LaunchConfiguration("drive")
    return Node(
        package=package,
        executable=executable,
        name=name,
        namespace=LaunchConfiguration("namespace"),
        parameters=[parameters],
        output="screen",
        condition=IfCondition(PythonExpression(["'", drive, "' in ", repr(ways)])) if ways else None,
    )


def estimating():
    """Parameters of whoever fits the samples: of the simulated gyros unit and sign are known."""
    return {
        "site": argument("site"),
        "imu": argument("imu"),
        "model": argument("model"),
        "out": LaunchConfiguration("out"),
        "gyro_unit": "rad/s",
        "gyro_sign": 1,
    }


def observers():
    """Record and calibrate."""
    bag = PathJoinSubstitution([LaunchConfiguration("out"), "bag"])
    awaited = ["imu/data_raw", "rate_table/status", "calibration/coefficients"]
    return [
        node("sdimu_calibration", "recorder_node", "recorder", {"out": bag, "wait_for": awaited}),
        node("sdimu_calibration", "calibration_node", "calibration", estimating() | {"report": True}),
    ]


def simulated_imu():
    """Simulate the IMU on the table; its truth goes beside the results."""
    sampling = {
        "imu": argument("imu"),
        "site": argument("site"),
        "plan": argument("plan"),
        "seed": argument("seed", int),
        "rate_hz": argument("rate_hz", float),
        "truth_file": PathJoinSubstitution([LaunchConfiguration("out"), "truth.yaml"]),
        "consumers": 2,
    }
    return node("sdimu_sim", "sdimu_node", "sdimu", sampling)


def simulated_tables():
    """Simulate the table: one that plays the plan, or one that follows trajectories."""
    table = {
        "plan": argument("plan"),
        "table": argument("table"),
        "seed": argument("seed", int),
        "speed": argument("speed", float),
        "consumers": 1,
        "status_peers": 2,
        "joint_peers": 1,
    }
    following = table | {"follow_goals": True}
    return [
        node("rate_table_sim", "rate_table_node", "rate_table", table, ""),
        node("rate_table_sim", "rate_table_node", "rate_table", following, "plan", "adaptive"),
    ]


def drivers():
    """Send trajectories: those of the plan, or those of turns that the test chooses."""
    driving = {
        "table": argument("table"),
        "finish": True,
        "allow_motion": argument("allow_motion", bool),
        "ask": argument("ask", bool),
    }
    planned, chosen = {"plan": argument("plan")}, estimating() | {"goals": argument("goals")}
    return [
        node("sdimu_calibration", "table_goals", "table_goals", driving | planned, "plan"),
        node("sdimu_calibration", "adaptive", "adaptive", driving | chosen, "adaptive"),
    ]


def generate_launch_description():
    """Declare the arguments and start the nodes; each waits for those it feeds."""
    ending = RegisterEventHandler(OnProcessExit(on_exit=ended))
    return LaunchDescription([*declared(), ending, *observers(), simulated_imu(), *simulated_tables(), *drivers()])
