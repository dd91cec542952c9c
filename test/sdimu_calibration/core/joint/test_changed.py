"""A coefficient that one recording of a set has for itself: the unit changed before it or in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.advice import Kind
from sdimu_calibration.core.joint.changed import is_change
from sdimu_calibration.core.joint.set_diagnosis import _advice, diagnose_set, sites_to_check
from sdimu_calibration.core.joint.set_evidence import set_evidence
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.joint.set_verdict import SetFacts, SetFinding, _found
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.advice_words import sentence

from .conftest import here, short, unit_set


@pytest.mark.parametrize(("name", "size"), [("accel_scale_x", 40e-6), ("gyro_misalignment_xy", 2e-5)])
def test_a_coefficient_that_changed_is_told_as_such_and_not_as_physics_that_looks_like_it(options, name, size):
    some = unit_set(37, [short()] * 3, shift={2: {name: size}})
    found = diagnose_set(some.members, options, here)
    assert [(f.label, f.recording) for f in found.findings] == [(name, "r2")]
    (told,) = found.findings
    assert told.probability > 0.99
    assert told.value == pytest.approx(size, abs=4.0 * told.sigma)
    assert is_change(told.label)
    assert "changed by" in found.sentence
    assert "in r2" in found.sentence
    # The value of the unit is that of the other two.
    others = set_outcome(fit_set(some.members[:2], options, here))
    place = others.names.index(name)
    sigma = float(np.sqrt(others.covariance[place, place]))
    assert found.after.values[found.after.names.index(name)] == pytest.approx(others.values[place], abs=sigma)


def test_scale_factors_of_the_accelerometers_that_differ_alike_are_those_of_another_site(options):
    shift = {f"accel_scale_{axis}": 100e-6 for axis in "xyz"}
    found = diagnose_set(unit_set(37, [short()] * 3, shift={2: shift}).members, options, here)
    assert {(f.label, f.recording) for f in found.findings} == {(name, "r2") for name in shift}
    assert found.verdict == Verdict.DATA_FAULT
    assert sentence(found.advice[0]).startswith("Check the site of r2: ")


def changed(axis: str, ppm: float, recording: str = "r2") -> SetFinding:
    label = f"accel_scale_{axis}"
    return SetFinding(label, recording, ppm * 1e-6, 5e-6, 20.0, "1", "ppm", ())


def test_a_site_is_to_be_checked_where_all_three_differ_alike():
    x, y, z = changed("x", 105.0), changed("y", 95.0), changed("z", 100.0)
    (told,) = sites_to_check([x, y, changed("x", 9.0, "r1"), z])
    assert (told.kind, told.about) == (Kind.LOOK_AT_SITE, ())
    assert told.arguments == ("r2", "100.0 +- 2.9 ppm")
    assert sites_to_check([x, y]) == []
    assert sites_to_check([x, y, changed("z", 60.0)]) == []


def many(against):
    """Five coefficients that are others in one recording."""
    return [replace(changed(axis, ppm), against=against) for axis, ppm in zip("xyzxy", range(50, 100, 10), strict=True)]


@pytest.mark.parametrize(
    ("against", "says"), [("r1", "r1 and r2 differ in 5 coefficients"), ("", "in r2, the unit differs in 5")]
)
def test_so_many_coefficients_that_changed_are_told_as_another_unit_or_other_axes(against, says):
    (told,) = _found(Verdict.DATA_FAULT, SetFacts(many(against), None, None, None, None))
    assert told.startswith(f"Not one unit, or one that was changed, or axes or units that are read otherwise: {says}")
    (few,) = _found(Verdict.DATA_FAULT, SetFacts(many(against)[:3], None, None, None, None))
    assert few.startswith("All recordings agree but for")


@pytest.mark.parametrize(("against", "kind"), [("r1", Kind.RECORD_A_THIRD), ("", Kind.LOOK_AT_RECORDING)])
def test_one_advice_stands_for_all_that_changed_in_a_recording(against, kind):
    (told,) = _advice(Verdict.DATA_FAULT, many(against), (), ())
    assert told.kind == kind
    assert "accel_scale_x, accel_scale_y, accel_scale_z, accel_scale_x and others" in told.arguments


def test_of_two_recordings_the_difference_is_told_and_not_which_of_them_changed(options):
    # It is the first one that changed, and the second that is told to differ from it: the sign says so.
    some = unit_set(37, [short()] * 2, shift={0: {"accel_scale_x": 40e-6}})
    found = diagnose_set(some.members, options, here)
    assert [(f.label, f.recording, f.against) for f in found.findings] == [("accel_scale_x", "r1", "r0")]
    (told,) = found.findings
    assert told.value == pytest.approx(-40e-6, abs=4.0 * told.sigma)
    assert "from r0 to r1 (two recordings do not tell which of them changed)" in found.sentence
    assert [one.kind for one in found.advice] == [Kind.RECORD_A_THIRD]


def test_the_value_of_one_recording_stands_in_the_evidence_as_its_difference(options):
    some = unit_set(37, [short()] * 3, shift={2: {"accel_scale_x": 40e-6}})
    fit = fit_set(some.members, SetOptions(options.model, local={"r2": ("accel_scale_x",)}), here)
    evidence = set_evidence(fit, ())
    own, shared = (fit.names.index(n) for n in ("accel_scale_x@r2", "accel_scale_x"))
    difference = float(fit.estimate.values[own] - fit.estimate.values[shared])
    assert -evidence.shift[own] == pytest.approx(difference)
    assert difference == pytest.approx(40e-6, rel=0.2)
    # A change of the unit's value moves the rows of all three recordings, that of the difference those of one.
    moved = [
        len(np.unique(evidence.stop[np.abs(evidence.W[:, k]) > 1e-6 * np.abs(evidence.W[:, k]).max()]))
        for k in (own, shared)
    ]
    assert moved == [1, 3]


def test_an_effect_of_one_recording_is_told_of_none_of_the_others(options):
    own, one = (unit_set(37, [short()] * 3, effects) for effects in ((), ("accel_scale_asymmetry_y=60 ppm",)))
    found = diagnose_set((own.members[0], one.members[1], own.members[2]), options, here)
    assert found.verdict == Verdict.UNEXPLAINED
    assert found.sentence.startswith("Something differs between the recordings")
    assert "An error that follows the attitude is in r1 (accel_y" in found.sentence
    assert "come back" not in found.sentence
    assert [one.kind for one in found.advice] == [Kind.LOOK_AT_RECORDING]
    assert found.advice[0].arguments[0] == "r1"
    assert not found.unknown
