"""States of a page: plain data, every step can be undone, nothing else is kept."""

from __future__ import annotations

import json

from sdimu_calibration.report.workbench.state import State, from_json


def test_undo_goes_back_through_every_step():
    steps = [State()]
    for step in (lambda s: s.add("a"), lambda s: s.add("b"), lambda s: s.hold((3, 1)), lambda s: s.drop("a")):
        steps.append(step(steps[-1]))
    state = steps[-1]
    assert (state.added, state.held) == (("b",), (1, 3))
    for before in reversed(steps[:-1]):
        state = state.undo()
        assert state == before
    assert state.undo() == state


def test_a_reload_of_the_page_loses_nothing():
    state = State().add("a").add("own: 1\nname: x").hold((4,)).look(8, 2)
    assert from_json(json.loads(json.dumps(state.as_json()))) == state


def test_what_is_no_state_is_a_fresh_page():
    assert from_json(None) == from_json("x") == State()


def test_steps_that_change_nothing_are_no_steps():
    state = State().add("a")
    assert state.add("a") is state
    assert state.drop("b") is state
    assert state.hold(()) is state
