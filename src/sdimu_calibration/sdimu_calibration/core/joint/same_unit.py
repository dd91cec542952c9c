"""Are the recordings of a set those of one unit? Scale factors, misalignments and the like stay with a unit.

Two units differ in them by what the IMU file states, s of each coefficient (more where a recording widened it); one
unit by a fraction of it from recording to recording. With d the difference of a recording from the others and v the
variance of d by the noise, the log odds that it is another unit are

    sum of log N(d; 0, v + 2 s^2) - log N(d; 0, v + 2 (share s)^2)

One unit whose axes were exchanged differs so, too. Read in the right one of the 23 other orders and senses of its axes
it is the same unit. That it is turned has, against that it is one unit as it is, the log odds from above less those of
the scale factors and misalignments as read, less log 23.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.data.axes_and_units import ROTATIONS, axes_in_words
from sdimu_calibration.core.effects.body_frame import TRIAD_NAMES, read_in_axes
from sdimu_calibration.core.effects.registry import get, names
from sdimu_calibration.core.joint.joint_prior import prior_weight
from sdimu_calibration.core.joint.member import Report
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.wording import Option, Work

SHARE = 0.3
"""What one unit differs by from recording to recording at most (share of the size that the IMU file gives): three times
the repeatability of data sheets, which is a tenth and less."""
_ODDS = 7.0
"""Log odds (1) from which a recording is refused: a thousand to one."""
_NAMED = 3.0
"""Log odds (1) against another unit from which turned axes are named: twenty to one."""
_TOLD = -5.0
"""Log odds (1) above which the data do not tell that it is one unit: of 90 clean sets with three stops in each
recording one is above it, of 85 with turned axes all are. Chosen by these sets; longer recordings are far from it."""
_APART_K = 10.0
"""Difference of mean temperatures (K) from which nothing is said: a coefficient then changes as from unit to unit."""


def check_one_unit(reports: Sequence[Report]) -> str:
    """Refuse a recording whose coefficients are those of another unit; biases, which are new each time, do not count.

    Parameters
    ----------
    reports : sequence of Report
        Of the recordings' own fits. A heading that stays open, or a prior that was widened, makes a fit no place about
        which a set is linear; its coefficients and sigmas are good enough here.

    Returns
    -------
    str
        Which recording may be of another unit, or have other axes, as far as the data tell; empty where they tell that
        it is not so.
    """
    own = [r for r in reports if len(r.values)]
    heat = [r.temperature_degc for r in own if r.has_temperature]
    if len(own) < 2 or (heat and max(heat) - min(heat) > _APART_K):
        return ""
    odds = [_log_odds(r, [o for o in own if o is not r]) for r in own]
    worst = int(np.argmax([total for total, _, _ in odds]))
    total, name, told = odds[worst]
    strange, others = own[worst], [o for o in own if o is not own[worst]]
    axes, turned = _turned_axes(strange, others)
    most = max(total, total + turned)
    if most <= _ODDS:
        return _open_words(strange, others) if most > _TOLD else ""
    whose = "the others" if len(others) > 1 else f"'{others[0].name}'"
    if turned > _NAMED:
        raise DataError(
            f"the axes of '{strange.name}' are turned against {whose}: its x, y, z are {axes_in_words(axes)} of "
            f"{whose}; correct the driver, or import the data with the same axes (columns and sign in a map of "
            f"{Work.IMPORT})"
        )
    which = f"'{strange.name}' is" if len(own) > 2 else " and ".join(f"'{r.name}'" for r in own) + " are"
    other = "another unit than the others" if len(own) > 2 else "two units"
    raise DataError(
        f"{which} of {other}, or the axes are mapped otherwise: coefficients differ as those of two units do, most "
        f"{name}, by {told}; calibrate each by itself, or state an {Option.IMU} that allows such a difference"
    )


def _open_words(strange: Report, others: Sequence[Report]) -> str:
    """Say that the data do not tell one unit, and what would."""
    whose = "the others are" if len(others) > 1 else f"'{others[0].name}' is"
    return (
        f"the data do not tell whether '{strange.name}' is of the unit that {whose} of, in the same axes: too few of "
        "its coefficients are known in all recordings, or two units of this IMU file may be as alike; look at its "
        "wiring and mount, or record it with turns about other axes"
    )


def _turned_axes(report: Report, others: Sequence[Report]) -> tuple[Floats, float]:
    """Find how the axes of a recording are turned, if they are: in which axes it is most like the others.

    Returns
    -------
    axes : ndarray, shape (3, 3)
        Signed permutation; its rows pick the axes of the others.
    odds : float
        Log odds (1) that it is turned against that it is of another unit; minus infinity where a recording lacks
        coefficients that turn, or nothing is more like the others than the axes as they are.
    """
    as_given = np.eye(3)
    if not all(set(TRIAD_NAMES) <= set(r.names) for r in (report, *others)):
        return as_given, -np.inf
    same = [_read_in(other, as_given) for other in others]
    odds = [_log_odds(_read_in(report, axes), same)[0] for axes in ROTATIONS]
    best = ROTATIONS[int(np.argmin(odds))]
    return best, -np.inf if np.array_equal(best, as_given) else -min(odds) - float(np.log(len(ROTATIONS) - 1))


def _read_in(report: Report, axes: Floats) -> Report:
    """Return what a report says of scale factors and misalignments, read in other axes."""
    places = [report.names.index(name) for name in TRIAD_NAMES]
    values, sigma = read_in_axes(TRIAD_NAMES, report.values[places], report.sigma[places], axes)
    return replace(report, names=TRIAD_NAMES, values=values, sigma=sigma)


def _log_odds(report: Report, others: Sequence[Report]) -> tuple[float, str, str]:
    """Log odds that a recording is of another unit than others; the coefficient that says most, and its difference."""
    every = (report, *others)
    held = tuple(dict.fromkeys(name for r in every for name in r.reduction.names))
    # What widened a prior in one recording may be an error of its fit: there nothing so wide tells units apart.
    spread = dict(zip(held, prior_weight(every, held).tolist(), strict=True))
    # What a grade may have says little of how its units differ: many have nothing of it, and then agree in it.
    effects = [e for e in map(get, names()) if e.scope == "unit" and (e.family or e.name) in report.imu.prior]
    stable = {p.name: p.display_unit for e in effects for p in e.parameters}
    total, most, name, told = 0.0, -np.inf, "", ""
    for place, coefficient in enumerate(report.names):
        known = [(o.values[i], o.sigma[i]) for o in others for i in _places(o, coefficient) if o.sigma[i] > 0.0]
        weight = spread.get(coefficient, 0.0)
        if coefficient not in stable or not known or weight <= 0.0 or report.sigma[place] <= 0.0:
            continue
        values, sigma = np.array(known).T
        mean, variance = np.average(values, weights=sigma**-2), 1.0 / np.sum(sigma**-2)
        d, v = float(report.values[place] - mean), float(report.sigma[place] ** 2 + variance)
        one, two = v + 2.0 * SHARE**2 / weight, v + 2.0 / weight
        odds = 0.5 * d * d * (1.0 / one - 1.0 / two) - 0.5 * float(np.log(two / one))
        total += odds
        if odds > most:
            most, name = odds, coefficient
            unit = stable[coefficient]
            told = f"{abs(from_si(d, unit)):.3g} {unit} ({abs(d) / np.sqrt(v):.0f} sigma)"
    return total, name, told


def _places(report: Report, name: str) -> list[int]:
    return [report.names.index(name)] if name in report.names else []
