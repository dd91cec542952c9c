"""Passes end where nothing moves, and not before position and velocity are taken in."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from sdimu_calibration.core.alignment.coarse_alignment import StartPoint
from sdimu_calibration.core.filter.filter_pass import COPY, NAV, PassState
from sdimu_calibration.core.filter.pass_loop import CONVERGED, Ending, FinishedPass, until_nothing_moves

TRUTH = np.array([3.0, -40.0])
"""Coefficients (1) to be found; their sigmas are 1."""
AT_ONCE = Ending(most=20, settled=1.0, most_loose=20, least=1, near=0.0)


@dataclass(frozen=True)
class Step(FinishedPass):
    """A pass from `begin` that leaves a share of the error."""

    begin: Any

    @property
    def about(self):
        return self.begin


def step(at: StartPoint, left: float) -> Step:
    size = NAV + len(TRUTH) + COPY
    x = np.zeros(size)
    x[NAV : NAV + len(TRUTH)] = (1.0 - left) * (TRUTH - at.coefficients)
    state = PassState(x, np.eye(size), at.C_nb, np.zeros(3), np.zeros(3), np.zeros(len(TRUTH)))
    return Step(at.C_nb, state, state, None, None, at.coefficients)  # type: ignore[arg-type]


def passes(ending: Ending, loose: bool, left: float = 0.5, begin=(0.0, 0.0)):
    seen: list[bool] = []

    def run(at: StartPoint, before: Step | None, free: bool) -> Step:
        assert (before is None) == (not seen)
        seen.append(free)
        return step(at, left)

    at = StartPoint(np.eye(3), np.array(begin))
    return *until_nothing_moves(run, at, loose, ending, lambda *_: None), seen


def test_each_pass_goes_on_where_the_one_before_ended():
    last, count, converged, _ = passes(AT_ONCE, loose=False)
    # Of 40 a pass takes half of what is left: the first movement below .02 is the eleventh, 40 / 2^11.
    assert (count, converged) == (11, True)
    assert np.abs(last.estimate - TRUTH).max() == pytest.approx(40.0 / 2**11)


def test_passes_do_not_end_without_position_and_velocity():
    _, count, converged, seen = passes(AT_ONCE, loose=True, left=0.0)
    # The first pass is at the truth, and moves by 40; the second does not move, and settles; the third may end.
    assert seen == [True, True, False]
    assert (count, converged) == (3, True)


@pytest.mark.parametrize(("near", "converged"), [(0.0, False), (0.5, True)])
def test_passes_that_run_out_converged_where_they_were_near(near: float, converged: bool):
    # Each pass takes three quarters of what is left: the fourth still moves by 30 / 4^3 = .47.
    last, count, found, _ = passes(Ending(4, 1.0, 4, 1, near), loose=False, left=0.25)
    moved = 30.0 / 4**3
    assert CONVERGED < moved < 0.5
    assert (count, found) == (4, converged)
    assert last.state.x[NAV + 1] == pytest.approx(-moved)


def test_position_and_velocity_are_taken_in_after_some_passes_whatever_moves():
    *_, seen = passes(Ending(5, 0.0, 2, 1, 0.0), loose=True, left=0.9)
    assert seen == [True, True, True, False, False]


@pytest.mark.parametrize("least", [1, 2, 3])
def test_passes_with_position_and_velocity_are_as_many_as_asked_at_least(least: int):
    _, count, converged, _ = passes(Ending(20, 1.0, 20, least, 0.0), loose=False, begin=TRUTH)
    assert (count, converged) == (least, True)
