"""The filter fed in pieces: the same digits however the pieces were cut, and the same as offline."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sdimu_calibration.core.alignment.prepared import first_attitude, reduce, set_up
from sdimu_calibration.core.data.axes_and_units import Stated
from sdimu_calibration.core.effects.body_frame import frame_jacobian, values_in_frame
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.filter.solution import solve
from sdimu_calibration.core.front_door import OpeningOptions
from sdimu_calibration.core.live import NS, LiveCalibration
from sdimu_calibration.core.progress import silent
from sdimu_calibration.core.recording import DataError, seconds

START = 1_700_000_000 * NS
SI = Stated(1.0, 1.0, 1, 1)


@pytest.fixture(scope="module")
def memory():
    return {}


@pytest.fixture
def recording(memory, recorded_test, three_stops):
    """One simulated test for all examples."""
    if "recording" not in memory:
        made = recorded_test(three_stops, seed=21)
        # Times as they come out of stamps: whole nanoseconds, by the one conversion there is.
        memory["recording"] = replace(
            made,
            start_ns=START,
            t=seconds(stamps(made.t), START),
            phase=replace(made.phase, t=seconds(stamps(made.phase.t), START)),
        )
    return memory["recording"]


def stamps(t):
    return START + np.rint(t * 1e9).astype(np.int64)


def feed(recording, options, model, lengths, lag_ns=0):
    """Give a recording to a live calibration in blocks; return it with all its estimates."""
    live = LiveCalibration(options, model)
    ns, log = stamps(recording.t), recording.phase
    estimates, at, entry, blocks = [], 0, 0, [*lengths, len(recording.t)]
    for length in blocks:
        rows = slice(at, min(at + length, len(recording.t)))
        if rows.start == rows.stop:
            continue
        live.add_samples(ns[rows], recording.omega_ib_b[rows], recording.f_ib_b[rows])
        at = rows.stop
        until = int(ns[at - 1])
        while entry < len(log.t) and stamps(log.t)[entry] <= until:
            live.add_phase(int(stamps(log.t)[entry]), bool(log.dwell[entry]), int(log.stop[entry]))
            entry += 1
        estimates += live.advance(until - lag_ns)
    estimates += live.advance(int(ns[-1]))
    return live, estimates


@pytest.fixture
def options(imu, site):
    return OpeningOptions(imu, site, stated=SI)


@settings(
    max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow], deadline=None
)
@given(lengths=st.lists(st.one_of(st.integers(1, 30), st.integers(100, 1500)), min_size=1, max_size=25))
def test_estimates_do_not_depend_on_how_samples_came(lengths, memory, recording, options, model):
    if "whole" not in memory:
        memory["whole"] = feed(recording, options, model, [])[1]
    whole = memory["whole"]
    _, pieces = feed(recording, options, model, lengths)
    assert len(pieces) == len(whole) >= 36
    for a, b in zip(pieces, whole, strict=True):
        assert (a.t, a.dwell, a.used, a.stop, a.nis) == (b.t, b.dwell, b.used, b.stop, b.nis)
        for name in ("coefficients", "covariance", "velocity", "q_nb", "navigation_covariance"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


def test_the_end_of_a_live_test_is_the_offline_answer(recording, site, imu, options, model):
    live, _ = feed(recording, options, model, [997] * 3)
    ended, offline = live.finish(), calibrate(recording, site, imu, model)
    np.testing.assert_array_equal(ended.values, offline.values)
    np.testing.assert_array_equal(ended.covariance, offline.covariance)
    assert ended.fit == offline.fit


@pytest.mark.parametrize(("name", "size"), [("f_ib_b", 1e5), ("omega_ib_b", -1e4)])
def test_one_corrupt_sample_costs_neither_the_filter_on_the_way_nor_the_end(name, size, recording, options, model):
    values = getattr(recording, name).copy()
    values[1234, 1] = size
    live, estimates = feed(replace(recording, **{name: values}), options, model, [997] * 3)
    keep = np.arange(len(recording.t)) != 1234
    columns = {n: getattr(recording, n)[keep] for n in ("t", "omega_ib_b", "f_ib_b")}
    without, expected = feed(replace(recording, **columns), options, model, [997] * 3)
    np.testing.assert_array_equal([e.coefficients for e in estimates], [e.coefficients for e in expected])
    assert estimates[-1].counts["rejected"] == 1
    np.testing.assert_array_equal(live.finish().values, without.finish().values)


def test_the_filter_on_the_way_ends_where_passes_over_the_whole_test_end(recording, site, imu, options, model):
    _, estimates = feed(recording, options, model, [333] * 20)
    setup = set_up(site, imu, model)
    prepared, names = reduce(recording, setup), setup.sensors.names
    start = first_attitude(prepared.epochs, prepared.phases, setup)
    whole = solve(setup, prepared, start, None, silent).last
    np.testing.assert_allclose([e.t for e in estimates], prepared.epochs.end, rtol=0, atol=1e-9)
    J, sigma = frame_jacobian(names, model.body_frame), np.sqrt(np.diag(estimates[-1].covariance))
    free = sigma > 0.0
    expected = np.sqrt(np.diag(J @ whole.covariance @ J.T))[free]
    # What has come since the last passes is linear about what they knew, and a stop is levelled by what it was so far.
    np.testing.assert_allclose(sigma[free], expected, rtol=0.02)
    apart = estimates[-1].coefficients - values_in_frame(names, whole.estimate, model.body_frame)
    assert (np.abs(apart[free]) < 0.1 * expected).all()
    far = estimates[5].coefficients - values_in_frame(names, whole.estimate, model.body_frame)
    assert (np.abs(far[free]) > expected).sum() > 5


def test_late_and_unusable_samples_are_counted_and_dropped(recording, options, model):
    live = LiveCalibration(options, model)
    ns = stamps(recording.t[:3000])
    w, f = recording.omega_ib_b[:3000].copy(), recording.f_ib_b[:3000].copy()
    order = np.arange(3000)
    order[[700, 701]] = [701, 700]
    w[1500] = np.nan
    live.add_samples(ns[order], w[order], f[order])
    live.add_samples(ns[100:103], w[100:103], f[100:103])
    counts = live.advance(int(ns[-1]), status_known=False)[-1].counts
    assert counts["late"] == 1 + 3
    assert counts["rejected"] == 1 + 3 + 1
    assert counts["lost"] == 2
    assert counts["samples"] == 3000 - 2


def test_nothing_comes_out_before_there_is_an_attitude_and_then_it_catches_up(recording, options, model):
    live = LiveCalibration(options, model)
    ns, first = stamps(recording.t), []
    for k in range(0, 1500, 100):
        rows = slice(k, k + 100)
        live.add_samples(ns[rows], recording.omega_ib_b[rows], recording.f_ib_b[rows])
        first.append(len(live.advance(int(ns[rows.stop - 1]), status_known=False)))
    # The first dwell of 10 s ends before the 30 s of an alignment: the turn that ends it starts the filter.
    assert first[:10] == [0] * 10
    assert sum(first) == 15


def test_the_filter_waits_for_the_turn_that_tells_unit_and_sense_of_the_gyros(recording, options, model):
    unstated = replace(options, stated=Stated())
    whole = feed(recording, options, model, [])[1]
    live, found = feed(recording, unstated, model, [250] * 15)
    assert [e.t for e in found] == [e.t for e in whole]
    np.testing.assert_array_equal([e.coefficients for e in found], [e.coefficients for e in whole])
    waits, starts = live.notes
    assert "waits: no turn" in waits
    assert "--gyro-unit" in waits
    # The first turn lasts from 10 to 14.1 s; an attempt is made every second.
    second = float(starts.split()[-2])
    assert 10.0 < second <= 15.0


def test_the_filter_reads_foreign_numbers_on_the_way_as_it_reads_si(recording, options, model):
    whole = feed(recording, options, model, [])[1]
    foreign = replace(recording, omega_ib_b=np.degrees(-recording.omega_ib_b), f_ib_b=recording.f_ib_b / 9.80665)
    live, found = feed(foreign, replace(options, stated=Stated()), model, [700] * 5)
    assert len(found) == len(whole)
    told = " ".join(live.notes)
    for words in ("in g", "in deg/s", "opposite sign"):
        assert words in told
    sigma = np.sqrt(np.diag(whole[-1].covariance))
    # Rounding of two factors, a million times below the noise; the frame pins three coefficients to zero.
    assert (np.abs(found[-1].coefficients - whole[-1].coefficients) <= 1e-6 * sigma + 1e-15).all()


def test_a_filter_that_cannot_start_says_so_and_leaves_the_rest_to_the_end(recording, options, model):
    late = replace(recording, t=recording.t - recording.t[1199])
    rows = slice(1200, None)
    moved = replace(late, t=late.t[rows], omega_ib_b=late.omega_ib_b[rows], f_ib_b=late.f_ib_b[rows])
    live, found = feed(moved, options, model, [500] * 4)
    assert found == []
    (note,) = live.notes
    assert "starts in motion" in note
    with pytest.raises(DataError, match="starts in motion"):
        live.finish()


def test_finishing_without_samples_says_so(options, model):
    with pytest.raises(DataError, match="too few samples"):
        LiveCalibration(options, model).finish()
