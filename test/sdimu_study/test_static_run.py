"""A small study of static recordings: both orders are one result, and its errors are those that its sigmas say."""

from __future__ import annotations

import pytest

from sdimu_study.static import CASES, GROUPS, NOISES, STUDY


@pytest.mark.parametrize("grade", ["dtg", "mems_consumer"])
def test_up_and_down_in_any_order_are_one_result_with_honest_sigmas(grade):
    # A seed of its own: those of the study are 95001 and up.
    row = STUDY.of(CASES["up and down", grade])(70)
    assert row["same"]
    assert row["left_out"] == 0
    assert row["noise"] in NOISES
    assert row["count"] >= 24
    assert row["z2"] / row["count"] < 1.5**2
    assert row["largest_z"] < 4.5
    assert {row[f"{group} count"] for group in GROUPS} == {3}
    assert row["verdict"] == "consistent"
    line = STUDY.table({("up and down", grade): [row, {"error": "refused"}]}).lines[0]
    assert line[2] == "1 of 2"
    assert line[4] == "1 of 1"
