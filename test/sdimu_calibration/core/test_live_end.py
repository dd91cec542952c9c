"""The end of a live test is the answer that a bag of the same messages gives, to the last digit."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pytest

from sdimu_calibration.core.estimation.outcome import calibrate, outcome
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.live import NS, LiveCalibration
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import UNNUMBERED, DataError
from sdimu_calibration.storage.bags.bag_writer import BagContent, write_recording
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_calibration.storage.files.model_choice import by_hand, named_model
from sdimu_calibration.storage.opening import Source, open_test, opening_options
from sdimu_sim.core.by_hand import ByHand, by_hand_recording
from sdimu_sim.core.scenario import Scenario, generate

G = 9.80665
START = 1_700_000_000 * NS
INTERVAL = NS // 20
KIM18 = load_plan("kim18")
SHORT = Plan(
    "kim18 in a hurry",
    (12.0,) * len(KIM18.dwell_s),
    tuple(replace(turn, rate_rad_s=np.radians(18.0)) for turn in KIM18.turns),
    np.radians(18.0),
)


@cache
def simulated(imu):
    return generate(Scenario(SHORT, load_imu(imu), load_site("daejeon"), rate_hz=20.0, seed=71))[0]


@dataclass(frozen=True)
class Messages:
    """What is on the topics."""

    ns: np.ndarray
    w: np.ndarray
    f: np.ndarray
    status: tuple | None
    temperature: tuple
    told: tuple[str, ...] = field(default=())
    source: Source = field(default_factory=Source)


def messages(imu):
    r = simulated(imu)
    second = np.arange(0.0, r.t[-1])
    row = np.searchsorted(r.phase.t, second, side="right") - 1
    at = START + (second * NS).astype(np.int64)
    return Messages(
        START + np.rint(r.t * NS).astype(np.int64),
        r.omega_ib_b,
        r.f_ib_b,
        (at, r.phase.dwell[row], r.phase.stop[row]),
        (at, 20.0 + 1e-3 * second),
    )


def foreign_units(m):
    return replace(m, w=np.degrees(m.w), f=m.f / G, told=("in g", "in deg/s"))


def negated_force(m):
    return replace(m, f=-m.f, source=Source(accel_sign=-1))


def negated_rate(m):
    return replace(m, w=-m.w, told=("body rate is read with the opposite sign",))


def jitter(m):
    late = np.random.default_rng(5).uniform(-0.1, 0.1, len(m.ns)) * INTERVAL
    return replace(m, ns=m.ns + late.astype(np.int64), told=("samples are taken as even",))


def bursts(m):
    """Every eighth sample is stamped too late by a fifth of the interval, as a busy computer does."""
    return replace(m, ns=m.ns + (np.arange(len(m.ns)) % 8 == 7) * (INTERVAL // 5), told=("taken as even",))


def other_clock(m):
    at, dwell, stop = m.status
    return replace(m, status=(at + 7 * NS, dwell, stop), told=("against the motion of the IMU: shifted",))


def no_numbers(m):
    at, dwell, stop = m.status
    return replace(m, status=(at, dwell, np.full_like(stop, UNNUMBERED)), told=("stops are counted",))


def no_status(m):
    return replace(m, status=None)


def spikes_and_a_stuck_axis(m):
    w, f = m.w.copy(), m.f.copy()
    w[[90, 3300, 5007], 1] += 0.5
    f[60:65, 2] = f[60, 2]
    return replace(m, w=w, f=f)


def stamp_of_another_year(m):
    """One sample of a turn is stamped years ahead."""
    ns = m.ns.copy()
    ns[700] = 2_000_000_000 * NS
    return replace(m, ns=ns, told=("1 sample has a stamp outside the test (2033-05-18",))


def torn(m):
    """Samples missing, not finite, and twice."""
    keep = np.r_[0:150, 157 : len(m.ns)]
    w = m.w.copy()
    w[100] = np.nan
    again = np.sort(np.r_[keep, 2500])
    return replace(m, ns=m.ns[again], w=w[again], f=m.f[again], told=("not finite", "repeated a stamp"))


def warm_another_day(m):
    at, value = m.temperature
    return replace(m, temperature=(at - 86_400 * NS, value), told=("temperature has no time in common",))


def stray_status(m):
    """One status with a stamp of zero, one of a year ahead."""
    at, dwell, stop = m.status
    status = (np.concatenate([[0], at, [START + 365 * 86_400 * NS]]), np.r_[True, dwell, True], np.r_[3, stop, 3])
    return replace(m, status=status, told=("2 messages have stamps outside the test",))


def second_publisher(m):
    """Another IMU on the topic for a part of the test, under the same name, and five strays of it."""
    n = len(m.ns)
    rows = np.r_[50 : n // 2, np.linspace(n // 2 + 50, n - 50, 5).astype(int)]
    at = np.concatenate([m.ns, m.ns[rows] + 3_000_000])
    w, f = np.concatenate([m.w, m.w[rows] + 1e-3]), np.concatenate([m.f, 1.001 * m.f[rows] + 0.05])
    order = np.argsort(at, kind="stable")
    return replace(m, ns=at[order], w=w[order], f=f[order], told=("two publishers with other values",))


CASES = (
    second_publisher,
    stray_status,
    foreign_units,
    negated_force,
    negated_rate,
    jitter,
    bursts,
    other_clock,
    no_numbers,
    no_status,
    spikes_and_a_stuck_axis,
    stamp_of_another_year,
    torn,
    warm_another_day,
)


def recorded(path, m):
    status = None if m.status is None else (m.status[0] - START, *m.status[1:])
    write_recording(
        path,
        BagContent(
            start_ns=START,
            imu_ns=m.ns - START,
            omega_ib_b=m.w,
            f_ib_b=m.f,
            status=status,
            temperature=(m.temperature[0] - START, m.temperature[1]),
        ),
    )
    return path


def live(m, imu, site="daejeon"):
    """A live calibration that has taken all messages in blocks of 20, and its estimates on the way."""
    options = opening_options(site, load_imu(imu), m.source if site else Source())
    found = LiveCalibration(options, named_model(None, []), named_model(None, [], handheld=True))
    estimates, entry, said = [], 0, [] if m.status is None else list(zip(*(c.tolist() for c in m.status), strict=True))
    for k in range(0, len(m.ns), 20):
        rows = slice(k, k + 20)
        found.add_samples(m.ns[rows], m.w[rows], m.f[rows])
        until = int(m.ns[rows].max())
        while entry < len(said) and said[entry][0] <= until:
            found.add_phase(*said[entry])
            entry += 1
        estimates += found.advance(until, m.status is not None)
    for status in said[entry:]:
        found.add_phase(*status)
    for at, value in zip(*m.temperature, strict=True):
        found.add_temperature(int(at), float(value))
    return found, estimates + found.advance(int(m.ns.max()), m.status is not None, final=True)


def equal(a, b):
    """Two recordings with the same digits everywhere."""
    assert a.start_ns == b.start_ns
    assert a.rejected == b.rejected
    for name in ("t", "omega_ib_b", "f_ib_b"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    for name, columns in (("phase", ("t", "dwell", "stop")), ("temperature", ("t", "value"))):
        one, other = getattr(a, name), getattr(b, name)
        assert (one is None) == (other is None), name
        for column in columns if one is not None else ():
            np.testing.assert_array_equal(getattr(one, column), getattr(other, column), err_msg=f"{name}.{column}")


@pytest.mark.parametrize("case", CASES)
def test_live_end_and_bag_open_the_same_recording(case, tmp_path):
    m = case(messages("dtg"))
    ended = live(m, "dtg")[0].opened()
    opened = open_test(recorded(tmp_path / "bag", m), "daejeon", load_imu("dtg"), m.source, handheld=False)
    equal(ended.recording, opened.recording)
    assert ended.recording.notes == opened.recording.notes
    assert (ended.imu, ended.site) == (opened.imu, opened.site)
    told = " ".join(ended.recording.notes)
    assert all(words in told for words in m.told), told


@pytest.mark.parametrize(
    ("imu", "cases"),
    [
        ("dtg", (foreign_units, jitter, other_clock)),
        ("fog_tactical", (second_publisher,)),
        ("dtg", (foreign_units, negated_rate, bursts, no_status)),
        ("rlg_navigation", (negated_force, spikes_and_a_stuck_axis)),
        ("fog_tactical", (foreign_units, jitter, no_status, torn)),
        ("dtg", (stamp_of_another_year,)),
        ("mems_industrial", (foreign_units, no_status)),
    ],
)
def test_live_end_and_bag_give_the_same_coefficients(imu, cases, tmp_path):
    m = messages(imu)
    for case in cases:
        m = case(m)
    there, estimates = live(m, imu)
    ended = there.finish()
    opened = open_test(recorded(tmp_path / "bag", m), "daejeon", load_imu(imu), m.source, handheld=False)
    offline = calibrate(opened.recording, opened.site, opened.imu, load_model("baseline"))
    np.testing.assert_array_equal(ended.values, offline.values)
    np.testing.assert_array_equal(ended.covariance, offline.covariance)
    assert ended.fit == offline.fit
    assert ended.data == offline.data
    assert ended.notes == offline.notes
    # The filter on the way runs, too, once it knows what it reads; a status on another clock costs it rests.
    assert len(estimates) > 0.95 * (m.ns[-1] - START) / NS
    if other_clock not in cases:
        assert sum(e.used for e in estimates) > 0.5 * sum(SHORT.dwell_s)


def test_the_end_of_a_run_by_hand_has_the_model_of_a_run_by_hand(tmp_path):
    """On the way nobody knows yet what it is; the end takes the model that the bag is estimated with."""
    r = by_hand_recording(ByHand(12, load_imu("mems_by_hand"), load_site("daejeon"), seed=72))[0]
    none = np.empty(0, dtype=np.int64)
    m = Messages(START + np.rint(r.t * NS).astype(np.int64), r.omega_ib_b, r.f_ib_b, None, (none, none))
    ended = live(m, "mems_by_hand")[0].finish()
    test = open_test(recorded(tmp_path / "bag", m), "daejeon", load_imu("mems_by_hand"), m.source)
    offline = outcome(solve(test, named_model(None, [], by_hand(test))))
    assert ended.estimator == "handheld"
    assert ended.model == offline.model
    np.testing.assert_array_equal(ended.values, offline.values)
    np.testing.assert_array_equal(ended.covariance, offline.covariance)


def test_an_assumed_site_that_the_data_exclude_is_refused_live_and_offline(tmp_path):
    m = negated_force(messages("dtg"))
    said = r"no site was stated, and the assumed one \(daejeon\).*is the sign of the force turned: then --accel-sign -1"
    with pytest.raises(DataError, match=said):
        live(m, "dtg", site=None)[0].opened()
    with pytest.raises(DataError, match=said):
        open_test(recorded(tmp_path / "bag", m), None, load_imu("dtg"), handheld=False)


def test_without_a_status_a_wide_specification_does_not_let_turns_pass_on_the_way():
    m = no_status(messages("mems_industrial"))
    log = simulated("mems_industrial").phase
    _, estimates = live(m, "mems_industrial")
    t = np.array([e.t for e in estimates])
    rests = np.array([e.dwell for e in estimates])
    middle = log.dwell[np.searchsorted(log.t, t - 0.5, side="right") - 1]
    # A second that lies across the edge of a turn may count either way.
    inside = np.array([log.dwell[(log.t > s - 1.0) & (log.t <= s)].all() for s in t])
    assert not (rests & ~middle & ~inside).any()
    assert rests.sum() > 0.7 * middle.sum()


def test_a_bag_with_a_second_publisher_gives_what_the_bag_without_it_gives(tmp_path):
    m = messages("fog_tactical")
    imu = load_imu("fog_tactical")
    alone, mixed = (
        open_test(recorded(tmp_path / name, case), "daejeon", imu, m.source, handheld=False)
        for name, case in (("alone", m), ("mixed", second_publisher(m)))
    )
    ours, found = (
        calibrate(test.recording, test.site, test.imu, load_model("baseline"), held_out=False)
        for test in (alone, mixed)
    )
    np.testing.assert_array_equal(found.values, ours.values)
    np.testing.assert_array_equal(found.covariance, ours.covariance)


def test_a_second_publisher_is_told_while_the_test_runs():
    m = second_publisher(messages("dtg"))
    found, _ = live(m, "dtg")
    assert sum("two publishers" in note for note in found.notes) == 1


def test_a_test_of_which_no_stream_can_be_told_says_so_early():
    m = messages("dtg")
    twice = np.repeat(np.arange(len(m.ns)), 2)
    odd = np.arange(len(twice)) % 2
    mixed = replace(m, ns=m.ns[twice] + 3_000_000 * odd, w=m.w[twice], f=m.f[twice] + 0.05 * odd[:, None])
    found, _ = live(mixed, "dtg")
    assert sum("will be refused as it is now: /imu/data_raw: two publishers" in note for note in found.notes) == 1
    with pytest.raises(DataError, match="two publishers write to one topic"):
        found.opened()
