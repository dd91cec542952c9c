"""The diagnosis while the table turns is that of `sdimu diagnose` on the same data, and waits for nobody."""

from __future__ import annotations

import importlib
import json
import os
import re
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from PIL import Image
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

import sdimu_calibration
from sdimu_calibration.core.data.arrival import RawStatus, RawTest, until
from sdimu_calibration.core.diagnosis import rounds
from sdimu_calibration.core.diagnosis.grades import named
from sdimu_calibration.core.diagnosis.live_diagnosis import LiveDiagnosis
from sdimu_calibration.core.diagnosis.search import search
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.nodes.credits import HISTORY
from sdimu_calibration.nodes.diagnosis_messages import diagnosis, heat_map
from sdimu_calibration.nodes.diagnosis_worker import Answer, Diagnoser, Picture, WorkerRequest, WorkerSetup
from sdimu_calibration.nodes.live_diagnosis import Worker
from sdimu_calibration.report.workbench.fit import FitSession
from sdimu_calibration.report.workbench.setting import Setting
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan
from sdimu_calibration.storage.files.diagnosis_file import odds
from sdimu_calibration.storage.files.journal import Journal, digest
from sdimu_calibration.storage.opening import Source, opening_options
from sdimu_sim.core.scenario import Scenario, generate

from .conftest import DEADLINE_S, sdimu

EFFECT = "gyro_scale_asymmetry_y"
START = 1_700_000_000 * 10**9
SHOWN = 1e-4  # an error is shown with three decimals
OPTIONS = opening_options("daejeon", load_imu("dtg"), Source(gyro_unit="rad/s", gyro_sign=1))
KIM18 = load_plan("kim18_signed")
PLAN = replace(KIM18, dwell_s=(60.0,) * 6, turns=KIM18.turns[:5])


@pytest.fixture(scope="module")
def raw() -> RawTest:
    """A test of six stops with an effect that the model lacks."""
    scenario = Scenario(PLAN, OPTIONS.imu, OPTIONS.site, rate_hz=20.0, seed=7, effects=(f"{EFFECT}=400 ppm",))
    r = generate(scenario)[0]
    second = np.arange(0.0, r.t[-1])
    row = np.searchsorted(r.phase.t, second, side="right") - 1
    status = RawStatus(START + (second * 1e9).astype(np.int64), r.phase.dwell[row], r.phase.stop[row])
    return RawTest(START + np.rint(r.t * 1e9).astype(np.int64), r.omega_ib_b, r.f_ib_b, status)


@pytest.fixture(scope="module")
def setup(raw: RawTest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[WorkerSetup]:
    journal = Journal(tmp_path_factory.mktemp("node") / "journal", digest("options"))
    for entry in zip(*raw.status, strict=True):
        journal.status(*map(int, entry))
    journal.samples(raw.ns, raw.omega_ib_b, raw.f_ib_b)
    yield WorkerSetup(journal.place, OPTIONS, "baseline")
    journal.close()


@pytest.fixture(scope="module")
def whole(setup: WorkerSetup) -> LiveDiagnosis:
    return Diagnoser(setup).answer(WorkerRequest(5, None)).diagnosis


def test_a_test_that_has_ended_leaves_diagnosis_and_report_where_they_are_wanted(setup, tmp_path):
    wanted = replace(setup, report=tmp_path)
    assert Diagnoser(wanted).answer(WorkerRequest(5, None, report=True)).unreported == ""
    found = json.loads((tmp_path / "diagnosis.json").read_text())
    assert any(candidate["label"] == EFFECT for candidate in found["candidates"]), found["sentence"]
    assert "<html" in (tmp_path / "report.html").read_text()
    missing = replace(wanted, journal=tmp_path / "none")
    assert "journal" in Diagnoser(missing).answer(WorkerRequest(5, None, report=True)).unreported


def stop_end(raw: RawTest, stop: int) -> int:
    return int(raw.status.ns[(raw.status.stop == stop) & raw.status.dwell].max())


@pytest.fixture(scope="module")
def bag(raw: RawTest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    bag = tmp_path_factory.mktemp("bag") / "bag"
    write_recording(
        bag,
        BagContent(
            start_ns=START,
            imu_ns=raw.ns - START,
            omega_ib_b=raw.omega_ib_b,
            f_ib_b=raw.f_ib_b,
            status=(raw.status.ns - START, raw.status.dwell, raw.status.stop),
        ),
    )
    return bag


@dataclass
class Notebook:
    """A diagnosis of the bag in Python, and the searches that it made."""

    opened: Any
    diagnosis: Any
    searches: list[Any]


@pytest.fixture(scope="module")
def notebook(bag: Path) -> Notebook:
    searches = []

    def seen(*arguments, **more):
        searches.append(search(*arguments, **more))
        return searches[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rounds, "search", seen)
        opened = sdimu_calibration.open(bag, site="daejeon", imu="dtg")
        return Notebook(opened, sdimu_calibration.diagnose(sdimu_calibration.calibrate(opened)).core, searches)


def test_all_data_are_ranked_as_the_first_scan_of_a_diagnosis_of_the_bag(whole, notebook):
    searches = notebook.searches
    evidence, first, limit = searches[0].evidence, searches[0].first, searches[0].threshold
    scanned = {
        evidence.names[k]: (first.z[k], first.estimate[k], first.sigma[k])
        for k in range(len(evidence.weight), len(first.z))
        if np.isfinite(first.sigma[k])
    }
    # A product of other columns beside them may round the last digit of one otherwise.
    for r in whole.ranking:
        assert (r.z, r.estimate, r.sigma) == pytest.approx(scanned[r.label], rel=1e-12, abs=0.0), r.label
    # Beyond those there are the times and time constants between those of the scan.
    assert len(scanned) <= len(whole.ranking) + len(searches[0].chosen)
    assert whole.threshold == pytest.approx(limit, rel=0.01)


def test_shell_notebook_workbench_and_the_live_end_tell_the_same_probabilities(whole, bag, notebook, tmp_path):
    """To the last digit."""
    shell = sdimu("diagnose", bag, "--site", "daejeon", "--imu", "dtg", "--out", tmp_path / "out")
    shell.communicate(timeout=DEADLINE_S)
    told = json.loads((tmp_path / "out" / "diagnosis.json").read_text())["probabilities"]
    assert told["families"][0]["p"] > 0.99
    workbench = FitSession(notebook.opened, load_model("baseline")).missing(Setting())
    for other in (notebook.diagnosis, workbench, whole):
        assert json.loads(json.dumps(odds(other.probabilities), default=str).replace("NaN", "null")) == told
    live = {v.key: v.value for s in diagnosis(START, whole).status if s.name == "probabilities" for v in s.values}
    assert float(live["nothing_missing"]) == told["nothing_missing"]
    for family in told["families"]:
        assert float(live[f"{family['family']} {family['sensor']}".strip()]) == family["p"]


def test_what_is_missing_stands_out_and_leaves_when_it_is_added(setup, whole):
    assert whole.verdict in {"one effect", "class of effects"}
    assert named(EFFECT) in whole.sentence
    assert EFFECT in {r.label for r in whole.standing}
    added = Diagnoser(setup).answer(WorkerRequest(5, None, ((), (EFFECT,)))).diagnosis
    assert added.verdict == "consistent"
    assert [rung.added for rung in added.ladder] == [(), (EFFECT,)]
    # One is of evidence with every candidate, the other of evidence with none: other shapes round otherwise.
    assert added.ladder[0].nis == pytest.approx(whole.ladder[0].nis, rel=SHOWN)
    assert added.ladder[0].held_out == pytest.approx(whole.ladder[0].held_out, rel=SHOWN)
    assert added.ladder[1].nis == pytest.approx(1.0, abs=0.1)
    assert added.ladder[1].held_out < added.ladder[0].held_out


def test_a_stop_is_diagnosed_by_what_had_come_by_its_end(raw, setup, tmp_path):
    """Whatever is in the journal behind it."""
    end = stop_end(raw, 2)
    short = until(raw, end)
    journal = Journal(tmp_path / "short", digest("options"))
    for entry in zip(*short.status, strict=True):
        journal.status(*map(int, entry))
    journal.samples(short.ns, short.omega_ib_b, short.f_ib_b)
    alone = Diagnoser(replace(setup, journal=journal.place)).answer(WorkerRequest(2, end)).diagnosis
    assert Diagnoser(setup).answer(WorkerRequest(2, end)).diagnosis == alone
    assert alone.stop == 2
    assert {place.stop for place in alone.where} == {0, 1, 2}


def test_a_stop_that_cannot_be_fitted_says_what_it_waits_for(setup):
    answer = Diagnoser(setup).answer(WorkerRequest(0, START + 10**9))
    assert answer.diagnosis.verdict == "waiting"
    assert "too few samples" in answer.diagnosis.sentence


QUESTION = """
def largest_score(fit, diagnosis, about):
    return about, fit.estimator, diagnosis.ranking[0].label
"""


@pytest.fixture
def question(tmp_path, monkeypatch):
    """A question as an adaptive test asks it, in a module that worker and node can import."""
    (tmp_path / "adaptive_question.py").write_text(QUESTION, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    return importlib.import_module("adaptive_question").largest_score


def wait_for(worker: Worker) -> tuple[list[Answer], list[Picture]]:
    came, begun = [], time.monotonic()
    while not worker.idle:
        assert time.monotonic() - begun < DEADLINE_S
        came.append(worker.answer())
        time.sleep(0.01)
    return [a for a in came if isinstance(a, Answer)], [p for p in came if isinstance(p, Picture)]


def test_of_the_requests_that_wait_the_newest_alone_is_answered(raw, setup, whole, question):
    worker = Worker(replace(setup, question=question))
    try:
        for stop in (1, 2, 3, 4):
            worker.ask(WorkerRequest(stop, stop_end(raw, stop), about=f"stop {stop}"))
        worker.ask(WorkerRequest(5, None, about="the end"))
        answers, pictures = wait_for(worker)
    finally:
        worker.close()
    assert [answer.request.stop for answer in answers] == [1, 5]
    assert [picture.request.stop for picture in pictures] == [1, 5]
    for picture in pictures:
        Image.open(BytesIO(picture.png)).verify()
    assert answers[1].diagnosis == whole
    assert answers[1].more == ("the end", "filter", whole.ranking[0].label)


def kill(worker: Worker) -> None:
    worker._process.kill()
    worker._process.wait()


def test_a_worker_killed_in_mid_search_is_started_anew_and_answers_the_same(setup, whole):
    told: list[str] = []
    worker = Worker(setup, told.append)
    try:
        worker.ask(WorkerRequest(5, None))
        kill(worker)
        ((answer,), (picture,)) = wait_for(worker)
        assert answer.diagnosis == whole
        assert picture.request == answer.request
    finally:
        worker.close()
    (line,) = told
    assert "begins anew" in line


def test_a_worker_killed_while_it_draws_answers_once(setup, whole):
    worker = Worker(setup)
    worker.ask(WorkerRequest(5, None))
    try:
        begun = time.monotonic()
        while (answer := worker.answer()) is None:
            assert time.monotonic() - begun < DEADLINE_S
            time.sleep(0.001)
        assert answer.diagnosis == whole
        if not worker._pipe.poll():
            kill(worker)
        assert wait_for(worker)[0] == []
    finally:
        worker.close()


def test_a_worker_that_ends_twice_is_told_once(setup):
    worker = Worker(setup)
    worker.ask(WorkerRequest(1, None))
    kill(worker)
    assert worker.answer() is None
    kill(worker)
    with pytest.raises(DataError, match="ended twice; the test goes on without it"):
        worker.answer()
    assert worker.idle
    assert worker.answer() is None
    worker.close()


def test_a_worker_ends_with_its_node(setup):
    worker = Worker(setup)
    worker._pipe.close()  # as the system does when the node is killed
    assert worker._process.wait(DEADLINE_S) == 0


def test_a_folder_is_no_journal(setup, tmp_path):
    answer = Diagnoser(replace(setup, journal=Path(tmp_path))).answer(WorkerRequest(0, None))
    assert answer.diagnosis.verdict == "waiting"
    assert "cannot be read" in answer.diagnosis.sentence


@pytest.mark.ros
@pytest.mark.usefixtures("bench")
def test_a_running_test_is_watched(whole: LiveDiagnosis) -> None:
    watching = sdimu("watch", "--domain", os.environ["ROS_DOMAIN_ID"], "--for", 30)
    context = Context()
    rclpy.init(context=context)
    node = Node("calibration", context=context)
    found = node.create_publisher(DiagnosticArray, "calibration/diagnosis", HISTORY)
    heat = node.create_publisher(Float64MultiArray, "calibration/heat_map", HISTORY)
    try:
        heat.publish(heat_map(START, whole))
        found.publish(diagnosis(START, whole))  # before anybody listens: the last one is kept
        out, err = watching.communicate(timeout=DEADLINE_S)
    finally:
        watching.kill()
        node.destroy_node()
        context.try_shutdown()
    assert watching.returncode == 0, err
    assert out.startswith("watching ROS domain ")
    (line,) = (line for line in out.splitlines() if line.startswith(f"diagnosis of stop 5: {whole.verdict}"))
    assert EFFECT in line


@pytest.mark.ros
def test_a_domain_without_a_test_is_told_after_the_time_to_watch() -> None:
    nobody = 1 + (int(os.environ["ROS_DOMAIN_ID"]) + 50) % 100
    watching = sdimu("watch", "--domain", nobody, "--for", 2)
    try:
        _, err = watching.communicate(timeout=DEADLINE_S)
    finally:
        watching.kill()
    assert watching.returncode == 1
    # On a busy machine the two seconds take longer to pass.
    assert re.search(rf"ROS domain {nobody}: nothing heard in \d+ s", err)
