"""Noise that a calibration learns."""

from dataclasses import replace

from sdimu_calibration.core.estimation import noise_learning
from sdimu_calibration.core.noise_term import RANDOM_WALK, SHIFT, STOP, TURN, NoiseTerm, unexplained
from sdimu_calibration.core.note import Note, Topic


def test_noise_says_which_kinds_look_the_same(diagnosis, monkeypatch):
    """A random walk was taken for shifts in turns, and nothing said that it looks the same: it would be a misfit."""
    monkeypatch.setattr(noise_learning, "suspected", lambda _: True)
    fit = replace(diagnosis.extended)
    vars(fit)["wander"] = replace(fit.wander, learned=(NoiseTerm("accel", SHIFT, size=1e-9),))
    (term,) = noise_learning.noise_of(fit)
    assert RANDOM_WALK in term.alike
    assert not term.is_drawn


def test_of_gyros_in_turns_nothing_follows_where_stamps_jitter():
    """A stamp that is late turns the IMU by its rate: a driver of 20 Hz with 4 ms of jitter was "not to be trusted"."""
    in_turns, forces, at_stops = NoiseTerm("gyro", TURN), NoiseTerm("accel", TURN), NoiseTerm("gyro", STOP)
    terms = (in_turns, forces, at_stops)
    assert unexplained(terms) == terms
    assert unexplained(terms, (), [Note("samples are taken as even", Topic.JITTER)]) == (forces, at_stops)
    assert unexplained(terms, ["spike"]) == ()
