"""Plain text: the matrices and biases row by row, comments with ``#``; ``numpy.loadtxt`` reads it as 11 rows of 3."""

from __future__ import annotations

from sdimu_calibration.core.compensation import LinearModel
from sdimu_calibration.storage.export.shared import Source, bent, comments, row, warm


def texts(source: Source) -> dict[str, str]:
    """Return the text of the file."""
    linear = source.linear
    lines = comments(source, "#")
    for name, block in (("M_g", linear.gyro), ("G", linear.by_force), ("M_a", linear.accel)):
        lines += [f"# {name}", *map(row, block)]
    lines += ["# b_g", row(linear.gyro_bias), "# b_a", row(linear.accel_bias)]
    return {"": "\n".join(lines) + "\n"}


def cannot_hold(linear: LinearModel) -> list[str]:
    """Say what is left out."""
    return bent(linear) + warm(linear)
