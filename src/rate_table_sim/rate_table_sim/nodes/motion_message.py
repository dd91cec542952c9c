"""True motion of the platform on its way to the simulated IMU: blocks of samples in one message.

Ours to shape: it never leaves the simulators. A std_msgs/Float64MultiArray with dim[0] = samples, labelled
``start_ns=<origin of t>``, and dim[1] = the columns t, q_nt (w, x, y, z), omega_nt_t (x, y, z).
"""

from __future__ import annotations

from array import array

import numpy as np
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from sdimu_calibration.core.arrays import Floats

_COLUMNS = "t,qw,qx,qy,qz,wx,wy,wz"


def encode_motion(start_ns: int, t: Floats, q_nt: Floats, omega_nt_t: Floats) -> Float64MultiArray:
    """Pack a block of motion.

    Parameters
    ----------
    start_ns : int
        Stamp (ns) from which `t` counts.
    t : ndarray, shape (n,)
        s.
    q_nt : ndarray, shape (n, 4)
        Orientation of the platform against NED, scalar first.
    omega_nt_t : ndarray, shape (n, 3)
        Its rate, in the platform frame (rad/s).
    """
    rows = np.column_stack([t, q_nt, omega_nt_t])
    n, k = rows.shape
    dims = [
        MultiArrayDimension(label=f"start_ns={start_ns}", size=n, stride=n * k),
        MultiArrayDimension(label=_COLUMNS, size=k, stride=k),
    ]
    return Float64MultiArray(layout=MultiArrayLayout(dim=dims), data=array("d", rows.tobytes()))


def decode_motion(message: Float64MultiArray) -> tuple[int, Floats, Floats, Floats]:
    """Unpack a block of motion: (start_ns, t, q_nt, omega_nt_t) as in `encode_motion`."""
    start_ns = int(message.layout.dim[0].label.removeprefix("start_ns="))
    rows = np.frombuffer(message.data, np.float64).reshape(-1, message.layout.dim[1].size)
    return start_ns, rows[:, 0].copy(), rows[:, 1:5].copy(), rows[:, 5:8].copy()
