"""What a set tells of its window: functions of all recordings and of each, and noise that no sensor has by itself."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from sdimu_calibration.core.joint.set_found import SetSearch, following
from sdimu_calibration.core.joint.set_noise import SetNoise
from sdimu_calibration.core.noise_term import ATTITUDE, FLICKER, RANDOM_WALK, SHIFT, STOP, NoiseTerm
from sdimu_calibration.core.posterior.noise_models import NoiseModel

SENSORS = ("gyro_z", "accel_x")


def noise(first=(), second=(), common=(0, 0), own=((0, 0), (0, 0))):
    """Noise of two recordings by their terms, and places of the sizes of functions."""
    return SetNoise((*first, *second), (), (), (NoiseModel(tuple(first)), NoiseModel(tuple(second))), common, own)


def found(*noises):
    """A search whose window has these noises with these probabilities."""

    class Window:
        def __init__(self):
            self.noises = noises

        def of_any_noise(self, holds):
            return sum(p for one, p in self.noises if holds(one))

    reports = (SimpleNamespace(name="r0"), SimpleNamespace(name="r1"))
    search = object.__new__(SetSearch)
    search.__dict__.update(
        posterior=Window(), after=SimpleNamespace(function=SimpleNamespace(sensors=SENSORS), reports=reports)
    )
    return search


def test_functions_have_the_probability_of_the_noises_that_hold_them():
    search = found(
        (noise(common=(0, 3)), 0.2),
        (noise(own=((0, 4), (0, 0))), 0.3),
        (noise(common=(2, 0), own=((0, 4), (0, 1))), 0.4),
        (noise(), 0.1),
    )
    told = [(one.recording, pytest.approx(one.probability), one.sensors) for one in search.functions]
    assert told == [("", 0.6, ("gyro_z",)), ("r0", 0.7, ("accel_x",)), ("r1", 0.4, ("accel_x",))]
    assert search.any_function == pytest.approx(0.9)
    assert [one.recording for one in search.told_functions] == ["", "r0"]


def test_where_it_is_open_whose_a_function_is_the_likeliest_is_told():
    apart = ((noise(common=(0, 3)), 0.3), (noise(own=((0, 0), (0, 4))), 0.4), (noise(), 0.3))
    assert [one.recording for one in found(*apart).told_functions] == ["r1"]
    assert found((noise(common=(0, 3)), 0.4), (noise(), 0.6)).told_functions == ()


def test_sensors_that_may_follow_the_attitude_are_those_of_the_noise_of_any_recording():
    here = NoiseTerm("accel", ATTITUDE, size=1.0, axes=(0, 2))
    search = found((noise(second=(here,)), 0.06), (noise(first=(NoiseTerm("gyro", ATTITUDE),)), 0.04), (noise(), 0.9))
    assert following(search.posterior, 0.05) == ("accel_x", "accel_z")
    assert following(search.posterior, 0.5) == ()


def test_noise_is_drawn_where_its_kinds_together_are_nearly_certain_and_what_wanders_is_not():
    stop, shift = (NoiseTerm("gyro", kind, size=1.0) for kind in (STOP, SHIFT))
    wander = NoiseTerm("accel", FLICKER, size=1.0)
    search = found((noise(first=(stop, wander)), 0.5), (noise(first=(shift, wander)), 0.46), (noise(), 0.04))
    assert search.drawn_in(0) == (stop,)
    assert search.drawn_in(1) == ()
    # A random walk that looks the same has its share of the probability.
    walk = NoiseTerm("gyro", RANDOM_WALK, size=1.0)
    assert found((noise(first=(shift,)), 0.6), (noise(first=(walk,)), 0.4)).drawn_in(0) == ()
