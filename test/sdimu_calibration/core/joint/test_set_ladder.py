"""The ladder of a set, and how far a recording drifts with what the others tell."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.estimation.free_inertial import AS_GIVEN, FOUND, NOTHING
from sdimu_calibration.core.joint import set_ladder
from sdimu_calibration.core.joint.set_diagnosis import diagnose_set
from sdimu_calibration.core.joint.set_fit import fit_set
from sdimu_calibration.report import first_screen
from sdimu_calibration.report.cost import in_use, in_use_entry
from sdimu_calibration.report.report_extras import of_navigations
from sdimu_calibration.report.use_section import in_use as use_section
from sdimu_calibration.storage.files.diagnosis_file import read_diagnosis, write_set_diagnosis

from .conftest import here, short, unit_set

AS_IT_IS = ("", frozenset())


@pytest.fixture(scope="module")
def bent(options):
    """Three recordings of a unit with an accelerometer that is not linear."""
    some = unit_set(9103, [short("kim18_signed", 10, 40.0)] * 3, ("accel_quadratic_x=100 ug/g^2",))
    return diagnose_set(some.members, options, here)


@pytest.fixture(scope="module")
def two(options):
    return fit_set(unit_set(41, [short("kim18_signed", 8, 20.0)] * 2).members, options, here)


def test_each_model_has_its_error_and_its_metres(bent):
    """A third of the prediction, or three times it, is chance; a model that lacks the effect is further off."""
    assert [f.label for f in bent.findings] == ["accel_quadratic_x"]
    assert [name for name, _ in bent.ladder.errors] == [AS_GIVEN, "+ accel_quadratic_x"]
    without, with_it = (error for _, error in bent.ladder.errors)
    assert without > 3.0 * with_it
    assert [[d.name for d in one.drifts] for one in bent.ladder.in_use] == [[NOTHING, AS_GIVEN, FOUND]] * 3
    assert [one.recording for one in bent.ladder.in_use] == ["r0", "r1", "r2"]
    use = in_use(of_navigations(bent.ladder))
    assert use.distance[0] > use.distance[1] > use.distance[2]
    assert use.promised / 3.0 < use.distance[2] < 3.0 * use.promised


def test_page_file_and_words_tell_the_same_metres(bent, tmp_path):
    more = of_navigations(bent.ladder)
    write_set_diagnosis(tmp_path / "diagnosis.json", bent, in_use_entry(more))
    told = read_diagnosis(tmp_path).in_use
    assert [one["model"] for one in told["position"]] == ["not compensated", AS_GIVEN, FOUND]
    assert told["stretches"] == 3
    grown = json.loads((tmp_path / "diagnosis.json").read_text())["grown"]
    assert [(one["added"], one["held_out_rms"]) for one in grown] == list(bent.ladder.rungs)
    metres = [f"{one['rms_m']:.0f} m" for one in told["position"] if one["rms_m"] < 1000.0]
    ladder = first_screen.of_set(bent).ladder
    assert metres
    assert all(f"<td>{text}</td>" in ladder for text in metres)
    section = use_section(more, lambda _: "")
    assert all(f"of {name}:" in section for name in ("r0", "r1", "r2"))


def test_a_recording_is_navigated_without_anything_of_its_own(two):
    """Not one digit of what the others tell hangs on the rows of the recording."""
    first, second = two.reports
    rows = replace(first.reduction, y=first.reduction.y + 100.0)
    changed = replace(two, reports=(replace(first, reduction=rows), second))
    told, same = (set_ladder._of_others(fit, fit.reports[0], *AS_IT_IS) for fit in (two, changed))
    assert np.array_equal(told.values, same.values)
    assert np.array_equal(told.covariance, same.covariance)
    other = set_ladder._of_others(changed, changed.reports[1], *AS_IT_IS)
    assert not np.array_equal(other.values, set_ladder._of_others(two, second, *AS_IT_IS).values)


def test_biases_of_another_power_on_have_its_scatter_and_what_a_model_lacks_is_zero(two):
    bias, lacking = two.names.index("gyro_bias_x"), two.names.index("accel_scale_x")
    told = set_ladder._of_others(two, two.reports[0], "x", {"accel_scale_x"})
    own = [told.names.index(two.names[k]) for k in (bias, lacking)]
    tau = {t.effect: t.sigma for t in two.turn_on}
    assert told.covariance[own[0], own[0]] > tau["gyro_bias"] ** 2 > 0.0
    assert told.values[own[1]] == told.covariance[own[1], own[1]] == 0.0


def test_runs_by_hand_are_not_navigated(two):
    by_hand = replace(two, reports=tuple(replace(r, estimator="handheld") for r in two.reports))
    assert set_ladder._navigated(by_hand) == []
    assert set_ladder._navigated(two) == [0, 1]


def test_of_many_recordings_four_are_navigated_and_none_with_a_fault_of_its_own(two):
    many = replace(two, reports=tuple(replace(two.reports[0], name=f"r{k}") for k in range(9)), local={"r4": ("x",)})
    assert set_ladder._navigated(many) == [0, 2, 6, 8]
