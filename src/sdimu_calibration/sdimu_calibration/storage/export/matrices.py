"""Plain text: the matrices and biases row by row, comments with ``#``; ``numpy.loadtxt`` reads it as 11 rows of 3."""

from __future__ import annotations

from sdimu_calibration.storage.export.shared import Source, comments, row


def texts(source: Source) -> dict[str, str]:
    """Return the text of the file."""
    linear = source.linear
    lines = comments(source, "#")
    for name, block in (("M_g", linear.gyro), ("G", linear.by_force), ("M_a", linear.accel)):
        lines += [f"# {name}", *map(row, block)]
    lines += ["# b_g", row(linear.gyro_bias), "# b_a", row(linear.accel_bias)]
    return {"": "\n".join(lines) + "\n"}
