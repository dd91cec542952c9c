"""The error at recordings held out: how far chance takes it where there are few recordings."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.joint.set_diagnosis import diagnose_set
from sdimu_calibration.core.joint.set_evidence import held_out, held_out_chance
from sdimu_calibration.core.joint.set_fit import SetFit, SetOptions, fit_set, with_reports
from sdimu_calibration.report import first_screen
from sdimu_calibration.storage.files.config import load_model
from sdimu_calibration.storage.set_work import judged_outcome

from .conftest import here, short, unit_set


@pytest.fixture(scope="module")
def two() -> SetFit:
    """Recordings of plans that see different things; the model lets nothing differ from power-on to power-on."""
    some = unit_set(35, [short("kim18_signed"), short("kim18")])
    scopes = dict.fromkeys(("gyro_bias", "accel_bias"), "unit")
    return fit_set(some.members, SetOptions(load_model("baseline"), scopes=scopes), here)


def drawn(fit: SetFit, rng: np.random.Generator) -> SetFit:
    """The set with coefficients from their priors and noise drawn anew."""
    values = rng.standard_normal(len(fit.names)) / np.sqrt(fit.weight)
    truth = dict(zip(fit.names, values.tolist(), strict=True))
    reports = []
    for report in fit.reports:
        own = report.reduction
        y = own.A[:, : len(own.names)] @ [truth[name] for name in own.names] + rng.standard_normal(len(own.y))
        reports.append(replace(report, reduction=replace(own, y=y)))
    return with_reports(fit, reports)


def test_what_chance_reaches_is_known_for_two_recordings(two):
    rng = np.random.default_rng(1)
    errors = np.array([held_out(drawn(two, rng)).rms for _ in range(1000)])
    for p in (0.5, 0.1, 0.02):
        limit = np.quantile(errors, 1.0 - p)
        # Four standard deviations of a share of 1000.
        assert held_out_chance(two, float(limit)) == pytest.approx(p, abs=4.0 * np.sqrt(p * (1.0 - p) / 1000.0))


def test_power_ons_that_differ_are_beyond_chance(two):
    # Their biases were switched on anew, which this model denies.
    assert held_out_chance(two, held_out(two).rms) < 1e-6


def test_a_set_is_judged_by_its_prediction_of_recordings_held_out(two):
    """That recordings do not predict each other is a misfit, whatever their innovations are; chance is none."""
    told = judged_outcome(two)
    assert any("do not predict each other" in line for line in told.misfits)
    assert set(told.misfits) <= set(told.notes)
    right = judged_outcome(drawn(two, np.random.default_rng(3)))
    assert not any("do not predict each other" in line for line in right.warnings)


def test_two_recordings_that_lack_an_effect_show_it_in_the_noise_of_those_that_have_it(options):
    """By itself each recording takes what it lacks for noise, in which its error is no larger than with the effect."""
    some = unit_set(36, [short("kim18_signed")] * 2, ("accel_quadratic_x=30 ug/g^2",))
    found = diagnose_set(some.members, options, here)
    with_it = found.after.fit["held_out_rms"]
    assert [f.label for f in found.findings] == ["accel_quadratic_x"]
    assert with_it < 1.25
    assert found.before.fit["held_out_rms"] < 0.5 * found.ladder.error_without
    assert found.ladder.error_without > 1.5 * with_it
    # The sentence is of the effects: an error near 1 may stand beside a coefficient that is far off.
    shown = re.sub("<[^>]+>", "", first_screen.of_set(found).head)
    assert found.sentence == shown.replace("\N{PLUS-MINUS SIGN}", "+-").replace("\u00a0", " ")
    assert not re.search(r"held out|->", found.sentence)
    assert f"<td>{found.ladder.error_without:.3f}</td>" in first_screen.of_set(found).ladder


def test_a_model_without_one_of_its_coefficients_predicts_worse(two):
    assert held_out(two, ("gyro_bias_x",)).rms > 2.0 * held_out(two).rms
