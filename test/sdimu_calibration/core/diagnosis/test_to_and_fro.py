"""A search whose steps undo each other ends, with the likeliest of what it went through."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest

from sdimu_calibration.core.diagnosis import noise_search


@dataclass
class _Choices:
    """A ground of three effects of which the second is worth most."""

    worth: dict[int, float] = field(default_factory=lambda: {0: 1.0, 1: 3.0, 2: 2.0})
    evidence = SimpleNamespace(names=("a", "b", "c"))

    def net(self, state):
        return sum(self.worth[c] for c in state.chosen)


def _state(*chosen):
    return noise_search._State(chosen, SimpleNamespace(terms=()))


@pytest.fixture
def undoing(monkeypatch):
    """Growing adds the next of three effects, pruning leaves it alone in the place of what was there."""
    calls = []

    def grown(ground, state):
        calls.append(state.chosen)
        assert len(calls) < 1000, "the search does not end"
        return ground, _state(*state.chosen, (state.chosen[-1] + 1) % 3)

    monkeypatch.setattr(noise_search, "_grown", grown)
    monkeypatch.setattr(noise_search, "_pruned", lambda _ground, state: _state(*state.chosen[-1:]))


@pytest.mark.usefixtures("undoing")
def test_steps_that_undo_each_other_end_with_the_likeliest_choice():
    _, settled, stood = noise_search._settled(_Choices(), _state(0))
    assert not stood
    assert settled.chosen == (1,)
