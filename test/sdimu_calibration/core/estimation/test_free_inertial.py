"""Navigation without aid on what no fit has seen: nothing drifts by itself, and drift is what theory says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.prepared import reduce, set_up
from sdimu_calibration.core.estimation.free_inertial import NOTHING
from sdimu_calibration.core.estimation.holdout import LEAST_S, WANTED_S, holdout_segments, part
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.planning.nominal import nominal_recording
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.units import to_si

RATE = np.radians(5.0)
TURNS = tuple(
    Turn(axis, np.radians(angle), RATE)
    for axis, angle in (("Y", 90), ("Z", 90), ("X", 90), ("Y", -180), ("X", 180), ("Z", -90), ("Y", 90), ("X", -90))
)


def plan_of(dwell_s: float, turns: tuple[Turn, ...] = TURNS) -> Plan:
    return Plan("test", (dwell_s,) * (len(turns) + 1), turns, np.radians(20.0))


def trials_of(recording, setup):
    return solve(PreparedTest(recording, setup.imu, setup.site), setup.model, "filter").free_inertial([])


@pytest.fixture
def setup(site, imu, model):
    return set_up(site, imu, model)


def test_a_perfect_imu_does_not_drift(setup, site):
    for trial in trials_of(nominal_recording(plan_of(180.0), site), setup):
        assert trial.segment.length_s == pytest.approx(WANTED_S, abs=1.0)
        for drift in trial.drifts:
            # 1 m in 10 min is a constant error of 0.6 ug: less than a tenth of what the noise makes of a dwell.
            assert drift.distance.max() < 1.0
            assert np.degrees(np.abs(drift.heading)).max() * 3600.0 < 1.0


def test_a_gyro_bias_drifts_as_schuler_says(site, imu):
    """At rest and level, a bias e of the north gyro makes ``R e (t - sin(w t) / w)`` east, w the Schuler rate."""
    bias = to_si(0.5, "deg/h")
    recording = nominal_recording(plan_of(1800.0, ()), site)
    recording = replace(recording, omega_ib_b=recording.omega_ib_b + np.array([bias, 0.0, 0.0]))
    setup = set_up(site, imu, Model(("gyro_bias",)))
    for trial in trials_of(recording, setup):
        (drift,) = (d for d in trial.drifts if d.name == NOTHING)
        radius = earth.radii(site.latitude_rad)[1] + site.height_m
        w = np.sqrt(setup.gravity / radius)
        expected = radius * bias * (drift.t - np.sin(w * drift.t) / w)
        # Earth rate turns the growing tilt by at most 2.5 deg in 10 min: 1 - cos of it is 0.1 %, its sine 4 %.
        assert np.abs(drift.position[-1, 1]) == pytest.approx(expected[-1], rel=0.01)
        assert np.abs(drift.position[-1, 0]) < 0.1 * expected[-1]


def test_a_compensation_drifts_as_its_fit_promises_and_far_less_than_none(setup, recorded_test):
    """Seeds 1 to 4, both ends: squared distances over the promise have the mean 1."""
    ratios = []
    for seed in range(1, 5):
        for trial in trials_of(recorded_test(plan_of(120.0), rate_hz=10.0, seed=seed), setup):
            nothing, compensated = trial.drifts
            ratios.append((compensated.distance[-1] / compensated.promised[-1]) ** 2)
            assert np.isnan(nothing.promised).all()
            # The specification is some hundred times what the fit leaves.
            assert compensated.distance[-1] < 0.3 * nothing.distance[-1]
    # Each is between chi-square of one and of two degrees of freedom over its number: standard deviation at most 1.4.
    # Eight of them: within four standard errors above; below, the distribution ends at zero: a tenth of the mean.
    assert len(ratios) == 8
    assert 0.1 < np.mean(ratios) < 1.0 + 4.0 * 1.4 / np.sqrt(8)


def test_a_stretch_and_its_fit_share_no_sample(setup, site):
    prepared = reduce(nominal_recording(plan_of(150.0), site), setup)
    stretches = holdout_segments(prepared)
    assert [s.place for s in stretches] == ["end", "start"]
    for stretch in stretches:
        seen = part(prepared, *stretch.seen).cycles
        kept = part(prepared, stretch.first, stretch.last).cycles
        assert not set(seen.t) & set(kept.t)
        if stretch.place == "end":
            # What comes after a stretch would tell of it too: there is none.
            assert seen.t[-1] <= kept.t[0] - kept.dt[0] + 1e-9
        else:
            assert seen.t[0] - seen.dt[0] >= kept.t[-1] - 1e-9
        rest = prepared.phases.used[stretch.first : stretch.start]
        assert rest.all()


def test_half_of_a_short_recording_is_left_to_the_fit(setup, site):
    prepared = reduce(nominal_recording(plan_of(60.0), site), setup)
    total = prepared.epochs.end[-1]
    assert total < 2.0 * WANTED_S
    for stretch in holdout_segments(prepared):
        assert LEAST_S <= stretch.length_s < WANTED_S
        first, last = stretch.seen
        assert prepared.epochs.end[last - 1] - prepared.epochs.start[first] >= 0.5 * total - 1e-6


def test_a_recording_of_minutes_has_nothing_to_spare(setup, site):
    prepared = reduce(nominal_recording(plan_of(30.0, TURNS[:1]), site), setup)
    with pytest.raises(DataError, match="too short"):
        holdout_segments(prepared)


def test_all_models_start_from_the_azimuth_of_the_model_with_what_was_found(setup, site, imu):
    recording = nominal_recording(plan_of(180.0), site)
    # What the base model lacks turns its azimuth: half of it is a scale factor, the other half is not.
    asymmetry = 40e-6 * np.abs(recording.omega_ib_b[:, 1])
    omega = recording.omega_ib_b + np.column_stack([0.0 * asymmetry, asymmetry, 0.0 * asymmetry])
    test = PreparedTest(replace(recording, omega_ib_b=omega), imu, site)
    lacking = solve(test, setup.model, "filter")
    found = solve(test, Model((*setup.model.effects, "gyro_scale_asymmetry_y")), "filter")
    for together, alone in zip(
        lacking.free_inertial([("with what was found", found)]), found.free_inertial([]), strict=True
    ):
        assert [d.name for d in together.drifts] == [NOTHING, "model as given", "with what was found"]
        for one, other in ((together.drifts[0], alone.drifts[0]), (together.drifts[2], alone.drifts[1])):
            np.testing.assert_array_equal(one.position, other.position)
