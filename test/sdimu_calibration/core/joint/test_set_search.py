"""What a set tells that one of its recordings does not."""

from __future__ import annotations

import pytest

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.joint.set_diagnosis import diagnose_set
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.config import load_model

from .conftest import here, short, unit_set

ASYMMETRY = "gyro_scale_asymmetry_y=3 ppm"


def test_a_weak_effect_is_found_in_all_recordings_together(options):
    some = unit_set(31, [short(stops=26)] * 6, (ASYMMETRY,))
    alone = climb(solve(some.members[0].open(), load_model("baseline")))
    found = diagnose_set(some.members, options, here)
    assert not alone.chosen
    assert [f.label for f in found.findings] == ["gyro_scale_asymmetry_y"]
    assert found.findings[0].value == pytest.approx(3e-6, abs=4.0 * found.findings[0].sigma)
    assert found.verdict in {"one effect", "class of effects"}
    assert found.after.model[-1] == "gyro_scale_asymmetry_y"


def test_a_clean_set_is_consistent(options):
    some = unit_set(32, [short(), short("kim18_signed"), short()])
    found = diagnose_set(some.members, options, here)
    assert found.verdict == "consistent"
    assert not found.findings
    assert found.after.fit["held_out_rms"] < 1.25


def test_a_fault_of_one_recording_is_told_of_that_one(options):
    some = unit_set(33, [short()] * 3)
    bad = unit_set(33, [short()] * 3, ("gyro_bias_step_x(t0=400 s)=0.3 deg/h",))
    found = diagnose_set((*some.members[:2], bad.members[2]), options, here)
    assert {f.recording for f in found.findings} == {"r2"}
    assert found.findings[0].label.startswith("gyro_bias_step_x(")
    assert found.verdict == "data fault"
    assert "r2" in found.sentence


def test_one_recording_is_no_set(options):
    with pytest.raises(DataError, match="a set of one recording"):
        diagnose_set(unit_set(32, [short()]).members, options, here)
