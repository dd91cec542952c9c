"""The live page over HTTP, from a record without ROS: what is new comes once, an effect is added, the end is told."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sdimu_calibration.report.live_page import figures, parts
from sdimu_calibration.report.live_page.app import build
from sdimu_calibration.report.live_page.curves import Drawn
from sdimu_calibration.report.live_page.record import End, Head, LiveRecord
from sdimu_calibration.report.live_page.visitors import Visitors
from sdimu_calibration.report.live_text import SeenChoice, SeenDiagnosis

from .seen import DRIFT, MISFIT, NIS, TEST, Now, record_of

LOOK = {"scale": 1, "theme": "light"}


class Page:
    """A page of a browser: it keeps what it knows and asks what is new, as the page's script does."""

    def __init__(self, record: LiveRecord, visitors: Visitors | None = None) -> None:
        self.client = build(record, visitors=visitors).server.test_client()
        self.callbacks = self.client.get("/_dash-dependencies").get_json()
        self.known: Any = None
        self.sent = 0

    def ask(self, look: Any = LOOK) -> dict[str, Any]:
        answer = self._post("known.data", {"look.data": look, "known.data": self.known, "page.data": "a"})
        self.known = answer["known"]["data"]
        return answer

    def add(self, effect: Any) -> str:
        """Click the button; what the page then says of it."""
        told = self._post("message.children", {"candidate.value": effect, "add.n_clicks": 1})
        return str(told["message"]["children"])

    def _post(self, output: str, values: dict[str, Any]) -> dict[str, Any]:
        (callback,) = [c for c in self.callbacks if output in c["output"] and c["clientside_function"] is None]
        parts = [o.rsplit(".", 1) for o in callback["output"].strip(".").split("...")]
        outputs = [{"id": part[0], "property": part[1]} for part in parts]
        filled = {
            kind: [{**p, "value": values.get(f"{p['id']}.{p['property']}")} for p in callback[kind]]
            for kind in ("inputs", "state")
        }
        body = {
            "output": callback["output"],
            "outputs": outputs if callback["output"].startswith("..") else outputs[0],
            **filled,
            "changedPropIds": ["add.n_clicks"] if "message" in output else ["tick.n_intervals"],
        }
        done = self.client.post("/_dash-update-component", data=json.dumps(body), content_type="application/json")
        assert done.status_code == 200
        self.sent = len(done.data)
        answer = done.get_json()
        told = answer.get("sideUpdate", {})
        return {**answer.get("response", {}), **told}


def words(content: Any) -> str:
    """All text in components of a page."""
    if isinstance(content, list):
        return " ".join(map(words, content))
    if isinstance(content, dict):
        return words(content["props"].get("children"))
    return "" if content is None else str(content)


def grown() -> Now:
    choices = [
        SeenChoice("X -180 deg: brings accel_bias", 0.3, 50.0),
        SeenChoice("Y +90 deg: brings gyro_bias", 0.8, 1.61),
    ]
    return Now(diagnosis=MISFIT, ladders={2: (("as given", "2.0"),), 3: MISFIT.ladder}, choices=choices)


def test_the_page_shows_where_the_test_is_what_it_knows_and_where_it_fails():
    shown = Page(record_of(grown())).ask()
    assert "stop 1 of 3 dwell" in words(shown["place"]["children"])
    assert "100 times real time" in words(shown["place"]["children"])
    traces = {trace["name"]: trace for trace in shown["sigmas"]["figure"]["data"]}
    assert traces["gyro scale<br>75 ppm"]["y"] == [0.5]
    assert traces["gyro bias<br>0.01 deg/h"]["x"] == pytest.approx([290.0 / 60.0], abs=1e-3)
    assert shown["sigmas"]["figure"]["layout"]["yaxis"]["type"] == "log"
    (map_,) = shown["nis"]["figure"]["data"]
    assert (map_["x"], map_["y"], map_["text"]) == (["0", "1"], ["position", "rate"], [["1.2", "1.2"], ["1.0", "1.0"]])
    (heat,) = shown["heat"]["figure"]["data"]
    assert (heat["x"], heat["y"]) == (["0", "1", "2", "3"], ["gyro x", "gyro y"])
    assert [trace["y"] for trace in shown["errors"]["figure"]["data"]] == [[2.0, 2.42], [0.98]]
    assert "gyro_scale_asymmetry_y +27.4 sigma, 41 ppm" in words(shown["candidates"]["children"])
    assert shown["verdict"]["className"] == "verdict doubtful"
    told = words(shown["choices"]["children"])
    assert told.index("Y +90 deg: brings gyro_bias") < told.index("X \N{MINUS SIGN}180 deg: brings accel_bias")
    assert "1.61" in told
    assert shown["candidate"]["options"][0]["value"] == "gyro_scale_asymmetry_y"


def test_stops_are_written_upright_and_shares_at_every_step_that_a_person_reads():
    """Twenty-eight numbers side by side would touch each other, or be turned on their side."""
    stops = tuple(map(str, range(28)))
    seen = replace(MISFIT, stops=stops, heat=np.zeros((2, 28)))
    shown = Page(record_of(Now(diagnosis=seen, nis_by_stop=dict.fromkeys(range(28), NIS)))).ask()
    for name in ("heat", "nis"):
        axis = shown[name]["figure"]["layout"]["xaxis"]
        assert (axis["tickangle"], axis["dtick"]) == (0, 2)
    axis = shown["sigmas"]["figure"]["layout"]["yaxis"]
    assert (axis["dtick"], axis["tickformat"]) == ("D2", ".2~%")


def test_a_screen_of_4k_has_words_cells_and_room_for_them_larger():
    small, large = (figures.sigmas(Drawn((60.0,), {"gyro_bias": (0.5,)}), ()) for _ in range(2))
    one, other = figures.finished(small, {"scale": 1.0})["layout"], figures.finished(large, {"scale": 1.6})["layout"]
    for part in (lambda made: made["legend"]["font"]["size"], lambda made: made["legend"]["entrywidth"]):
        assert part(other) == pytest.approx(1.6 * part(one))
    cells = figures.finished(figures.heat_map(MISFIT), {"scale": 1.6})["data"][0]["textfont"]["size"]
    assert cells == pytest.approx(1.6 * figures.heat_map(MISFIT).data[0]["textfont"]["size"])


def test_probabilities_are_told_by_family_with_their_members_folded():
    last = replace(MISFIT, verdict="one effect", nothing=0.02, families=(DRIFT,))
    shown = Page(record_of(Now(diagnosis=last))).ask()["candidates"]["children"]
    assert "2 % no effect of the catalogue is missing" in words(shown)
    assert "97 % Slow change of the bias, gyro y" in words(shown)
    (folded,) = (part for part in shown if part["type"] == "Details")
    assert "gyro_bias_step_y(t0=300 s)  60 %" in words(folded)


def test_what_has_not_changed_is_not_sent_again():
    record = record_of(grown())
    page = Page(record)
    page.ask()
    assert set(page.ask()) == {"known"}
    record.take(replace(grown(), nis_by_stop={0: NIS, 1: NIS, 2: NIS}), True, 3.0)
    assert set(page.ask()) >= {"known", "nis"}
    assert "sigmas" not in page.ask()


def test_the_theme_draws_everything_anew():
    page = Page(record_of(grown()))
    light = page.ask()["sigmas"]["figure"]
    dark = page.ask({"scale": 1, "theme": "dark"})["sigmas"]["figure"]
    assert light["data"][0]["line"]["color"] != dark["data"][0]["line"]["color"]


def test_lines_of_a_triad_differ_without_their_colour_and_the_legend_is_as_large_as_the_rest():
    """The fifth had long dashes, which look like the dashes of the second, and words of 9 px named them."""
    effects = ("gyro_bias", "gyro_scale", "gyro_misalignment", "gyro_mass_unbalance", "gyro_scale_asymmetry_y")
    figure = figures.sigmas(Drawn((0.0, 60.0), dict.fromkeys(effects, (1.0, 0.5))), ())
    lines = [(trace["line"]["dash"], trace["line"]["width"]) for trace in figure.data]
    assert len(set(lines)) == len(effects)
    assert not any("long" in dash for dash, _ in lines)
    assert figure.layout["legend"]["font"]["size"] >= 12


def test_a_page_of_an_earlier_test_gets_all_of_the_new_one():
    page = Page(record_of(grown()))
    page.ask()
    other = Page(record_of(grown()))
    other.known = page.known
    assert {"place", "sigmas", "nis", "verdict"} <= set(other.ask())


def test_a_page_without_a_message_says_that_it_waits():
    shown = Page(LiveRecord(TEST)).ask()
    assert "waiting" in words(shown["place"]["children"])
    assert shown["verdict"]["className"] == "verdict neutral"
    assert "No diagnosis so far" in words(shown["candidates"]["children"])


def test_a_page_of_a_test_without_diagnosis_says_so():
    """It promised one at the end of each stop."""
    shown = Page(LiveRecord(replace(TEST, diagnosed=False))).ask()
    for text in (words(shown["candidates"]["children"]), shown["verdict"]["children"]):
        assert text == "No diagnosis while this test runs: it was begun with --no-diagnose."


def test_the_button_adds_what_was_chosen_and_the_answer_is_one_line():
    record, asked = record_of(grown()), []
    page = Page(record)
    page.ask()
    assert page.add("gyro_scale_asymmetry_y") == ""
    assert "asked" in page.ask()["answer"]["children"]
    record.carry_out(lambda effects: asked.extend(effects) or "")
    assert asked == ["gyro_scale_asymmetry_y"]
    assert page.ask()["answer"]["children"].startswith("the test adds gyro_scale_asymmetry_y")
    now = grown()
    now.sigmas["gyro_scale_asymmetry_y"] = 1e-5
    record.take(now, True, 3.0)
    assert page.ask()["answer"]["children"].startswith("gyro_scale_asymmetry_y is in the model")


@pytest.mark.parametrize("effect", [None, "/etc/passwd", "no_such_effect"])
def test_what_cannot_be_added_is_told(effect):
    record = record_of(grown())
    assert Page(record).add(effect).startswith("Not done: ")
    record.carry_out(lambda effects: pytest.fail(str(effects)))


def test_the_end_is_told_stops_the_asking_and_is_known_of_the_page():
    record, visitors = record_of(grown()), Visitors()
    page = Page(record, visitors)
    page.ask()
    record.end(End(True, "The test has ended; results in out/run.", "xdg-open out/run/report.html"))
    assert visitors.unaware()
    shown = page.ask()
    assert words(shown["ended"]["children"]) == (
        "The test has ended; results in out/run.  The report:  xdg-open out/run/report.html"
    )
    assert (shown["tick"]["disabled"], shown["add"]["disabled"]) == (True, True)
    assert shown["ended"]["className"] == "ended good"
    assert not visitors.unaware()


def test_a_stop_that_was_no_end_is_told_as_bad():
    record = record_of(grown())
    record.end(End(False, "The test was stopped."))
    assert Page(record).ask()["ended"]["className"] == "ended bad"


def test_a_page_after_hours_is_small():
    # 60 stops, 12 channels, an estimate every second of six hours, a diagnosis at each stop.
    stops = range(60)
    heat = np.random.default_rng(3).normal(0.0, 3.0, (12, len(stops)))
    channels = tuple(f"channel_{k}" for k in range(12))
    last = replace(MISFIT, channels=channels, stops=tuple(map(str, stops)), heat=heat)
    record, now = LiveRecord(TEST), replace(grown(), nis_by_stop=dict.fromkeys(stops, NIS), diagnosis=last)
    now.ladders = dict.fromkeys(stops, MISFIT.ladder)
    now.choices = [SeenChoice(f"turn {k}: brings accel_bias from 50 times to 0.86 of its limit", k, 2.0) for k in stops]
    for t in range(21_600):
        record.take(replace(now, table_s=float(t), filter_s=float(t)), True, 3.0)
    page = Page(record)
    page.ask()
    assert page.sent < 150_000
    for t in range(5):
        record.take(replace(now, table_s=22_000.0 + t, filter_s=22_000.0 + t), True, 3.0)
        page.ask()
        assert page.sent < 40_000


@pytest.mark.parametrize("verdict", ["consistent", "waiting", "data fault", "several effects"])
def test_every_verdict_has_a_tone(verdict):
    tone = Page(record_of(Now(diagnosis=SeenDiagnosis(1, verdict, "said")))).ask()["verdict"]["className"].split()[1]
    assert tone == {"consistent": "good", "waiting": "neutral", "data fault": "bad"}.get(verdict, "doubtful")


def test_a_test_that_has_ended_shows_no_bar_that_seems_to_wait():
    head = Head("stop 3", share=0.1)
    assert "Progress" in str(parts.place(head))
    assert "Progress" not in str(parts.place(replace(head, end=End(True, "The test has ended.", ""))))


@pytest.mark.parametrize(("share", "words"), [(1.0, "100 %"), (0.995, "100 %"), (0.0996, "10 %"), (0.0123, "1.2 %")])
def test_a_share_is_written_without_exponent(share, words):
    view = SimpleNamespace(fallen=[SimpleNamespace(effect="gyro_scale", share=share)])
    assert f", {words} of its sigma" in parts.largest(view)


def test_candidates_that_noise_reaches_are_not_said_to_be_missing():
    told = words(Page(record_of(Now(diagnosis=replace(MISFIT, standing=1)))).ask()["candidates"]["children"])
    assert "gyro_scale_asymmetry_y" in told
    assert "gyro_bias_step_y" not in told
    shown = Page(record_of(Now(diagnosis=replace(MISFIT, standing=0)))).ask()
    assert words(shown["candidates"]["children"]) == (
        "Nothing stands out: noise reaches 3.82, and the score of no candidate is larger."
    )
    # Whoever wants to try one can.
    assert shown["candidate"]["options"][0]["value"] == "gyro_scale_asymmetry_y"


def test_numbers_of_the_page_have_one_sign_of_minus():
    ranking = (("gyro_bias_step_y(t0=-3 s)", "-12.1 sigma, \N{MINUS SIGN}3 deg/h"),)
    seen = replace(MISFIT, sentence="gyro_bias_y (-3.0 +- 0.2 deg/h) may be missing.", ranking=ranking, standing=1)
    choices = [SeenChoice("X -180 deg: a", 0.3, 50.0), SeenChoice("Y -90 deg: b", 0.8, 1.61)]
    shown = Page(record_of(Now(diagnosis=seen, choices=choices))).ask()
    told = [words(shown[part]["children"]) for part in ("candidates", "choices", "verdict")]
    # A label is what a command takes: it stays as it is typed.
    told.append(shown["candidate"]["options"][0]["label"])
    for text in told:
        assert "-" not in text.replace("t0=-3 s", ""), text
        assert "\N{MINUS SIGN}" in text
