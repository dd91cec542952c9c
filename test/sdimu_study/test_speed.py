"""How fast: run by `make bench`, on a machine with nothing else to do."""

import sys

import pytest

from sdimu_study.cli.bench import measure

CORES = 2
RUNS = 1000
MINUTES = 10


@pytest.mark.bench
@pytest.mark.timeout(600)
def test_a_thousand_runs_take_less_than_ten_minutes_on_two_cores(tmp_path, capsys):
    times = measure("kim18", 100.0, 3, tmp_path)
    with capsys.disabled():
        for what, wall, cpu, count, noun in times:
            sys.stdout.write(f"\n{what:40s} {wall:7.3f} s wall {cpu:7.3f} s processor {count / wall:12,.0f} {noun}/s")
    processor = {what: cpu for what, _, cpu, _, _ in times}
    assert processor["one Monte-Carlo run"] * RUNS / CORES < MINUTES * 60.0
