"""The plans that the advice names exist, run on the ideal table, and have what makes effects testable."""

from __future__ import annotations

import numpy as np
import pytest

from rate_table_sim.core.motion import table_motion
from rate_table_sim.table_file import load_table
from sdimu_calibration.storage.files.config import load_plan


@pytest.mark.parametrize("name", ["kim18_signed", "recommended"])
def test_the_ideal_table_can_drive_it_both_ways_about_every_axis(name):
    plan = load_plan(name)
    motion = table_motion(plan, load_table("ideal"), 1)
    assert motion.t[-1] == pytest.approx(plan.duration_s, rel=0.02)
    for axis in "XYZ":
        assert {np.sign(t.angle_rad) for t in plan.turns if t.axis == axis} == {-1.0, 1.0}


def test_the_signed_plan_stands_where_the_plan_of_the_paper_stands():
    first, second = load_plan("kim18"), load_plan("kim18_signed")
    for a, b in zip(first.turns, second.turns, strict=True):
        assert a.axis == b.axis
        # The same attitude after it: half a turn back is half a turn on.
        assert np.cos(a.angle_rad - b.angle_rad) == pytest.approx(1.0)
    assert first.duration_s == pytest.approx(second.duration_s)


def test_the_recommended_plan_has_two_rates_about_every_axis_and_is_shorter():
    plan = load_plan("recommended")
    for axis in "XYZ":
        rates = [t.rate_rad_s for t in plan.turns if t.axis == axis]
        assert max(rates) > 4.0 * min(rates)
    assert plan.duration_s < load_plan("kim18").duration_s
    assert len(plan.dwell_s) == 28
