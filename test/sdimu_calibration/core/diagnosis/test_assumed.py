"""What a coefficient takes for granted moves it by what is told, when it is there after all."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.assumed import assumed_absent
from sdimu_calibration.core.units import from_si


@pytest.fixture(scope="module")
def assumed(bench):
    return {one.coefficient: one for one in assumed_absent(bench.diagnosis(effects=()))}


# One rate of all turns, and every stop at +-1 g or level: of two orders the plan shows the sum.
@pytest.mark.parametrize("name", ["gyro_scale_x", "accel_scale_z"])
def test_a_coefficient_is_off_by_what_is_told_where_the_effect_is_there(bench, assumed, name):
    one = assumed[name]
    size = from_si(one.size, one.display_unit)
    without = bench.fit(effects=())
    with_it = bench.fit(effects=(f"{one.label}={size!r} {one.display_unit}",))
    k = without.sensors.names.index(name)
    after = bench.diagnosis(effects=()).after
    sigma = np.sqrt(np.diag(after.covariance))[after.names.index(name)]
    moved = abs(with_it.estimate[k] - without.estimate[k]) / sigma
    assert one.sigmas > 3.0
    # The same seed: the noise is the same in both.
    assert moved == pytest.approx(one.sigmas, rel=0.1)


def test_what_the_test_shows_well_is_not_taken_for_granted(assumed):
    # Misalignments of gyros show in turns of 90 deg, and nothing that a gyro does looks like them: only what the
    # accelerometers take for their axes, which are the frame of the report.
    moved = [one.label for name, one in assumed.items() if name.startswith("gyro_misalignment")]
    assert all(label.startswith("accel_") for label in moved)
    assert all(one.sigmas > 3.0 for one in assumed.values())


def test_what_a_drift_that_is_told_may_be_instead_is_not_taken_for_granted(bench):
    """A bias is its mean over the dwells, which drift it is moves it little; and the rivals are told with it."""
    hidden = ("accel_quadratic_z=25 ug/g^2", "gyro_bias_warm_up_y(tau=300 s)=0.07 deg/h")
    found = bench.diagnosis(12, hidden, "recommended")
    rivals = {share.name for one in found.found_effects for share in one.may_be}
    listed = {one.label.partition("(")[0] for one in assumed_absent(found)}
    assert len(rivals) > 2
    assert not rivals & listed


def test_a_coefficient_of_the_model_is_not_taken_as_absent_by_another_name(assumed):
    """A mass unbalance is a sensitivity to force: six of them were told to be 49 to 79 sigma off by themselves."""
    assert not [one for one in assumed.values() if one.label.startswith("gyro_g_sensitivity")]
