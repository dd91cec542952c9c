"""What a line of advice tells to type works, and no line stands there twice."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from sdimu_calibration.cli.next_commands import Asked, spelled
from sdimu_calibration.core.advice import Advice, Kind
from sdimu_calibration.core.diagnosis import advice as room
from sdimu_calibration.core.diagnosis.advice import (
    _about_data,
    _at_stake,
    _in_sight,
    add,
    mend,
    others,
    recorded_first,
    telling_stay,
    together,
)
from sdimu_calibration.core.diagnosis.coefficient_shifts import CoefficientShift
from sdimu_calibration.core.diagnosis.found import Found
from sdimu_calibration.core.diagnosis.grades import other_coefficients
from sdimu_calibration.core.diagnosis.plan_seen import PlanSeen, TurnSeen
from sdimu_calibration.core.diagnosis.screen import Finding
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.evidence.candidate import split
from sdimu_calibration.core.noise_term import MARKOV, NoiseTerm
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.posterior.told import Share
from sdimu_calibration.storage.files.advice_words import _SPOKEN, _WORDS, sentence
from sdimu_calibration.storage.files.advice_words import lead as words_before_command
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
from sdimu_calibration.storage.files.effect_file import find_effects

MIX = """
format: sdimu-effect/1
name: odd_mix
expressions:
  accel_z: k1 * ax * wz
  gyro_x: k2 * ex**2
parameters:
  k1: {unit: ug*s/deg/g, prior: 50 ug*s/deg/g}
  k2: {unit: deg/h, prior: 0.1 deg/h}
"""


def found(candidate, alike=()):
    return Found(candidate, 1.0, 0.1, 10.0, 50.0, 45.0, 1e-9, 1.0, 2.0, 1.0, tuple(alike), ())


def added(advice):
    words = shlex.split(sentence(advice).rstrip("."))
    return [words[k + 1] for k, word in enumerate(words) if word == "--add"]


@pytest.mark.parametrize("name", registry.names())
def test_every_effect_of_the_catalogue_can_be_added_as_the_advice_says(name):
    for candidate in split(registry.get(name)):
        (text,) = added(add([found(candidate)])[0])
        assert [e.labels for e in find_effects(text)] == [candidate.effect.labels]


def test_equations_can_be_added_as_the_advice_says():
    (candidate,) = split(find_effects("gyro_x: ey^2")[0])
    (text,) = added(add([found(candidate)])[0])
    assert find_effects(text)[0].labels == candidate.effect.labels


def test_effects_of_a_file_can_be_added_as_the_advice_says(tmp_path):
    path = tmp_path / "odd mix.yaml"
    path.write_text(MIX)
    candidates = [candidate for effect in find_effects(str(path)) for candidate in split(effect)]
    (advice,) = add([found(candidate) for candidate in candidates])
    assert sentence(advice).startswith("Calibrate with what was found in the model: ")
    assert [find_effects(text)[0].labels for text in added(advice)] == [c.effect.labels for c in candidates]


def test_what_is_to_be_done_for_several_finds_is_said_once():
    x, y, z = split(registry.get("accel_quadratic"))
    turn, rest = Advice(Kind.REPEAT_TURN, (4.6,)), Advice(Kind.REST_BETWEEN)
    asked = [(found(x, ["a"]), turn), (found(y, ["b", "c"]), turn), (found(z, ["d"]), rest)]
    assert [sentence(one) for one in together(asked)] == [
        f"To tell accel_quadratic_x from a, and accel_quadratic_y from b, c: {sentence(turn)}.",
        f"To tell accel_quadratic_z from d: {sentence(rest)}.",
    ]


def test_nothing_found_gives_no_advice():
    assert add([]) == []
    assert together([]) == []


def test_every_kind_of_advice_has_words():
    assert set(_WORDS) | set(_SPOKEN) == set(Kind)
    assert not set(_WORDS) & set(_SPOKEN)


def test_what_is_likely_is_tried_and_not_kept():
    certain, likely = (found(candidate) for candidate in split(registry.get("accel_quadratic"))[:2])
    sure = replace(certain, of_family=0.999)
    open_ = replace(likely, of_family=0.7)
    assert [one.kind for one in add([sure, open_])] == [Kind.KEEP, Kind.TRY]
    kept, tried = (sentence(one) for one in add([sure, open_]))
    assert kept == "Calibrate with accel_quadratic_x in the model: --add 'accel_quadratic_x'."
    before, _, then = tried.partition(". Afterwards, ")
    assert before == "It is open which effect it is: record more before accel_quadratic_y goes into the model"
    assert then == "if it is that one: --add 'accel_quadratic_x' --add 'accel_quadratic_y'."
    assert added(add([sure, open_])[1]) == ["accel_quadratic_x", "accel_quadratic_y"]


def test_what_goes_into_the_model_after_a_recording_more_is_told_behind_what_to_record():
    """The step that said to record more gave the command that adds the effect."""
    mend, keep, again, plan = (
        Advice(kind) for kind in (Kind.MEND_RECORDING, Kind.KEEP, Kind.RECORD_ONCE_MORE, Kind.PLAN_NEXT)
    )
    afterwards, turns = Advice(Kind.TRY), Advice(Kind.SIGNED_TURNS)
    assert recorded_first([mend, keep, afterwards, again, plan, turns]) == (mend, keep, again, plan, afterwards, turns)
    assert recorded_first([keep, afterwards, turns]) == (keep, afterwards, turns)


def test_what_is_certain_is_tried_and_not_kept_while_it_is_open_which_of_its_family_it_is():
    (candidate,) = split(resolve("accel_magnetic_yz"))
    open_which = (Share("accel_magnetic_yz", 0.86), Share("accel_magnetic_yx", 0.14))
    one = replace(found(candidate), probability=0.999, of_family=0.999, may_be=open_which)
    assert [advice.kind for advice in add([one])] == [Kind.TRY]
    assert [advice.kind for advice in add([replace(one, may_be=open_which[:1])])] == [Kind.KEEP]


def test_coefficients_at_stake_are_those_of_members_that_are_named():
    (candidate,) = split(resolve("gyro_scale_asymmetry_z"))
    shifts = (
        CoefficientShift("accel_play_x(r=0.6 g)", "accel_scale_x", -18.0),
        CoefficientShift("gyro_scale_quadratic_z", "gyro_scale_z", 5.0),
    )
    shares = (Share("gyro_scale_asymmetry_z", 0.7), Share("gyro_scale_quadratic_z", 0.29), Share("accel_play_x", 0.005))
    one = replace(found(candidate), coefficient_shifts=shifts, may_be=shares)
    assert _at_stake(one).arguments == ("gyro_scale_asymmetry_z", (("gyro_scale_quadratic_z", "gyro_scale_z", 5.0),))
    equation = CoefficientShift("accel_x: sin(3 fx)", "accel_bias_x", 7.0)
    odd = replace(one, coefficient_shifts=(equation,), may_be=(*shares, Share("accel_x: sin(3 fx)", 0.2)))
    assert _in_sight(odd) == [equation]


def test_the_minutes_of_a_stay_are_those_of_all_that_is_told():
    (candidate,) = split(resolve("gyro_bias_warm_up_x(tau=600 s)"))
    what = telling_stay(candidate.effect, PlanSeen((TurnSeen(0, 0, 1.0, 0.1, 0.3),), True, 2.0))
    assert sentence(what) == "stay at the last stop for 20 min more, then repeat the first stop (23 min together)"


def test_an_equation_has_no_variant_that_its_brackets_would_hide():
    assert other_coefficients("accel_x: sin(2 fx)", ["accel_x: sin(3 fx)"]) == ("accel_x: sin(3 fx)",)
    assert other_coefficients("gyro_bias_step_x(t0=60 s)", ["gyro_bias_step_x(t0=90 s)@r1"]) == (
        "gyro_bias_step_x(t0=90 s)@r1",
    )


def test_another_time_constant_of_the_same_effect_is_not_to_be_told_apart():
    (candidate,) = split(resolve("gyro_bias_warm_up_x(tau=600 s)"))
    rivals = ["gyro_bias_warm_up_x(tau=1200 s)", "gyro_bias_ramp_x", "gyro_bias_warm_up_y(tau=600 s)"]
    assert others(found(candidate, rivals)) == ("gyro_bias_ramp_x", "gyro_bias_warm_up_y(tau=600 s)")


@pytest.mark.parametrize(
    ("finding", "lead", "command"),
    [
        (
            Finding("accelerometer x is at the end of its range", True, "saturated", 66.62, 66.68),
            "Mend the recording first: accelerometer x is at the end of its range. Without that time",
            "sdimu diagnose 'a bag' --imu dtg --exclude-times 66.6-66.7",
        ),
        (
            Finding("samples are missing", True, "long gap", 150.0, 153.04),
            "Mend the recording first: samples are missing. Part it at that gap, and calibrate both parts as two "
            "recordings",
            "sdimu bag cut 'a bag' --to 150.0 --out 'a bag_before' && sdimu bag cut 'a bag' --from 153.1 --out "
            "'a bag_after' && sdimu calibrate 'a bag_before' 'a bag_after' --imu dtg",
        ),
        (Finding("turns are off", True, "misfit"), "Mend the recording first: turns are off.", ""),
        (Finding("the passes did not converge", True), "Look at this first: the passes did not converge.", ""),
    ],
    ids=["clipped", "gap", "misfit", "no fault of samples"],
)
def test_a_fault_is_told_with_what_mends_it(finding, lead, command):
    """ "Mend the recording first" did not say how."""
    light = Finding("12 samples are missing", False, "gap", 1.0, 2.0)
    (advice,) = mend(SimpleNamespace(findings=(finding, light)))
    assert words_before_command(advice) == lead
    asked = Asked((Path("a bag"),), ["--imu", "dtg"], [], Path("out"))
    assert spelled(advice, asked) == command
    more = Asked((Path("a bag"),), ["--exclude-times", "1-2"], [], Path("out"))
    if "--exclude-times" in command:
        assert spelled(advice, more) == "sdimu diagnose 'a bag' --exclude-times 1-2,66.6-66.7"


def test_a_file_of_another_grade_is_the_first_advice_and_no_factor_is():
    noise = SimpleNamespace(ratio=4.8, sigma=0.2)
    unknown = SimpleNamespace(ratio=0.0, sigma=3.0)
    seen = SimpleNamespace(gyro=unknown, accel=noise)
    lines = ("accel white noise is 4.80 +- 0.20 times the specification",)
    learned = SimpleNamespace(noise=(NoiseTerm("gyro", MARKOV),))
    grade = Note("gyros show 4.2; fog_tactical fits", Topic.OTHER_GRADE)
    d = SimpleNamespace(findings=(), consistency=seen, found=learned, noise=(grade, *lines))
    assert sentence(_about_data(d)[0]) == "Look at the IMU's file first: gyros show 4.2; fog_tactical fits."
    assert not any(one.kind == Kind.CORRECT_NOISE for one in _about_data(d))
    d.noise, d.found = (*lines, "gyro Gauss-Markov"), learned
    # "gyro times 0.00" was advised where noise with a memory hides the white noise.
    (factor,) = (one for one in _about_data(d) if one.kind == Kind.CORRECT_NOISE)
    assert factor.arguments == (1.0, 4.8)


@pytest.mark.parametrize(("after", "told"), [(2.9, []), (3.0, ["gyro_bias_ramp_y"])])
def test_a_change_with_time_is_told_apart_by_a_stay_where_no_turn_tells_enough(monkeypatch, after, told):
    every = [(("gyro_bias_ramp_y", "gyro_bias_wrap_yx"), SimpleNamespace(after=after))]
    every += [(("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y"), SimpleNamespace(after=0.1))]
    monkeypatch.setattr(room, "next_recording", lambda *_: every)
    monkeypatch.setattr(room, "standing", lambda *_: None)
    every_one = [found(*split(resolve(members[0])), members[1:]) for members, _ in every]
    site, imu, model = load_site("daejeon"), load_imu("dtg"), load_model("baseline")
    d = SimpleNamespace(fit=SimpleNamespace(test=SimpleNamespace(site=site, imu=imu), model=model))
    assert [members[0] for members, _ in room._closing(d, every_one)] == [*told, "gyro_scale_asymmetry_y"]
    assert room._closing(d, [found(*split(resolve("gyro_bias_ramp_y")))]) == []
    d.fit.test.site = None
    assert room._closing(d, every_one) == []


def test_what_only_a_change_of_temperature_tells_is_known_by_either_of_two():
    (scale,) = split(resolve("accel_quadratic_x"))
    (heat,) = split(resolve("accel_bias_temperature_x"))
    assert room._hangs_on_heat(found(heat, ["accel_quadratic_x"]))
    assert room._hangs_on_heat(found(scale, ["accel_bias_temperature_x"]))
    assert not room._hangs_on_heat(found(scale, ["accel_cubic_x"]))
    assert not room._hangs_on_heat(found(scale, ["accel_x: sin(3 fx)"]))
