"""Noise that a calibration learns."""

from dataclasses import replace

from sdimu_calibration.core.estimation import noise_learning
from sdimu_calibration.core.noise_term import RANDOM_WALK, SHIFT, NoiseTerm


def test_noise_says_which_kinds_look_the_same(diagnosis, monkeypatch):
    """A random walk was taken for shifts in turns, and nothing said that it looks the same: it would be a misfit."""
    monkeypatch.setattr(noise_learning, "suspected", lambda _: True)
    fit = replace(diagnosis.extended)
    vars(fit)["wander"] = replace(fit.wander, learned=(NoiseTerm("accel", SHIFT, size=1e-9),))
    (term,) = noise_learning.noise_of(fit).terms
    assert RANDOM_WALK in term.alike
    assert not term.is_drawn
