"""The rounds of a search: when they end, when equations are looked for, when rows are whitened anew."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from sdimu_calibration.core.diagnosis import rounds
from sdimu_calibration.core.noise_term import NoiseTerm

COARSE, FINE, FINER = "coarse", "fine", "finer"


@dataclass(frozen=True)
class Found:
    """What a round found."""

    noise: tuple[NoiseTerm, ...] = ()
    stood: bool = True
    threshold: float = 1.0


@dataclass(frozen=True)
class Round:
    """A round of a script."""

    labels: tuple[str, ...]
    wants_equations: bool = False
    found: Found = field(default_factory=Found)
    fit: object = None

    @property
    def chosen(self):
        return [SimpleNamespace(label=one, family="own" if "=" in one else "") for one in self.labels]


@dataclass(frozen=True)
class Request:
    """A request of stretches by name."""

    wander: str = COARSE


@pytest.fixture
def play(monkeypatch):
    """Run the rounds of a script; give each with its stretches, whether with equations, and what came of it."""

    def ground(*_, tried=()):
        return SimpleNamespace(fit=None, tried=tuple(tried))

    def run(script, whitened=lambda _request, _done: None):
        told, left = [], iter(script)

        def run_round(request, _ground, own, _limits, _earlier):
            done = next(left)
            told.append((request.wander, own, done.labels))
            return done

        monkeypatch.setattr(rounds, "run_round", run_round)
        monkeypatch.setattr(rounds, "_whitened", whitened)
        monkeypatch.setattr(rounds, "_first_ground", ground)
        monkeypatch.setattr(rounds, "fresh_ground", lambda _r, _f, tried, _own: ground(tried=tried))
        monkeypatch.setattr(rounds, "next_ground", lambda _r, _b, _f, tried, *_: ground(tried=tried))
        monkeypatch.setattr(rounds, "extended", lambda *_: None)
        monkeypatch.setattr(rounds, "with_attitude_functions", lambda request, _found: request)
        monkeypatch.setattr(rounds, "with_steps", lambda found: found)
        monkeypatch.setattr(rounds, "in_every_noise", lambda found: found)
        monkeypatch.setattr(rounds, "_with_chosen", lambda *_: None)
        monkeypatch.setattr(rounds, "in_found_noise", lambda *_: None)
        request, done = rounds.searched(Request(), lambda *_: None)
        assert not list(left)
        return told, request, done

    return run


def test_rounds_go_on_until_the_choice_stands(play):
    told, request, done = play([Round(("a",)), Round(("a", "b")), Round(("a", "b"))])
    assert told == [(COARSE, False, ("a",)), (COARSE, False, ("a", "b")), (COARSE, False, ("a", "b"))]
    assert (request.wander, done.labels, done.found.stood) == (COARSE, ("a", "b"), True)


def test_a_choice_that_goes_to_and_fro_does_not_stand(play):
    script = [Round(("a",)), Round(("b",))] * (rounds.MOST_ROUNDS // 2)
    assert not play(script)[2].found.stood


def once(at):
    """Whiten once, at the round with these labels."""

    def whitened(request, done):
        return Request(FINE) if request.wander == COARSE and done.labels == at else None

    return whitened


def test_noise_of_the_first_round_that_moves_is_whitened_before_the_second(play):
    told, request, _ = play([Round(("a",)), Round(())], once(("a",)))
    assert told == [(COARSE, False, ("a",)), (FINE, False, ())]
    assert request.wander == FINE


def test_noise_beside_what_stands_is_looked_at_once_more(play):
    told, request, _ = play([Round(("a",)), Round(("a",)), Round(("b",)), Round(("b",))], second_time(("a",)))
    assert [stretches for stretches, _, _ in told] == [COARSE, COARSE, FINE, FINE]
    assert request.wander == FINE


def second_time(at):
    asked = []

    def whitened(request, done):
        asked.append(done.labels)
        return Request(FINE) if request.wander == COARSE and asked.count(at) == 2 else None

    return whitened


def test_rows_are_whitened_twice_at_most(play):
    finer = {COARSE: Request(FINE), FINE: Request(FINER), FINER: Request("never")}
    told, request, _ = play([Round(())] * 3, lambda request, _done: finer[request.wander])
    assert [stretches for stretches, _, _ in told] == [COARSE, FINE, FINER]
    assert request.wander == FINER


def test_equations_are_looked_for_again_in_whitened_rows(play):
    wants = Round(("a",), wants_equations=True)
    script = [wants, Round(("a",)), Round(("a",)), wants, Round(("x=1",)), Round(("x=1",))]
    told, _, done = play(script, second_time(("a",)))
    assert [(stretches, own) for stretches, own, _ in told[:3]] == [(COARSE, False), (COARSE, True), (COARSE, False)]
    assert [(stretches, own) for stretches, own, _ in told[3:]] == [(FINE, False), (FINE, True), (FINE, True)]
    assert done.labels == ("x=1",)


def test_beside_an_equation_that_stands_noise_is_looked_at_too(play):
    script = [Round((), wants_equations=True), Round(("x=1",)), Round(("x=1",)), Round(())]
    told, request, _ = play(script, once(("x=1",)))
    assert [stretches for stretches, _, _ in told] == [COARSE, COARSE, COARSE, FINE]
    assert request.wander == FINE
