"""From a start to a converged calibration: passes until nothing moves, with wider priors where data contradict them.

Each pass is a Gauss-Newton step of the whole test, with the original prior.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.alignment.alignment import Alignment
from sdimu_calibration.core.alignment.coarse_alignment import StartPoint, coarse_start
from sdimu_calibration.core.alignment.prepared import PreparedData, TestSetup
from sdimu_calibration.core.arrays import Bools, Floats
from sdimu_calibration.core.effects.imu_model import ImuModel
from sdimu_calibration.core.filter.means_at_stops import means_at_stops
from sdimu_calibration.core.filter.pass_loop import Pass, until_nothing_moves
from sdimu_calibration.core.filter.pass_setup import firm_setup, loosened
from sdimu_calibration.core.filter.passes import one_pass
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.recording import DataError

_FITS = 1.1
"""NIS per degree of freedom (1) up to which a pass fits: above it linearisation may be the trouble."""
_ATTITUDE_PASSES = 3
"""Number of passes that let position and velocity go: each leaves the square of the attitude's error: of a degree
nothing."""


@dataclass(frozen=True)
class Solution:
    """Where passes ended."""

    setup: TestSetup
    """With priors as wide as the data ask for."""
    last: Pass
    passes: int
    """How many there were."""
    converged: bool
    """The coefficients stood still at the end."""


def solve(
    setup: TestSetup, prepared: PreparedData, start: Alignment, begin: StartPoint | None, progress: Progress
) -> Solution:
    """Repeat passes until the coefficients stand still; where they contradict their priors, with wider ones.

    Parameters
    ----------
    start : Alignment
        Mean and sigma of the initial attitude.
    begin : StartPoint or None
        Attitude and coefficients of the first linearisation; None finds them from all stops.
    """
    found = _passes(setup, prepared, start, begin, progress)
    for _ in range(MOST_WIDENINGS):
        # An estimate that does not stand still says nothing against a prior.
        wider = _with_room(found, prepared) if found.converged else None
        if wider is None:
            break
        begin = StartPoint(found.last.smoothed_start, found.last.estimate)
        again = _passes(replace(found.setup, sensors=wider), prepared, start, begin, progress)
        found = replace(again, passes=found.passes + again.passes)
    return found


def _passes(
    setup: TestSetup, prepared: PreparedData, start: Alignment, begin: StartPoint | None, progress: Progress
) -> Solution:
    """Make passes from `begin` or, where there is none or it leads nowhere, from what all stops say."""
    wide, firm = loosened(setup), firm_setup(setup)

    def run(at: StartPoint, loose: bool) -> Pass:
        return one_pass(prepared, wide if loose else firm, start, at.C_nb, at.coefficients)

    if begin is not None:
        try:
            found = Solution(setup, *until_nothing_moves(run, begin, False, progress))
        except DataError:
            pass
        else:
            if found.converged:
                return found
    return Solution(setup, *until_nothing_moves(run, coarse_start(prepared, setup, start), True, progress))


def _with_room(found: Solution, prepared: PreparedData) -> ImuModel | None:
    """Widen the priors of effects that are far beyond them and that they hold back; None where there are none.

    A prior is a statement about the class of the sensor; one that the model states of a coefficient is taken at its
    word. Where the data contradict a prior, the estimate lies between the two and is wrong, and the rest of the effect
    goes into the other coefficients. Misalignments keep their prior: nothing else holds their common part, the frame of
    the prior.
    """
    sensors, last = found.setup.sensors, found.last
    means = means_at_stops(last.output.innovation / last.output.innovation_sigma, prepared)[1]
    scatter = max(1.0, float(np.sqrt(np.nanmean(means**2))))
    gauge = np.array([e.gauge for e in sensors.effects for _ in e.parameters])
    held, data = held_back(sensors.weight, last.estimate, last.covariance, scatter)
    held &= ~gauge & ~sensors.restated
    return replace(sensors, prior=np.where(held, ROOM * np.abs(data), sensors.prior)) if held.any() else None


def held_back(weight: Floats, estimate: Floats, covariance: Floats, scatter: float = 1.0) -> tuple[Bools, Floats]:
    """Tell the coefficients whose data are far beyond their prior and that it holds back, and what the data say.

    The prior p and what the data say by themselves d differ by ``d / sqrt(sigma_d^2 + sigma_p^2)`` sigmas, which of an
    estimate x of variance v is ``x / (sigma_p sqrt(s))``, s = 1 - v / sigma_p^2 the share of the data: where they know
    less than the prior, the estimate stays near it however far they are. Below a share of `_LEAST_SHARE` its square
    over s stands in the place of s: the less the data know, the more it takes, up to the estimate itself.

    Parameters
    ----------
    weight : ndarray, shape (p,)
        Prior information (1/SI^2).
    estimate, covariance : ndarray, shapes (p,) and (p, p)
        SI.
    scatter : float
        Scatter of the data over that which the covariance knows (1): in noise with a memory, which the passes do not
        know, data of a weak coefficient are further off than white noise says.

    Returns
    -------
    held : ndarray of bool, shape (p,)
    data : ndarray, shape (p,)
        Each coefficient without its own prior (SI), the prior left in by as much as the data hardly know it.
    """
    size, variance = np.abs(estimate), np.diag(covariance)
    share = np.maximum(1.0 - weight * variance, _LEAST_SHARE**2)
    of_data = np.where(share > _LEAST_SHARE, share, _LEAST_SHARE**2 / share)
    # An estimate that is far beyond its prior is so in any noise.
    beyond = size * np.sqrt(weight) > _BEYOND * np.minimum(scatter * np.sqrt(of_data), 1.0)
    return beyond & (size * np.sqrt(variance) * weight > _PULL), estimate / of_data


_BEYOND = 3.0
"""Distance of the data from the prior (sigma of both) from which they contradict it: chance ends there."""
_LEAST_SHARE = 0.05
"""Share of the information on a coefficient (1) from which data speak by themselves: with less they know it to four
sigmas of its prior, so far off that a fit of one rest is not linear any more, and noise with a memory widens a prior a
thousandfold."""
_PULL = 0.1
"""Shift of an estimate by its prior (sigma of the estimate) from which the passes are repeated: less is not seen."""
ROOM = 10.0
"""New sigma of a contradicted prior, as a multiple of the estimate: so wide that the prior holds nothing back."""
MOST_WIDENINGS = 3
"""Number of times at most that priors are widened and the passes repeated: a widened prior holds nothing back, so a
next time is for coefficients that the first ones had hidden."""


def attitude_about(
    prepared: PreparedData, setup: TestSetup, start: Alignment, C_nb: Floats, reference: Floats
) -> Floats:
    """Find the initial attitude where the coefficients are given.

    The coarse azimuth of uncalibrated gyros may be wrong by a degree; position and velocity would pin a pass near
    it (`pass_loop.until_nothing_moves`).

    Parameters
    ----------
    C_nb : ndarray, shape (3, 3)
        Initial attitude to begin with, b to n (dimensionless).
    reference : ndarray, shape (p,)
        Coefficients (SI).

    Returns
    -------
    ndarray, shape (3, 3)
        `C_nb` itself where it fits.
    """
    if not _misfits(one_pass(prepared, setup, start, C_nb, reference)):
        return C_nb
    for _ in range(_ATTITUDE_PASSES):
        C_nb = one_pass(prepared, loosened(setup), start, C_nb, reference).smoothed_start
    return C_nb


def _misfits(done: Pass) -> bool:
    """Whether the innovations are so large that linearisation may be the trouble."""
    nis = done.output.nis
    return bool(np.nansum(nis) > _FITS * 3 * np.isfinite(nis).sum())
