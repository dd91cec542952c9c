"""Table 3.3 of Kim, Song & Lyou, by covariance simulation with one noise set for all three mounts."""

import numpy as np
import pytest

from sdimu_calibration.core.planning.predict import largest_by_effect, predict
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_calibration.storage.files.noise_file import load_noise
from sdimu_calibration.storage.files.reference_file import read_columns, read_reference


@pytest.mark.parametrize("mount", read_columns("table33"))
def test_every_row_of_table_33_is_met_within_a_quarter(mount):
    what = load_plan("kim18"), load_site("daejeon"), load_imu("dtg"), load_model("baseline")
    angle = np.radians(float(mount.removesuffix(" deg")))
    found = largest_by_effect(predict(*what, mount_rad=np.full(3, angle), noise=load_noise("paper")))
    for effect, printed in read_reference("table33", mount).items():
        assert abs(found[effect] / printed - 1.0) < 0.25, effect


def test_table_33_lies_far_above_what_the_data_hold():
    # method.md 2.3: five to ten times. The paper's filter was told more noise than the IMU of its own page has.
    what = load_plan("kim18"), load_site("daejeon"), load_imu("dtg"), load_model("baseline")
    reached = largest_by_effect(predict(*what))
    for effect, printed in read_reference("table33", "1 deg").items():
        assert printed / reached[effect] > 4.0, effect
