"""A recording of another unit is told as that before any physics is sought."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sdimu_calibration.core.joint.member import Job
from sdimu_calibration.core.joint.same_unit import check_one_unit
from sdimu_calibration.core.joint.set_fit import fit_set
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_model

from .conftest import here, short, unit_set


@pytest.fixture(scope="module")
def reports():
    """Three recordings of one unit, and one of another, each by its own fit."""
    own, other = unit_set(31, [short()] * 3).members, unit_set(32, [short()]).members

    return here([Job(m, load_model("baseline")) for m in (*own, replace(other[0], name="strange"))])


def test_one_unit_passes(reports):
    check_one_unit(reports[:3])
    check_one_unit(reports[:1])


def test_the_recording_of_another_unit_is_named(reports):
    with pytest.raises(
        DataError, match=r"'strange' is of another unit than the others.*(ppm|arcmin|deg/h/g) \(\d+ sigma\)"
    ):
        check_one_unit(reports)


def test_of_two_recordings_none_is_the_stranger(reports):
    with pytest.raises(DataError, match="'r0' and 'strange' are of two units"):
        check_one_unit([reports[0], reports[3]])


def test_temperatures_far_apart_may_change_a_unit_as_much(reports):
    cold, warm = (replace(r, temperature_degc=t) for r, t in ((reports[0], -20.0), (reports[3], 50.0)))
    check_one_unit([cold, warm])


def test_a_set_is_refused_before_physics_is_sought(options):
    own, other = unit_set(31, [short()] * 2).members, unit_set(32, [short()]).members
    with pytest.raises(DataError, match="'strange' is of another unit"):
        fit_set((*own, replace(other[0], name="strange")), options, here)
