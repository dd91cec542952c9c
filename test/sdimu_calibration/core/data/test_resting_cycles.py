"""A long test gets longer epochs and joined cycles at rest: the same test with less in memory."""

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment import prepared as preparing
from sdimu_calibration.core.data.epochs import Epochs
from sdimu_calibration.core.data.phases import Phases, restarts
from sdimu_calibration.core.data.resting_cycles import join
from sdimu_calibration.core.estimation import prepared_test
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.navigation.strapdown import Cycles, navigate_cycle, velocity_increment
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_sim.core.scenario import Scenario, generate

SITE = load_site("daejeon")
PER_EPOCH = 10


def navigated(cycles: Cycles) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    C, velocity, position = np.eye(3), np.zeros(3), np.array([SITE.latitude_rad, 0.0, 0.0])
    for k in range(len(cycles)):
        dv = velocity_increment(cycles.alpha[k], cycles.upsilon[k], cycles.sculling[k])
        phi = cycles.alpha[k] + cycles.coning[k]
        navigate_cycle(C, velocity, position, phi, dv, float(cycles.dt[k]), 9.8)
    return C, velocity, position


@pytest.fixture
def cycles() -> tuple[Cycles, Epochs]:
    """Three seconds at rest, with the noise of a navigation-grade sensor (seed 1)."""
    rng, n = np.random.default_rng(1), 3 * PER_EPOCH
    t, none = 0.1 * (np.arange(n) + 1.0), np.zeros((n, 3))
    alpha = 0.1 * earth.earth_rate(SITE.latitude_rad) + 2e-7 * rng.standard_normal((n, 3))
    upsilon = np.array([0.0, 0.0, -0.98]) + 3e-5 * rng.standard_normal((n, 3))
    edge, at = PER_EPOCH * np.arange(4), np.arange(3.0)
    epochs = Epochs(edge[:-1], edge[1:], at, at + 1.0, np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3)))
    whole = np.ones(n, dtype=np.int64)
    return Cycles(t, np.full(n, 0.1), alpha, upsilon, 1e-9 + none, 1e-7 + none, whole, 0 * whole, none), epochs


def test_joined_cycles_navigate_as_their_parts(cycles):
    before, epochs = cycles
    after, fewer = join(before, epochs, np.array([True, False, True]))
    assert len(after) == 2 + PER_EPOCH
    assert fewer.first.tolist() == [0, 1, 11]
    assert fewer.last.tolist() == [1, 11, 12]
    assert after.samples.sum() == before.samples.sum()
    # Velocity wanders by 2e-4 m/s here: within a joined cycle the transport rate (3e-11 rad in a second), the Earth's
    # turn (1e-8 m/s) and the position (1e-4 m, of which 2e-11 rad) do not see it.
    position = np.array([2e-11, 2e-11, 1e-4])
    for one, other, tolerance in zip(navigated(before), navigated(after), (3e-11, 1e-8, position), strict=True):
        assert (np.abs(other - one) < tolerance).all()


def test_a_second_that_is_not_used_does_not_make_a_rest_short():
    at = np.arange(400.0)
    used = (at % 100.0 != 50.0) & ((at < 220.0) | (at > 350.0))
    none = np.zeros(400, dtype=bool)
    epochs = Epochs(*(np.zeros(400, np.int64),) * 2, at, at + 1.0, at, np.zeros((400, 3)), np.zeros((400, 3)))
    phases = Phases(used, used, none, np.zeros(400, np.int64), none, none)
    # What was not looked at for two minutes begins anew at once.
    assert np.flatnonzero(restarts(epochs, phases)).tolist() == [110, 351]


def test_navigation_starts_anew_in_long_rests_alone():
    at = np.arange(400.0)
    used = at != 100.0
    none = np.zeros(400, dtype=bool)
    epochs = Epochs(*(np.zeros(400, np.int64),) * 2, at, at + 1.0, at, np.zeros((400, 3)), np.zeros((400, 3)))
    phases = Phases(used, used, none, (at > 100.0).astype(np.int64), none, none)
    assert np.flatnonzero(restarts(epochs, phases)).tolist() == [101 + 110, 101 + 220]


@pytest.mark.timeout(300)
def test_a_test_taken_for_a_long_one_gives_the_same_estimate(monkeypatch):
    """One white test (kim18, dtg, seed 1, 20 Hz) as it is, and with the epochs and cycles of a long one."""
    recording, _ = generate(Scenario(load_plan("kim18"), load_imu("dtg"), SITE, seed=1, rate_hz=20.0))
    test, model = PreparedTest(recording, load_imu("dtg"), SITE), load_model("baseline")
    short = solve(test, model, "filter")
    for module in (preparing, prepared_test):
        monkeypatch.setattr(module, "MOST_EPOCHS", 300)
    long = solve(replace(test, _prepared={}), model, "filter")
    assert len(long.prepared.epochs) < 0.7 * len(short.prepared.epochs)
    assert len(long.prepared.cycles) < 0.7 * len(short.prepared.cycles)
    sigma = np.sqrt(np.diag(short.covariance))
    free = sigma > 0.0
    # Ten seconds of a stop of a hundred lose up to two per cent of a sigma; the estimates differ by what was lost (four
    # sigma of the difference of two estimates of which one knows more), and by the movement at which passes end.
    ratio = np.sqrt(np.diag(long.covariance))[free] / sigma[free]
    assert ratio.min() > 0.999
    # A twentieth of a sigma is what a joint estimate may lose, too; nothing of a test is lost that would be felt.
    assert ratio.max() < 1.05
    moved = np.abs(long.values - short.values)[free] / sigma[free]
    assert (moved < 4.0 * np.sqrt(np.maximum(ratio**2 - 1.0, 0.0)) + 0.02).all()
    assert long.held_out_rms() == pytest.approx(short.held_out_rms(), rel=0.1)
    assert long.consistency().gyro.ratio == pytest.approx(short.consistency().gyro.ratio, rel=1e-6)
