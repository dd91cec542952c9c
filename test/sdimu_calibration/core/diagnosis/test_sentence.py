"""The sentence of a diagnosis: what is certain, what is likely, what is open, and the advice that goes with it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.cli.diagnosis_text import candidate_rows
from sdimu_calibration.core.advice import Kind
from sdimu_calibration.core.diagnosis.advice import advice, handheld_advice
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, _beside_wrong_prior
from sdimu_calibration.core.diagnosis.grades import Graded, each_grade, graded, in_grades, named, size_of
from sdimu_calibration.core.diagnosis.plan_seen import plan_seen
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary, summarise
from sdimu_calibration.core.diagnosis.verdict import Facts, something_missing, statements, verdict
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.estimation.noise_estimate import term_in_words
from sdimu_calibration.core.evidence.candidate import split
from sdimu_calibration.core.joint.set_found import FunctionShare
from sdimu_calibration.core.joint.set_ladder import SetLadder
from sdimu_calibration.core.joint.set_verdict import SetFacts, SetFinding, verdict_of_set
from sdimu_calibration.core.joint.set_verdict import statements as statements_of_set
from sdimu_calibration.core.noise_term import ATTITUDE, FLICKER, STOP, NoiseTerm
from sdimu_calibration.core.posterior.family import family_of
from sdimu_calibration.core.posterior.told import FamilyShare, MemberShare, NoiseShare, Probabilities, Share
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.report import cost, first_screen


def sentence(d, found, held=True):
    return " ".join(statements(d, found, held))


@pytest.fixture(scope="module")
def summary(diagnosis: Diagnosis) -> DiagnosisSummary:
    return summarise(diagnosis)


def with_shares(summary, probability, *shares):
    """The summary as if its effect, or one of its class, had that probability."""
    (one,) = summary.found
    told = replace(one, probability=probability, of_family=0.0, may_be=tuple(Share(*share) for share in shares))
    return replace(summary, found=(told,))


def said(summary):
    return in_grades(graded(summary.candidates, summary.diagnosis.probabilities))


def own(summary):
    return summary.found[0].candidate.coefficient


def test_what_is_certain_is_told_with_its_size(summary):
    told = said(with_shares(summary, 0.999, (own(summary), 0.999)))
    (one,) = summary.found
    assert told == f"Certain: accelerometer second-order nonlinearity K2, x ({size_of(one)})."


def test_a_class_that_is_certain_says_which_member_is_open_each_with_its_probability(summary):
    told = said(with_shares(summary, 0.995, (own(summary), 0.82), ("accel_cubic_x", 0.18)))
    assert told.startswith("Certain, but open which: accelerometer second-order nonlinearity K2, x (")
    assert told.endswith(f") 82 % or {named('accel_cubic_x')} 18 %.")


def test_probabilities_of_one_list_add_up_in_the_sentence_and_in_the_table(summary):
    told = with_shares(summary, 0.999, (own(summary), 0.515), ("accel_cubic_x", 0.485))
    assert said(told).endswith(f") 52 % or {named('accel_cubic_x')} 48 %.")
    rows = candidate_rows(told.found[0], told.diagnosis.probabilities)
    assert [row[4] for row in rows] == ["52 %", "48 %"]


def test_a_sentence_says_how_likely_none_of_those_that_it_names_is_it(summary):
    told = said(with_shares(summary, 0.97, (own(summary), 0.58), ("accel_cubic_x", 0.21)))
    assert told.endswith(f") 58 %, {named('accel_cubic_x')} 21 % or another one 18 %.")


def test_shares_beyond_all_are_said_to_be_of_two_that_may_be_there(summary):
    told = said(with_shares(summary, 0.92, (own(summary), 0.6), ("accel_cubic_x", 0.43)))
    assert told.endswith("43 %; two of them may be there.")


def test_an_equation_that_fits_is_not_called_certain_physics(summary):
    told = with_shares(summary, 0.999, (own(summary), 0.999))
    d, one = replace(told.diagnosis, own=True, verdict=Verdict.OWN_EQUATION), told.found[0]
    equation = replace(one, candidate=replace(one.candidate, family="own"))
    begun = "No effect of the catalogue fits, an equation does. Missing for certain, and fitted by: accel_quadratic_x ("
    assert sentence(d, [equation]).startswith(begun)
    assert sentence(replace(d, own=False, verdict=Verdict.ONE_EFFECT), [one]).startswith("Certain: accelerometer")
    both = sentence(d, [one, equation])
    assert both.startswith("Certain: accelerometer second-order")
    assert "). No effect of the catalogue fits what is left, an equation does. Missing for certain, and" in both


@pytest.mark.parametrize(("kind", "left"), [(STOP, "What is left looks like"), (ATTITUDE, "What is left is the accel")])
def test_what_is_found_beside_what_is_unexplained_has_its_grade(summary, kind, left):
    """A step of .61, beside hysteresis of .39, was "Found, but not all: gyro_bias_step_x"."""
    told = with_shares(summary, 0.999, (own(summary), 0.61), ("accel_cubic_x", 0.39))
    noise = NoiseTerm("accel", kind, size=2e-5, low=1e-5, high=3e-5)
    d = replace(told.diagnosis, found=replace(told.diagnosis.found, noise=(noise,)), verdict=Verdict.UNEXPLAINED)
    words = sentence(d, told.found)
    assert words.startswith("Certain, but open which: accelerometer second-order nonlinearity K2, x (")
    assert f") 61 % or {named('accel_cubic_x')} 39 %. {left}" in words
    alone = with_shares(summary, 0.999, (own(summary), 0.999))
    assert sentence(d, alone.found).startswith("Certain: accelerometer")
    assert sentence(d, alone.found, held=False).startswith("In what was fitted, but not beyond it: accelerometer")
    one = alone.found[0]
    equation = sentence(replace(d, own=True), [replace(one, candidate=replace(one.candidate, family="own"))])
    assert equation.startswith("Missing for certain, and fitted by: accel_quadratic_x (")


def test_what_fails_where_it_was_not_fitted_is_not_called_certain_nor_to_be_trusted(summary, monkeypatch):
    """In a recording metres without aid grew from 40 to 105 m beside "Certain: ..."."""
    told = with_shares(summary, 0.999, (own(summary), 0.999))
    d = replace(told.diagnosis, found_effects=told.found, verdict=Verdict.ONE_EFFECT)
    names = ("not compensated", "model as given", "with what was found")
    ends = iter((30.0, 105.0))
    monkeypatch.setattr(cost, "in_use", lambda _: cost.InUse(10.0, 2, names, (2500.0, 40.0, next(ends)), 27.0))
    assert cost.held_to_use(d, None) is d
    judged = cost.held_to_use(d, None)
    assert judged.sentence.startswith("In what was fitted, but not beyond it: accelerometer")
    assert "Certain" not in judged.sentence
    assert judged.after.not_to_be_trusted[-1].startswith(
        "what was found does not hold where it was not fitted: after 10"
    )


@pytest.mark.parametrize(
    ("alike", "word"),
    [
        ((), Verdict.ONE_EFFECT),
        (("gyro_bias_warm_up_x(tau=1200 s)",), Verdict.ONE_EFFECT),
        (("gyro_bias_warm_up_x(tau=1200 s)", "gyro_bias_ramp_x"), Verdict.CLASS_OF_EFFECTS),
    ],
)
def test_another_time_constant_of_one_coefficient_makes_no_class(summary, alike, word):
    label = "gyro_bias_warm_up_x(tau=600 s)"
    assert verdict(Facts([(label, alike)])) == word
    of_set = SetFinding(label, "", 1e-6, 1e-7, 9.0, "rad/s", "deg/h", alike)
    after = replace(summary.diagnosis.after, of_set=None, fit={"held_out_rms": None})
    assert verdict_of_set(SetFacts([of_set], after, SimpleNamespace(function=None, reports=()), None, None)) == word


@pytest.mark.parametrize(
    ("nothing", "noise", "word"),
    [
        (0.6, False, Verdict.CONSISTENT),
        (0.4, False, Verdict.CLASS_OF_EFFECTS),
        (0.6, True, Verdict.NOISE_MODEL_WRONG),
        (0.4, True, Verdict.CLASS_OF_EFFECTS),
    ],
)
def test_a_recording_is_consistent_where_nothing_is_more_likely_missing_than_something(nothing, noise, word):
    assert verdict(Facts(nothing=nothing, noise=noise)) == word


def test_faults_of_one_recording_beside_an_effect_of_the_unit_are_no_second_effect():
    label = "gyro_bias_warm_up_x(tau=600 s)"
    assert verdict(Facts([(label, ())], of_recording=2)) == Verdict.ONE_EFFECT
    assert verdict(Facts([(label, ()), ("accel_cubic_z", ())], of_recording=1)) == Verdict.SEVERAL_EFFECTS
    assert verdict(Facts(of_recording=2)) == Verdict.DATA_FAULT


def test_a_fault_of_the_recording_is_told_by_itself_with_size_and_probability(summary):
    (lost,) = split(resolve("gyro_lost_data(turn=3, at=289.9 s)"))
    (effect,) = with_shares(summary, 0.999, (own(summary), 0.999)).found
    fault = replace(effect, candidate=lost, value=0.1, sigma=0.001, probability=0.7, of_family=0.7, may_be=())
    d = replace(summary.diagnosis, verdict=Verdict.ONE_EFFECT)
    words = sentence(d, (fault, effect))
    told = "Likely (70 %): gyro data lost in a turn (turn=3, at=289.9 s) (100.0 +- 1.0 ms)."
    assert words == f"{sentence(d, (effect,))} The data have a fault in this recording. {told}"
    alone = sentence(replace(d, verdict=Verdict.DATA_FAULT, findings=()), (fault, fault))
    assert alone.startswith("The data have a fault in this recording. Likely (70 %): ")
    equation = sentence(replace(d, own=True, verdict=Verdict.OWN_EQUATION), (fault, effect))
    assert "lost" not in equation.partition("The data have a fault")[0]


def test_a_slow_change_of_a_bias_is_told_as_that_before_what_it_may_be(summary):
    (effect,) = summary.found
    (drift,) = split(resolve("gyro_bias_ramp_y"))
    shares = (("gyro_bias_ramp_y", 0.55), ("gyro_bias_warm_up_y", 0.16))
    members = tuple(
        MemberShare(label, p, 1.0, 0.1, "rad/s", "deg/h")
        for label, p in (("gyro_bias_ramp_y", 0.55), ("gyro_bias_warm_up_y(tau=600 s)", 0.16))
    )
    told = Probabilities(0.1, (FamilyShare("gyro_bias_drift", "gyro_y", 0.83, members),), ())
    one = replace(effect, candidate=drift, probability=0.83, of_family=0.83, may_be=tuple(Share(*s) for s in shares))
    words = in_grades(graded([one], told))
    assert words.startswith("Likely (83 %): a slow change of the bias of gyro y - gyro bias ramp, y (")
    # What else it may be is no slow change: then the names say more than the family.
    other = replace(one, may_be=(*one.may_be, Share("gyro_scale_asymmetry_y", 0.1)))
    assert "slow change" not in in_grades(graded([other], told))
    assert "slow change" not in said(with_shares(summary, 0.995, (own(summary), 0.82), ("accel_cubic_x", 0.18)))


def test_what_no_single_effect_is_probable_for_lists_the_likeliest(summary):
    ranked = (("accel_cubic", 0.3), ("accel_quadratic", 0.2))
    families = tuple(
        FamilyShare(name, "accel", share, (MemberShare(f"{name}_z", share, 1.0, 0.1, "1/g", "ppm/g"),))
        for name, share in ranked
    )
    nothing_chosen = replace(summary.diagnosis.found, chosen=np.empty(0, dtype=np.int64))
    d = replace(summary.diagnosis, verdict=Verdict.CLASS_OF_EFFECTS, found=nothing_chosen)
    vars(d)["probabilities"] = Probabilities(0.4, families, ())
    assert sentence(d, ()) == (
        "Something is missing (60 %), but no effect by itself is likely: accel_cubic_z 30 %, accel_quadratic_z 20 %."
    )
    (turns,) = [one for one in advice(d, (), (), plan_seen(d.navigation)) if one.kind == Kind.RANK_TURNS]
    assert turns.about == ("accel_cubic_z", "accel_quadratic_z")
    assert Kind.RECORD_MORE in {one.kind for one in advice(d, (), (), plan_seen(d.navigation))}
    assert Kind.RECORD_MORE in {one.kind for one in handheld_advice(d, ())}


def test_what_is_unexplained_beside_noise_that_every_sensor_has_says_what_may_be_missing(summary):
    family = FamilyShare(
        "accel_cubic", "accel_z", 0.43, (MemberShare("accel_cubic_z", 0.43, 1.0, 0.1, "1/g", "ppm/g"),)
    )
    follows = NoiseShare("accel", ATTITUDE, 0.57, 1.0, 0.5, 2.0, "m/s^2", (0, 2))
    plain = NoiseShare("accel", FLICKER, 1.0, 1.0, 0.5, 2.0, "m/s^2")
    found = replace(
        summary.diagnosis.found,
        chosen=np.empty(0, dtype=np.int64),
        noise=(NoiseTerm("accel", FLICKER, size=1e-3, low=5e-4, high=2e-3),),
    )
    d = replace(summary.diagnosis, verdict=Verdict.UNEXPLAINED, found=found)
    vars(d)["probabilities"] = Probabilities(0.0, (family,), (plain, follows))
    assert sentence(d, ()) == (
        "Something is missing, and which is open: accel x and z error that follows the attitude 57 %, "
        "accel_cubic_z 43 %."
    )
    # What is less likely missing than not is not listed, whatever alarm rings.
    vars(d)["probabilities"] = Probabilities(0.88, (replace(family, probability=0.11),), (plain,))
    assert "which is open" not in sentence(d, ())
    vars(d)["probabilities"] = Probabilities(0.9, (), (plain,))
    assert sentence(d, ()).startswith("Something is missing that looks like accel bias instability")


def test_members_of_one_recording_and_very_many_of_them_are_said_in_words():
    one = MemberShare("gyro_bias_x@r2", 0.2, 1.0, 0.1, "rad/s", "deg/h")
    # Of the family .45, most in members that are no more likely than one in a hundred.
    family = FamilyShare("gyro_bias", "gyro_x", 0.45, (one,))
    assert something_missing(Probabilities(0.3, (family,), ())).endswith(": gyro_bias_x in r2 20 %.")
    none = replace(family, members=())
    assert something_missing(Probabilities(0.3, (none,), ())) == (
        "Something is missing (70 %), but none of very many effects by itself is likely."
    )


def test_a_set_whose_search_came_to_no_end_is_not_called_consistent(summary):
    after = replace(summary.diagnosis.after, of_set=None, fit={"held_out_rms": None})
    fit = SimpleNamespace(function=None, reports=())
    assert verdict_of_set(SetFacts([], after, fit, None, None)) == Verdict.UNEXPLAINED
    assert verdict_of_set(SetFacts([], after, fit, None, Probabilities(0.9, (), ()))) == Verdict.CONSISTENT
    assert verdict_of_set(SetFacts([], after, fit, None, Probabilities(0.4, (), ()))) == Verdict.CLASS_OF_EFFECTS


def test_a_set_is_unexplained_where_a_recording_has_noise_that_no_sensor_has(summary):
    after = replace(summary.diagnosis.after, of_set=None, fit={"held_out_rms": None}, warnings=())
    drawn = {"r0": (NoiseTerm("gyro", STOP, size=1.0),), "r2": (NoiseTerm("gyro", STOP, size=2.0),)}
    facts = SetFacts([], after, SimpleNamespace(reports=()), None, Probabilities(0.9, (), ()), drawn=drawn)
    assert verdict_of_set(facts) == Verdict.UNEXPLAINED
    told = statements_of_set(Verdict.UNEXPLAINED, facts)
    assert told[1].startswith("What is left looks like gyro bias drawn anew at each stop in r0 and r2; the sigmas")


def test_a_set_of_which_recordings_have_functions_of_their_own_is_unexplained(summary):
    after = replace(summary.diagnosis.after, of_set=None, fit={"held_out_rms": None}, warnings=())
    own = [FunctionShare(name, 0.97, ("accel_x",)) for name in ("r0", "r1")]
    facts = SetFacts([], after, SimpleNamespace(reports=()), None, Probabilities(0.9, (), ()), own)
    assert verdict_of_set(facts) == Verdict.UNEXPLAINED
    assert not facts.beside_function
    told = statements_of_set(Verdict.UNEXPLAINED, facts)
    assert told == (
        "Something differs between the recordings that no effect of the catalogue explains.",
        "An error that follows the attitude, another one in each, is in r0 (accel_x, 97 %) and r1 (accel_x, 97 %).",
    )
    # Stops that do not come back say nothing that the functions have not said.
    assert facts.is_of_each
    assert statements_of_set(Verdict.UNEXPLAINED, replace(facts, again=SimpleNamespace(answer=()))) == told
    common = replace(facts, functions=[FunctionShare("", 0.97, ("accel_x",))])
    assert not common.is_of_each
    assert not replace(facts, again=SimpleNamespace(answer=("time",))).is_of_each
    assert statements_of_set(Verdict.UNEXPLAINED, common)[0].startswith("The recordings share something")


def test_a_fault_of_one_recording_does_not_hide_what_another_one_has(summary):
    after = replace(summary.diagnosis.after, of_set=None, fit={"held_out_rms": None}, warnings=())
    fault = SetFinding("gyro_bias_step_x(t0=9 s)", "r2", 1e-6, 1e-7, 9.0, "rad/s", "deg/h", (), 0.99)
    told = Probabilities(0.9, (), ())
    for name, word in (("r1", Verdict.UNEXPLAINED), ("r2", Verdict.DATA_FAULT)):
        own = [FunctionShare(name, 0.97, ("accel_x",))]
        facts = SetFacts([fault], after, SimpleNamespace(reports=()), None, told, own)
        assert verdict_of_set(facts) == word
        assert f"An error that follows the attitude is in {name} (accel_x, 97 %)." in statements_of_set(word, facts)
    # Where the search came to no end no probability is told.
    open_ = replace(facts, told=None)
    assert "is in r2 (accel_x)." in " ".join(statements_of_set(Verdict.DATA_FAULT, open_))


def test_a_coefficient_of_one_recording_is_named_with_it():
    assert named("gyro_bias_x@r2") == f"{named('gyro_bias_x')} in r2 alone"


def test_what_is_likely_says_how_likely(summary):
    told = said(with_shares(summary, 0.9, (own(summary), 0.9)))
    assert told.startswith("Likely (90 %): ")
    assert "ertain" not in told


def test_what_is_not_probable_enough_to_be_named_leaves_nothing_open(summary):
    """What is named is as sure as it is itself: that one of its class is certain says less."""
    told = said(with_shares(summary, 0.999, (own(summary), 0.97), ("accel_cubic_x", 0.03)))
    assert told.startswith("Likely (97 %): accelerometer second-order")
    assert said(with_shares(summary, 0.999, (own(summary), 0.995))).startswith("Certain: ")


def test_what_a_sentence_has_no_room_for_is_counted():
    more = [Graded(f"effect {k}", f"e{k}", "1 ug", 0.9) for k in range(6)]
    assert each_grade(more[:5])[-1] == "1 more is in the table."
    assert each_grade(more)[-1] == "2 more are in the table."


def test_the_sentence_has_no_error_of_another_place(summary):
    assert "held out" not in summary.diagnosis.sentence


@pytest.mark.parametrize(
    ("verdict", "adequate", "tone"),
    [(Verdict.UNEXPLAINED, False, "bad"), (Verdict.DATA_FAULT, False, "bad"), (Verdict.ONE_EFFECT, False, "doubtful")],
)
def test_red_is_for_what_no_effect_mends(summary, verdict, adequate, tone):
    """With what was found the page is right: its errors are near 1, and red above them would deny it."""
    found = replace(summary, diagnosis=replace(summary.diagnosis, verdict=verdict, adequate=adequate))
    assert first_screen.of_diagnosis(found).tone == tone


def test_green_needs_an_error_near_one(summary):
    d = summary.diagnosis
    none = d.found.chosen[:0]
    clean = replace(d, verdict=Verdict.CONSISTENT, adequate=True, found=replace(d.found, chosen=none, steps=()))
    for error, tone in ((1.0, "good"), (1.25, "doubtful")):
        after = replace(clean.after, fit={**clean.after.fit, "held_out_rms": error}, warnings=())
        told = replace(summary, found=(), diagnosis=replace(clean, before=after, after=after))
        assert first_screen.of_diagnosis(told).tone == tone


def test_a_family_surer_than_the_class_is_told_with_its_members_each_once_by_one_figure(summary):
    (one,) = summary.found
    family, sensor = family_of(one.candidate)
    members = [
        MemberShare(label, p, 1.0, 0.1, "1", "ppm")
        for label, p in (
            (one.candidate.label, 0.5),
            ("accel_cubic_x", 0.1),
            ("accel_scale_x(tau=1 s)", 0.15),
            ("accel_scale_x(tau=2 s)", 0.15),
        )
    ]
    told = Probabilities(0.0, (FamilyShare(family, sensor, 0.97, tuple(members)),), ())
    shares = (Share(own(summary), 0.5), Share("accel_scale_x", 0.28))
    found = replace(one, probability=0.6, of_family=0.97, may_be=shares)
    (one,) = graded([found], told)
    assert one.probability == 0.97
    assert [(s.name, s.probability) for s in one.may_be] == [
        (own(summary), 0.5),
        ("accel_scale_x", 0.28),
        ("accel_cubic_x", 0.1),
    ]


@pytest.mark.parametrize(
    ("verdict", "error", "tone"),
    [
        (Verdict.ONE_EFFECT, 1.0, "doubtful"),
        (Verdict.UNEXPLAINED, 1.0, "bad"),
        (Verdict.CONSISTENT, 1.0, "good"),
        (Verdict.CONSISTENT, 1.25, "doubtful"),
    ],
)
def test_the_page_of_a_set_does_not_call_wrong_what_it_tells_to_use(summary, verdict, error, tone):
    d = summary.diagnosis
    after = replace(d.after, fit={**d.after.fit, "held_out_rms": error})
    findings = (object(),) if verdict == Verdict.ONE_EFFECT else ()
    found = SimpleNamespace(
        verdict=verdict,
        statements=("x",),
        before=d.before,
        after=after,
        ladder=SetLadder(),
        findings=findings,
        advice=(),
        probabilities=Probabilities(0.9, (), ()) if error == 1.0 else None,
    )
    first = first_screen.of_set(found)
    assert first.tone == tone
    assert first.tag != "The model is wrong" or tone == "bad"
    assert first.advice == (f"Use the coefficients of this page{', which hold what was found' if findings else ''}.",)
    assert ("wrong by" in first.off) == bool(findings)
    assert ("over all models" in first.off) == bool(findings)
    joint = first_screen.of_set(SimpleNamespace(**{**vars(found), "probabilities": None}))
    assert ("one sigma of the joint fit" in joint.off) == bool(findings)


def test_noise_of_the_data_sheet_is_no_part_of_what_is_unexplained(summary):
    unknown = NoiseTerm("accel", ATTITUDE, size=1e-3, axes=(1,))
    terms = (NoiseTerm("gyro", FLICKER, size=1e-5), unknown)
    d = summary.diagnosis
    told = sentence(replace(d, verdict=Verdict.UNEXPLAINED, rungs=(), found=replace(d.found, noise=terms)), ())
    left, _, account = told.partition("; the sigmas count ")
    assert term_in_words(unknown) in left
    assert "flicker" not in left
    assert account.startswith("it and gyro bias instability (flicker)")


def test_what_a_set_finds_beside_what_is_unexplained_has_its_grade(summary):
    label = "gyro_bias_warm_up_x(tau=600 s)"
    of_set = SetFinding(label, "", 1e-6, 1e-7, 9.0, "rad/s", "deg/h", (), 0.7, (Share("gyro_bias_warm_up_x", 0.7),))
    after = replace(summary.diagnosis.after, of_set=None, warnings=())
    facts = SetFacts([of_set], after, SimpleNamespace(function=None, reports=()), None, None)
    words = " ".join(statements_of_set(Verdict.UNEXPLAINED, facts))
    assert words.startswith("Something differs between the recordings that no effect of the catalogue explains. ")
    assert "Found beside it: Likely (70 %): gyro warm-up" in words


def test_what_was_found_beside_a_prior_that_the_data_contradict_is_said_to_hang_on_it():
    base = SimpleNamespace(contradicted_priors=lambda: ["the stated prior of a contradicts the data", "that of b too"])
    told = "The stated prior of a contradicts the data. If it holds all the same: "
    assert _beside_wrong_prior(base, SimpleNamespace(chosen=("effect",))) == told
    assert _beside_wrong_prior(base, SimpleNamespace(chosen=())) == ""
    assert _beside_wrong_prior(SimpleNamespace(contradicted_priors=list), SimpleNamespace(chosen=("effect",))) == ""
