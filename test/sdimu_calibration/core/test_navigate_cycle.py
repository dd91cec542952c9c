"""The mechanization left to itself: what a perfect IMU at rest must show, and the two periods of its errors."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from sdimu_calibration.core import earth
from sdimu_calibration.core.navigation.strapdown import CYCLE_S, navigate_cycle, velocity_increment
from sdimu_calibration.core.rotation import rotation_matrix, rotation_vector

HOUR = 3600.0


def at_rest(C_nb, lat, height, dt):
    """Rotation vector and velocity increment of a perfect IMU at rest: constant rate and force in the body."""
    alpha = C_nb.T @ earth.earth_rate(lat) * dt
    upsilon = C_nb.T @ np.array([0.0, 0.0, -earth.normal_gravity(lat, height)]) * dt
    return alpha, velocity_increment(alpha, upsilon, np.zeros(3))


def run(C_nb, velocity, position, phi, dv, dt, steps, hold_height=False):
    """Free inertial navigation; returns velocity and position after each step and the last attitude."""
    C, v, p = C_nb.copy(), np.array(velocity, dtype=float), np.array(position, dtype=float)
    height = p[2]
    vs, ps = np.empty((steps, 3)), np.empty((steps, 3))
    for k in range(steps):
        navigate_cycle(C, v, p, phi, dv, dt, earth.normal_gravity(p[0], p[2]))
        if hold_height:
            v[2], p[2] = 0.0, height
        vs[k], ps[k] = v, p
    return vs, ps, C


@pytest.mark.parametrize("lat_deg", [36.0, -60.0])
def test_a_perfect_imu_at_rest_stays_put_for_an_hour(lat_deg, general_attitude):
    lat, h = np.radians(lat_deg), 120.0
    position = np.array([lat, 0.5, h])
    phi, dv = at_rest(general_attitude, lat, h, CYCLE_S)
    vs, ps, C = run(general_attitude, np.zeros(3), position, phi, dv, CYCLE_S, int(HOUR / CYCLE_S))
    # The velocity update takes the turn of NED to first order; what it leaves out is an acceleration of at most
    # w^2 g dt^2 / 6 = 9e-11 m/s^2. It swings in the horizontal (2 a / ws^2), where Coriolis of the vertical channel's
    # growing speed adds as much again, and grows in the vertical channel.
    left_out = earth.RATE**2 * 9.83 * CYCLE_S**2 / 6.0
    schuler2 = 9.83 / 6.36e6
    horizontal = 2.0 * 2.0 * left_out / schuler2
    vertical = left_out / (2.0 * schuler2) * np.cosh(np.sqrt(2.0 * schuler2) * HOUR)
    north = (ps[:, 0] - lat) * 6.37e6
    east = (ps[:, 1] - 0.5) * 6.37e6 * np.cos(lat)
    assert np.abs(north).max() < horizontal < 1e-3
    assert np.abs(east).max() < horizontal
    assert np.abs(ps[:, 2] - h).max() < vertical < 0.02
    assert np.abs(vs[:, :2]).max() < horizontal * np.sqrt(schuler2)
    # Attitude: the place's own error turns NED by as much.
    assert np.linalg.norm(rotation_vector(C @ general_attitude.T)) < 2.0 * horizontal / 6.36e6


def test_what_rest_leaves_is_of_second_order_in_the_cycle(general_attitude):
    lat = np.radians(36.0)
    drift = []
    for dt in (40.0, 20.0, 10.0):
        phi, dv = at_rest(general_attitude, lat, 0.0, dt)
        _, ps, _ = run(general_attitude, np.zeros(3), [lat, 0.0, 0.0], phi, dv, dt, int(2400 / dt), hold_height=True)
        drift.append(np.linalg.norm(ps[-1, :2] - [lat, 0.0]))
    ratios = np.array(drift[:-1]) / drift[1:]
    assert (ratios > 3.5).all()


def amplitude_fit(t, y, basis):
    """Sum of squares left after fitting the columns of `basis` to `y`."""
    A = basis(t)
    left = y - A @ np.linalg.lstsq(A, y, rcond=None)[0]
    return float(left @ left)


def test_velocity_errors_swing_with_the_schuler_period(general_attitude):
    """84.4 min, and the plane of the swing turns like Foucault's pendulum."""
    lat, dt = np.radians(45.0), 10.0
    phi, dv = at_rest(general_attitude, lat, 0.0, dt)
    steps = int(6 * 84.4 * 60 / dt)
    still, _, _ = run(general_attitude, np.zeros(3), [lat, 0.0, 0.0], phi, dv, dt, steps, hold_height=True)
    start = np.array([0.1, 0.0, 0.0])
    moved, _, _ = run(general_attitude, start, [lat, 0.0, 0.0], phi, dv, dt, steps, hold_height=True)
    v = (moved - still)[:, :2]
    t = dt * np.arange(1, steps + 1)
    foucault = earth.RATE * np.sin(lat)

    def misfit(period):
        ws = 2 * np.pi / period

        def basis(t):
            swing = [f(ws * t) * g(foucault * t) for f in (np.cos, np.sin) for g in (np.cos, np.sin)]
            slow = [np.cos(earth.RATE * t), np.sin(earth.RATE * t), np.ones_like(t)]
            return np.column_stack(swing + slow)

        return amplitude_fit(t, v[:, 0], basis) + amplitude_fit(t, v[:, 1], basis)

    found = minimize_scalar(misfit, bounds=(80 * 60, 90 * 60), method="bounded", options={"xatol": 0.1})
    # North and east feel different radii (0.3 %), hence their own periods; the swing, fitted
    # with one, shows one between them but for the 24 h part.
    g = earth.normal_gravity(lat, 0.0)
    periods = [2 * np.pi * np.sqrt(r / g) for r in earth.radii(lat)]
    assert 0.999 * min(periods) < found.x < 1.001 * max(periods)
    assert found.x / 60 == pytest.approx(84.4, abs=0.15)
    # The swing is all of it: what the fit leaves is under 2 % of the 0.1 m/s.
    assert np.sqrt(found.fun / len(t)) < 0.002
    # In the northern hemisphere the plane turns clockwise: after a quarter of a Foucault turn north has become east.
    quarter = t > 0.9 * (np.pi / 2) / foucault
    quarter &= t < 1.1 * (np.pi / 2) / foucault
    assert np.ptp(v[quarter, 1]) > 3 * np.ptp(v[quarter, 0])


def test_an_azimuth_error_swings_with_the_sidereal_day(general_attitude):
    """The 24 h oscillation of Earth rate, under the Schuler swing."""
    lat, dt = np.radians(36.0), 20.0
    phi, dv = at_rest(general_attitude, lat, 0.0, dt)
    C = rotation_matrix(np.array([0.0, 0.0, 1e-4])) @ general_attitude
    steps = int(2 * 86400 / dt)
    still, there, _ = run(general_attitude, np.zeros(3), [lat, 0.0, 0.0], phi, dv, dt, steps, hold_height=True)
    _, moved, _ = run(C, np.zeros(3), [lat, 0.0, 0.0], phi, dv, dt, steps, hold_height=True)
    north = (moved - there)[:, 0] * 6.37e6
    t = dt * np.arange(1, steps + 1)
    ws = np.sqrt(earth.normal_gravity(lat, 0.0) / earth.radii(lat)[0])
    foucault = earth.RATE * np.sin(lat)

    def misfit(period):
        w = 2 * np.pi / period

        def basis(t):
            swing = [f(ws * t) * g(foucault * t) for f in (np.cos, np.sin) for g in (np.cos, np.sin)]
            return np.column_stack([np.cos(w * t), np.sin(w * t), np.ones_like(t), *swing])

        return amplitude_fit(t, north, basis)

    found = minimize_scalar(misfit, bounds=(20 * HOUR, 28 * HOUR), method="bounded", options={"xatol": 1.0})
    # 86164 s; the fit's model of the Schuler swing (one period for north and east) biases it by less than 1 %.
    assert found.x == pytest.approx(2 * np.pi / earth.RATE, rel=0.01)
    # Size: an azimuth error e shows a latitude error of e cos(lat) times Earth's radius, as the rotation of the Earth
    # about a polar axis that is off by that much.
    expected = 1e-4 * np.cos(lat) * 6.37e6
    assert np.ptp(north) / 2 == pytest.approx(expected, rel=0.15)
    # Without the error there is next to nothing: what the first order of the turn of NED leaves out.
    assert np.abs(still).max() < 2.0 * earth.RATE**2 * 9.83 * dt**2 / 6.0 / ws


def test_gravity_alone_makes_a_free_fall(general_attitude):
    """No specific force: the fall of a stone, with Coriolis pulling it east by w g t^3 cos(lat) / 3."""
    lat, dt, steps = np.radians(36.0), 0.01, 500
    phi = general_attitude.T @ earth.earth_rate(lat) * dt
    vs, ps, _ = run(general_attitude, np.zeros(3), [lat, 0.0, 1000.0], phi, np.zeros(3), dt, steps)
    t, g = dt * steps, earth.normal_gravity(lat, 1000.0)
    # Gravity grows by 3e-6 per metre on the way down; the trapezoid of the position is off by g dt^2 t... / 12.
    assert 1000.0 - ps[-1, 2] == pytest.approx(0.5 * g * t**2, rel=1e-4)
    east = ps[-1, 1] * (earth.radii(lat)[1] + 1000.0) * np.cos(lat)
    assert east == pytest.approx(earth.RATE * np.cos(lat) * g * t**3 / 3.0, rel=0.01)
    assert vs[-1, 2] == pytest.approx(g * t, rel=1e-4)
