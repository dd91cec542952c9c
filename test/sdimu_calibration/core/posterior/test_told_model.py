"""What is told of a window: families whose members share their probability out, and nothing that is improbable."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.evidence.candidate import split
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.models import Data
from sdimu_calibration.core.posterior.noise_models import NoiseModel
from sdimu_calibration.core.posterior.posterior import Posterior, Weighed
from sdimu_calibration.core.posterior.prior import prior_of

KEYS = (
    "gyro_bias_warm_up_y(tau=600 s)",
    "gyro_bias_warm_up_y(tau=1200 s)",
    "gyro_bias_ramp_y",
    "accel_quadratic_x",
    "accel_quadratic_z",
)
SHORT, LONG, RAMP, QUADRATIC, OTHER = range(5)


def window(*models: tuple[tuple[int, ...], float], noises: tuple[NoiseModel, ...] = ()) -> Posterior:
    """Models and their probabilities, about data in which the slow changes of a bias look the same."""
    candidates = [split(resolve(key))[0] for key in KEYS]
    W = np.random.default_rng(3).standard_normal((40, len(KEYS)))
    W[:, LONG] = W[:, SHORT] + 0.01 * W[:, LONG]
    W[:, RAMP] = W[:, SHORT] + 0.02 * W[:, RAMP]
    e = 4.0 * W[:, SHORT] + 6.0 * W[:, QUADRATIC]
    prior = prior_of(candidates)
    board = SimpleNamespace(
        use=np.arange(len(KEYS)),
        evidence=SimpleNamespace(candidates=candidates, candidate=candidates.__getitem__, weight=()),
        prior=prior,
        finer=frozenset(),
        data=lambda _: (0.0, Data(W.T @ W, W.T @ e, prior)),
    )
    kinds = noises or (NoiseModel(),) * len(models)
    weighed = [Weighed(tuple((k, 0) for k in m), n, p) for (m, p), n in zip(models, kinds, strict=True)]
    return Posterior(board, tuple(weighed), tuple((one.noise, one.probability) for one in weighed))


def told(found: Posterior) -> set[str]:
    return {KEYS[number] for place, (number, _) in enumerate(found.told.members) if found.of_class(place) > 0.5}


def test_a_family_is_told_though_no_effect_is_likelier_than_each_of_its_members():
    found = window(((), 0.35), ((SHORT,), 0.25), ((LONG,), 0.2), ((RAMP,), 0.2))
    assert found.best.members == ()
    assert told(found) == {KEYS[SHORT]}
    assert found.of_class(0) == pytest.approx(0.65)


def test_a_family_is_told_beside_what_is_sure():
    found = window(((QUADRATIC,), 0.4), ((SHORT, QUADRATIC), 0.25), ((LONG, QUADRATIC), 0.2), ((RAMP, QUADRATIC), 0.15))
    assert told(found) == {KEYS[SHORT], KEYS[QUADRATIC]}


def test_nothing_is_told_that_is_less_than_probable():
    found = window(((), 0.55), ((SHORT,), 0.2), ((LONG,), 0.1), ((OTHER,), 0.15))
    assert told(found) == set()


def test_an_effect_beside_another_of_its_family_does_not_stand_in_its_place():
    # A warm-up is certain; in some models a ramp is present, too.
    found = window(((SHORT,), 0.7), ((SHORT, RAMP), 0.3))
    assert RAMP not in found._in_place_of((SHORT,))
    assert found._in_place_of((SHORT,)) == []


def test_two_that_stand_in_each_others_place_are_not_told_together():
    """Each is probable, and a model that holds both is not."""
    found = window(((QUADRATIC, SHORT), 0.48), ((OTHER, SHORT), 0.47), ((QUADRATIC, OTHER, SHORT), 0.05))
    assert told(found) == {KEYS[QUADRATIC], KEYS[SHORT]}


def test_what_is_probable_apart_from_each_other_is_told_together():
    both = ((QUADRATIC, SHORT), 0.3), ((QUADRATIC, LONG), 0.3)
    found = window(((QUADRATIC,), 0.35), *both, ((SHORT,), 0.05))
    assert told(found) == {KEYS[QUADRATIC], KEYS[SHORT]}


def test_a_family_is_as_sure_as_that_so_many_of_it_are_there():
    """That one slow change of a bias is certain makes a second one no surer."""
    drifts = window(((SHORT, RAMP), 0.7), ((SHORT,), 0.3))
    assert [drifts.of_family(place) for place in range(2)] == pytest.approx([0.7, 0.7])
    one = window(((SHORT, QUADRATIC), 0.7), ((RAMP, QUADRATIC), 0.3))
    assert [one.of_family(place) for place in range(2)] == pytest.approx([1.0, 1.0])


def test_the_next_search_begins_with_the_likeliest_model_in_each_noise():
    # Noise with a memory makes the effect unnecessary: about the next point that must be asked again.
    walk = NoiseModel((NoiseTerm("gyro", "random_walk", size=1e-6),), (-1.0,))
    found = window(((SHORT,), 0.6), ((), 0.39), ((OTHER,), 0.01), noises=(NoiseModel(), walk, NoiseModel(())))
    assert found.starts() == [{KEYS[SHORT]: (0, False)}, {KEYS[SHORT]: (0, False)}, {}]


def test_what_models_hold_instead_is_of_the_class_though_it_fits_worse_in_the_noise_of_the_told_model():
    """The other effect is there beside a smaller noise: one of the two is certain, and which is open."""
    small = NoiseModel((NoiseTerm("gyro", "stop", size=1e-7),), (-1.0,))
    found = window(((QUADRATIC,), 0.6), ((OTHER,), 0.39), ((), 0.01), noises=(NoiseModel(), small, NoiseModel()))
    assert found.classes == ((OTHER,),)
    assert found.of_class(0) == pytest.approx(0.99)


def test_an_effect_that_has_nothing_to_do_with_another_is_not_told_in_its_place():
    apart = ((QUADRATIC,), 0.3), ((QUADRATIC, OTHER), 0.3), ((OTHER,), 0.2), ((), 0.2)
    assert window(*apart).classes == ((),)


def test_what_stands_for_two_effects_is_told_in_the_place_of_one():
    found = window(((QUADRATIC, SHORT), 0.45), ((OTHER,), 0.4), ((QUADRATIC,), 0.15))
    assert [number for number, _ in found.told.members] == [QUADRATIC, SHORT]
    assert found.classes == ((OTHER,), (LONG, RAMP))
    assert found.of_class(0) == pytest.approx(1.0)
    assert told(found) == {KEYS[QUADRATIC]}


def test_what_few_models_hold_in_the_place_of_a_class_is_not_told():
    found = window(((QUADRATIC,), 0.9), ((OTHER,), 0.04), ((), 0.06))
    assert found.classes == ((),)
    assert window(((QUADRATIC,), 0.97), ((OTHER,), 0.03)).classes == ((),)
