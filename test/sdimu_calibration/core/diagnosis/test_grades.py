"""A sentence on several effects says which are certain, which are likely, and where another one may stand."""

from __future__ import annotations

import pytest

from sdimu_calibration.core.diagnosis.grades import CERTAIN, NAMED, named

HIDDEN = ("accel_quadratic_z=25 ug/g^2", "gyro_bias_warm_up_y(tau=300 s)=0.07 deg/h")


@pytest.fixture(scope="module")
def found(bench):
    return bench.diagnosis(12, HIDDEN, "recommended")


def test_the_certain_effect_is_called_certain_and_the_weak_one_is_not(found):
    p = {c.label: found.may_be(int(column))[0] for c, column in zip(found.chosen, found.found.chosen, strict=True)}
    assert p["accel_quadratic_z"] >= CERTAIN
    assert f"Certain: {named('accel_quadratic_z')} (" in found.sentence
    (drift,) = [c for c in found.chosen if c.label != "accel_quadratic_z"]
    _, shares = found.may_be(int(found.found.chosen[found.chosen.index(drift)]))
    others = [s for s in shares if s.name != drift.coefficient and s.probability >= NAMED]
    assert others
    told = found.sentence.rpartition(": ")[2]
    assert all(named(s.name) in told for s in others[:2])
