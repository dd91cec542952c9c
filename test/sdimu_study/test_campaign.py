"""A campaign: every seed once, failures reported, shards reused, the same answer in processes."""

import os
import subprocess
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from rate_table_sim.core import TableSpecification
from sdimu_calibration.core.filter.pass_loop import MOST_PASSES
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
from sdimu_sim.core import Scenario
from sdimu_study import campaign, clean
from sdimu_study.campaign import CHUNK, HERE, run_campaign
from sdimu_study.monte_carlo import STUDY, Campaign, summarise
from sdimu_study.shards import Shards, key_of, sources_of
from sdimu_study.study import Study

PLAN = Plan("short", (12.0,) * 4, tuple(Turn(a, np.pi / 2, np.radians(15)) for a in "YZX"), np.radians(30))
SCENARIO = Scenario(PLAN, load_imu("dtg"), load_site("daejeon"), TableSpecification(axes=None), rate_hz=20.0)


@dataclass(frozen=True)
class Square:
    """Work that is done at once, fails where it is told to and notes what it did."""

    log: Path
    fails: Path = Path("none")
    offset: float = 0.0
    unused: dict = field(default_factory=dict)

    def __call__(self, seed):
        with self.log.open("a") as log:
            log.write(f"{seed}\n")
        if self.fails.exists() and str(seed) in self.fails.read_text().split():
            raise ValueError(f"seed {seed} does not like it")
        return {"value": self.offset + seed**2, "array": np.array([seed, np.nan])}

    def done(self):
        return [int(line) for line in self.log.read_text().split()] if self.log.exists() else []


@pytest.fixture
def square(tmp_path):
    return Square(tmp_path / "log", tmp_path / "fails")


def test_rows_come_in_the_order_of_the_seeds_and_as_json_gives_them(square, tmp_path):
    rows = run_campaign(square, [5, 3, 9], tmp_path / "out", HERE)
    assert [(row["seed"], row["value"]) for row in rows] == [(5, 25), (3, 9), (9, 81)]
    assert rows[0]["array"] == [5.0, None]
    assert all(row["wall_s"] >= 0.0 and row["cpu_s"] >= 0.0 for row in rows)


def test_a_failed_run_is_reported_and_tried_again_without_the_others(square, tmp_path):
    square.fails.write_text("2 6")
    rows = run_campaign(square, range(1, 9), tmp_path / "out", HERE)
    assert [row["seed"] for row in rows if "error" in row] == [2, 6]
    assert rows[1]["error"] == "ValueError: seed 2 does not like it"
    assert rows[2]["value"] == 9
    square.fails.write_text("")
    square.log.unlink()
    rows = run_campaign(square, range(1, 9), tmp_path / "out", HERE)
    assert square.done() == [2, 6]
    assert [row["value"] for row in rows] == [k**2 for k in range(1, 9)]


def test_a_stopped_campaign_goes_on_where_it_stood(square, tmp_path):
    def stop(word, _share):
        if word.startswith(f"run {1 + CHUNK} "):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_campaign(square, range(20), tmp_path / "out", HERE, stop)
    before = square.done()
    assert len(before) < 20
    rows = run_campaign(square, range(20), tmp_path / "out", HERE)
    assert sorted(square.done()) == list(range(20))
    assert [row["value"] for row in rows] == [k**2 for k in range(20)]


def test_a_lost_shard_costs_its_own_runs_only(square, tmp_path):
    run_campaign(square, range(1 + 3 * CHUNK), tmp_path / "out", HERE)
    shards = sorted((tmp_path / "out").glob("runs-*/seeds-*.json"))
    assert len(shards) == 4
    shards[2].unlink()
    square.log.unlink()
    run_campaign(square, range(1 + 3 * CHUNK), tmp_path / "out", HERE)
    assert square.done() == list(range(1 + CHUNK, 1 + 2 * CHUNK))


def test_more_seeds_of_the_same_settings_keep_the_first_ones(square, tmp_path):
    run_campaign(square, range(3), tmp_path / "out", HERE)
    run_campaign(square, range(7), tmp_path / "out", HERE)
    assert sorted(square.done()) == list(range(7))


def test_other_settings_are_another_campaign(square, tmp_path):
    other = Square(square.log, square.fails, offset=0.5)
    run_campaign(square, range(3), tmp_path / "out", HERE)
    assert [row["value"] for row in run_campaign(other, range(3), tmp_path / "out", HERE)] == [0.5, 1.5, 4.5]


def test_another_state_of_the_program_is_another_campaign(square, monkeypatch):
    before = key_of(square)
    monkeypatch.setattr("sdimu_study.shards.program_digest", lambda: "another")
    assert key_of(square) != before


def test_the_key_hangs_on_what_makes_a_row_and_not_on_what_makes_its_page():
    """Draws and scores that another file defines count; a new column of the table does not throw runs away."""
    work = clean.STUDY.of(("dtg", "kim18"))
    texts = "\n".join(sources_of(work))
    for part in ("def world", "def score", "def baseline_z", "def drawn_site", "LATITUDES_DEG", "def study_plan"):
        assert part in texts
    assert "def page" not in texts
    more = Study("clean", clean.world, clean.STUDY.run, clean.score, (("other", str),))
    assert key_of(more.of(("dtg", "kim18"))) == key_of(work)


def test_another_draw_or_score_is_another_campaign(monkeypatch):
    work = clean.STUDY.of(("dtg", "kim18"))
    before = key_of(work)
    monkeypatch.setattr("sdimu_study.clean.RATES_HZ", (20.0,))
    assert key_of(work) != before
    monkeypatch.undo()
    assert key_of(work) == before
    assert key_of(replace(work, score=clean.scored)) != before


def test_the_key_is_that_of_another_process_too():
    """Sets have another order in each process."""
    script = "from sdimu_study import sets, shards; print(shards.key_of(sets.STUDY.of(('weak', 'dtg'))))"
    keys = {
        subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, "PYTHONHASHSEED": seed},
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        for seed in ("1", "2", "3")
    }
    assert len(keys) == 1


def test_every_field_of_a_scenario_is_a_setting():
    keys = {
        key_of(STUDY.of(Campaign(scenario, load_model("baseline"))))
        for scenario in (
            SCENARIO,
            Scenario(PLAN, SCENARIO.imu, SCENARIO.site),
            Scenario(PLAN, SCENARIO.imu, SCENARIO.site, SCENARIO.table, rate_hz=20.0, effects=("gyro_z=1e-9*t",)),
        )
    }
    assert len(keys) == 3


def test_a_shard_that_is_not_one_is_named(square, tmp_path):
    shards = Shards(tmp_path, square)
    (shards.folder / "seeds-1-1.json").write_text('{"format": "sdimu-campaign/1", "key": "x", "runs": []}')
    with pytest.raises(DataError, match=r"seeds-1-1\.json"):
        shards.read()


def test_progress_counts_runs_and_failures(square, tmp_path):
    square.fails.write_text("3")
    told = []
    run_campaign(square, range(1, 6), tmp_path / "out", HERE, lambda word, share: told.append((word, share)))
    assert told[0] == ("run 0 of 5", 0.0)
    assert told[-1] == ("run 5 of 5, 1 failed", 1.0)
    shares = [share for _, share in told]
    assert shares == sorted(shares)


def test_no_scheduler_at_the_address_is_said_in_one_line(square, tmp_path, monkeypatch):
    monkeypatch.setattr("sdimu_calibration.storage.cluster._ANSWER_S", 1)
    with pytest.raises(DataError, match="no dask scheduler answers"):
        run_campaign(square, range(2), tmp_path / "out", "tcp://127.0.0.1:9")


def test_seeds_are_shared_out_once_each():
    for count in (1, 2, CHUNK, CHUNK + 1, 10 * CHUNK + 3):
        groups = campaign.chunks(range(count))
        assert [seed for group in groups for seed in group] == list(range(count))
        assert len(groups[0]) == 1


def test_four_tests_calibrated_in_processes_are_those_calibrated_here(tmp_path):
    """The whole way: simulate, calibrate, keep, judge; with an effect that makes one coefficient wrong."""
    work = STUDY.of(Campaign(SCENARIO, load_model("baseline")))
    here = run_campaign(work, range(4), tmp_path / "here", HERE)
    apart = run_campaign(work, range(4), tmp_path / "apart", workers=2)
    assert [row.get("error") for row in apart] == [None] * 4
    for a, b in zip(here, apart, strict=True):
        assert a["estimate"] == b["estimate"]
        assert a["covariance"] == b["covariance"]
    summary = summarise([*apart, {"seed": 9, "error": "DataError: no"}], work.case.model, SCENARIO.imu)
    assert summary["runs"] == 4
    assert summary["failed"] == [{"seed": 9, "error": "DataError: no"}]
    assert len(summary["coefficients"]) == summary["nees"]["dof"] == 27
    # Errors of an honest filter: no coefficient of four runs is six sigma off (1e-9 each, 108 of them).
    assert max(c["rms_z"] for c in summary["coefficients"]) < 6.0


def test_a_run_that_took_all_passes_is_named():
    work = STUDY.of(Campaign(SCENARIO, load_model("baseline")))
    rows = [{**work(seed), "seed": seed, "wall_s": 1.0, "cpu_s": 1.0} for seed in (1, 2, 3)]
    assert summarise(rows, work.case.model, SCENARIO.imu)["unconverged"] == []
    rows[1]["passes"] = MOST_PASSES
    assert summarise(rows, work.case.model, SCENARIO.imu)["unconverged"] == [2]


def test_a_campaign_of_failures_says_why():
    with pytest.raises(DataError, match="DataError: too short"):
        summarise([{"seed": 1, "error": "DataError: too short"}], load_model("baseline"), SCENARIO.imu)
