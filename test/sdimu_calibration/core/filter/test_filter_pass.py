"""The whole filter against a different algorithm: the test as one Gaussian, every noise sample an unknown."""

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core import earth
from sdimu_calibration.core.alignment.prepared import first_attitude, reduce, set_up
from sdimu_calibration.core.filter.filter_pass import (
    COPY,
    MEASURED,
    NAV,
    PassState,
    _feed_back,
    _measurement,
    new_output,
    run_pass,
)
from sdimu_calibration.core.filter.pass_setup import pass_settings, start_state
from sdimu_calibration.core.filter.passes import linearise, run_linearised
from sdimu_calibration.core.measurement_kind import HELD_ALL, HELD_SENSORS, SKIP
from sdimu_calibration.core.rotation import skew

PARTS = 10
"""White noise is taken as constant over this part of an epoch."""


def copied(state):
    return PassState(*(v.copy() for v in state))


def prepare_pass(recording, site, imu, model):
    """Reduced test, its settings, and an open-loop pass linearised at zero coefficients."""
    setup = set_up(site, imu, model)
    prepared = reduce(recording, setup)
    start = first_attitude(prepared.epochs, prepared.phases, setup)
    none = np.zeros(len(setup.sensors.prior))
    # A small start so that the first order is all there is: the alignment's own sigma, not the widened one.
    start = replace(start, filter_sigma=np.array([2e-4, 2e-4, 1e-3]))
    begin = start_state(setup, start, start.C_nb, none)
    return setup, prepared, begin


def passed(prepared, setup, begin):
    """Pass about zero coefficients and one attitude: the least squares knows no shift from stop to stop."""
    at = linearise(prepared, setup, begin.C_nb, np.zeros(len(setup.sensors.prior)))
    at = replace(at, data=at.data._replace(shift=np.full_like(at.data.shift, -1)))
    return run_linearised(at, setup, begin, keep=True)


class Batch:
    """All measurements as one linear function of the start and of every piece of noise.

    Rows are built epoch by epoch from the transition and response of the pass (their own tests compare them with the
    mechanization), but noise enters by first principles: n_g and n_a of each tenth of an epoch turn the attitude,
    push the velocity, and make the mean rate and force of the same epoch.
    """

    def __init__(self, out, kind, lengths, begin, setup):
        p = len(setup.sensors.prior)
        s, e = NAV + p + COPY, len(kind)
        noises = e * PARTS * 6
        settings = pass_settings(setup)
        A, B = np.eye(s), np.zeros((s, noises))
        rows_A, rows_B, rows_R, rows_z = [], [], [], []
        gravity = earth.normal_gravity(setup.site.latitude_rad, setup.site.height_m)
        f_cross = skew(np.array([0.0, 0.0, -gravity]))
        for k in range(e):
            T = lengths[k]
            F = np.eye(s)
            F[:NAV, :NAV], F[:NAV, NAV : NAV + p] = out.Phi[k], out.G[k]
            A, B = F @ A, F @ B
            C = out.C_nb[k]
            mean = np.zeros((6, noises))
            for i in range(PARTS):
                left = T * (1.0 - (i + 0.5) / PARTS)
                at = (k * PARTS + i) * 6
                gyro, accel = slice(at, at + 3), slice(at + 3, at + 6)
                turn = -C * T / PARTS
                push = C * T / PARTS
                B[6:9, gyro] += turn
                B[3:6, gyro] += f_cross @ turn * left
                B[0:3, gyro] += f_cross @ turn * left**2 / 2
                B[3:6, accel] += push
                B[0:3, accel] += push * left
                mean[0:3, gyro] += np.eye(3) / PARTS
                mean[3:6, accel] += np.eye(3) / PARTS
            if kind[k] == SKIP:
                continue
            low = 0 if kind[k] == HELD_ALL else 6
            H = out.H[k, low:]
            direct = np.vstack([np.zeros((6, noises)), mean])[low:]
            rows_A.append(H @ A)
            rows_B.append(H @ B + direct)
            rows_z.append(out.innovation[k, low:])
            extra = [settings.position_sigma**2] * 3 + [settings.velocity_sigma**2] * 3 + [0.0] * 6
            rows_R += extra[low:]
        density = np.tile([settings.gyro_psd] * 3 + [settings.accel_psd] * 3, e * PARTS)
        power = density / np.repeat(lengths / PARTS, PARTS * 6)
        J, D, z = np.vstack(rows_A), np.vstack(rows_B), np.concatenate(rows_z)
        S = J @ begin.P @ J.T + (D * power) @ D.T + np.diag(rows_R)
        cross = A @ begin.P @ J.T + (B * power) @ D.T
        gain = np.linalg.solve(S, cross.T).T
        self.mean = gain @ z
        self.covariance = A @ begin.P @ A.T + (B * power) @ B.T - gain @ cross.T
        sign, logdet = np.linalg.slogdet(S)
        assert sign > 0
        self.log_likelihood = -0.5 * (z @ np.linalg.solve(S, z) + logdet + len(z) * np.log(2 * np.pi))


@pytest.fixture
def batch_and_filter(recorded_test, three_stops, site, imu, model):
    recording = recorded_test(three_stops, seed=11)
    setup, prepared, begin = prepare_pass(recording, site, imu, model)
    none = np.zeros(len(setup.sensors.prior))
    taken = passed(prepared, setup, begin)
    kind = np.where(prepared.kind == 2, HELD_ALL, np.where(prepared.kind == 1, HELD_SENSORS, SKIP))
    free = new_output(len(kind), len(none), True, 1)
    settings = pass_settings(setup)
    run_pass(taken.data._replace(kind=kind), settings, copied(begin), free)
    lengths = prepared.epochs.end - prepared.epochs.start
    return Batch(free, kind, lengths, begin, setup), taken, setup


def test_the_filter_is_the_least_squares_of_the_whole_test(batch_and_filter):
    """Estimate, covariance and likelihood of a short test with turns, process noise and shared noise."""
    batch, taken, setup = batch_and_filter
    p = len(setup.sensors.prior)
    # Coefficients and the copies of the first attitude error; velocity and position were fed back on the way.
    rows = np.r_[6 : NAV + p + COPY]
    expected = np.sqrt(np.diag(batch.covariance))[rows]
    sigma = np.sqrt(np.diag(taken.state.P))[rows]
    # Noise held over tenths of an epoch, and the mean force of the epoch, leave 1e-3 of the small terms.
    np.testing.assert_allclose(sigma, expected, rtol=1e-3)
    P, Q = taken.state.P[np.ix_(rows, rows)], batch.covariance[np.ix_(rows, rows)]
    assert np.abs((P - Q) / np.outer(expected, expected)).max() < 2e-3
    assert np.abs((taken.state.x - batch.mean)[rows] / expected).max() < 0.01
    # It is a calibration and not an idle filter: something was learned, by ten and more.
    assert (sigma[3 : 3 + p] / setup.sensors.prior).min() < 0.1
    assert taken.output.log_likelihood.sum() == pytest.approx(batch.log_likelihood, abs=0.5)


def test_without_shared_noise_the_filter_is_not_that_least_squares(
    batch_and_filter, recorded_test, three_stops, site, imu, model
):
    """M is seen: a filter that takes the same noise for two claims other sigmas, ten tolerances off in a short test."""
    batch, _, _ = batch_and_filter
    other = replace(model, shared_noise=False)
    setup, prepared, begin = prepare_pass(recorded_test(three_stops, seed=11), site, imu, other)
    taken = passed(prepared, setup, begin)
    ratio = np.sqrt(np.diag(taken.covariance) / np.diag(batch.covariance)[NAV : NAV + len(setup.sensors.prior)])
    assert np.abs(ratio - 1.0).max() > 10 * 1e-3


def test_held_out_epochs_are_scored_but_not_taken(batch_and_filter):
    _, taken, setup = batch_and_filter
    kind = np.where(taken.data.kind > 0, -taken.data.kind, taken.data.kind)
    out = new_output(len(kind), len(setup.sensors.prior), False, 1)
    state = copied(taken.start)
    run_pass(taken.data._replace(kind=kind), pass_settings(setup), state, out)
    measured = kind != SKIP
    assert np.isfinite(out.nis[measured][:, 2:]).all()
    np.testing.assert_array_equal(state.P[NAV:-COPY, NAV:-COPY], np.diag(setup.sensors.prior**2))
    np.testing.assert_array_equal(state.x, taken.start.x)


def test_innovations_of_the_right_model_are_white(batch_and_filter):
    """Mean square within its own 99.9 % bounds for their number."""
    _, taken, _ = batch_and_filter
    white = taken.output.normalised[np.isfinite(taken.output.normalised)]
    assert len(white) > 100
    assert abs(np.mean(white**2) - 1.0) < 3.3 * np.sqrt(2.0 / len(white))
    assert taken.output.normalised.shape[1] == MEASURED


def test_position_and_velocity_are_fed_back_and_the_attitude_is_not(site, imu, model, general_attitude):
    setup = set_up(site, imu, model)
    s = NAV + len(setup.sensors.prior) + COPY
    x = np.arange(1.0, s + 1.0)
    position = np.array([site.latitude_rad, 0.0, site.height_m])
    state = PassState(
        x.copy(), np.eye(s), general_attitude.copy(), np.zeros(3), position.copy(), np.zeros(s - NAV - COPY)
    )
    _feed_back(pass_settings(setup), state)
    north, east = (position - state.position)[:2] * 6.371e6 * np.array([1.0, np.cos(site.latitude_rad)])
    # Errors N, E, D (m) against a sphere: the radii of the ellipsoid differ by half a per cent.
    np.testing.assert_allclose([north, east, state.position[2] - position[2]], x[:3], rtol=0.01)
    np.testing.assert_array_equal(state.velocity, -x[3:6])
    np.testing.assert_array_equal(state.x, np.concatenate([np.zeros(6), x[6:]]))
    np.testing.assert_array_equal(state.C_nb, general_attitude)
    np.testing.assert_array_equal(state.P, np.eye(s))


def test_shared_noise_of_an_epoch_is_that_of_its_pieces(site, imu, model, general_attitude):
    """M and R against the sum over pieces of white noise, each with its own lever on the end of the epoch."""
    setup = set_up(site, imu, model)
    settings = pass_settings(setup)
    p, T, pieces = len(setup.sensors.prior), 1.3, 200
    position = np.array([site.latitude_rad, 0.0, site.height_m])
    s = NAV + p + COPY
    state = PassState(np.zeros(s), np.eye(s), general_attitude.copy(), np.zeros(3), position, np.zeros(p))
    _, _, R, M = _measurement(settings, state, np.zeros((6, p)), np.zeros(6), T, p, 1.0)
    f_cross = skew(np.array([0.0, 0.0, -earth.normal_gravity(site.latitude_rad, site.height_m)]))
    left = T * (1.0 - (np.arange(pieces) + 0.5) / pieces)
    C = general_attitude
    # Piece i of the noise has variance psd / (T / pieces), acts for T / pieces, and makes 1 / pieces of the mean.
    gyro, accel = settings.gyro_psd / pieces, settings.accel_psd / pieces
    expected = np.zeros((NAV, MEASURED))
    for tau in left:
        expected[6:9, 6:9] -= gyro * C
        expected[3:6, 6:9] -= gyro * tau * f_cross @ C
        expected[0:3, 6:9] -= gyro * tau**2 / 2 * f_cross @ C
        expected[3:6, 9:12] += accel * C
        expected[0:3, 9:12] += accel * tau * C
    for block in (slice(0, 3), slice(3, 6), slice(6, 9)):
        for channel in (slice(0, 6), slice(6, 9), slice(9, 12)):
            size = np.abs(expected[block, channel]).max()
            # The midpoint rule over the pieces: 1 / (8 pieces^2) of tau^2.
            np.testing.assert_allclose(M[block, channel], expected[block, channel], rtol=0, atol=1e-4 * size)
    np.testing.assert_array_equal(M[NAV:], 0.0)
    np.testing.assert_allclose(np.diag(R)[6:], [settings.gyro_psd / T] * 3 + [settings.accel_psd / T] * 3, rtol=1e-12)
