"""What an effect says of itself agrees with its regressors, and its key reads back to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import sdimu_calibration.core.effects  # noqa: F401  (fills the registry)
from sdimu_calibration.core.compensation.reads import any_motion, reads
from sdimu_calibration.core.diagnosis.candidates import catalogue
from sdimu_calibration.core.effects import body_frame, registry
from sdimu_calibration.core.effects.effect import Excitation, Timetable
from sdimu_calibration.core.effects.selection import resolve

EFFECTS = registry.names()
TIMES = Timetable(900.0, ((0, 0.0, 100.0), (1, 150.0, 250.0)), ((0, 100.0, 150.0),))


@pytest.mark.parametrize("name", EFFECTS)
def test_the_key_of_every_variant_that_a_diagnosis_tries_reads_back_to_it(name):
    effect = registry.get(name)
    motion = any_motion(np.random.default_rng(2))
    for variant in effect.scan(TIMES) if effect.scan else (effect,):
        for key in (variant.key, *variant.labels, variant.only(tuple(p.name for p in variant.parameters[:2])).key):
            found = resolve(key)
            assert found.key == key
            assert found.options == variant.options
            kept = variant.only(tuple(p.name for p in found.parameters))
            np.testing.assert_array_equal(found.regressors(motion), kept.regressors(motion))


@pytest.mark.parametrize("name", EFFECTS)
def test_functions_of_time_ask_for_the_same_attitude_early_and_late(name):
    effect = registry.get(name)
    over_time = bool(reads(effect) & {"t", "temperature", "temperature_rate"}) and effect.scope != "recording"
    assert (Excitation.REPEATED_ATTITUDES in effect.excitation) == over_time


@pytest.mark.parametrize("name", EFFECTS)
def test_a_drift_of_a_bias_is_a_function_of_time_alone(name):
    effect = registry.get(name)
    assert effect.bias_drift == (reads(effect) == {"t"})


@pytest.mark.parametrize("name", EFFECTS)
def test_what_a_wander_imitates_depends_on_the_motion_before(name):
    effect = registry.get(name)
    assert not effect.wander_like or reads(effect) & {"since_turn", "past", "wound"}
    assert effect.wander_like or not reads(effect) & {"since_turn", "wound"}


@pytest.mark.parametrize("name", [n for n in EFFECTS if Excitation.BOTH_SENSES in registry.get(n).excitation])
def test_an_effect_that_needs_both_senses_is_even_in_the_rate(name):
    effect = registry.get(name)
    there = any_motion(np.random.default_rng(2))
    back = replace(there, w=-there.w, w_table=-there.w_table, alpha=-there.alpha)
    assert reads(effect) & {"w", "rest"}
    np.testing.assert_allclose(effect.regressors(back), effect.regressors(there), rtol=1e-12)


@pytest.mark.parametrize("name", [n for n in EFFECTS if Excitation.OBLIQUE_STOPS in registry.get(n).excitation])
def test_an_effect_that_needs_oblique_stops_is_bias_and_scale_or_nothing_at_cardinal_ones(name):
    effect = registry.get(name)
    motion = any_motion(np.random.default_rng(2))
    cardinal = np.concatenate([9.80665 * s * np.eye(3) for s in (1.0, -1.0)])
    part = replace(motion, f=cardinal[np.arange(len(motion.t)) % 6], w=0.0 * motion.w, w_table=0.0 * motion.w)
    values = effect.regressors(part)[:6]
    affine = np.column_stack([np.ones(6), cardinal, np.abs(cardinal)])
    left = values - affine @ np.linalg.lstsq(affine, values, rcond=None)[0]
    np.testing.assert_allclose(left, 0.0, atol=1e-9 * max(1.0, np.abs(values).max()))


def test_a_diagnosis_of_one_recording_does_not_try_what_only_a_set_tells_apart():
    alone = {e.name for e in catalogue(TIMES, set(), has_temperature=True)}
    together = {e.name for e in catalogue(TIMES, set(), has_temperature=True, of_a_set=True)}
    of_sets = {name for name in EFFECTS if registry.get(name).tried_in == "set"}
    assert together - alone == of_sets
    assert not {e.name for e in catalogue(TIMES, set(), has_temperature=False, of_a_set=True)} & of_sets
    # Seven effects of the baseline: both misalignments in first power, all in second and third; four of hysteresis.
    assert len(of_sets) == 2 + 7 + 7 + 4
    assert all(registry.get(name).needs == "temperature" for name in of_sets)


@pytest.mark.parametrize("name", [n for n in EFFECTS if n.endswith(("_temperature_squared", "_temperature_cubed"))])
def test_powers_of_the_temperature_are_products_of_the_linear_effect(name):
    effect = registry.get(name)
    linear = registry.get(name.rpartition("_")[0])
    motion = any_motion(np.random.default_rng(2))
    times = 1 if name.endswith("_squared") else 2
    expected = linear.regressors(motion) * motion.temperature[:, None] ** times
    np.testing.assert_allclose(effect.regressors(motion), expected, rtol=1e-12)
    assert [t.channel for t in effect.terms] == [t.channel for t in linear.terms]


def test_the_gauge_is_what_a_turn_of_the_body_frame_changes_to_first_order():
    baseline = [e for e in map(registry.get, EFFECTS) if e.group == "The baseline"]
    names = [p.name for e in baseline for p in e.parameters]
    assert len(names) == 30
    moved = np.any(body_frame.frame_jacobian(names, body_frame.FRAMES[0]) != np.eye(30), axis=1)
    gauge = [e.gauge for e in baseline for _ in e.parameters]
    np.testing.assert_array_equal(moved, gauge)


@pytest.mark.parametrize("name", EFFECTS)
def test_what_holds_for_a_setup_or_a_recording_is_no_property_of_the_unit(name):
    effect = registry.get(name)
    # Site and mount are seen through attitude or acceleration, a fault of the data by the rate of the table, its cables
    # by the angle that it turned.
    if effect.scope in ("setup", "recording"):
        assert reads(effect) & {"C_nb", "w_table", "alpha", "wound"}
    if effect.never_seen:
        assert effect.scope == "setup"
