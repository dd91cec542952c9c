"""What an open class costs is told from the sigmas that it widens, and nothing where it widens none."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.found import found_effects
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.core.estimation.outcome import WIDER
from sdimu_calibration.core.posterior.coefficients import Averages
from sdimu_calibration.report.sections import confused

RAMP = ("accel_bias_ramp_x=20 ug/h",)


def _sigma(diagnosis, models, name):
    """Sigma of a coefficient over some models: of each, and of their means."""
    board = diagnosis.found.posterior.board
    averages, k = Averages(board, diagnosis.fit.dwell_means), board.evidence.names.index(name)
    each = [averages.of_model(m.members, m.noise) for m in models]
    weight = np.array([m.probability for m in models]) / sum(m.probability for m in models)
    mean, variance = (np.array(v) for v in zip(*((m.mean[k], m.covariance[k, k]) for m in each), strict=True))
    return float(np.sqrt(weight @ variance + weight @ (mean - weight @ mean) ** 2))


def test_an_open_ramp_names_the_bias_that_is_known_less_well_for_its_sake(bench):
    """The page said "nothing that matters" where a bias was known four times less well."""
    diagnosis = bench.diagnosis(102, RAMP)
    (one,) = diagnosis.found_effects
    ((name, factor),) = one.widened
    assert name == "accel_bias_x"
    assert factor > 3.0
    window, own = diagnosis.found.posterior, one.candidate.coefficient
    known = [m for m in window.models if any(window.candidate(k).coefficient == own for k, _ in m.members)]
    ratio = _sigma(diagnosis, window.models, name) / _sigma(diagnosis, known, name)
    assert factor == pytest.approx(ratio, rel=0.1)
    page = confused(summarise(diagnosis))
    assert f"the sigma of accel_bias_x is {factor:.1f} times what it would be if this were known to be {own}" in page
    assert "nothing that matters" not in page


def test_what_is_told_which_it_is_widens_nothing(bench):
    (one,) = found_effects(bench.diagnosis(effects=("accel_scale_asymmetry_z=60 ppm",)))
    assert one.widened == ()


def test_what_is_widened_by_less_than_is_seen_in_use_is_not_named(bench):
    diagnosis = bench.diagnosis(101, RAMP)
    (one,) = diagnosis.found_effects
    assert len(one.may_be) > 1
    window = diagnosis.found.posterior
    assert _sigma(diagnosis, window.models, "accel_bias_x") < WIDER * _sigma(diagnosis, [window.told], "accel_bias_x")
    assert one.widened == ()
    assert "nothing that matters" in confused(summarise(diagnosis))
