"""What the population says of the next unit before it is measured: one sigma of every effect."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sdimu_calibration.core.fleet.population import Population


def population_priors(people: Population, effect_of: Mapping[str, str]) -> dict[str, float]:
    """Give the size of each effect in a unit that nobody has measured.

    An IMU file has one sigma about zero for all coefficients of an effect: the root mean square over them of mean,
    spread and error of the mean.

    `effect_of`: effect of each coefficient. Gives one sigma (SI) by effect, in the order of the coefficients.
    """
    squares: dict[str, list[float]] = {}
    for one in people.coefficients:
        square = one.between.mean**2 + one.between.spread**2 + one.between.mean_sigma**2
        squares.setdefault(effect_of[one.name], []).append(square)
    return {effect: math.sqrt(sum(all_of) / len(all_of)) for effect, all_of in squares.items()}
