"""Passes over what came so far of a running test, each about where the one before ended.

What the filter on the way took in early it took in about coefficients and an azimuth that it did not know yet. A pass
over everything about the present estimate has samples that are corrected exactly, and leaves the square of what the
estimate has moved by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sdimu_calibration.core.alignment.alignment import Alignment
from sdimu_calibration.core.alignment.coarse_alignment import StartPoint
from sdimu_calibration.core.alignment.prepared import PreparedData
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.filter.filter_pass import COPY, NAV, PassState, new_output, run_pass
from sdimu_calibration.core.filter.pass_loop import SETTLED, furthest_move
from sdimu_calibration.core.filter.pass_setup import check_finite, firm_setup, loosened, pass_settings
from sdimu_calibration.core.filter.passes import begun, linearise
from sdimu_calibration.core.live_model import LiveModel
from sdimu_calibration.core.rotation import rotation_matrix

_NEAR = 0.1
"""Movement of a coefficient (sigma) from one pass to the next at which no other is made: it leaves its square."""
_MOST = 4
"""Number of passes (1) at a time at most: where more are wanted, the next are due when the test has grown."""


@dataclass(frozen=True)
class SoFar:
    """What passes over everything so far have found."""

    reference: Floats
    """Coefficients (SI) at which the samples of the last pass were corrected, shape (q,)."""
    C_start: Floats
    """Initial attitude about which it was linearised, b to n (dimensionless), shape (3, 3)."""
    state: PassState
    """At its end, for a filter that feeds back: coefficients count from `reference`."""
    loose: bool
    """Position and velocity had to be let go."""
    passes: int
    """How many there were."""


def passes_so_far(
    model: LiveModel, prepared: PreparedData, alignment: Alignment, begin: StartPoint, loose: bool
) -> SoFar:
    """Make passes until nothing moves.

    Parameters
    ----------
    alignment : Alignment
        Mean and sigma of the initial attitude.
    begin : StartPoint
        Initial attitude and coefficients about which the first pass is linearised.
    loose : bool
        Begin without position and velocity, as `until_nothing_moves` does from a coarse start.
    """
    wide, firm = loosened(model.setup), firm_setup(model.setup)
    C_nb, reference, constant = begin.C_nb, begin.coefficients * model.constant, model.constant
    for count in range(1, _MOST + 1):
        setup = wide if loose else firm
        at = linearise(prepared, setup, C_nb, reference)
        state = begun(at, setup, alignment)
        settings = pass_settings(setup, model.averaged)
        run_pass(at.data, settings, state, new_output(len(at.data.first), len(reference), False, len(at.data.first)))
        check_finite(state)
        found = SoFar(reference, at.C_start, state, loose, count)
        rows = np.flatnonzero(constant)
        moved = furthest_move(state.x[NAV + rows], state.P[np.ix_(NAV + rows, NAV + rows)])
        if not loose and moved < _NEAR:
            break
        loose = loose and moved >= SETTLED
        C_nb = np.asarray(rotation_matrix(state.x[-COPY:].copy()) @ at.C_start)
        reference = (reference + state.x[NAV:-COPY]) * constant
    return found
