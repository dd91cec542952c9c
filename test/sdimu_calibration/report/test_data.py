"""The numbers behind the figures are those of the diagnosis, laid out for the eye."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.report import data

HIDDEN = "accel_quadratic_x"


def test_residuals_are_the_whitened_innovations_coloured_again(diagnosis):
    found = data.residuals(diagnosis)
    evidence = diagnosis.evidence
    model, weight = evidence.model, evidence.weight
    white = evidence.e - evidence.W[:, model] @ evidence.information.estimate(model, weight)[0]
    innovation = np.nan_to_num(found.before) * np.nan_to_num(found.sigma)
    for epoch in np.unique(evidence.epoch)[::50]:
        rows = evidence.epoch == epoch
        channels = evidence.channel[rows]
        L = evidence.output.L[epoch][np.ix_(channels, channels)]
        assert np.linalg.solve(L, innovation[epoch, channels]) == pytest.approx(white[rows], abs=1e-9)


def test_what_is_not_measured_has_no_residual(diagnosis):
    found = data.residuals(diagnosis)
    assert np.array_equal(np.isfinite(found.after), np.isfinite(diagnosis.evidence.output.normalised))
    assert np.array_equal(np.isfinite(found.sigma), np.isfinite(found.before))


def test_stop_means_stand_out_before_and_are_noise_after(diagnosis):
    found = data.residuals(diagnosis)
    before, after = data.stop_grid(found, after=False), data.stop_grid(found, after=True)
    assert np.nanmax(np.abs(before.value)) > 6.0
    # 228 standard normal numbers exceed 4.8 once in 3000 tests.
    assert np.nanmax(np.abs(after.value)) < 4.8


def test_the_grid_has_every_channel_and_stop_of_the_check(diagnosis):
    grid = data.where(diagnosis.consistency)
    assert np.isfinite(grid.value).sum() == len(diagnosis.consistency.where)
    for mean in diagnosis.consistency.where:
        row = CHANNEL_NAMES.index(mean.channel)
        assert grid.value[row, list(grid.stops).index(mean.stop)] == mean.normalised_mean


def test_the_hidden_effect_ranks_first_and_leaves_nothing(diagnosis):
    entries = data.scored(diagnosis)
    assert entries[0].label == HIDDEN
    assert entries[0].chosen
    assert entries[0].left == 0.0
    assert max(abs(entry.left) for entry in entries) < diagnosis.found.threshold + 1.0


def test_scores_are_those_of_the_search(diagnosis):
    best = data.scored(diagnosis)[0]
    step = diagnosis.found.steps[0]
    assert best.z == pytest.approx(step.z, rel=1e-9)
    assert best.estimate == pytest.approx(best.z * best.sigma, rel=1e-9)


def test_one_bar_stands_for_all_onsets_of_a_step(diagnosis):
    labels = [entry.label.partition("(")[0] for entry in data.best_variants(data.scored(diagnosis))]
    assert len(labels) == len(set(labels))
    assert "gyro_bias_step_x" in labels


def test_misfit_lies_on_what_the_found_effect_predicts(diagnosis):
    (part,) = data.explained(diagnosis)
    slope = part.predicted @ part.misfit / (part.predicted @ part.predicted)
    # Least squares leaves a residual orthogonal to the regressor, up to the priors, which are small here.
    assert slope == pytest.approx(1.0, abs=1e-2)
    # The square of the length of the prediction is the fall of chi-square, up to the priors.
    fall = 2.0 * diagnosis.found.steps[0].log_likelihood_gain
    assert np.linalg.norm(part.predicted) ** 2 == pytest.approx(fall, rel=0.02)


def test_free_inputs_alternate_between_stops_and_turns_in_time(diagnosis):
    found = data.free_inputs(diagnosis)
    assert np.all(np.diff(found.start) > 0.0)
    assert np.array_equal(found.turn, np.arange(len(found.start)) % 2 == 1)
    assert np.all(found.end[:-1] <= found.start[1:] + 1e-6)


def test_variables_at_rest_are_gravity_and_earth_rate(diagnosis):
    values = data.variables(diagnosis)[np.isfinite(data.residuals(diagnosis).before[:, 8])]
    assert np.linalg.norm(values[:, :3], axis=1) == pytest.approx(1.0, abs=2e-3)
    assert np.linalg.norm(values[:, 3:6], axis=1) == pytest.approx(15.041, abs=1e-3)


def test_bins_do_not_tear_equal_values_apart():
    x = np.repeat([1.0, 2.0, 3.0, 4.0], [7, 1, 20, 2])
    y = x**2
    at, mean, error = data.binned(x, y, bins=3)
    assert len(at) <= 3
    assert 4.0 not in at[:-1]
    # Means of bins, weighted by their counts (1 / error^2), keep the mean of all.
    assert np.sum(mean / error**2) == pytest.approx(y.sum(), rel=1e-12)
    assert np.sum(at / error**2) == pytest.approx(x.sum(), rel=1e-12)


def test_bins_of_nothing_are_nothing():
    assert all(len(part) == 0 for part in data.binned(np.full(3, np.nan), np.ones(3), 4))


def test_a_thinned_curve_keeps_its_extremes():
    rng = np.random.default_rng(3)
    x, y = np.arange(5000.0), rng.standard_normal(5000)
    y[[17, 4321]] = -9.0, 9.0
    thin_x, thin_y = data.envelope(x, y, 200)
    assert len(thin_x) <= 200
    assert {(17.0, -9.0), (4321.0, 9.0)} <= set(zip(thin_x, thin_y, strict=True))
    assert np.all(np.diff(thin_x) > 0.0)


def test_no_line_is_drawn_over_a_gap():
    x, y = data.interrupted(np.array([0.0, 1.0, 9.0]), np.ones(3), gap=2.0)
    assert np.array_equal(np.isnan(x), [False, False, True, False])
    assert np.array_equal(np.isnan(y), np.isnan(x))


def test_hardest_pairs_are_the_strongest_of_either_sign():
    C = np.array([[1.0, 0.2, -0.9], [0.2, 1.0, 0.6], [-0.9, 0.6, 1.0]])
    assert data.hardest_pairs(("a", "b", "c"), C) == [("a", "c", -0.9), ("b", "c", 0.6)]


def test_the_correlation_leaves_out_what_the_frame_fixes(diagnosis):
    names, C = data.correlation(diagnosis.after)
    assert not {"accel_misalignment_xy", "accel_misalignment_xz", "accel_misalignment_yx"} & set(names)
    assert np.diag(C) == pytest.approx(np.ones(len(names)))
    assert np.abs(C).max() <= 1.0 + 1e-9
