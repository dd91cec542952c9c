"""Where a choice of a set has what, and what of a recording's noise stands beside functions of the attitude."""

from __future__ import annotations

from sdimu_calibration.core.joint.rival_noises import _without_functions
from sdimu_calibration.core.joint.set_noise import Layout, SetNoise
from sdimu_calibration.core.noise_term import ATTITUDE, FLICKER, NoiseTerm
from sdimu_calibration.core.posterior.noise_models import NoiseModel


def test_a_choice_has_noises_then_the_common_function_then_that_of_each():
    layout = Layout(3, 2)
    chosen = layout.choice((5, 6, 7), (1, 0), ((2, 3), (0, 0), (4, 0)))
    assert layout.noises(chosen) == (5, 6, 7)
    assert layout.common(chosen) == (1, 0)
    assert layout.own(chosen) == ((2, 3), (0, 0), (4, 0))
    bare = Layout(2, 0)
    assert bare.own(bare.choice((1, 2), (), ((), ()))) == ()


def test_a_function_of_one_recording_does_not_wander_and_counts_as_a_size_of_its_own():
    noise = SetNoise((), (), (0, 0, 0, 4), (NoiseModel(), NoiseModel()), (0,), ((0,), (4,)))
    assert not noise.wanders_alone
    assert set(noise.sizes.values()) == {4}
    other = SetNoise((), (), (0, 0, 4, 0), (NoiseModel(), NoiseModel()), (0,), ((4,), (0,)))
    assert noise.key != other.key
    assert SetNoise((), (), (0, 0, 0, 0), (NoiseModel(), NoiseModel()), (0,), ((0,), (0,))).wanders_alone
    assert (noise.sizes_of(None), noise.sizes_of(1)) == ((0,), (4,))


def test_what_follows_the_attitude_in_a_sensor_with_functions_is_no_noise_besides():
    here, there = NoiseTerm("accel", ATTITUDE, axes=(0, 1)), NoiseTerm("gyro", ATTITUDE, axes=(2,))
    noise = NoiseModel((NoiseTerm("gyro", FLICKER), here, there), (1.0, 2.0, 3.0))
    assert _without_functions(noise, ("accel_x",)) == NoiseModel((noise.terms[0], there), (1.0, 3.0))
    assert _without_functions(noise, ()) == noise
