"""Passes end where nothing moves, and not before position and velocity are taken in."""

import numpy as np
import pytest

from sdimu_calibration.core.alignment.coarse_alignment import StartPoint
from sdimu_calibration.core.filter.filter_pass import COPY, NAV, PassState
from sdimu_calibration.core.filter.pass_loop import CONVERGED, MOST_PASSES, Pass, until_nothing_moves

TRUTH = np.array([3.0, -40.0])
"""Coefficients (1) to be found; their sigmas are 1."""


def step(at: StartPoint, left: float) -> Pass:
    """Make a pass that leaves a share of the error."""
    size = NAV + len(TRUTH) + COPY
    x = np.zeros(size)
    x[NAV : NAV + len(TRUTH)] = (1.0 - left) * (TRUTH - at.coefficients)
    state = PassState(x, np.eye(size), at.C_nb, np.zeros(3), np.zeros(3), np.zeros(len(TRUTH)))
    return Pass(at.coefficients, at.C_nb, state, state, None, None)  # type: ignore[arg-type]


def passes(loose: bool, left: float = 0.5, begin=(0.0, 0.0)):
    seen: list[bool] = []

    def run(at: StartPoint, free: bool) -> Pass:
        seen.append(free)
        return step(at, left)

    return *until_nothing_moves(run, StartPoint(np.eye(3), np.array(begin)), loose, lambda *_: None), seen


def test_each_pass_goes_on_where_the_one_before_ended():
    last, count, converged, _ = passes(loose=False)
    # Of 40 a pass takes half of what is left: the first movement below .02 is the eleventh, 40 / 2^11.
    assert (count, converged) == (11, True)
    assert np.abs(last.estimate - TRUTH).max() == pytest.approx(40.0 / 2**11)


def test_passes_do_not_end_without_position_and_velocity():
    _, count, converged, seen = passes(loose=True, left=0.0)
    # The first pass ends at the truth, and moves by 40; the second does not move, and settles; the third may end.
    assert seen == [True, True, False]
    assert (count, converged) == (3, True)


def test_passes_that_run_out_did_not_converge():
    # Each pass takes a tenth of what is left: the last one still moves by 4 * .9^29 = .19.
    last, count, found, seen = passes(loose=True, left=0.9)
    moved = 4.0 * 0.9 ** (MOST_PASSES - 1)
    assert CONVERGED < moved < 0.5
    assert (count, found) == (MOST_PASSES, False)
    assert last.state.x[NAV + 1] == pytest.approx(-moved)
    # Position and velocity are taken in at once: the first pass moved by 4, which is less than five sigmas.
    assert seen.index(False) == 1


def test_a_start_that_is_right_takes_one_pass():
    _, count, converged, _ = passes(loose=False, begin=TRUTH)
    assert (count, converged) == (1, True)
