"""Recordings by hand of few rests learn one scatter together; one that scatters otherwise keeps its own."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.handheld.run_scatter import FORCE
from sdimu_calibration.core.joint.member import Job, tried
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.config import load_imu, load_model
from sdimu_sim.core.by_hand import ByHand
from sdimu_study.parts import parts as cut

from .conftest import here

IMU = load_imu("mems_by_hand")
OPTIONS = SetOptions(load_model("hand"))
ALIKE = to_si(200.0, "ug")
"""What forces scatter by from rest to rest."""


def parts(seed, rests, scatter):
    """Parts of a run by hand, the forces at each rest off by a scatter (m/s^2) of the part."""
    return cut(ByHand(sum(rests), IMU, Site(np.radians(45.0)), seed=seed), rests, scatter)[0]


@pytest.fixture(scope="module")
def sets():
    """Sets of two parts of seven rests that scatter alike, and what each part learns by itself."""
    members = [parts(seed, (7, 7), (ALIKE, ALIKE)) for seed in range(1, 7)]
    alone = [tried(Job(member, OPTIONS.model)).by_hand.extra for pair in members for member in pair]
    return [fit_set(pair, OPTIONS, here) for pair in members], alone


def error(sigmas):
    """RMS of the logarithm of sigmas of the forces over the true one; one learned as none counts as a tenth of it."""
    ratio = np.maximum(np.array([sigma[FORCE] for sigma in sigmas]) / ALIKE, 0.1)
    return float(np.sqrt(np.mean(np.log(ratio) ** 2)))


def test_parts_of_a_run_have_one_scatter_nearer_than_their_own(sets):
    fits, alone = sets
    for fit in fits:
        one, other = (report.scatter for report in fit.reports)
        np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(fit.reports[0].by_hand.extra, one)
    assert error([fit.reports[0].scatter for fit in fits]) < 0.5 * error(alone)


def test_parts_are_one_unit_that_stays_the_same(sets):
    fits, _ = sets
    assert [warning for fit in fits for warning in set_outcome(fit).warnings] == []


def test_the_scatter_does_not_depend_on_the_order():
    members = parts(3, (7, 8), (ALIKE, ALIKE))
    one, other = (fit_set(order, OPTIONS, here) for order in (members, members[::-1]))
    np.testing.assert_array_equal(one.reports[0].scatter, other.reports[0].scatter)
    np.testing.assert_array_equal(one.estimate.values, other.estimate.values)


def test_a_part_that_scatters_otherwise_keeps_its_own():
    fit = fit_set(parts(5, (20, 20, 20), (0.1 * ALIKE, 0.1 * ALIKE, 10.0 * ALIKE)), OPTIONS, here)
    quiet, also, wild = fit.reports
    np.testing.assert_array_equal(quiet.scatter, also.scatter)
    told = [note for note in set_outcome(fit).notes if "beyond white noise" in note]
    assert [note.split(":")[0] for note in told] == ["part 0, part 1", "part 2"]
    assert quiet.scatter[FORCE] < ALIKE < wild.by_hand.extra[FORCE]


@pytest.mark.parametrize("seed", [1, 2])
def test_a_wild_part_that_makes_the_scatter_of_all_parts_from_them(seed):
    """By its own likelihood alone it stayed: the scatter of all was nearly its own."""
    fit = fit_set(parts(seed, (7, 7, 7), (0.3 * ALIKE, 0.3 * ALIKE, 3.0 * ALIKE)), OPTIONS, here)
    *quiet, wild = fit.reports
    assert max(one.scatter[FORCE] for one in quiet) < ALIKE < wild.scatter[FORCE]
