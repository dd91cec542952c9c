"""An error that follows the attitude in an unknown way, in turns too, leaves the sigmas right."""

from __future__ import annotations

import pytest

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.noise_term import ATTITUDE
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
from sdimu_study.score import errors
from sdimu_study.worlds import simulated_test

WAVES = (
    ("accel_x: sin(7 fx/g + 4 fy/g)=40 ug", "kim18_signed", 41),
    ("accel_y: sin(4.48 fx/g + 2.77 fy/g + 3.44 fz/g)=40 ug", "kim18", 27),
)


@pytest.mark.parametrize(("hidden", "plan", "seed"), WAVES, ids=("x", "y"))
def test_coefficients_are_as_good_as_their_sigmas_say(hidden, plan, seed):
    """With one size for the sensors of a triad RMS z 2.3 of the first; without functions in turns 6.0 of the second."""
    test, sensor = simulated_test("dtg", load_imu("dtg"), plan, load_site("daejeon"), seed, (hidden,))
    found = climb(solve(test, load_model("baseline")))
    assert found.verdict == Verdict.UNEXPLAINED
    sensor_of_it = hidden.partition(":")[0].replace("_", " ")
    assert [(term.where, term.kind) for term in found.found.noise] == [(sensor_of_it, ATTITUDE)]
    assert not found.chosen
    scored = errors(found.after, sensor)
    assert (scored["z2"] / scored["count"]) ** 0.5 < 1.5
    assert scored["largest_z"] < 4.5
