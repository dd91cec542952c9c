"""Measurements left out: nothing of them reaches a fit, and the rest of their stop still measures the place."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from sdimu_calibration.cli.options import read_spans, read_stops
from sdimu_calibration.core.alignment.prepared import PreparedData, set_up
from sdimu_calibration.core.alignment.without import without
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.measurement_kind import ALL, SKIP
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.storage.files.config import load_model


@pytest.fixture(scope="module")
def whole(bench: Any) -> PreparedTest:
    return PreparedTest(bench.recording(), bench.imu, bench.site)


@pytest.fixture(scope="module")
def prepared(whole: PreparedTest, bench: Any) -> PreparedData:
    return whole.data(set_up(bench.site, bench.imu, bench.model))


def span_of(prepared: PreparedData, stop: int) -> tuple[float, float]:
    rows = np.flatnonzero((prepared.phases.stop == stop) & (prepared.kind != SKIP))
    return float(prepared.epochs.start[rows[0]]), float(prepared.epochs.end[rows[-1]])


def test_the_place_is_measured_by_the_first_epoch_that_is_left(prepared):
    begin, _ = span_of(prepared, 3)
    left = without(prepared, (), ((begin, begin + 5.0),))
    rows = np.flatnonzero(prepared.phases.stop == 3)
    taken = rows[left.kind[rows] != SKIP]
    assert prepared.epochs.start[taken[0]] >= begin + 5.0
    assert left.kind[taken[0]] == ALL
    assert (left.kind == ALL).sum() == (prepared.kind == ALL).sum()


def test_a_span_over_a_whole_stop_is_that_stop_left_out(prepared):
    begin, end = span_of(prepared, 3)
    assert (without(prepared, (), ((begin, end),)).kind == without(prepared, (3,), ()).kind).all()


def test_no_residual_of_what_is_left_out_reaches_the_fit(whole, prepared):
    begin, end = span_of(prepared, 4)
    fit = solve(whole.without_times(((begin, begin + 20.0),)), load_model("baseline"), learn=False)
    inside = (prepared.epochs.end > begin) & (prepared.epochs.start < begin + 20.0)
    assert end > begin + 20.0
    assert np.isnan(fit.last.output.normalised[inside]).all()
    assert "times held out of the fit" in " ".join(fit.notes())


@pytest.mark.parametrize(
    ("stops", "spans", "word"),
    [
        ((0,), (), "first one, which gives the attitude"),
        ((99,), (), "stop 99 has no measurements"),
        ((), ((5.0, 8.0),), "give the attitude"),
        ((), ((500.0, 400.0),), "ends before it begins"),
        ((), ((1e6, 2e6),), "begins after the recording"),
    ],
)
def test_what_cannot_be_left_out_is_told(prepared, stops, spans, word):
    with pytest.raises(DataError, match=word):
        without(prepared, stops, spans)


def test_the_options_are_read_and_refused_in_one_line():
    assert read_stops("7, 4,7") == (4, 7)
    assert read_spans("812-815, 900.5-910") == ((812.0, 815.0), (900.5, 910.0))
    with pytest.raises(DataError, match="--exclude-stops 4;7"):
        read_stops("4;7")
    with pytest.raises(DataError, match="--exclude-times 812"):
        read_spans("812")


def test_an_estimator_that_takes_every_stop_says_so(whole):
    with pytest.raises(DataError, match="'batch' cannot leave stops out"):
        solve(whole.without_stops((3,)), load_model("baseline"), "batch")
