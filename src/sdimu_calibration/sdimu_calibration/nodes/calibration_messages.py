"""Estimates as messages."""

from __future__ import annotations

from array import array
from collections.abc import Sequence

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.live import EpochEstimate
from sdimu_calibration.core.rotation import quaternion_matrix
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.nodes.credits import header
from sdimu_calibration.storage.bags.compensated_bag import frame_of


def coefficients(
    stamp_ns: int, body_frame: str, names: Sequence[str], values: Floats, covariance: Floats
) -> JointState:
    """Return names, values (SI) as positions and sigmas as efforts; frame_id is the body frame."""
    message = JointState(header=header(stamp_ns, body_frame), name=list(names))
    message.position = array("d", np.asarray(values, dtype=float))
    message.effort = array("d", np.sqrt(np.maximum(np.diag(covariance), 0.0)))
    return message


def covariance_matrix(stamp_ns: int, names: Sequence[str], covariance: Floats) -> Float64MultiArray:
    """Return a covariance (p, p), SI; the names label its dimensions, the stamp is in the last label."""
    p = len(names)
    label = ",".join(names)
    dims = [
        MultiArrayDimension(label=label, size=p, stride=p * p),
        MultiArrayDimension(label=label, size=p, stride=p),
        MultiArrayDimension(label=f"stamp_ns={stamp_ns}", size=1, stride=1),
    ]
    data = array("d", np.ascontiguousarray(covariance, dtype=float).tobytes())
    return Float64MultiArray(layout=MultiArrayLayout(dim=dims), data=data)


ESTIMATES_EVERY_S = 10
"""Whole seconds of data between two tables of estimates: people read them."""


def estimates(
    stamp_ns: int, names: Sequence[str], values: Floats, covariance: Floats, units: Sequence[str]
) -> DiagnosticArray:
    """Return each coefficient with its sigma in customary units, as ``ros2 topic echo`` shows it."""
    message = DiagnosticArray(header=header(stamp_ns))
    sigmas = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    for name, value, sigma, unit in zip(names, values.tolist(), sigmas.tolist(), units, strict=True):
        shown, spread = f"{from_si(value, unit):.6g}", f"{from_si(sigma, unit):.3g}"
        status = DiagnosticStatus(name=name, message=f"{shown} +- {spread} {unit}", hardware_id="imu")
        pairs = {"value": shown, "sigma": spread, "unit": unit}
        status.values = [KeyValue(key=key, value=text) for key, text in pairs.items()]
        message.status.append(status)
    return message


def navigation(stamp_ns: int, estimate: EpochEstimate, level: str = "ned", body: str = "") -> Odometry:
    """Return navigation: pose in the local-level frame, twist in the body frame, as nav_msgs/Odometry has it.

    pose: position error N, E, D (m) and q_nb, with the covariance of position and attitude error; twist.linear:
    velocity (m/s) along the axes of the IMU, with its covariance.
    """
    message = Odometry(header=header(stamp_ns, level), child_frame_id=body or frame_of(estimate.body_frame))
    position, orientation = message.pose.pose.position, message.pose.pose.orientation
    position.x, position.y, position.z = map(float, estimate.position_error_m)
    orientation.w, orientation.x, orientation.y, orientation.z = map(float, estimate.q_nb)
    linear = message.twist.twist.linear
    C_bn = quaternion_matrix(estimate.q_nb).T
    linear.x, linear.y, linear.z = (C_bn @ estimate.velocity).tolist()
    P = estimate.navigation_covariance
    pose = [0, 1, 2, 6, 7, 8]
    message.pose.covariance = P[np.ix_(pose, pose)].ravel()
    twist = np.zeros((6, 6))
    twist[:3, :3] = C_bn @ P[3:6, 3:6] @ C_bn.T
    message.twist.covariance = twist.ravel()
    return message


def diagnostics(stamp_ns: int, estimate: EpochEstimate, name: str = "calibration") -> DiagnosticArray:
    """Return phase, stop, counts and innovation consistency; nothing of wall time, so runs can be compared."""
    phase = "dwell" if estimate.dwell else "rotating"
    values = {"phase": phase, "stop": str(estimate.stop), "used": str(estimate.used).lower()}
    values |= {key: str(count) for key, count in estimate.counts.items()}
    values |= {f"nis_{channel}": f"{nis:.6g}" for channel, nis in estimate.nis.items()}
    values |= {f"stop_nis_{channel}": f"{nis:.6g}" for channel, nis in estimate.stop_nis.items()}
    values["verdict"] = estimate.verdict
    level = DiagnosticStatus.OK if estimate.verdict == Verdict.CONSISTENT else DiagnosticStatus.WARN
    status = DiagnosticStatus(level=level, name=name, message=phase, hardware_id="imu")
    status.values = [KeyValue(key=key, value=value) for key, value in values.items()]
    return DiagnosticArray(header=header(stamp_ns), status=[status])


def notice(stamp_ns: int, text: str, name: str = "calibration") -> DiagnosticArray:
    """Return a note of the calibration that is no estimate, such as what it waits for."""
    status = DiagnosticStatus(level=DiagnosticStatus.WARN, name=name, message=text, hardware_id="imu")
    return DiagnosticArray(header=header(stamp_ns), status=[status])
