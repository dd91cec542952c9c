"""The study of runs by hand in parts: the parts are those of one run, fitted in one scatter and each in its own."""

import numpy as np

from sdimu_study.parts import run, score, world


def test_parts_are_of_one_power_on_and_follow_each_other():
    one = world(("mems_by_hand",), 94_903)
    recordings = [member.open().recording for member in one.members]
    assert {member.power_on for member in one.members} == {"one"}
    ends = [r.start_ns + round(r.t[-1] * 1e9) for r in recordings]
    begins = [r.start_ns + round(r.t[0] * 1e9) for r in recordings[1:]]
    interval = recordings[0].interval_s * 1e9
    np.testing.assert_allclose(np.subtract(begins, ends[:-1]), interval, atol=0.1 * interval)


def test_both_ways_differ_and_the_sigmas_of_the_shared_scatter_hold():
    one = world(("mems_by_hand",), 94_903)
    found = run(one)
    assert not np.array_equal(found["shared"].covariance, found["own"].covariance)
    row = score(one, found)["shared"]
    # Some twenty errors over sigma: their root scatters by a sixth about one.
    assert 0.4 < (row["z2"] / row["count"]) ** 0.5 < 1.6
