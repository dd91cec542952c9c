"""A sentence on several effects says which are certain, which are likely, and where another one may stand."""

from __future__ import annotations

import pytest

from sdimu_calibration.core.diagnosis.verdict import CERTAIN

HIDDEN = ("accel_quadratic_z=25 ug/g^2", "gyro_bias_warm_up_y(tau=300 s)=0.07 deg/h")


@pytest.fixture(scope="module")
def found(bench):
    return bench.diagnosis(12, HIDDEN, "recommended")


def test_the_certain_effect_is_called_certain_and_the_weak_one_is_not(found):
    p = {c.label: found.may_be(int(column))[0] for c, column in zip(found.chosen, found.found.chosen, strict=True)}
    assert p["accel_quadratic_z"] >= CERTAIN
    assert "certain accel_quadratic_z" in found.sentence
    (drift,) = [c for c in found.chosen if c.label != "accel_quadratic_z"]
    assert found.is_open(drift)
    _, shares = found.may_be(int(found.found.chosen[found.chosen.index(drift)]))
    told = found.sentence.partition(f"open {drift.label} or what looks the same (")[2].partition(")")[0]
    assert [s.name in told for s in shares if s.name != drift.coefficient][:3].count(True) == min(3, len(shares) - 1)
