"""A sensitivity to force along the spin axis is found beside what a turn of the frame makes of mass unbalance."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.estimation.solve import extend, solve
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.units import to_si
from sdimu_calibration.core.verdict import Verdict

HIDDEN = "gyro_g_sensitivity_xz"


@pytest.fixture(scope="module")
def found(bench):
    return bench.diagnosis(102, (f"{HIDDEN}=0.3 deg/h/g",))


def test_it_is_found_with_its_size(found):
    assert found.verdict == Verdict.ONE_EFFECT
    (one,) = found.found_effects
    assert one.candidate.label == HIDDEN
    assert abs(one.value - to_si(0.3, "deg/h/g")) < 4.0 * one.sigma


def test_no_prior_that_nobody_stated_contradicts_the_data(found):
    assert found.fit.contradicted_priors() == []
    assert "prior" not in found.sentence


def test_a_model_without_misalignments_keeps_its_frame_when_they_are_added(bench):
    effects = tuple(e for e in bench.model.effects if e != "accel_misalignment")
    fit = solve(bench.fit().test, Model(effects), learn=False)
    wider = extend(fit, [resolve("accel_misalignment")], learn=False)
    added = wider.added_columns(6)
    assert (np.array(wider.setup.sensors.names)[added] == wider.names[-6:]).all()
    assert min(added) >= len(effects)
