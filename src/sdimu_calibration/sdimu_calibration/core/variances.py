"""What estimates of variances share: where a falling function crosses zero, and where a likelihood has fallen.

A sum of squares over their variances falls with what is added to these: where it is as large as its degrees of freedom,
or as a quantile of chi-square, a variance or a bound of it is found.
"""

from __future__ import annotations

from collections.abc import Callable

FALL = 1.92
"""Fall of the log-likelihood (1) at the bounds of a 95 % interval: half of chi-square with one degree of freedom."""
_STEPS = 200
"""Number of steps at most: a third of them are halvings, of which rounding leaves fifty to a range of ten to one."""
_DOUBLINGS = 1100
"""Number of doublings at most (1): a larger value is no number of a computer."""


def crossing(excess: Callable[[float], float], scale: float, tolerance: float = 1e-12) -> float:
    """Find where a falling function of a value from 0 on crosses zero; 0 where it begins below.

    Regula falsi, an end that stays weighed by half (M. Dowell, P. Jarratt, "A modified regula falsi method", BIT 11,
    1971); each third step halves the range, so that no shape of the function keeps it wide.

    Parameters
    ----------
    excess : callable
        It ends below zero.
    scale : float
        A value above 0 to begin with, in the unit of the values.
    tolerance : float
        Share of the value by which it may be too large (1).

    Raises
    ------
    ArithmeticError
        If the function does not end below zero, or is not a number.
    """
    low, above = 0.0, excess(0.0)
    if above <= 0.0:
        return 0.0
    high, below = scale, excess(scale)
    for _ in range(_DOUBLINGS):
        if not below > 0.0:
            break
        low, above, high = high, below, 2.0 * high
        below = excess(high)
    if not below <= 0.0:
        raise ArithmeticError(f"the function is {below:.3g} at {high:.3g} and should be below zero")
    stayed = 0
    for step in range(_STEPS):
        if high - low <= tolerance * high:
            break
        middle = high - below * (high - low) / (below - above)
        if step % 3 == 2 or not low < middle < high:
            middle = 0.5 * (low + high)
        value = excess(middle)
        if value > 0.0:
            low, above = middle, value
            below *= 0.5 if stayed > 0 else 1.0
            stayed = 1
        else:
            high, below = middle, value
            above *= 0.5 if stayed < 0 else 1.0
            stayed = -1
    return high
