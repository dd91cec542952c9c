"""A joint fit of simulated recordings: against all rows at once, with one attitude each, and in bad company."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.estimation.solve import with_effects
from sdimu_calibration.core.joint import set_fit
from sdimu_calibration.core.joint.member import Member, fitted, run
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set, job_of
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.joint.variation import _scatter, variation
from sdimu_calibration.core.noise_term import may_be_an_effect
from sdimu_calibration.core.note import Topic, topic_of
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import to_si
from sdimu_calibration.storage.files.effect_file import extended_model
from sdimu_calibration.storage.files.result_file import as_note
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.score import baseline_z

from .conftest import InMemory, _recorded, here, short, switched_on, unit_set


def errors(result, truth):
    return baseline_z(result, ImuTruth(coefficients=dict(truth)))


def test_the_set_is_the_least_squares_of_all_rows(options):
    # One power-on, so that all are linear about nearly one point and nothing differs between them.
    members = tuple(
        Member(f"r{k}", InMemory(_recorded(5, k, short(), (), (), None, 0)), power_on="1") for k in range(3)
    )
    fit = fit_set(members, options, here)
    J, d = 0.0, 0.0
    for member in fit.members:
        # The rows as the navigation leaves them, thousands, about the recording's own fit.
        own = fitted(job_of(member, SetOptions(fit.model), None))
        rows = own.evidence()
        assert own.noise_terms == ()
        p = rows.coefficients
        assert rows.names[:p] == fit.names
        assert len(rows.e) > 20 * len(rows.names)
        own_J, own_d = rows.W.T @ rows.W, rows.W.T @ (rows.e - rows.W @ rows.shift)
        # What only serves is of each recording alone.
        gain = np.linalg.solve(own_J[p:, p:] + np.diag(rows.weight[p:]), own_J[p:, :p]).T
        J, d = J + own_J[:p, :p] - gain @ own_J[p:, :p], d + own_d[:p] - gain @ own_d[p:]
    weight = fit.reports[0].reduction.weight
    unit = 1.0 / np.sqrt(np.diag(J) + weight)
    dense = unit * np.linalg.solve((J + np.diag(weight)) * np.outer(unit, unit), unit * d)
    sigma = np.sqrt(np.diag(fit.estimate.covariance))
    assert np.abs((dense - fit.estimate.values) / sigma).max() < 1e-4


def test_the_result_of_a_set_names_the_files_of_its_own_effects(options, tmp_path):
    file = tmp_path / "own.yaml"
    file.write_text(
        "format: sdimu-effect/1\nname: bent\nexpressions: {accel_x: k * ax**2}\n"
        "parameters: {k: {unit: ug/g^2, prior: 30 ug/g^2}}\n"
    )
    own = replace(options, model=extended_model("baseline", [str(file)]))
    result = set_outcome(fit_set(unit_set(5, [short()] * 2).members, own, here))
    assert result.names[-1] == "bent_k"
    assert result.origin.effect_files == (str(file),)


def test_errors_of_a_set_are_those_its_sigmas_say(options):
    z = []
    for seed in (1, 2, 3):
        some = unit_set(seed, [short()] * 4)
        result = set_outcome(fit_set(some.members, options, here))
        assert {t.effect for t in result.of_set.turn_on} == {"gyro_bias", "accel_bias"}
        assert not result.warnings
        z.append(errors(result, some.truth))
    rms = float(np.sqrt(np.mean(np.square(z))))
    assert 0.75 < rms < 1.25
    assert np.abs(z).max() < 4.5


def test_more_recordings_know_more(options):
    some = unit_set(7, [short()] * 4)
    two, four = (set_outcome(fit_set(some.members[:k], options, here)) for k in (2, 4))
    shared = [k for k, name in enumerate(four.names) if "bias" not in name and four.covariance[k, k] > 0.0]
    ratio = np.sqrt(np.diag(four.covariance)[shared] / np.diag(two.covariance)[shared])
    assert np.all(ratio < 0.8)


def test_six_attitudes_in_six_files_are_a_test(options):
    # None of them knows its heading, or any coefficient by itself; together they know nine and more.
    turns = np.array([(0, 0, 0), (1, 0, 0), (2, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)]) * np.pi / 2
    still = Plan("still", (200.0,), (), 0.3)
    members = tuple(
        Member(f"a{k}", InMemory(_recorded(9, k, still, (), (), tuple(map(float, turn)), 0)), power_on="1")
        for k, turn in enumerate(turns)
    )
    fit = fit_set(members, options, here)
    result = set_outcome(fit)
    assert not fit.left_out
    sigma = dict(zip(result.names, np.sqrt(np.diag(result.covariance)), strict=True))
    for axis in "xyz":
        assert sigma[f"accel_scale_{axis}"] < 5e-6
        assert sigma[f"accel_bias_{axis}"] < 5e-5
        assert sigma[f"gyro_bias_{axis}"] < 1e-7
    z = errors(result, switched_on(9, 0))
    assert np.abs(z).max() < 4.5
    assert np.sqrt(np.mean(z**2)) < 1.4


def test_a_recording_that_cannot_be_read_is_left_out_and_told(options):
    some = unit_set(11, [short()] * 2)

    def broken():
        raise DataError("no samples")

    fit = fit_set((*some.members, Member("bad", broken)), options, here)
    assert [name for name, _ in fit.left_out] == ["bad"]
    result = set_outcome(fit)
    assert any("bad is left out: no samples" in note for note in result.notes)
    with pytest.raises(
        DataError, match=r"only one of 2 recordings can be used: mend or omit the others \(bad is left out"
    ):
        fit_set((some.members[0], Member("bad", broken)), options, here)


def test_several_units_are_no_set(options):
    some = unit_set(11, [short()] * 2)
    with pytest.raises(DataError, match=r"several units \(SN1, SN2\).*sdimu fleet"):
        fit_set([replace(m, serial=f"SN{k + 1}") for k, m in enumerate(some.members)], options, here)
    with pytest.raises(DataError, match="two recordings of the set are called 'r0'"):
        fit_set([some.members[0]] * 2, options, here)


def test_a_coefficient_that_changed_in_one_recording_is_pointed_out(options):
    some = unit_set(13, [short(stops=20)] * 4, shift={2: {"gyro_scale_z": 20e-6}})
    varied = variation(fit_set(some.members, options, here))
    k = varied.names.index("gyro_scale_z")
    assert np.argmax(np.abs(varied.z[:, k])) == 2
    assert varied.p_value[k] < 1e-6
    others = [p for name, p in zip(varied.names, varied.p_value, strict=True) if name != "gyro_scale_z"]
    assert np.nanmin(others) > 1e-5


def test_a_coefficient_that_follows_the_date_is_told(options):
    some = unit_set(17, [short()] * 5, shift={k: {"accel_scale_x": 8e-6 * k} for k in range(5)})
    result = set_outcome(fit_set(some.members, options, here))
    first = result.of_set.trends[0]
    assert (first.name, first.covariate) == ("accel_scale_x", "date (d)")
    assert first.slope == pytest.approx(8e-6, abs=4.0 * first.sigma)
    assert any("accel_scale_x is not the same in all recordings" in line for line in result.warnings)


def test_many_coefficients_that_differ_are_told_in_one_line_and_two_recordings_follow_nothing(options):
    shift = {"accel_scale_x": 6e-5, "accel_scale_y": -6e-5, "accel_scale_z": 5e-5, "gyro_scale_z": 4e-5}
    result = set_outcome(fit_set(unit_set(17, [short()] * 2, shift={1: shift}).members, options, here))
    told = [line for line in result.warnings if topic_of(line) == Topic.DIFFERS]
    assert len(told) == 1
    assert re.match(r"[4-9] of 2\d coefficients are not the same in all recordings", told[0])
    assert "changed between the recordings" in told[0]
    assert result.of_set.trends == ()
    assert topic_of(as_note(str(told[0]))) == Topic.DIFFERS


@pytest.mark.parametrize("seed", [19, 20])
def test_recordings_that_the_model_does_not_fit_are_named_though_learned_noise_takes_it_in(options, seed):
    """All whose noise hangs on turns or stops; what flicker alone explains no recording can tell from flicker."""
    fit = fit_set(unit_set(seed, [short()] * 2, ("accel_x: sin(7 fx/g + 4 fy/g)=100 ug",)).members, options, here)
    odd = [r.name for r in fit.reports if may_be_an_effect(r.noise)]
    assert odd
    line = next(text for text in set_outcome(fit).warnings if "does not fit" in text)
    assert [r.name for r in fit.reports if f"{r.name}: " in line] == odd
    assert line.endswith("run: sdimu diagnose")


def test_what_a_strong_effect_leaves_at_an_earlier_point_is_no_noise_beside_it(options):
    hidden = {"accel_quadratic_y": to_si(800.0, "ug/g^2"), "gyro_scale_asymmetry_y": 120e-6}
    some = unit_set(37, [short()] * 2, ("accel_quadratic_y=800 ug/g^2", "gyro_scale_asymmetry_y=120 ppm"))
    before = fit_set(some.members, options, here)
    assert all(report.noise for report in before.reports)
    fit = fit_set(some.members, replace(options, model=with_effects(options.model, [*hidden])), here, before)
    for report in fit.reports:
        assert report.noise == ()
        assert report.statistics.nis_mean == pytest.approx(1.0, abs=0.15)
    for name, true in hidden.items():
        place = fit.names.index(name)
        assert fit.estimate.values[place] == pytest.approx(true, abs=4.0 * fit.estimate.covariance[place, place] ** 0.5)


def test_each_recording_learns_its_noise_whichever_moved_last(options, monkeypatch):
    some = unit_set(37, [short(stops=8)] * 2, ("accel_quadratic_y=80 ug/g^2",))
    before = fit_set(some.members, options, here)
    asked = []

    def run(jobs):
        asked.append({job.member.name: job.noise for job in jobs})
        return here(jobs)

    monkeypatch.setattr(set_fit, "_moved", lambda _, name: name == "r1" and len(asked) < 2)
    fit_set(some.members, replace(options, model=with_effects(options.model, ["accel_quadratic_y"])), run, before)
    assert asked == [{"r0": (), "r1": ()}, {"r1": ()}, {"r0": None, "r1": None}]


def test_a_prior_that_holds_all_recordings_back_is_no_scatter():
    # Three recordings of one coefficient, six sigma of its prior in size, which the estimate is held back from.
    own, weight = np.array([40.0, 90.0, 160.0]), 30.0
    value, P = 6.0 / np.sqrt(weight), 1.0 / (own.sum() + weight)
    gram = np.diag(own) - P * np.outer(own, own)
    held_back = own * P * weight * value
    seen = np.ones(3, dtype=bool)
    assert float(held_back @ np.linalg.solve(gram, held_back)) > 30.0
    assert _scatter(gram, held_back, own, seen) > 0.999
    assert _scatter(gram, held_back + np.array([40.0, 0.0, -40.0]), own, seen) < 1e-4
    rng = np.random.default_rng(1)
    p = [_scatter(gram, d, own, seen) for d in rng.multivariate_normal(held_back, gram, 2000)]
    assert 0.035 < np.mean(np.array(p) < 0.05) < 0.075


def test_a_clean_set_scatters_as_chance_does(options):
    smallest = []
    for seed in (21, 22, 23, 24):
        some = unit_set(seed, [short()] * 3)
        p_value = variation(fit_set(some.members, options, here)).p_value
        seen = p_value[np.isfinite(p_value)]
        smallest.append(len(seen) * seen.min())
    assert min(smallest) > 0.01


def test_what_is_open_of_the_scatter_hides_no_deviate(options):
    some = unit_set(6, [short(stops=12)] * 2)
    varied = variation(fit_set(some.members, options, here))
    biases = [k for k, name in enumerate(varied.names) if "bias" in name]
    assert np.isfinite(varied.z[:, biases]).all()
    # Two recordings differ from their mean by the same.
    assert varied.z[0, biases] == pytest.approx(-varied.z[1, biases], abs=0.2)


def test_imus_of_different_grades_are_one_clear_error(options):
    some = unit_set(35, [short(), short()])
    test = some.members[1].open()
    other = Member("other", InMemory(test.with_imu(replace(test.imu, name="cheap", grade="mems"))))
    with pytest.raises(DataError, match=r"different grades \(r0: dtg, navigation, other: cheap, mems\)"):
        fit_set((some.members[0], other), options, here)


RAMP = "gyro_bias_ramp_x"


def ramps(*sizes):
    """Recordings of a unit, each with a ramp of its own (deg/h/h)."""
    return tuple(
        unit_set(51, [short(stops=12)] * len(sizes), (f"{RAMP}={size} deg/h/h",)).members[k]
        for k, size in enumerate(sizes)
    )


def test_a_recording_has_its_own_value_of_an_effect_that_all_have(options):
    members = ramps(10.0, 10.0, -10.0)
    model = replace(options.model, effects=(*options.model.effects, RAMP))
    fit = fit_set(members, SetOptions(model, local={"r2": (RAMP,)}, scopes={"gyro_bias_ramp": "unit"}), here)
    sigma = np.sqrt(np.diag(fit.estimate.covariance))
    size = np.radians(10.0) / 3600.0**2
    for name, truth in ((RAMP, size), (f"{RAMP}@r2", -size)):
        k = fit.names.index(name)
        assert fit.estimate.values[k] == pytest.approx(truth, abs=4.0 * sigma[k])
        assert sigma[k] < 0.2 * size


def test_another_variant_in_one_recording_is_not_taken_for_that_of_all(options):
    slow, fast = "gyro_bias_warm_up_x(tau=900 s)", "gyro_bias_warm_up_x(tau=200 s)"
    model = replace(options.model, effects=(*options.model.effects, slow))
    job = job_of(ramps(1.0)[0], SetOptions(model, local={"r0": (fast,)}), None)
    names = run(job).reduction.names
    assert {"gyro_bias_warm_up_x", f"{fast}@r0"} <= set(names)
    assert len(set(names)) == len(names)


def same(one, other):
    """Whether two results are one to the last digit."""
    for name in ("values", "covariance"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    np.testing.assert_array_equal(one.of_set.scatter_p, other.of_set.scatter_p)
    assert (one.fit, one.of_set.turn_on, one.of_set.trends) == (other.fit, other.of_set.turn_on, other.of_set.trends)


def renamed(members, names):
    return tuple(replace(m, name=name) for m, name in zip(members, names, strict=True))


def test_the_result_depends_on_neither_order_nor_names(options):
    plans = [short(stops=12), short("kim18_signed", stops=12), short(stops=8), short("kim18", stops=12)]
    members = unit_set(8, plans).members
    first = set_outcome(fit_set(members, options, here))
    other = set_outcome(fit_set(renamed(members[::-1], "dacb"), options, here))
    same(first, other)
    assert [r.name for r in other.of_set.recordings] == ["b", "c", "a", "d"]
    assert [d.power_on for d in other.of_set.deviations[::6]] == [f"that of {name}" for name in "bcad"]
    for one, its in zip(first.of_set.recordings, other.of_set.recordings, strict=True):
        np.testing.assert_array_equal(one.deviate, its.deviate)


def test_recordings_that_say_no_time_keep_their_order_in_tables_alone(options):
    # A logger without a clock: each begins at zero.
    tests = [m.open() for m in unit_set(8, [short(stops=12), short("kim18_signed", stops=12), short(stops=8)]).members]
    members = tuple(
        Member(f"r{k}", InMemory(replace(test, recording=replace(test.recording, start_ns=0))))
        for k, test in enumerate(tests)
    )
    results = [set_outcome(fit_set(some, options, here)) for some in (members, members[::-1])]
    same(*results)
    assert [r.name for r in results[0].of_set.recordings] == ["r0", "r1", "r2"]
    assert [r.name for r in results[1].of_set.recordings] == ["r2", "r1", "r0"]
    assert not any(t.covariate in {"order", "date (d)"} for t in results[0].of_set.trends)


def test_what_noise_of_a_recording_takes_in_is_judged_as_in_a_recording_by_itself(options):
    """In white noise the stops show what the NIS does not: 14 ppm of asymmetry."""
    result = set_outcome(fit_set(unit_set(9, [short()] * 2, ("gyro_scale_asymmetry_x=14 ppm",)).members, options, here))
    (told,) = [line for line in result.warnings if "does not fit" in line]
    assert "r0: NIS 1." in told
    assert "held-out error 1." in told
