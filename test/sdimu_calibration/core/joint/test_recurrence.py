"""What stays unexplained in a set: does it come back at the same attitude, time or temperature, or not at all?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.advice import Advice
from sdimu_calibration.core.advice import Kind as Do
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.joint.leftovers import ATTITUDE, TEMPERATURE, TIME, Leftovers, leftovers, likeness
from sdimu_calibration.core.joint.recurrence import Kind, Recurrence, recurrence
from sdimu_calibration.core.joint.recurrence_words import answer_in_words, next_steps
from sdimu_calibration.core.joint.set_diagnosis import diagnose_set
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set
from sdimu_calibration.core.plan import Plan, backwards
from sdimu_calibration.report.set_sections import recurrence_section
from sdimu_calibration.storage.files.advice_words import sentence
from sdimu_calibration.storage.files.config import load_model
from sdimu_calibration.storage.files.diagnosis_file import FORMAT, write_set_diagnosis
from sdimu_calibration.storage.files.json_file import read_json
from sdimu_calibration.storage.kept_report import read_report, write_report
from sdimu_sim.core.temperature import TemperatureProfile

from .conftest import here, short, unit_set

FORTH = short("recommended", stops=28)
BACK = backwards(FORTH)
OF_ATTITUDE = ("accel_x: sin(7 fx/g + 4 fy/g)=40 ug",)
"""Of the specific force, and no power of it: the catalogue has nothing like it."""
OF_TIME = ("accel_x: exp(-t/300 s)=60 ug",)
OF_TEMPERATURE = ("accel_x: T^3=0.8 ug/degC^3",)
HEAT = tuple(
    TemperatureProfile(start_degc=24.0, ripple=4.0, ripple_period_s=period) for period in (500.0, 370.0, -430.0)
)
"""Three recordings whose temperatures come and go at different times."""
OPTIONS = SetOptions(load_model("baseline"))


def left_of(seed: int, plans: Sequence[Plan], effects: tuple[str, ...] = (), **more: object) -> Leftovers:
    """What the baseline leaves in the stops of a simulated set."""
    members = unit_set(seed, plans, effects, **more).members  # type: ignore[arg-type]
    return leftovers(fit_set(members, OPTIONS, here), here)


@pytest.fixture(scope="module")
def clean() -> Leftovers:
    """Two clean recordings of one plan, forth and back."""
    return left_of(41, [FORTH, BACK])


def drawn(clean: Leftovers, u: Floats, seed: int) -> Leftovers:
    """The same recordings with other noise, and with errors u of the sensors in the stops."""
    values, vectors = np.linalg.eigh(clean.gram)
    noise = vectors @ (np.sqrt(np.maximum(values, 0.0)) * np.random.default_rng(seed).standard_normal(len(u)))
    return replace(clean, score=noise + clean.gram @ u)


def test_a_clean_set_is_not_asked(clean):
    assert recurrence(clean) is None
    assert all(recurrence(drawn(clean, np.zeros(len(clean.score)), seed)) is None for seed in range(20))


def test_the_order_of_the_plans_decides_what_is_told_apart(clean):
    assert clean.coincide(ATTITUDE, TIME) < 0.5
    assert clean.pairs(ATTITUDE) > 20
    assert clean.pairs(TIME) > 20
    assert clean.pairs(TEMPERATURE) == 0


def test_likeness_is_that_of_places():
    up = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    alike = likeness(up, np.array([0.0, 0.5, 0.5]), np.array([20.0, 20.0, np.nan]))
    assert alike[ATTITUDE][0, 1] == 1.0
    assert alike[ATTITUDE][0, 2] < 0.02
    assert alike[TIME][1, 2] == 1.0
    assert alike[TIME][0, 1] < 0.05
    assert alike[TEMPERATURE][0, 1] == 1.0
    assert not alike[TEMPERATURE][2].any()
    assert all(np.linalg.eigvalsh(value).min() > -1e-12 for value in alike.values())


@pytest.mark.parametrize("own", ["scatter", ATTITUDE, TIME])
def test_what_is_of_each_recording_does_not_come_back(clean, own):
    """Ten draws each: scatter, or a function of attitude or time that every recording has anew.

    What is told is more likely than not: one of ten is allowed, as its probability before the data is small.
    """
    accel = clean.sensor == 3
    same = clean.recording[:, None] == clean.recording[None, :]
    K = np.eye(len(accel)) if own == "scatter" else np.where(same, clean.likeness[own], 0.0)
    root = np.linalg.cholesky(K[np.ix_(accel, accel)] + 1e-9 * np.eye(accel.sum()))
    false = 0
    for seed in range(10):
        u = np.zeros(len(accel))
        u[accel] = 10.0 * root @ np.random.default_rng(seed + 100).standard_normal(accel.sum())
        found = recurrence(drawn(clean, u, seed))
        assert found is not None
        false += bool(found.answer)
    assert false < 2


@pytest.mark.parametrize("kind", [ATTITUDE, TIME])
def test_what_is_common_comes_back(clean, kind):
    """Five draws of a function of attitude or time that is the same in both recordings."""
    accel = clean.sensor == 3
    root = np.linalg.cholesky(clean.likeness[kind][np.ix_(accel, accel)] + 1e-6 * np.eye(accel.sum()))
    right = 0
    for seed in range(5):
        u = np.zeros(len(accel))
        u[accel] = 10.0 * root @ np.random.default_rng(seed + 200).standard_normal(accel.sum())
        found = recurrence(drawn(clean, u, seed))
        assert found is not None
        right += found.answer == (kind,)
    assert right >= 4


def test_recordings_in_the_same_order_do_not_tell_attitude_from_time():
    found = recurrence(left_of(1, [FORTH, FORTH], OF_ATTITUDE))
    assert found is not None
    assert found.probability > 0.9
    assert (found.answer, found.apart) == ((ATTITUDE, TIME), False)
    assert "the order of the stops" in answer_in_words(found, True)
    for function in (False, True):
        assert "--backwards" in sentence(next_steps(found, True, function)[0])
    assert next_steps(_found((0.95, 0.02, np.nan), 0.96), True, True) == [Advice(Do.TRY_FORCE_EQUATION)]


def test_three_kinds_that_come_in_one_order_have_a_third_each(clean):
    """Whatever shares its partners with the attitude is as likely: the same warm-up in the same order, as one."""
    same = clean.likeness[ATTITUDE]
    left = replace(clean, likeness={ATTITUDE: same, TIME: same, TEMPERATURE: same})
    accel = left.sensor == 3
    root = np.linalg.cholesky(same[np.ix_(accel, accel)] + 1e-6 * np.eye(accel.sum()))
    u = np.zeros(len(accel))
    u[accel] = 10.0 * root @ np.random.default_rng(200).standard_normal(accel.sum())
    found = recurrence(drawn(left, u, 0))
    assert found is not None
    assert found.probability > 0.9
    assert found.answer == (ATTITUDE, TIME, TEMPERATURE)
    assert not found.apart
    assert len({round(k.probability, 9) for k in found.kinds}) == 1
    assert sum(k.probability for k in found.kinds) == pytest.approx(found.probability)


def test_what_all_rows_tell_of_a_kind_stands_in_the_place_of_what_stops_tell():
    # Independent kinds: 1 - (1 - .9)(1 - .2) is .92 of any.
    judged = _found((0.9, 0.2, np.nan), 0.92).judged(ATTITUDE, 0.1)
    assert [k.probability for k in judged.kinds[:2]] == [0.1, 0.2]
    assert judged.probability == pytest.approx(1.0 - 0.9 * 0.8)
    assert judged.answer == ()
    # Where stops said nothing the rows alone tell.
    silent = _found((np.nan, 0.1, np.nan), 0.1).judged(ATTITUDE, 0.98)
    assert not _found((np.nan, 0.1, np.nan), 0.1).may_come_back(ATTITUDE)
    assert _found((0.3, 0.1, np.nan), 0.4).may_come_back(ATTITUDE)
    assert silent.answer == (ATTITUDE,)
    assert silent.probability == pytest.approx(1.0 - 0.02 * 0.9)


@pytest.mark.slow
def test_a_set_says_what_comes_back(tmp_path):
    """A shape that no effect of the catalogue has; noise takes it in where a recording is alone."""
    found = diagnose_set(unit_set(3, [FORTH, BACK], OF_ATTITUDE).members, OPTIONS, here)
    assert found.verdict == "unexplained"
    assert found.recurrence is not None
    assert found.recurrence.answer == (ATTITUDE,)
    assert "comes back at the same attitude" in found.sentence
    assert "it belongs to the sensor" in found.sentence
    # No effect that imitates the sine in these stops is told; what it moves, the function has.
    assert not found.findings
    # The other accelerometers may have a share of it.
    assert "An unknown function of the attitude in accel_x" in found.sentence
    assert "the same in all recordings, explains it." in found.sentence
    assert found.unknown
    assert any("--try FILE" in line for line in map(sentence, found.advice))
    write_set_diagnosis(tmp_path / "diagnosis.json", found)
    content = read_json(tmp_path / "diagnosis.json", FORMAT)["recurrence"]
    assert content["answer"] == [ATTITUDE]
    assert content["kinds"][0]["probability"] > 0.5
    assert content["sensors"][0] == "accel_x"
    assert read_json(tmp_path / "diagnosis.json", FORMAT)["function"] > 0.5


def _kinds(shares: tuple[float, float, float]) -> tuple[Kind, ...]:
    return tuple(Kind(k, 20, p) for k, p in zip((ATTITUDE, TIME, TEMPERATURE), shares, strict=True))


def _found(shares: tuple[float, float, float], any_kind: float) -> Recurrence:
    return Recurrence(_kinds(shares), any_kind, ("accel_x",), 1e-9)


@pytest.mark.parametrize(
    ("found", "words", "step"),
    [
        (_found((0.01, 0.97, 0.02), 0.98), "accel_x comes back at the same time after the start (97 %)", "warm"),
        (_found((0.01, 0.03, 0.9), 0.93), "it belongs to the temperature", "Soaks"),
        (_found((0.04, 0.03, np.nan), 0.07), "does not come back at the same attitude or time after the", "mount"),
        (_found((0.02, 0.3, np.nan), 0.32), "is open (32 %): nearest is the same time after the start", "--backwards"),
        (_found((0.46, 0.45, np.nan), 0.9), "attitude (46 %) or time after the start (45 %)", "--backwards"),
        (_found((0.0, 0.5, 0.5), 1.0), "the temperature of these recordings does not tell which", "Soaks"),
        (_found((np.nan, np.nan, np.nan), 0.0), "share too few stops", "--backwards"),
    ],
)
def test_words_say_what_it_belongs_to_and_what_to_do(found, words, step):
    assert words in answer_in_words(found, True)
    assert step in sentence(next_steps(found, True)[0])
    # A set whose noise takes in what is left says so as well.
    own = answer_in_words(found, False)
    assert "the model leaves in the stops" in own
    if step == "mount":
        # What each recording has for itself is noise there: no mount is to be looked at.
        assert own.endswith(": it is noise of each run.")
        assert next_steps(found, False) == []
    else:
        assert own.endswith(answer_in_words(found, True)[-20:])
        assert next_steps(found, False) == next_steps(found, True)


def test_what_only_the_temperature_tells_is_not_said_to_belong_to_each_run():
    text = answer_in_words(_found((np.nan, np.nan, 0.04), 0.04), True)
    assert "does not come back at the same temperature" in text
    assert "each run" not in text
    assert "each run" in answer_in_words(_found((0.04, 0.04, np.nan), 0.08), True)


def test_the_page_says_that_too_few_stops_are_shared():
    none = _found((np.nan, np.nan, np.nan), 0.0)
    text = recurrence_section(none)
    assert "share too few stops" in text
    assert "nan" not in text


def test_the_page_has_what_comes_back():
    text = recurrence_section(_found((0.96, 0.02, np.nan), 0.97))
    assert "What comes back" in text
    assert "<td>96\u00a0%</td>" in text


def test_places_are_kept(tmp_path):
    kept = []

    def run(jobs):
        done = here(jobs)
        for report in done:
            write_report(tmp_path / "one", report, "1")
            kept.append((report, read_report(tmp_path / "one", "1")))
        return done

    leftovers(fit_set(unit_set(41, [FORTH, BACK]).members, OPTIONS, here), run)
    for report, back in kept:
        for name in ("middle", "up", "temperature_degc", "way"):
            np.testing.assert_array_equal(getattr(back.places, name), getattr(report.places, name))


def _answers(
    seeds: Sequence[int], plans: Sequence[Plan], effects: tuple[str, ...] = (), **more: object
) -> list[object]:
    found: list[Recurrence | None] = [recurrence(left_of(seed, plans, effects, **more)) for seed in seeds]
    return [None if r is None else r.answer for r in found]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effects", "kind"),
    [
        (OF_ATTITUDE, ATTITUDE),
        (("gyro_x: sin(7 fx/g + 4 fy/g)=0.2 deg/h",), ATTITUDE),
        (OF_TIME, TIME),
        (("gyro_x: sin(2 pi t/700 s)=0.2 deg/h",), TIME),
    ],
)
def test_two_recordings_say_what_comes_back(effects, kind):
    answers = _answers(range(1, 11), [FORTH, BACK], effects)
    assert answers.count((kind,)) >= 8


@pytest.mark.slow
def test_three_recordings_say_what_comes_back_with_the_temperature():
    answers = _answers(range(1, 11), [FORTH, BACK, FORTH], OF_TEMPERATURE, temperature=HEAT)
    assert answers.count((TEMPERATURE,)) >= 8


@pytest.mark.slow
@pytest.mark.parametrize("noise", ["accel_noise_stop=20 ug", "accel_noise_random_walk=60 ug/sqrt(h)"])
def test_noise_does_not_come_back(noise):
    answers = _answers(range(1, 11), [FORTH, BACK], noise=(noise,))
    assert sum(bool(answer) for answer in answers) <= 1


@pytest.mark.slow
def test_ten_clean_sets_are_not_asked():
    assert _answers(range(1, 11), [FORTH, BACK]) == [None] * 10
