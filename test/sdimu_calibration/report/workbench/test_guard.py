"""The workbench answers this machine only, reads no files that a page names, and never fails in silence."""

from __future__ import annotations

import json
from typing import Any

import pytest
from werkzeug.test import EnvironBuilder

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.report.workbench.app import build
from sdimu_calibration.report.workbench.guard import LARGEST
from sdimu_calibration.report.workbench.own_effect import read_effect
from sdimu_calibration.report.workbench.recording_cache import RecordingCache

from .test_workbench import OWN, Page, bench, shelf  # noqa: F401 (a fixture)


def closed(_: str) -> Any:
    raise DataError("bag: is no recording")


@pytest.fixture(scope="module")
def server() -> Any:
    return build(RecordingCache(["bag"], closed)).server


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.1:8050", "localhost:8050", "LOCALHOST", "[::1]:8050"])
def test_names_of_this_machine_are_answered(server, host):
    assert server.test_client().get("/", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        "evil.example:8050",
        "127.0.0.1.evil.example",
        "localhost.evil.example",
        "192.168.1.7",
        "0.0.0.0",
        "",
        "127.0.0.1@evil.example",
        "evil.example#127.0.0.1",
        "evil.example@127.0.0.1",
        "evil.example\\@127.0.0.1",
        "127.0.0.1/evil.example",
        "127.0.0.1:8050?evil.example",
    ],
)
@pytest.mark.parametrize("path", ["/", "/_dash-layout", "/_dash-dependencies"])
def test_other_names_are_refused_on_every_path(server, host, path):
    assert server.test_client().get(path, headers={"Host": host}).status_code in {400, 403}


def test_a_page_of_another_site_is_refused(server):
    ask = {"Host": "127.0.0.1:8050", "Origin": "http://evil.example"}
    assert server.test_client().post("/_dash-update-component", headers=ask, json={}).status_code == 403
    # Other servers on this machine, at another port or name, are other sites to a browser.
    neighbours = ("http://127.0.0.1:8888", "http://127.0.0.1", "http://localhost:8050")
    for origin in ("null", "http://evil.example@127.0.0.1:8050", "file://", *neighbours):
        ask["Origin"] = origin
        assert server.test_client().post("/_dash-update-component", headers=ask, json={}).status_code == 403
    own = {"Host": "127.0.0.1:8050", "Origin": "http://127.0.0.1:8050"}
    assert server.test_client().get("/", headers=own).status_code == 200


def test_an_address_that_was_asked_for_is_answered_too():
    server = build(RecordingCache(["bag"], closed), "192.168.1.7").server
    assert server.test_client().get("/", headers={"Host": "192.168.1.7:8050"}).status_code == 200
    assert server.test_client().get("/", headers={"Host": "evil.example"}).status_code == 403


@pytest.mark.parametrize("declared", [True, False])
def test_a_body_larger_than_a_page_is_refused(server, declared):
    body = json.dumps({"output": "x" * (2 * LARGEST)})
    builder = EnvironBuilder("/_dash-update-component", method="POST", data=body, content_type="application/json")
    environ = builder.get_environ()
    if not declared:  # sent in chunks
        del environ["CONTENT_LENGTH"]
        environ["wsgi.input_terminated"] = True
    assert server.test_client().open(environ).status_code == 413


@pytest.mark.parametrize(
    "body", ["[" * 100_000, "{}", "null", '{"output": "nothing.children"}', '{"output": 1}', "\x00"]
)
def test_a_body_that_is_no_callback_is_a_bad_request(server, body):
    done = server.test_client().post("/_dash-update-component", data=body, content_type="application/json")
    assert done.status_code == 400


def test_a_page_reads_no_file_of_the_server(tmp_path):
    path = tmp_path / "own.yaml"
    path.write_text(OWN)
    assert [effect.name for effect in read_effect(OWN)] == ["bent_k"]
    for text in (str(path), f" {path}", f"{path}:k", "../own.yaml", "/etc/passwd", f"{path}\n"):
        with pytest.raises(DataError) as error:
            read_effect(text)
        assert "ug/g" not in str(error.value)


BAD = [
    {"now": {"held": [9999]}},
    {"now": {"held": [-1]}},
    {"now": {"cut": [[5.0]]}},
    {"now": {"cut": [[700.0, 1e9], [-5.0, 3.0]]}},
    {"now": {"cut": [[9.0, 8.0]]}},
    {"now": {"priors": [["gyro_bias_x", "1 ppm", "1 deg/h"]]}},
    {"now": {"priors": [["nobody", "1 deg/h", "nan deg/h"]]}},
    {"now": {"priors": "abc"}},
    {"now": 7},
    {"cell": [99, 0]},
    {"cell": [-5, 10**9]},
    {"cell": [0, 1e400]},
    {"now": {"added": ["gyro_bias"]}},
    {"now": {"added": ["/etc/passwd"]}},
    {"now": {"added": ["a\nb"]}},
    {"now": {"added": [[]]}, "past": 7},
    {"seen": [{"added": ["x"], "held": [4]}], "past": [{"added": ["no"], "held": [1]}], "future": [{}]},
    {"recording": ["good"]},
    {"recording": "../../etc"},
    {"cell": {}},
    {"cell": {"a": 1}},
    [],
    "text",
    7,
]


@pytest.mark.parametrize("state", BAD, ids=str)
def test_a_bad_state_shows_a_page_and_says_what_is_wrong(bench, state):  # noqa: F811
    page = Page(build(shelf(bench)), state)
    shown = page.post("numbers.children", "state.modified_timestamp")
    assert "IMU dtg" in shown["about"]["children"]
    page.post("verdict.children", "shown.data", shown_at_data=state)
    page.post("state.data", "undo.n_clicks")


def test_a_bad_state_takes_nothing_home_and_is_told(bench):  # noqa: F811
    for state in ({"recording": "gone"}, {"now": {"held": [9999]}}, {"now": {"added": ["no_such_effect"]}}):
        answer = Page(build(shelf(bench)), state).post("file.data", "export.n_clicks")
        assert answer["message"]["children"].startswith("Not done")
        assert "file" not in answer


@pytest.mark.parametrize(
    ("changed", "values"),
    [
        ("heat.clickData", {"heat_at_clickData": {"points": []}}),
        ("heat.clickData", {"heat_at_clickData": {"points": [{"x": "7", "y": "no channel"}]}}),
        ("leave-points.n_clicks", {"residuals_at_selectedData": {"points": [{"customdata": ["a", 2]}]}}),
        ("fix.n_clicks", {"coefficient_at_value": "gyro_bias_x", "mean_at_value": "much"}),
        ("set-prior.n_clicks", {"coefficient_at_value": "gyro_bias_x", "mean_at_value": "1 deg/h"}),
        ("fix.n_clicks", {"mean_at_value": "1 deg/h"}),
        ("hold.n_clicks", {"held_at_value": ["a", 1]}),
        ("hold.n_clicks", {"held_at_value": [4711]}),
        ("add.n_clicks", {"candidate_at_value": {"a": 1}}),
    ],
)
def test_a_click_that_means_nothing_is_told(bench, changed, values):  # noqa: F811
    page = Page(build(shelf(bench)))
    answer = page.post_all("state.data", changed, **values)
    told = answer["response"].get("message", {}) | answer.get("sideUpdate", {}).get("message", {})
    assert told["children"].startswith("Not done")
    assert "state" not in answer["response"]


@pytest.mark.parametrize(("path", "host"), [("/", "localhost"), ("/_dash-layout", "localhost"), ("/", "evil.example")])
def test_every_answer_stands_in_no_other_page_and_talks_to_this_server_alone(server, path, host):
    headers = server.test_client().get(path, headers={"Host": host}).headers
    policy = dict(rule.strip().split(" ", 1) for rule in headers["Content-Security-Policy"].split(";"))
    assert policy["default-src"] == "'self'"
    assert policy["frame-ancestors"] == policy["object-src"] == "'none'"
    assert headers["X-Frame-Options"] == "DENY"
    assert not [word for rule in policy.values() for word in rule.split() if word == "*" or word.startswith("http")]
