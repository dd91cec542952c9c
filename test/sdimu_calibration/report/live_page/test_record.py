"""The record of a running test: small whatever the length of the test, and the way of an effect from a page to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.core.units import to_si
from sdimu_calibration.report.live_page.curves import MOST, Curves
from sdimu_calibration.report.live_page.record import ANSWER, CURVES, DIAGNOSIS, HEAD, PARTS, STOPS, End, LiveRecord
from sdimu_calibration.report.live_page.visitors import Visitors
from sdimu_calibration.report.live_text import SeenChoice

from .seen import MISFIT, NIS, SCALE, TEST, Now, record_of


@pytest.mark.parametrize("count", [MOST, 3600, 40_000])
def test_curves_of_any_length_have_few_points_over_all_of_the_time(count):
    curves = Curves()
    for k in range(count):
        curves.add(float(k + 1), {"a": float(k + 1)})
    t = np.array(curves.drawn().t)
    assert len(t) <= MOST
    assert (t[0], t[-1]) == (1.0, float(count))
    assert curves.drawn().values["a"] == tuple(t)
    # No stretch is left out: a hundredth of the test is seen.
    assert np.diff(t).max() <= max(1.0, 0.01 * count)


def test_a_curve_that_begins_later_is_not_drawn_before():
    curves = Curves()
    curves.add(1.0, {"a": 1.0})
    curves.add(2.0, {"a": 0.5, "b": 1.0})
    assert curves.drawn().values == {"a": (1.0, 0.5), "b": (None, 1.0)}


def test_curves_begin_anew_with_the_test_and_not_with_a_late_message():
    curves = Curves()
    for t in (10.0, 20.0, 18.0):
        curves.add(t, {"a": t})
    assert curves.drawn().t == (10.0, 20.0)
    curves.add(1.0, {"a": 1.0})
    assert curves.drawn().t == (1.0,)


def test_only_what_is_new_gets_a_new_version():
    record = record_of(Now())
    before = record.view().versions
    record.take(Now(), True, 3.0)
    assert record.view().versions == before
    record.take(Now(nis_by_stop={0: NIS, 1: NIS, 2: NIS}), True, 3.0)
    after = record.view().versions
    assert [part for part in PARTS if after[part] != before[part]] == [STOPS]
    record.take(Now(nis_by_stop={0: NIS, 1: NIS, 2: NIS}, diagnosis=MISFIT, ladders={3: MISFIT.ladder}), True, 3.0)
    assert record.view().versions[DIAGNOSIS] > after[DIAGNOSIS]


def test_the_head_says_stop_time_and_share():
    head = record_of(Now()).view().head
    assert head.place == "stop 1 of 3 dwell"
    assert head.time == "300 of 900 s, 6 s left at 100 times real time"
    assert head.share == pytest.approx(1.0 / 3.0)


def test_of_a_test_that_chooses_its_turns_the_longest_time_is_told_as_such():
    """One that ended after 3 min had "of 1800 s, 5 min left" all the time."""
    chooses = replace(TEST, stops=0)
    record = LiveRecord(chooses)
    record.take(Now(), True, 3.0)
    assert record.view().head.time == "300 of at most 900 s, at most 6 s left at 100 times real time"


def test_an_effect_that_was_added_has_a_curve_and_a_unit_of_its_own():
    # Its name begins as that of an effect of the model.
    name = "gyro_scale_asymmetry_x"
    now = Now()
    now.sigmas[name], now.first[name] = to_si(4.0, "ppm"), to_si(40.0, "ppm")
    view = record_of(now).view()
    (own,) = (f for f in view.fallen if f.effect == name)
    assert (own.unit, own.sigma, own.share) == ("ppm", pytest.approx(4.0), pytest.approx(0.1))
    assert view.curves.values[name] == (pytest.approx(0.1),)
    assert next(f.share for f in view.fallen if f.effect == "gyro_scale") == pytest.approx(
        now.sigmas["gyro_scale_x"] / SCALE
    )


def test_what_a_page_asks_for_reaches_the_test_once_and_its_answer_comes_back():
    record, asked = record_of(Now(diagnosis=MISFIT)), []
    for effect in ("gyro_bias_step_y(t0=300 s)", "accel_quadratic_x"):
        record.ask(effect)
    assert "accel_quadratic_x" in record.view().answer
    record.carry_out(lambda effects: asked.append(effects) or "")
    record.carry_out(lambda effects: asked.append(effects) or "")
    assert asked == [["gyro_bias_step_y(t0=300 s)"], ["accel_quadratic_x"]]
    record.take(Now(diagnosis=MISFIT), True, 3.0)
    assert record.view().answer.startswith("the test adds accel_quadratic_x: its filter goes through all samples")
    now = Now(diagnosis=MISFIT)
    now.sigmas["accel_quadratic_x"] = 1e-5
    record.take(now, True, 3.0)
    # Of the two that were asked for, the one that the filter has by now.
    assert record.view().answer.startswith("accel_quadratic_x is in the model")
    before = record.view().versions[ANSWER]
    record.ask("accel_quadratic_y")
    record.carry_out(lambda _: "the calibration node\ndoes not answer")
    assert record.view().answer == "not added: the calibration node does not answer"
    assert record.view().versions[ANSWER] > before


@pytest.mark.parametrize("text", ["no_such_effect", "/etc/passwd", "own.yaml", "gyro_x: ey^2", ""])
def test_a_page_adds_what_the_list_offers_and_nothing_else(text):
    record = record_of(Now(diagnosis=MISFIT))
    with pytest.raises(DataError, match="in the catalogue"):
        record.ask(text)
    record.carry_out(lambda effects: pytest.fail(str(effects)))


def test_a_test_that_has_ended_takes_nothing_more_and_keeps_its_first_end():
    record = record_of(Now())
    record.end(End(True, "The test has ended."))
    record.end(End(False, "The test was stopped."))
    assert record.view().head.end == End(True, "The test has ended.")
    with pytest.raises(DataError, match="has ended"):
        record.ask("accel_quadratic_x")


def test_what_is_done_after_the_samples_is_said_in_the_place_of_the_stop():
    record = record_of(Now())
    record.tell("the report is being made")
    assert record.view().head.place == "the report is being made"


def test_nothing_is_told_before_the_first_message():
    view = LiveRecord(TEST).view()
    assert (view.head.place, view.curves.t, view.answer) == ("waiting for the first message", (), "")
    assert view.versions == dict.fromkeys(PARTS, 0)


def test_joining_late_is_known():
    assert record_of(Now(table_s=300.0), Now(table_s=301.0)).view().joined_s == 300.0


def test_choices_are_kept_as_they_came():
    made = [SeenChoice("X +90 deg: brings most", 0.3, 50.0)]
    record = record_of(Now(choices=made))
    made.append(SeenChoice("the test ends", 2.6, 0.9))
    assert len(record.view().choices) == 1
    assert record.view().versions[HEAD] == record.view().versions[CURVES] == 1


def test_a_page_that_has_gone_is_not_waited_for(monkeypatch):
    clock = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: clock[0])
    visitors = Visitors()
    assert not visitors.unaware()
    visitors.came("a", False)
    assert visitors.unaware()
    visitors.came("a", True)
    assert not visitors.unaware()
    visitors.came("b", False)
    clock[0] += 60.0
    assert not visitors.unaware()


def test_a_diagnosis_is_the_same_as_long_as_it_is_the_same_object():
    record = record_of(Now(diagnosis=MISFIT))
    before = record.view().versions[DIAGNOSIS]
    record.take(Now(diagnosis=MISFIT), True, 3.0)
    assert record.view().versions[DIAGNOSIS] == before
    record.take(Now(diagnosis=replace(MISFIT, stop=4)), True, 3.0)
    assert record.view().versions[DIAGNOSIS] == before + 1
