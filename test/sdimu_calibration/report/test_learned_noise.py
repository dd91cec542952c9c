"""Where noise with a memory was learned, what is right at 1 is in that noise, and the rest says that it is not."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.api.fitted import Fitted
from sdimu_calibration.cli.diagnosis_text import notes_of_diagnosis
from sdimu_calibration.core.diagnosis.alarms import Alarm
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, p_value
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.core.diagnosis.verdict import error_falls
from sdimu_calibration.core.error_figures import held_out, held_out_judged, nis_judged
from sdimu_calibration.core.estimation.azimuth_words import NO_AZIMUTH
from sdimu_calibration.core.estimation.free_inertial import NOTHING
from sdimu_calibration.core.noise_term import FLICKER, NoiseTerm
from sdimu_calibration.core.note import Topic
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.report import data, evidence_figures, first_screen, sections
from sdimu_calibration.report.page import Contents, page
from sdimu_calibration.report.report_extras import report_extras
from sdimu_calibration.storage.files.result_file import as_note

TERM = NoiseTerm("gyro", FLICKER, size=1e-4)
IN_NOISE = {"nis_in_noise": 1.303, "held_out_in_noise": 1.076}
WHITE = {"nis_mean": 3.084, "held_out_rms": 7.052}


def in_noise(result: Calibration) -> Calibration:
    notes = (*result.notes, NO_AZIMUTH)
    return replace(result, fit={**result.fit, **WHITE, **IN_NOISE}, noise=(TERM,), notes=notes)


@pytest.fixture(scope="module")
def learned(diagnosis: Diagnosis) -> Diagnosis:
    """The diagnosis as if it had found noise with a memory and no effect."""
    after = in_noise(diagnosis.after)
    found = replace(diagnosis.found, noise=(TERM,), steps=(), chosen=diagnosis.found.chosen[:0])
    told = {"verdict": "noise model wrong", "adequate": False, "found_effects": ()}
    return replace(diagnosis, found=found, before=after, after=after, **told)


def no_figure(_: object) -> str:
    return ""


def right_at_one(costs: tuple[tuple[str, str], ...]) -> list[str]:
    return [number for number, words in costs if "1 is right" in words]


def test_the_figure_that_judges_is_in_the_noise_that_was_learned_where_any_was(diagnosis):
    given = replace(diagnosis.after, fit={**diagnosis.after.fit, **WHITE})
    assert held_out_judged(given) == held_out(given) == WHITE["held_out_rms"]
    assert nis_judged(given) == WHITE["nis_mean"]
    found = in_noise(diagnosis.after)
    assert held_out(found) == WHITE["held_out_rms"]
    assert (held_out_judged(found), nis_judged(found)) == (IN_NOISE["held_out_in_noise"], IN_NOISE["nis_in_noise"])


def test_the_first_screen_of_a_diagnosis_calls_right_at_one_what_is_in_that_noise(learned):
    costs = first_screen.of_diagnosis(summarise(learned)).costs
    assert right_at_one(costs) == ["1.08"]
    (white,) = (words for number, words in costs if number == "7.05")
    assert "white noise" in white


def test_the_first_screen_of_a_fit_does_so_too(learned):
    costs = first_screen.of_fit(learned.after).costs
    assert right_at_one(costs) == ["1.08", "1.303"]
    assert any(number == "7.05" and "white noise" in words for number, words in costs)


def test_a_misfit_shows_no_figure_in_the_noise_that_stands_for_it(learned):
    said = as_note(
        "the model in white noise does not fit (NIS 3.1, held-out error 7.1; 1 is right); run: sdimu diagnose"
    )
    assert said.topic == Topic.MISFIT
    in_place = {**learned.after.fit, "held_out_in_noise": 0.998, "nis_in_noise": 1.014}
    costs = first_screen.of_fit(replace(learned.after, warnings=(said,), fit=in_place)).costs
    assert costs[0][0] == "7.05"
    assert not {"1.00", "1.014"} & {number for number, _ in costs}


def test_a_page_without_learned_noise_says_nothing_of_white_noise(diagnosis):
    first = first_screen.of_diagnosis(summarise(diagnosis))
    assert "1 is right" in first.ladder
    assert not any("white noise" in words for words in (first.ladder, *(words for _, words in first.costs)))
    assert "in white noise" not in error_falls(diagnosis)


def test_a_sentence_that_compares_models_says_in_which_noise(learned):
    assert "in white noise: 7.052 -> 7.052" in error_falls(learned)


def test_the_heat_map_says_in_which_noise_its_sigmas_are(learned, diagnosis):
    drawn = sections.heat_maps(learned, no_figure)
    assert "white noise" in drawn
    assert "is chance" not in drawn
    assert "is chance" in sections.heat_maps(diagnosis, no_figure)


def test_under_a_misfit_a_cell_beyond_three_counts(learned):
    """The page said that the model is wrong, and below that its cells prove nothing."""
    assert "no cell by itself" in sections.heat_maps(learned, no_figure)
    wrong = sections.heat_maps(replace(learned, alarms=frozenset({Alarm.NIS})), no_figure)
    said = as_note("the model in white noise does not fit (NIS 3.1); run: sdimu diagnose")
    of_fit = page(replace(learned.after, warnings=(said,)), Contents("x", fit=learned.fit))
    for text in (wrong, of_fit):
        assert "It counts beyond 3: the noise that was learned stands for what is missing" in text
        assert "no cell by itself" not in text


def test_the_colours_of_a_map_have_the_number_from_which_a_cell_counts(diagnosis):
    (drawn,) = evidence_figures.heat_map(data.where(diagnosis.consistency)).data
    beside = drawn["colorbar"]
    assert {-data.NOTABLE, data.NOTABLE, drawn["zmin"], drawn["zmax"]} <= set(beside["tickvals"])
    assert len(beside["ticktext"]) == len(beside["tickvals"])
    assert "beyond 3:" in sections.heat_maps(diagnosis, no_figure)


def test_nothing_is_shown_with_what_was_found_where_nothing_was(learned, diagnosis):
    """The fit at the end is another object than the first one, also where nothing was added."""
    assert learned.extended is not learned.fit
    assert "with what was found" not in sections.heat_maps(learned, no_figure)
    assert "with what was found" in sections.heat_maps(diagnosis, no_figure)
    for trial in report_extras(learned).trials:
        assert [drift.name for drift in trial.drifts] == [NOTHING, "model as given"]


def test_a_page_says_before_its_numbers_that_headings_mean_nothing(learned):
    body = page(learned.after, Contents("x", summary=summarise(learned))).partition("<body>")[2]
    assert body.index("headings of this test mean nothing") < body.index("How well it predicts")
    assert first_screen.of_fit(learned.after).remarks
    assert not first_screen.of_fit(replace(learned.after, notes=())).remarks


def test_the_shell_repeats_what_still_holds_and_no_finding_twice(learned):
    misfit = as_note("the model in white noise does not fit (NIS 3); run: sdimu diagnose")
    warnings = (misfit, "gyro_bias_x is far off")
    told = notes_of_diagnosis(
        replace(learned, after=replace(learned.after, warnings=warnings), findings=(SimpleNamespace(text=warnings[1]),))
    )
    assert told == (NO_AZIMUTH, "the model in white noise does not fit (NIS 3)")


def test_a_fit_in_python_prints_the_figure_in_that_noise_first(learned):
    class Shown(Fitted):
        result = learned.after
        _heading = "x"

    last = repr(Shown()).splitlines()[-1]
    assert "NIS 1.303, held-out error 1.076 in the noise that was learned (1 is right; in white noise NIS 3.084" in last


def test_p_takes_the_nis_in_white_noise_and_is_called_so(learned, diagnosis):
    done = SimpleNamespace(
        found=SimpleNamespace(p_value=0.2), free=np.arange(3), left_before=SimpleNamespace(p_value=0.3)
    )
    assert p_value(done, SimpleNamespace(nis_p_value=0.0), noise=False) == pytest.approx(0.6)
    assert p_value(done, SimpleNamespace(nis_p_value=0.0), noise=True) == 0.0
    assert "that a right model in white noise looks like this" in sections.numbers(learned)
    assert "that a right model looks like this" in sections.numbers(diagnosis)


def test_noise_is_remarked_and_no_advice(learned):
    line = "gyro white noise is 1.30 +- 0.02 times the specification"
    told = first_screen.of_diagnosis(
        summarise(replace(learned, noise=(line,), statements=("The noise model is wrong.",)))
    )
    assert not any(line in text for text in told.advice)
    assert any("1.30" in text for text in told.remarks)
    whole = replace(learned, noise=(line,), statements=(f"The noise is wrong: {line}.",))
    said = first_screen.of_diagnosis(summarise(whole))
    assert not any("1.30" in text for text in said.remarks)
