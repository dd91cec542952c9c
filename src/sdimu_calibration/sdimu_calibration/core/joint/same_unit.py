"""Are the recordings of a set those of one unit? Scale factors, misalignments and the like stay with a unit.

Two units differ in them by what the IMU file allows, s of each coefficient; one unit by a fraction of it from recording
to recording. With d the difference of a recording from the others and v the variance of d by the noise, the log odds
that it is another unit are

    sum of log N(d; 0, v + 2 s^2) - log N(d; 0, v + 2 (share s)^2)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sdimu_calibration.core.effects.registry import get, names
from sdimu_calibration.core.joint.member import Report
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.wording import Option

SHARE = 0.3
"""What one unit differs by from recording to recording at most (share of the size that the IMU file gives): three times
the repeatability of data sheets, which is a tenth and less."""
_ODDS = 7.0
"""Log odds (1) from which a recording is refused as of another unit: a thousand to one."""
_APART_K = 10.0
"""Difference of mean temperatures (K) from which nothing is said: a coefficient then changes as from unit to unit."""


def check_one_unit(reports: Sequence[Report]) -> None:
    """Refuse a recording whose coefficients are those of another unit; biases, which are new each time, do not count.

    Parameters
    ----------
    reports : sequence of Report
        Of the recordings' own fits; those that do not stand alone are left out.
    """
    alone = [r for r in reports if r.stands_alone]
    heat = [r.temperature_degc for r in alone if r.has_temperature]
    if len(alone) < 2 or (heat and max(heat) - min(heat) > _APART_K):
        return
    odds = [_log_odds(r, [o for o in alone if o is not r]) for r in alone]
    worst = int(np.argmax([total for total, _, _ in odds]))
    total, name, told = odds[worst]
    if total > _ODDS:
        which = f"'{alone[worst].name}' is" if len(alone) > 2 else " and ".join(f"'{r.name}'" for r in alone) + " are"
        other = "another unit than the others" if len(alone) > 2 else "two units"
        raise DataError(
            f"{which} of {other}, or the axes are mapped otherwise: coefficients differ as those of two units do, most "
            f"{name}, by {told}; calibrate each by itself, or state an {Option.IMU} that allows such a difference"
        )


def _log_odds(report: Report, others: Sequence[Report]) -> tuple[float, str, str]:
    """Log odds that a recording is of another unit than others; the coefficient that says most, and its difference."""
    spread = dict(zip(report.reduction.names, report.reduction.weight.tolist(), strict=True))
    stable = {p.name: p.display_unit for e in map(get, names()) if e.scope == "unit" for p in e.parameters}
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
