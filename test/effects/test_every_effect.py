"""Every registered effect: what it says of itself, its regressors against a simulated sensor, its way to the filter.

The simulator's sensor is written from exact geometry and from formulas of its own (sdimu_sim.core); only names are
shared. A wrong sign cannot cancel.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

import sdimu_calibration.core.effects  # noqa: F401  (fills the registry)
from rate_table_sim.core.specification import TableSpecification
from sdimu_calibration.core.alignment.prepared import first_attitude, reduce, set_up
from sdimu_calibration.core.effect_key import sized
from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.filter.filter_pass import NAV, PassState, new_output, run_pass
from sdimu_calibration.core.filter.pass_setup import pass_settings
from sdimu_calibration.core.filter.passes import begun, linearise, run_linearised
from sdimu_calibration.core.measurement_kind import HELD_ALL, SKIP
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.rotation import rotation_vector
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.core.units import parse_unit, to_si
from sdimu_calibration.storage.files.effect_file import find_effects
from sdimu_sim.core.hidden import effect_names, parse_effects
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_sim.core.temperature import TemperatureProfile
from sdimu_sim.own_effects import simulated_effects

GRADES = ("navigation", "tactical", "mems")
EFFECTS = registry.names()
SITE = Site(latitude_rad=np.radians(36.4), height_m=80.0)
IMU = ImuSpecification(
    "navigation grade",
    gyro_white_noise=to_si(0.1, "deg/h/sqrt(Hz)"),
    accel_white_noise=to_si(10, "ug/sqrt(Hz)"),
    prior={"gyro_bias": to_si(1, "deg/h"), "accel_bias": to_si(100, "ug")},
)
TEMPERATURE = TemperatureProfile(rise=80.0, tau_s=600.0)

# A general attitude, then turns of both signs about every axis, slow enough for cycles of a tenth of a second; they
# last whole seconds, because the core knows rest from motion by epochs of a second.
PLAN = Plan(
    "every effect",
    (12.0, *[4.0] * 6),
    (
        Turn("X", 1.2, 0.2),
        Turn("Z", -0.8, 0.2),
        Turn("Y", 1.5, 0.25),
        Turn("X", -1.0, 0.2),
        Turn("Z", 1.4, 0.2),
        Turn("Y", -0.8, 0.2),
    ),
    0.5,
)
STEP_AT, TURN = 27.0, 2
"""Onset of the steps (s), and the turn in which data are lost."""


def of(name):
    """The effect, with what is fixed in it set to values that mean something in a test of two minutes."""
    effect = registry.get(name)
    values = {
        "tau": 40.0,
        "t0": STEP_AT,
        "span": 80.0,
        "turn": TURN,
        "at": 23.0,
        "r": to_si(0.3, "g"),
        "threshold": to_si(5.0, "degC/min"),
    }
    if effect.with_options is None:
        return effect
    return effect.with_options(**{key: values[key] for key in effect.options})


def simulated(**truth):
    scenario = Scenario(
        PLAN,
        replace(IMU, gyro_white_noise=0.0, accel_white_noise=0.0),
        truth.pop("site", SITE),
        TableSpecification(axes=None),
        mount_rad=(0.8, -0.5, 1.7),
        coefficients=truth.pop("coefficients", {}),
        temperature=TEMPERATURE,
        **truth,
    )
    return generate(scenario)[0]


class Prepared(NamedTuple):
    """A perfect sensor's test, reduced once for all effects."""

    recording: object
    prepared: object


@pytest.fixture(scope="module")
def perfect():
    recording = simulated()
    none = Model(("gyro_bias",))
    return Prepared(recording, reduce(recording, set_up(SITE, IMU, none)))


def passed(perfect, effect):
    """Pass over the perfect test with this effect alone, about zero and one attitude: no shift from stop to stop."""
    setup = set_up(SITE, IMU, Model((effect,)))
    start = first_attitude(perfect.prepared.epochs, perfect.prepared.phases, setup)
    none = np.zeros(len(setup.sensors.prior))
    at = linearise(perfect.prepared, setup, start.C_nb, none)
    at = replace(at, data=at.data._replace(shift=np.full_like(at.data.shift, -1)))
    return run_linearised(at, setup, begun(at, setup, start)), setup


# -- what an effect says of itself ------------------------------------------------------------------------------------


def test_names_of_parameters_are_unique():
    names = [p.name for effect in EFFECTS for p in registry.get(effect).parameters]
    assert len(names) == len(set(names))
    assert len(EFFECTS) >= 7


@pytest.mark.parametrize("name", EFFECTS)
def test_units_are_readable_si_and_the_displayed_one_has_their_dimension(name):
    for parameter in registry.get(name).parameters:
        si, shown = parse_unit(parameter.unit), parse_unit(parameter.display_unit)
        assert si.dimension == shown.dimension, parameter
        # K and degC, rad, s, m and 1 are their own SI; "per g" stays per g.
        assert si.factor == 1.0, parameter


@pytest.mark.parametrize("name", EFFECTS)
def test_every_grade_has_a_prior_and_coarser_grades_are_not_better(name):
    prior = registry.get(name).prior
    sizes = [prior[grade] for grade in GRADES]
    assert all(size > 0 for size in sizes)
    assert sizes == sorted(sizes)


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_explains_itself_and_knows_only_registered_lookalikes(name):
    effect = registry.get(name)
    assert effect.title
    assert "=" in effect.equation
    assert set(effect.confused_with) <= set(EFFECTS)
    assert name not in effect.confused_with


@pytest.mark.parametrize("name", EFFECTS)
def test_every_parameter_acts_on_some_sensor_and_every_term_has_its_parameter(name):
    effect = registry.get(name)
    assert {t.parameter for t in effect.terms} == set(range(len(effect.parameters)))
    assert {t.channel for t in effect.terms} <= set(range(6))


# -- its regressors against the simulated sensor -----------------------------------------------------------------------


def with_errors(effect, sizes):
    """Simulate the sensor with sizes (SI) of the parameters of an effect, by the keys that the estimator gives them."""
    named = zip(effect.labels, effect.parameters, sizes, strict=True)
    return simulated(effects=tuple(sized(label, size, p.display_unit) for label, p, size in named))


@pytest.mark.parametrize("name", EFFECTS)
def test_what_can_be_estimated_can_be_simulated_by_the_same_key(name):
    effect = of(name)
    for parameter, label in zip(effect.parameters, effect.labels, strict=True):
        assert parameter.name in effect_names()
        assert resolve(label).parameters == (parameter,)
        hidden = parse_effects([sized(label, 1e-3, parameter.display_unit)])
        assert (dict(hidden.sizes) | dict(hidden.coefficients)) == {parameter.name: pytest.approx(1e-3)}


NOT_OF_THE_MEAN = {
    # Derivatives of the motion: a cycle of 0.1 s and its neighbours smooth the ramps of the rate.
    "gyro_acceleration_sensitivity": 0.2,
    "gyro_delay": 0.2,
    "accel_delay": 0.02,
    "accel_triad_delay": 0.02,
    "accel_size": 0.2,
    "lever_arm": 0.2,
    **{name: 0.05 for name in EFFECTS if "_temperature_rate" in name or "_temperature_hysteresis" in name},
    # Switches: they change inside a cycle, and are softened where noise decides.
    "gyro_dead_band": 0.1,
    "gyro_hysteresis": 0.1,
    "accel_hysteresis": 0.1,
    "gyro_bias_in_motion": 0.1,
    "accel_bias_in_motion": 0.1,
    "accel_bias_asymmetry": 0.05,
    # Powers and kinks: the mean over a cycle of a ramp is not that of its mean.
    "gyro_scale_cubic": 0.01,
    "gyro_scale_quadratic": 0.01,
    "gyro_scale_asymmetry": 0.01,
    "gyro_anisoinertia": 0.01,
    "gyro_misalignment_asymmetry": 0.01,
    # Play is a kink where the sweep turns about; settled ones begin at the end of the turn, within a cycle.
    "accel_play": 0.01,
    "accel_creep": 0.1,
    "gyro_creep": 0.1,
    # The next order is L^2/(4 w^2), and up to a tenth for L^2 = 1.5 deg^2/h^2.
    "gyro_lock_in": 0.1,
    # The full rate of the turn is the median over it, in a rate that a mount of a radian spreads over three axes.
    "gyro_lost_data": 0.01,
    # Second order of up to 7.5 mrad of latitude.
    "reference_latitude": 4e-3,
}
"""Share of the signal that regressors may miss because they are functions of a cycle's mean motion. For all others the
second order of the coefficients and of half a cycle, 2e-3. A wrong sign or axis misses 100 %."""

NOT_NEGATIVE = {"gyro_delay", "accel_delay", "accel_triad_delay", "gyro_dead_band", "gyro_lock_in"}


@pytest.mark.parametrize("name", EFFECTS)
def test_regressors_are_the_derivative_of_the_simulated_sensor(name, perfect):
    effect = of(name)
    rng = np.random.default_rng(len(name))
    sizes = rng.uniform(0.5, 1.5, len(effect.parameters)) * effect.prior["navigation"]
    if name not in NOT_NEGATIVE:
        sizes *= rng.choice([-1.0, 1.0], len(effect.parameters))
    compare(perfect, effect, sizes, with_errors(effect, sizes), NOT_OF_THE_MEAN.get(name, 2e-3))


def compare(perfect, effect, sizes, recording, allowed):
    """Hold the errors that the regressors predict to those of a simulated recording, cycle by cycle."""
    np.testing.assert_array_equal(recording.t, perfect.recording.t)
    dt = np.diff(recording.t, prepend=0.0)[:, None]
    cycles = perfect.prepared.cycles
    ends = np.searchsorted(recording.t, cycles.t + 1e-6)

    def per_cycle(error):
        total = np.vstack([np.zeros(3), np.cumsum(error * dt, axis=0)])
        return np.diff(total[np.concatenate([[0], ends])], axis=0) / cycles.dt[:, None]

    measured = np.hstack(
        [
            per_cycle(recording.omega_ib_b - perfect.recording.omega_ib_b),
            per_cycle(recording.f_ib_b - perfect.recording.f_ib_b),
        ]
    )
    found, setup = passed(perfect, effect)
    predicted = setup.sensors.errors(found.data.values, sizes)
    for channel in sorted({t.channel for t in effect.terms}):
        size = np.linalg.norm(measured[:, channel])
        assert size > 0.0, channel
        assert np.linalg.norm(predicted[:, channel] - measured[:, channel]) < allowed * size, channel
    silent = sorted(set(range(6)) - {t.channel for t in effect.terms})
    assert np.abs(measured[:, silent]).max(initial=0.0) <= 1e-3 * np.abs(measured).max()


OWN = """\
format: sdimu-effect/1
name: cross_talk
expressions:
  gyro_x: k * ax * ey * exp(-t / tau) + 3 * q * wx
  accel_z: b * T * (nx + dz)
  gyro_y: -2 * k * ay * tanh(fz / f0) * dx
parameters:
  k: {unit: deg/h/g, prior: 1 deg/h/g}
  b: {unit: ug/K, prior: 20 ug/K}
  q: {unit: ppm, prior: 50 ppm}
constants: {tau: 60 s, f0: 3 m/s^2}
"""


@pytest.mark.parametrize("parameter", ["k", "b", "q"])
def test_an_effect_file_is_simulated_as_it_is_estimated(parameter, perfect, tmp_path):
    (tmp_path / "own.yaml").write_text(OWN)
    (effect,) = find_effects(f"{tmp_path}/own.yaml:{parameter}")
    size = effect.prior["navigation"]
    effects = simulated_effects([sized(f"{tmp_path}/own.yaml:{parameter}", size, effect.parameters[0].display_unit)])
    assert dict(parse_effects(effects).sizes) == {f"cross_talk_{parameter}": pytest.approx(size)}
    assert str(tmp_path) not in "".join(effects)
    compare(perfect, effect, np.array([size]), simulated(effects=effects), 4e-3)


@pytest.mark.parametrize(
    "label", ["gyro_x: ey^2", "accel_y: ax wtz", "gyro_z: T", "accel_x: ax^2 ay", "gyro_y: sin(2 pi t / 31 s + 40 deg)"]
)
def test_an_equation_is_simulated_by_the_label_by_which_it_is_added(label, perfect):
    (effect,) = find_effects(label)
    size = effect.prior["navigation"]
    recording = simulated(effects=(sized(effect.key, size, effect.parameters[0].display_unit),))
    compare(perfect, effect, np.array([size]), recording, 0.02)


def test_data_lost_in_a_turn_take_the_angle_of_that_turn_that_the_simulator_loses(perfect):
    # Spread over the turn here, lost at a moment there: the same angle, to the step of the simulator's samples.
    effect, tau = registry.get("gyro_lost_data").with_options(turn=1, at=15.0), 0.05
    recording = simulated(effects=(f"gyro_lost_data(turn=1)={1e3 * tau} ms",))
    dt = np.diff(recording.t, prepend=0.0)[:, None]
    angle = np.sum((recording.omega_ib_b - perfect.recording.omega_ib_b) * dt, axis=0)
    found, setup = passed(perfect, effect)
    predicted = setup.sensors.errors(found.data.values, np.array([tau]))[:, :3]
    expected = np.sum(predicted * perfect.prepared.cycles.dt[:, None], axis=0)
    # The turn is driven a little faster than planned, so that it lasts whole seconds.
    assert 0.2 * tau < np.linalg.norm(angle) < 0.25 * tau
    np.testing.assert_allclose(expected, angle, atol=1e-2 * np.linalg.norm(angle))


# -- its way through navigation and filter -----------------------------------------------------------------------------


NOTHING = (1e-5, 1e-6, 2e-8)
"""What nobody can measure in two minutes (m, m/s, rad) of the effect of a coefficient of usual size."""
NOTHING_MEASURED = (1e-5, 1e-6, 2e-12, 2e-7)
"""The same of position, velocity, rate (rad/s) and force (m/s^2)."""


def run_with(found, settings, kind, coefficients):
    """Free run with these coefficients in the compensation: measurements z and the last navigation state."""
    state = PassState(*(v.copy() for v in found.start))
    state.used[:] = coefficients
    out = new_output(len(kind), len(coefficients), False, 1)
    run_pass(found.data._replace(kind=kind), settings, state, out)
    return out.innovation, state


def predicted_chain(found, kind):
    """Last navigation errors and all z per unit of each deviation, from Phi, G and H; the largest errors on the way."""
    out = found.output
    p = out.G.shape[2]
    N, rows, largest = np.zeros((NAV, p)), [], np.zeros((NAV, p))
    for e in range(len(kind)):
        N = out.Phi[e] @ N + out.G[e]
        largest = np.maximum(largest, np.abs(N))
        if kind[e] != SKIP:
            rows.append(out.H[e][:, :NAV] @ N + out.H[e][:, NAV : NAV + p])
    return N, np.array(rows), largest


@pytest.mark.parametrize("name", EFFECTS)
def test_filter_matrices_are_the_derivative_of_compensation_and_navigation(name, perfect):
    """Change each coefficient in the compensation, navigate freely, and compare with Phi, G and H."""
    effect = of(name)
    found, setup = passed(perfect, effect)
    settings = pass_settings(setup)
    settings = settings._replace(decay_rate=np.zeros_like(settings.decay_rate), drive=np.zeros_like(settings.drive))
    kind = np.where(perfect.prepared.phases.used, HELD_ALL, SKIP).astype(np.int64)
    free = replace(found, output=new_output(len(kind), len(setup.sensors.prior), True, 1))
    state = PassState(*(v.copy() for v in found.start))
    run_pass(found.data._replace(kind=kind), settings, state, free.output)
    N, Z, largest = predicted_chain(free, kind)
    measured = kind != SKIP
    r_n, r_e, cos = 6.36e6, 6.38e6, np.cos(SITE.latitude_rad)
    for j in range(len(setup.sensors.prior)):
        step = np.zeros(len(setup.sensors.prior))
        step[j] = effect.prior["navigation"]
        (z_up, up), (z_down, down) = (run_with(found, settings, kind, s * step) for s in (1.0, -1.0))
        # A coefficient put into the compensation is taken out of the sensor: the deviation goes the other way.
        dz = -(z_up - z_down)[measured] / (2 * step[j])
        moved = down.position - up.position
        nav = np.concatenate(
            [moved * [r_n, r_e * cos, -1.0], down.velocity - up.velocity, -rotation_vector(down.C_nb @ up.C_nb.T)]
        ) / (2 * step[j])
        for k, rows in enumerate((slice(0, 3), slice(3, 6), slice(6, 9))):
            atol = 5e-3 * largest[rows, j].max() + NOTHING[k] / step[j]
            np.testing.assert_allclose(nav[rows], N[rows, j], rtol=0, atol=atol, err_msg=f"{rows}")
        for k, rows in enumerate((slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12))):
            atol = 5e-3 * np.abs(Z[:, rows, j]).max() + NOTHING_MEASURED[k] / step[j]
            np.testing.assert_allclose(dz[:, rows], Z[:, rows, j], rtol=0, atol=atol, err_msg=f"{rows}")
        assert np.abs(Z[:, :, j]).max() > 0.0
