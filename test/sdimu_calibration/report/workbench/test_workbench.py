"""The loop in the browser: see the misfit, add the effect, see it fall, take the model home; bad input is told."""

from __future__ import annotations

import base64
import io
import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.report.workbench.app import build
from sdimu_calibration.report.workbench.fit import FitSession
from sdimu_calibration.report.workbench.recording_cache import RecordingCache, neighbours
from sdimu_calibration.report.workbench.view import numbers
from sdimu_calibration.storage.config import load_imu, load_model, load_site
from sdimu_calibration.storage.effect_file import extended_model

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

    def make(path: Path) -> FitSession:
        if path.name == "bad":
            raise DataError("bad: is no recording")
        return bench

    return RecordingCache({"good": Path("good"), "bad": Path("bad")}, make)


@pytest.fixture(scope="module")
def app(bench: FitSession) -> Any:
    return build(shelf(bench))


class Page:
    """A page of a browser: it keeps its state and posts what is clicked, as the page's script does."""

    def __init__(self, app: Any, state: Any = None) -> None:
        self.client, self.state, self.message = app.server.test_client(), state, ""
        self.callbacks = self.client.get("/_dash-dependencies").get_json()

    def post(self, output: str, changed: str, **values: Any) -> dict[str, Any]:
        return self.post_all(output, changed, **values)["response"]

    def post_all(self, output: str, changed: str, **values: Any) -> dict[str, Any]:
        known = {"state.data": self.state, **{k.replace("__", "-").replace("_at_", "."): v for k, v in values.items()}}
        (callback,) = [c for c in self.callbacks if output in c["output"] and c["clientside_function"] is None]
        parts = [o.rsplit(".", 1) for o in callback["output"].strip(".").split("...")]
        outputs = [{"id": part[0], "property": part[1]} for part in parts]

        def filled(places: list[dict[str, Any]]) -> list[dict[str, Any]]:
            return [{**p, "value": known.get(f"{p['id']}.{p['property']}")} for p in places]

        body = {
            "output": callback["output"], "outputs": outputs if callback["output"].startswith("..") else outputs[0],
            "inputs": filled(callback["inputs"]), "state": filled(callback["state"]), "changedPropIds": [changed],
        }  # fmt: skip
        done = self.client.post("/_dash-update-component", data=json.dumps(body), content_type="application/json")
        assert done.status_code == 200
        return done.get_json()

    def click(self, changed: str, **values: Any) -> None:
        answer = self.post("state.data", changed, **values)
        self.state = answer.get("state", {}).get("data", self.state)
        self.message = answer["message"]["children"]

    def shown(self) -> dict[str, Any]:
        """Everything that the page shows: the numbers, then what the candidates say."""
        numbers = self.post("heat.figure", "state.modified_timestamp")
        return numbers | self.post("verdict.children", "shown.data", shown_at_data=numbers["shown"]["data"])

    @property
    def verdict(self) -> str:
        return self.shown()["verdict"]["children"]


def test_the_loop_finds_adds_and_takes_home_the_hidden_effect(app, recording, tmp_path):
    page = Page(app)
    shown = page.shown()
    assert HIDDEN in shown["verdict"]["children"]
    bars = shown["ranking"]["figure"]["data"][0]["y"]
    assert bars[0] == HIDDEN
    page.click("ranking.clickData", ranking_at_clickData={"points": [{"y": bars[0]}]})
    after = page.shown()
    assert "Nothing stands out" in after["verdict"]["children"]
    rungs = after["ladder"]["figure"]["data"][0]["y"]
    assert rungs[1] < rungs[0]
    # A right model predicts left-out stops to one sigma; 11,000 numbers scatter by 0.7 %.
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


def test_an_effect_of_ones_own_does_what_the_registered_one_does(app, bench):
    page = Page(app)
    page.click("add-own.n_clicks", own_at_value=OWN)
    assert page.message == ""
    own = bench.fit((OWN,), ()).calibration
    registered = bench.fit((HIDDEN,), ()).calibration
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


def test_undo_brings_the_misfit_back(app):
    page = Page(app)
    before = page.verdict
    page.click("add.n_clicks", candidate_at_value=HIDDEN)
    assert page.verdict != before
    page.click("undo.n_clicks")
    assert page.verdict == before


def test_two_pages_do_not_disturb_each_other_and_a_restart_loses_nothing(app, recording):
    one, other = Page(app), Page(app)
    before = other.verdict
    one.click("add.n_clicks", candidate_at_value=HIDDEN)
    assert other.verdict == before
    restarted = build(shelf(new_bench(recording)))
    # The restarted server fits from cold, the first one went on from the fit before: same numbers to the digits shown.
    assert Page(restarted, one.state).shown()["numbers"] == one.shown()["numbers"]


def test_a_click_on_a_cell_shows_that_stop_and_channel(app):
    page = Page(app)
    page.click("heat.clickData", heat_at_clickData={"points": [{"x": "7", "y": "accel x"}]})
    assert "accel x at stop 7" in page.shown()["cell"]["figure"]["layout"]["title"]["text"]


def test_held_out_stops_are_predicted_not_fitted(bench):
    held = bench.fit((HIDDEN,), (5, 9))
    assert not np.isin(held.grid.stops, (5, 9)).any()
    # Errors of the coefficients are common to a stop: some 24 independent numbers, an RMS that scatters by 14 %.
    assert held.at_held == pytest.approx(1.0, abs=3 * 0.14)
    assert bench.fit((), (5, 9)).at_held > held.at_held


def test_a_coefficient_that_is_another_one_is_told(bench):
    given = bench.fit((), ())
    assert "gyro_bias_x and gyro_x: 1 cannot be told from each other" in numbers(bench.fit(("gyro_x: 1",), ()), given)
    assert "cannot be told" not in numbers(given, given)


def test_the_first_stop_cannot_be_held_out(bench):
    with pytest.raises(DataError, match="attitude"):
        bench.fit((), (bench.stops[0],))


def test_a_recording_that_cannot_be_read_is_told_and_the_other_stays(app):
    page = Page(app)
    page.click("open.n_clicks", recording_at_value="bad")
    assert page.message == "Not done: bad: is no recording"
    assert page.state is None
    page.click("open.n_clicks", recording_at_value="good")
    assert page.message == ""


def test_a_state_of_another_server_shows_a_fresh_page_and_says_so(app):
    page = Page(app, {"added": ["no_such_effect"], "recording": "gone"})
    shown = page.post("heat.figure", "state.modified_timestamp")
    assert "gone" in shown["message"]["children"]
    assert shown["title"]["children"].endswith("good")


def test_models_of_a_page_stand_side_by_side_after_an_undo(app):
    page = Page(app)
    page.shown()
    page.click("add.n_clicks", candidate_at_value=HIDDEN)
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
    new_bench(recording).fit((), (), lambda word, _share: told.append(word))
    assert "passes" in told
    assert "candidates" not in told
