"""Two publishers, or strays of another sensor, on the topic of the IMU: told by stamps and values, live and offline."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.data.arrival import RawTest, in_order
from sdimu_calibration.core.data.streams import one_stream
from sdimu_calibration.core.recording import DataError

MS = 1_000_000
T = 10 * MS
N = 12_000
RESTS = np.array([[0, 0, 9.8], [0, 9.8, 0], [9.8, 0, 0], [0, 0, -9.8], [0, -9.8, 0], [-9.8, 0, 0]])
"""Specific force (m/s^2) of one attitude after another: 19 s each, and a turn of 1 s."""


def sensor(seed, n=N, bias=0.1, interval=T, noise=0.005):
    """Stamps, rates and forces of an IMU that a table tips six times."""
    rng = np.random.default_rng(seed)
    turn = np.clip(20.0 * (np.arange(n) * len(RESTS) / n % 1.0) - 19.0, 0.0, 1.0)[:, None]
    at = np.arange(n) * len(RESTS) // n
    attitude = (1.0 - turn) * RESTS[at] + turn * RESTS[np.minimum(at + 1, len(RESTS) - 1)]
    gyro, accel, scale = rng.normal(size=3) * 0.1 * bias, rng.normal(size=3) * bias, rng.normal(size=3) * 1e-3
    rate = gyro + 0.1 * noise * rng.normal(size=(n, 3))
    force = accel + (1.0 + scale) * attitude + noise * rng.normal(size=(n, 3))
    return 10**15 + interval * np.arange(1, n + 1), rate, force


def later(stream, ns):
    return (stream[0] + round(ns), *stream[1:])


def part(stream, rows):
    return tuple(column[rows] for column in stream)


def jittered(stream, share, seed=7):
    ns, *values = stream
    return (ns + np.rint(share * T * np.random.default_rng(seed).normal(size=len(ns))).astype(np.int64), *values)


def mixed(*streams):
    together = tuple(np.concatenate(columns) for columns in zip(*streams, strict=True))
    return part(together, np.argsort(together[0], kind="stable"))


OURS, THEIRS = sensor(1), sensor(2)
LONG = slice(1000, 8000)
"""Rows of a publisher that begins after the other and ends before it."""


def kept(stream):
    """Samples that are kept, and the notes."""
    rows, notes = one_stream(*stream, "bag: /imu/data_raw")
    return (stream if rows is None else part(stream, rows)), notes


SECOND = {
    "other phase": part(later(THEIRS, 0.3 * T), LONG),
    "a short distance": part(later(THEIRS, 0.03 * T), LONG),
    "half an interval": part(later(THEIRS, 0.5 * T), LONG),
    "half an interval from the start": part(later(THEIRS, 0.5 * T), slice(0, 6000)),
    "the same stamps": part(THEIRS, LONG),
    "half the rate": later(sensor(2, N // 2, interval=2 * T), 0.3 * T),
    "half the rate, the same stamps": sensor(2, N // 2, interval=2 * T),
    "another rate": later(sensor(2, round(0.62 * N), interval=round(T / 0.62)), 0.3 * T),
}


@pytest.mark.parametrize("name", SECOND)
def test_of_two_publishers_the_longer_stream_is_kept_and_the_other_told(name):
    found, (note,) = kept(mixed(OURS, SECOND[name]))
    for column, ours in zip(found, OURS, strict=True):
        np.testing.assert_array_equal(column, ours)
    assert note.startswith("/imu/data_raw: two publishers with other values, 12000 samples at 100 Hz and ")
    assert f"{len(SECOND[name][0])} samples at" in note
    assert "give each publisher a topic of its own" in note


@pytest.mark.parametrize(
    "second",
    [
        later(THEIRS, 0.3 * T),
        later(THEIRS, 0.5 * T),
        THEIRS,
        jittered(later(THEIRS, 0.4 * T), 0.05),
        later(sensor(2, round(0.99 * N), interval=round(T / 0.99)), 0.3 * T),
    ],
    ids=["other phase", "half an interval", "same stamps", "jitter", "other clock"],
)
def test_two_equal_publishers_are_refused_by_name(second):
    with pytest.raises(
        DataError, match=r"bag: /imu/data_raw: two publishers write to one topic, .* nothing says which"
    ):
        kept(mixed(jittered(OURS, 0.05) if len(second[0]) == N and np.ptp(np.diff(second[0])) else OURS, second))


def test_numbers_that_are_not_finite_do_not_hide_a_publisher():
    ns, rate, force = mixed(OURS, later(THEIRS, 0.5 * T))
    force[::50] = np.inf
    with pytest.raises(DataError, match="two publishers"):
        kept((ns, rate, force))


def test_of_two_equal_publishers_that_which_turns_is_kept():
    ns, rate, force = sensor(2)
    lies = (ns + round(0.3 * T), rate, np.resize(force[:1900], (N, 3)))
    found, (note,) = kept(mixed(lies, OURS))
    np.testing.assert_array_equal(found[2], OURS[2])
    assert "as their sensor does not turn" in note


@pytest.mark.parametrize("delay_ms", [1, 5, 8, 50])
def test_a_relay_of_the_same_sensor_is_told_and_the_first_reading_kept(delay_ms):
    found, (note,) = kept(mixed(OURS, later(OURS, delay_ms * MS)))
    np.testing.assert_array_equal(found[0], OURS[0])
    np.testing.assert_array_equal(found[2], OURS[2])
    assert f"12000 of 24000 samples are others once more, {delay_ms} ms later" in note


@pytest.mark.parametrize("lag_s", [0.0503, 2.003, 3600.0])
def test_a_publisher_whose_clock_lags_is_told(lag_s):
    theirs = part(THEIRS, LONG)
    arrival = np.argsort(np.concatenate([OURS[0], theirs[0] + 1]))
    ours_and_theirs = tuple(np.concatenate(columns) for columns in zip(OURS, later(theirs, -lag_s * 1e9), strict=True))
    found, (note,) = kept(part(ours_and_theirs, arrival))
    np.testing.assert_array_equal(found[2], OURS[2])
    assert "7000 samples at 100 Hz; the second are left out" in note


def test_three_publishers_are_told_one_after_the_other():
    first = part(later(sensor(2), 0.3 * T), slice(0, 5000))
    second = part(later(sensor(3), 0.6 * T), slice(6000, 9000))
    found, _ = kept(mixed(OURS, first, second))
    np.testing.assert_array_equal(found[2], OURS[2])


@pytest.mark.parametrize("jitter", [0.0, 0.05])
@pytest.mark.parametrize("rows", [[3001], list(range(500, N, 900)), list(range(4000, 4150))])
def test_strays_of_another_sensor_are_dropped_and_counted(rows, jitter):
    ours = jittered(OURS, jitter)
    found, (note,) = kept(mixed(ours, part(later(THEIRS, 0.3 * T), np.array(rows))))
    np.testing.assert_array_equal(found[2], ours[2])
    assert ("1 sample is" if len(rows) == 1 else f"{len(rows)} samples are") + " of another sensor" in note


def by_hand(seed):
    """Rests of 5 s in any attitudes with turns of 2 s between them."""
    ns, rate, _ = sensor(seed)
    rng = np.random.default_rng(10 + seed)
    k, phase = np.divmod(np.arange(N) + 350 * seed, 700)
    ends = rng.normal(size=(k[-1] + 2, 3))
    turned = np.clip((phase - 500) / 200, 0.0, 1.0)[:, None]
    force = (1.0 - turned) * ends[k] + turned * ends[k + 1]
    turn = np.sin(np.pi * turned) ** 2 * rng.normal(size=ends.shape)[k]
    return ns, rate + turn, 9.8 * force + 0.005 * rng.normal(size=(N, 3))


def test_a_second_sensor_that_turns_at_other_times_is_told():
    """What lasts is the difference of the biases of the gyros."""
    ours, theirs = by_hand(1), by_hand(2)
    found, (note,) = kept(mixed(ours, part(later(theirs, 0.3 * T), slice(0, 8000))))
    np.testing.assert_array_equal(found[2], ours[2])
    assert "two publishers with other values" in note


def test_strays_that_fit_by_chance_go_with_those_that_do_not():
    rows = np.arange(500, N, 900)
    ns, rate, force = part(later(OURS, 0.3 * T), rows)
    force[0] += 1.0
    found, (note,) = kept(mixed(OURS, (ns, rate + 1e-6, force)))
    np.testing.assert_array_equal(found[2], OURS[2])
    assert f"{len(rows)} samples are of another sensor" in note


def bursts(packet, apart_ns):
    ns, *values = OURS
    first = np.minimum(np.arange(N) // packet * packet + packet - 1, N - 1)
    return (ns[first] + apart_ns * (np.arange(N) % packet), *values)


def hum():
    """Hum at half the sample rate, with a beat: every second sample differs, for a while."""
    alternating = 0.1 * np.cos(np.pi * np.arange(N) * (1.0 + 2e-3))
    return OURS[0], OURS[1], OURS[2] + alternating[:, None]


def clock_steps():
    ns = OURS[0].copy()
    for at, step_ms in ((2000, 4), (5000, -25), (7000, 256), (9000, -10)):
        ns[at:] += step_ms * MS
    return (ns, *OURS[1:])


def set_back():
    ns = OURS[0].copy()
    ns[6000:] -= 30 * 10**9
    return (ns, *OURS[1:])


def repeated_stamps():
    ns = OURS[0].copy()
    again = np.flatnonzero(np.random.default_rng(3).random(N - 1) < 0.1) + 1
    ns[again] = ns[again - 1]
    return (ns, *OURS[1:])


def out_of_order():
    place = np.arange(N, dtype=float)
    place[np.random.default_rng(3).choice(N, N // 100, replace=False)] += 20.5
    return part(OURS, np.argsort(place))


def coarse():
    return OURS[0], np.round(OURS[1], 2), np.round(OURS[2], 1)


def not_finite():
    ns, rate, force = jittered(OURS, 0.05)
    return ns, rate, np.where(np.random.default_rng(3).random((N, 1)) < 0.01, np.nan, force)


CLEAN = {
    "even": OURS,
    **{f"jitter {share}": jittered(OURS, share) for share in (0.02, 0.075, 0.2)},
    "late in turn": (np.maximum.accumulate(OURS[0] + np.random.default_rng(3).integers(0, T, N)), *OURS[1:]),
    **{f"bursts of {packet}": bursts(packet, 0) for packet in (2, 3, 8)},
    **{f"bursts of {packet}, apart": bursts(packet, MS // 3) for packet in (2, 3, 8)},
    "gaps": part(OURS, np.r_[0:3000, 3001:5000, 6500:N]),
    "lost": part(OURS, np.random.default_rng(3).random(N) > 0.1),
    "every second one lost": part(OURS, np.r_[0:3000, 3000:9000:2, 9000:N]),
    "clock steps": clock_steps(),
    "clock set back": set_back(),
    "sent twice": part(OURS, np.repeat(np.arange(N), 2)),
    "some sent twice": part(OURS, np.sort(np.r_[np.arange(N), np.arange(0, N, 7)])),
    "stamps of the one before": repeated_stamps(),
    "out of order": out_of_order(),
    "coarse": coarse(),
    "held": part(OURS, np.arange(N) // 4 * 4),
    "hum": hum(),
    "not finite": not_finite(),
    "noiseless": sensor(1, noise=0.0),
    "short": part(OURS, slice(0, 60)),
}


@pytest.mark.parametrize("name", CLEAN)
def test_one_sensor_is_never_taken_for_two(name):
    assert one_stream(*CLEAN[name], "bag: /imu/data_raw") == (None, ())


def test_a_recording_has_the_samples_of_one_sensor_and_counts_the_others():
    recording = in_order(RawTest(*mixed(OURS, SECOND["other phase"]), where="bag: /imu/data_raw"))
    alone = in_order(RawTest(*OURS))
    np.testing.assert_array_equal(recording.t, alone.t)
    np.testing.assert_array_equal(recording.f_ib_b, alone.f_ib_b)
    assert (recording.rejected, len(recording.notes), recording.clock_steps) == (len(SECOND["other phase"][0]), 1, ())
