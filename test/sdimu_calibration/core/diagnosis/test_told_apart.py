"""Two variants of one effect can be in a model together."""

from __future__ import annotations

from sdimu_calibration.core.diagnosis.candidates import split
from sdimu_calibration.core.diagnosis.rounds import told_apart
from sdimu_calibration.core.effects.imu_model import build
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.storage.config import load_imu


def test_two_steps_of_one_bias_make_a_model_with_two_names() -> None:
    chosen = [
        split(resolve(text))[0]
        for text in ("gyro_bias_step_y(t0=625 s)", "gyro_bias_step_y(t0=670 s)", "accel_quadratic_x")
    ]
    model = build(told_apart(chosen), load_imu("dtg"))
    assert model.names == ("gyro_bias_step_y", "gyro_bias_step_y(t0=670 s)", "accel_quadratic_x")
    # The prior is still that of the family.
    assert model.prior[0] == model.prior[1]
