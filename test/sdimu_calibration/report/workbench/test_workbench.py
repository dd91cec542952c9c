"""The loop in the browser: see the misfit, add the effect, see it fall, take the model home; bad input is told."""

from __future__ import annotations

import base64
import io
import json
import zipfile
from typing import Any

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.cost import OVER_MODELS, wrong_without
from sdimu_calibration.report.report_extras import report_extras
from sdimu_calibration.report.workbench.app import build
from sdimu_calibration.report.workbench.fit import FitSession
from sdimu_calibration.report.workbench.parts import numbers
from sdimu_calibration.report.workbench.recording_cache import RecordingCache, neighbours
from sdimu_calibration.report.workbench.setting import Setting
from sdimu_calibration.report.workbench.tables import coefficients
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
from sdimu_calibration.storage.files.effect_file import extended_model

HIDDEN = "accel_quadratic_x"
OWN = """format: sdimu-effect/1
name: bent
expressions:
  accel_x: k * ax**2
parameters:
  k: {unit: ug/g^2, prior: 50 ug/g^2}
"""


def new_bench(recording: Any) -> FitSession:
    return FitSession(PreparedTest(recording, load_imu("dtg"), load_site("daejeon")), load_model("baseline"))


@pytest.fixture(scope="module")
def bench(recording: Any) -> FitSession:
    return new_bench(recording)


def shelf(bench: FitSession) -> RecordingCache:
    """A shelf with one recording that reads, and one that does not."""

    def make(name: str) -> FitSession:
        if name == "bad":
            raise DataError("bad: is no recording")
        return bench

    return RecordingCache(["good", "bad"], make)


@pytest.fixture(scope="module")
def app(bench: FitSession) -> Any:
    return build(shelf(bench))


CHOICES = {"shows_at_value": "now", "which_at_value": "one", "against_at_value": "time (s)"}


class Page:
    """A page of a browser: it keeps its state and posts what is clicked, as the page's script does."""

    def __init__(self, app: Any, state: Any = None) -> None:
        self.client, self.state, self.message = app.server.test_client(), state, ""
        self.callbacks = self.client.get("/_dash-dependencies").get_json()

    def post(self, output: str, changed: str, **values: Any) -> dict[str, Any]:
        return self.post_all(output, changed, **values)["response"]

    def post_all(self, output: str, changed: str, **values: Any) -> dict[str, Any]:
        look = {"scale": 1, "theme": "light"}
        told = {k.replace("__", "-").replace("_at_", "."): v for k, v in values.items()}
        known = {"state.data": self.state, "look.data": look, **told}
        (callback,) = [
            c
            for c in self.callbacks
            if output in c["output"]
            and c["clientside_function"] is None
            and changed in {f"{one['id']}.{one['property']}" for one in c["inputs"]}
        ]
        parts = [o.rsplit(".", 1) for o in callback["output"].strip(".").split("...")]
        outputs = [{"id": part[0], "property": part[1]} for part in parts]

        def filled(places: list[dict[str, Any]]) -> list[dict[str, Any]]:
            return [{**p, "value": known.get(f"{p['id']}.{p['property']}")} for p in places]

        body = {
            "output": callback["output"],
            "outputs": outputs if callback["output"].startswith("..") else outputs[0],
            "inputs": filled(callback["inputs"]),
            "state": filled(callback["state"]),
            "changedPropIds": [changed],
        }
        done = self.client.post("/_dash-update-component", data=json.dumps(body), content_type="application/json")
        assert done.status_code == 200
        return done.get_json()

    def click(self, changed: str, **values: Any) -> None:
        answer = self.post("state.data", changed, **values)
        self.state = answer.get("state", {}).get("data", self.state)
        self.message = answer["message"]["children"]

    def add(self, effect: str) -> None:
        self.click("add.n_clicks", candidate_at_value=effect)

    def shown(self) -> dict[str, Any]:
        """Everything that the page shows: the numbers, then what the candidates say."""
        numbers = self.post("numbers.children", "state.modified_timestamp", **CHOICES)
        kept = {"shown_at_data": numbers["shown"]["data"]}
        return numbers | self.post("verdict.children", "shown.data", **kept)

    def drawn(self, shown: dict[str, Any], **choices: Any) -> dict[str, Any]:
        """Heat map and residuals of what is chosen."""
        return self.post("heat.figure", "looked.data", shown_at_data=shown["shown"]["data"], **{**CHOICES, **choices})

    @property
    def verdict(self) -> str:
        return self.shown()["verdict"]["children"]


def test_the_loop_finds_adds_and_takes_home_the_hidden_effect(app, recording, tmp_path):
    page = Page(app)
    shown = page.shown()
    assert "Certain: accelerometer second-order nonlinearity K2, x (" in shown["verdict"]["children"]
    bars = shown["ranking"]["figure"]["data"][0]["y"]
    assert bars[0] == HIDDEN
    chosen = page.post("candidate.value", "ranking.clickData", ranking_at_clickData={"points": [{"y": bars[0]}]})
    page.add(chosen["candidate"]["value"])
    after = page.shown()
    assert "nothing stands out" in after["verdict"]["children"]
    rungs = after["ladder"]["figure"]["data"][0]["x"]
    assert rungs[1] < rungs[0]
    # A right model predicts left-out stops to one sigma; 4,400 numbers scatter by 1.1 %.
    assert rungs[1] == pytest.approx(1.0, abs=0.03)

    packed = page.post("file.data", "export.n_clicks")["file"]["data"]["content"]
    zipfile.ZipFile(io.BytesIO(base64.b64decode(packed))).extractall(tmp_path)
    model = extended_model(str(tmp_path / "model.yaml"), [])
    again = calibrate(recording, load_site("daejeon"), load_imu("dtg"), model, held_out=False)
    result = {c["name"]: c for c in json.loads((tmp_path / "result.json").read_text())["coefficients"]}
    sigma = np.sqrt(np.diag(again.covariance))
    assert set(result) == set(again.names)
    for name, value, s in zip(again.names, again.values, sigma, strict=True):
        # Passes end when nothing moves by 0.005 sigma; two ways to get there may differ by twice that.
        assert abs(result[name]["value"] - value) <= 0.01 * s + 1e-15
    assert (tmp_path / "report.html").stat().st_size < 6e6


def test_the_verdict_leads_with_what_is_wrong_by_the_figure_of_the_report(app, bench):
    """An error near 1 says nothing of a coefficient that is many sigmas off."""
    fit = solve(bench.test, bench.model)
    found = climb(fit)
    (worst, *_) = wrong_without(summarise(found), report_extras(found, fit))
    assert bench.missing(Setting()).worst.text == worst.text
    # Values keep beside their sigmas by spaces that no line breaks at.
    told = Page(app).verdict.replace("\N{NO-BREAK SPACE}", " ")
    assert f"Wrong without it: {worst.text}; +-: {OVER_MODELS}.".replace("+-", "\N{PLUS-MINUS SIGN}") in told


def test_an_effect_of_ones_own_does_what_the_registered_one_does(app, bench):
    page = Page(app)
    page.click("add-own.n_clicks", own_at_value=OWN)
    assert page.message == ""
    own = bench.fit(Setting((OWN,))).calibration
    registered = bench.fit(Setting((HIDDEN,))).calibration
    sigma = registered.covariance[-1, -1] ** 0.5
    assert own.names[-1] == "bent_k"
    # The priors differ (50 against the grade's), the data outweigh both by hundreds.
    assert own.values[-1] == pytest.approx(registered.values[-1], abs=0.2 * sigma)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        (OWN.replace("ax**2", "ax**2 * q"), "expressions.accel_x"),
        (OWN.replace("k * ax", "k * wx * ax"), "comes to"),
        ("no effect at all\n: [", "yaml"),
        ("gyro_bais", "unknown effect"),
    ],
)
def test_bad_effects_are_told_in_the_page_and_change_nothing(app, text, word):
    page = Page(app)
    page.click("add-own.n_clicks", own_at_value=text)
    assert page.state is None
    assert word in page.message.lower() or word in page.message
    assert "/tmp" not in page.message
    assert "\n" not in page.message


@pytest.mark.parametrize(
    ("coefficient", "mean", "message"),
    [
        ("accel_bias_y", "abc", "value of accel_bias_y: 'abc' is not a number with a unit (expected something like"),
        ("gyro_bias_x", "", "value of gyro_bias_x: it is empty (write a number with its unit, such as '1 deg/h')"),
        ("accel_misalignment_xy", "1 arcmin", "prior of accel_misalignment_xy: the body frame"),
    ],
)
def test_a_wrong_prior_is_told_in_the_page_and_changes_nothing(app, coefficient, mean, message):
    page = Page(app)
    page.click("set-prior.n_clicks", coefficient_at_value=coefficient, mean_at_value=mean, sigma_at_value="5")
    assert page.state is None
    assert page.message.startswith(f"Not done: {message}")


def test_undo_brings_the_misfit_back(app):
    page = Page(app)
    before = page.verdict
    page.add(HIDDEN)
    assert page.verdict != before
    page.click("undo.n_clicks")
    assert page.verdict == before


def test_two_pages_do_not_disturb_each_other_and_a_restart_loses_nothing(app, recording):
    one, other = Page(app), Page(app)
    before = other.verdict
    one.add(HIDDEN)
    assert other.verdict == before
    restarted = build(shelf(new_bench(recording)))
    # The restarted server fits from cold, the first one went on from the fit before: same numbers to the digits shown.
    assert Page(restarted, one.state).shown()["numbers"] == one.shown()["numbers"]


def test_a_click_on_a_cell_shows_that_stop_and_channel(app):
    page = Page(app)
    page.click("heat.clickData", heat_at_clickData={"points": [{"x": "7", "y": "accel x"}]})
    figure = page.shown()["residuals"]["figure"]
    count = len(figure["data"][0]["text"])
    assert count > 1
    # The mean is over the sigma of a point, that of the map over its own.
    assert figure["layout"]["title"]["text"].startswith(f"accel x at stop 7: mean of {count} points ")


def test_held_out_stops_are_predicted_not_fitted(bench):
    held = bench.fit(Setting((HIDDEN,), (5, 9)))
    assert not np.isin(held.grid.stops, (5, 9)).any()
    # Errors of the coefficients are common to a stop: some 24 independent numbers, an RMS that scatters by 14 %.
    assert held.at_held == pytest.approx(1.0, abs=3 * 0.14)
    assert bench.fit(Setting(held=(5, 9))).at_held > held.at_held


def test_a_coefficient_that_is_another_one_is_told(bench):
    given = bench.fit(Setting())
    twice = bench.fit(Setting(("gyro_x: 1",)))
    assert "gyro_bias_x and gyro_x: 1 cannot be told from each other" in numbers(twice, given)
    assert "cannot be told" not in numbers(given, given)


def test_as_given_is_the_fit_without_priors_of_a_user(bench):
    given = bench.fit(Setting())
    setting = Setting().with_prior("accel_bias_y", "500 ug", "5 ug")
    assert bench.fit(setting.given) is given
    told = coefficients(bench.fit(setting.given), bench.fit(setting), setting)
    (row,) = [
        row for row in told.children[1].children if row.to_plotly_json()["props"]["data-coefficient"] == "accel_bias_y"
    ]
    k = given.calibration.names.index("accel_bias_y")
    assert float(row.children[6].children) == pytest.approx(from_si(given.calibration.values[k], "ug"), abs=1.0)
    assert abs(float(row.children[7].children)) > 10.0


def test_the_first_stop_cannot_be_held_out(bench):
    with pytest.raises(DataError, match="attitude"):
        bench.fit(Setting(held=(bench.stops[0],)))


def test_a_recording_that_cannot_be_read_is_told_and_the_other_stays(app):
    page = Page(app)
    page.click("open.n_clicks", recording_at_value="bad")
    assert page.message == "Not done: bad: is no recording"
    assert page.state is None
    page.click("open.n_clicks", recording_at_value="good")
    assert page.message == ""


def test_a_state_of_another_server_shows_a_fresh_page_and_says_so(app):
    page = Page(app, {"now": {"added": ["no_such_effect"]}, "recording": "gone"})
    shown = page.post("numbers.children", "state.modified_timestamp")
    assert "gone" in shown["message"]["children"]
    assert shown["about"]["children"].startswith("good \N{MIDDLE DOT} ")


def test_models_of_a_page_stand_side_by_side_after_an_undo(app):
    page = Page(app)
    page.shown()
    page.add(HIDDEN)
    page.shown()
    page.click("undo.n_clicks")
    body = page.shown()["models"]["children"]["props"]["children"][1]["props"]["children"]
    first = [row["props"]["children"][0]["props"]["children"] for row in body]
    assert first == ["model as given", f"+ {HIDDEN}"]
    assert [row["props"]["className"] for row in body] == ["here", ""]


def test_recordings_beside_the_one_asked_for_are_offered(tmp_path):
    for name in ("b.mcap", "a.mcap", "notes.txt"):
        (tmp_path / name).touch()
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "metadata.yaml").touch()
    assert list(neighbours(tmp_path / "b.mcap")) == ["b.mcap", "a.mcap", "bag"]


def test_numbers_do_not_wait_for_candidates(recording):
    told: list[str] = []
    new_bench(recording).fit(Setting(), lambda word, _share: told.append(word))
    assert "passes" in told
    assert "candidates" not in told


def test_undo_and_redo_walk_the_steps_and_a_new_step_forgets_the_way_forward(app):
    page = Page(app)
    page.add(HIDDEN)
    page.click("toggle-stop.n_clicks", stop_at_data=5)
    both = page.state["now"]
    page.click("undo.n_clicks")
    page.click("undo.n_clicks")
    assert page.state["now"] == {"added": [], "held": [], "cut": [], "priors": []}
    page.click("undo.n_clicks")
    assert page.message == "Nothing to undo."
    page.click("redo.n_clicks")
    page.click("redo.n_clicks")
    assert page.state["now"] == both
    page.click("undo.n_clicks")
    page.click("toggle-stop.n_clicks", stop_at_data=7)
    page.click("redo.n_clicks")
    assert page.message == "Nothing to redo."


def test_points_that_are_selected_are_left_out_and_taken_in_again(app, bench):
    page = Page(app)
    drawn = page.shown()["residuals"]["figure"]["data"][0]
    spans = drawn["customdata"][10:13]
    points = {"points": [{"customdata": span} for span in spans]}
    page.click("leave-points.n_clicks", residuals_at_selectedData=points)
    ((begin, end),) = page.state["now"]["cut"]
    assert (begin, end) == (pytest.approx(spans[0][0], abs=0.01), pytest.approx(spans[-1][1], abs=0.01))
    fitted = bench.fit(Setting(cut=((begin, end),)))
    assert np.isfinite(fitted.left_out).any(axis=1).sum() == len(spans)
    # What is left out is drawn apart, with the error by which the others predict it.
    shown = page.shown()["residuals"]["figure"]["data"]
    assert [trace["name"] for trace in shown] == ["residual", "left out"]
    assert len(shown[1]["customdata"]) == len(spans)
    page.click("take-points.n_clicks", residuals_at_selectedData=points)
    assert page.state["now"]["cut"] == []


def test_a_coefficient_is_fixed_given_a_prior_and_freed(app, bench):
    page = Page(app)
    free = bench.fit(Setting()).calibration
    # Where it is already, so that the noise that is learned stays what it is.
    mean = f"{from_si(free.values[0], 'deg/h'):.6f} deg/h"
    one = {"coefficient_at_value": "gyro_bias_x", "mean_at_value": mean, "sigma_at_value": "0.0001 deg/h"}
    page.click("fix.n_clicks", **one)
    assert page.state["now"]["priors"] == [["gyro_bias_x", mean, "0 deg/h"]]
    fixed = bench.fit(Setting(priors=(("gyro_bias_x", mean, "0 deg/h"),))).calibration
    assert fixed.covariance[0, 0] == 0.0
    assert fixed.values[0] == pytest.approx(free.values[0], rel=1e-5)
    page.click("set-prior.n_clicks", **one)
    told = bench.fit(Setting(priors=(("gyro_bias_x", mean, "0.0001 deg/h"),))).calibration
    assert 0.0 < told.covariance[0, 0] < free.covariance[0, 0]
    page.click("free.n_clicks", **one)
    assert page.state["now"]["priors"] == []
    page.click("fix.n_clicks", **{**one, "mean_at_value": "0.5 ppm"})
    assert "wrong unit" in page.message
    assert page.state["now"]["priors"] == []


def test_a_candidate_is_shown_with_what_it_would_take_before_it_is_added(app, bench):
    page = Page(app)
    kept = {"shown_at_data": page.shown()["shown"]["data"]}
    looked = page.post("preview.children", "candidate.value", candidate_at_value=HIDDEN, **kept)
    assert "df_i = K2_i a_i^2" in json.dumps(looked["preview"]["children"])
    found = bench.preview(Setting(), HIDDEN)
    assert found.what.objections == ()
    after = bench.fit(Setting((HIDDEN,)))
    # The linear model, before the fit, says what the fit then finds; noise that was learned weighs stops otherwise.
    sigma = after.calibration.covariance[-1, -1] ** 0.5
    sigma = max(sigma, found.what.sigma[0])
    assert found.what.estimate[0] == pytest.approx(after.calibration.values[-1], abs=3.0 * sigma)
    assert found.what.held_out[1] == pytest.approx(after.held_out, abs=0.01)
    drawn = page.drawn({"shown": {"data": kept["shown_at_data"]}}, looked_at_data=HIDDEN)
    assert "would take" in drawn["residuals"]["figure"]["data"][-1]["name"]


def test_a_degenerate_addition_is_objected_to_before_and_after_and_gets_no_tick(app, bench):
    before = " ".join(bench.preview(Setting((HIDDEN,)), "gyro_x: 1").what.objections)
    after = " ".join(bench.objections(Setting((HIDDEN, "gyro_x: 1"))))
    for told in (before, after):
        assert "raises the sigma of gyro_bias_x" in told
        assert "does not lower the error" in told
    page = Page(app)
    page.add(HIDDEN)
    assert page.shown()["verdict"]["className"] == "verdict good"
    page.click("add-own.n_clicks", own_at_value="gyro_x: 1")
    shown = page.shown()
    assert shown["verdict"]["className"] == "verdict doubtful"
    assert not shown["verdict"]["children"].startswith("\N{CHECK MARK}")
    assert len(shown["objections"]["children"]) >= 2


def test_a_prior_that_the_data_contradict_gets_no_tick_and_is_named(app, bench):
    prior = ("gyro_scale_y", "-2000 ppm", "10 ppm")
    page = Page(app)
    page.add(HIDDEN)
    page.click("set-prior.n_clicks", coefficient_at_value=prior[0], mean_at_value=prior[1], sigma_at_value=prior[2])
    shown = page.shown()
    assert shown["verdict"]["className"] != "verdict good"
    (told,) = (line for line in bench.fit(Setting((HIDDEN,), priors=(prior,))).calibration.warnings if "stated" in line)
    assert "the stated prior of gyro_scale_y (-2000 +- 10 ppm) contradicts the data" in told
    page.click("set-prior.n_clicks", coefficient_at_value=prior[0], mean_at_value="-2000", sigma_at_value="10")
    assert "has no unit" in page.message


def test_residuals_are_drawn_against_what_is_chosen(app, bench):
    page = Page(app)
    shown = page.shown()
    axes = bench.fit(Setting()).axes
    for against in axes:
        drawn = page.drawn(shown, against_at_value=against, which_at_value="all")["residuals"]["figure"]
        assert drawn["layout"]["xaxis"]["title"]["text"] == against
        # More than ten of the nineteen stops have.
        assert len(drawn["data"][0]["customdata"]) > 10 * 40
    assert {"roll (deg)", "specific force z (g)", "rate x (deg/h)", "turn before, x (deg/s)"} <= set(axes)


def test_what_is_taken_home_names_what_was_left_out_and_fixed(app, recording, tmp_path):
    page = Page(app)
    page.add(HIDDEN)
    page.click("toggle-stop.n_clicks", stop_at_data=5)
    page.click("fix.n_clicks", coefficient_at_value="gyro_bias_x", mean_at_value="0.69 deg/h")
    points = {"points": [{"customdata": [700.0, 701.0]}]}
    page.click("leave-points.n_clicks", residuals_at_selectedData=points)
    packed = page.post("file.data", "export.n_clicks")["file"]["data"]["content"]
    zipfile.ZipFile(io.BytesIO(base64.b64decode(packed))).extractall(tmp_path)
    command = (tmp_path / "command.txt").read_text()
    assert "--exclude-stops 5 --exclude-times 700.001-700.999" in command
    model = extended_model(str(tmp_path / "model.yaml"), [])
    test = PreparedTest(recording, load_imu("dtg"), load_site("daejeon"))
    again = solve(test.without_stops((5,)).without_times(((700.001, 700.999),)), model)
    result = json.loads((tmp_path / "result.json").read_text())["coefficients"]
    assert [c["value"] for c in result] == again.values.tolist()
    assert [c["sigma"] for c in result] == np.sqrt(np.diag(again.covariance)).tolist()
    assert json.loads((tmp_path / "session.json").read_text())["now"] == page.state["now"]


def test_the_server_says_that_it_is_alive_and_to_this_machine_alone(app):
    client = app.server.test_client()
    assert client.get("/alive").status_code == 204
    assert client.get("/alive", headers={"Host": "elsewhere.example"}).status_code == 403


def test_a_recording_that_was_changed_in_place_is_opened_anew(tmp_path):
    """What the page shows, and the command that it gives away, are of the same file."""
    (tmp_path / "a").mkdir()
    file = tmp_path / "a" / "a_0.mcap"
    file.write_bytes(b"one")
    opened = []
    shelf = RecordingCache(["a", "bare"], lambda name: opened.append(name) or object(), {"a": tmp_path / "a"})
    first, bare = shelf.bench("a"), shelf.bench("bare")
    assert shelf.bench("a") is first
    file.write_bytes(b"two, of another length")
    assert shelf.bench("a") is not first
    assert shelf.bench("bare") is bare
    file.unlink()
    file.parent.rmdir()
    shelf.bench("a")
    assert opened == ["a", "bare", "a", "a"]
