"""Tail probabilities of the normal, the chi-square and Student's distribution.

Functions of scipy.special, loaded when one is asked for: `scipy.stats` has the same behind a second of imports.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist

from sdimu_calibration.core.arrays import Floats

GAUSS_MAD = 1.482602218505602
"""Ratio of sigma to median absolute deviation (1): that of a Gaussian, 1 over the normal quantile of 3/4."""

_ROUNDING = 1e-9
"""Part of a percent (1) that counts as none: a product of floats may be below a whole number by rounding."""


def in_percent(p: float) -> str:
    """Write a probability for people: ``87 %``; beyond what two digits can say ``< 1 %`` and ``> 99 %``."""
    return "> 99 %" if p > 0.995 else "< 1 %" if p < 0.005 else f"{100.0 * p:.0f} %"


def in_percents(shares: Sequence[float]) -> list[str]:
    """Write probabilities of a list for people, so that what is written adds up as they do.

    Each is its number of whole percents or one more; the largest remainders get the one, until the sum is that of the
    list, rounded: .515 and .485 are 52 % and 48 %, not 49 %.
    """
    whole = [math.floor(100.0 * p + _ROUNDING) for p in shares]
    missing = round(100.0 * math.fsum(shares)) - sum(whole)
    by_remainder = sorted(range(len(whole)), key=lambda k: whole[k] - 100.0 * shares[k])
    for k in by_remainder[: max(missing, 0)]:
        whole[k] += 1
    limits = (in_percent(p) for p in shares)
    return [told if told[0] in "<>" else f"{number} %" for told, number in zip(limits, whole, strict=True)]


def normal_tail(z: float) -> float:
    """Probability that a standard normal variable exceeds `z`."""
    return 0.5 * math.erfc(z / math.sqrt(2.0))


def normal_limit(p: float) -> float:
    """Give the number that a standard normal variable exceeds with probability `p`."""
    return -NormalDist().inv_cdf(p)


def chi2_tail(x: float, dof: float) -> float:
    """Probability that chi-square with `dof` degrees of freedom exceeds `x`."""
    from scipy.special import chdtrc  # noqa: PLC0415 (0.2 s that a calibration does not need)

    return float(chdtrc(dof, x))


def chi2_head(x: float, dof: float) -> float:
    """Probability that chi-square with `dof` degrees of freedom stays below `x`."""
    from scipy.special import chdtr  # noqa: PLC0415

    return float(chdtr(dof, x))


def chi2_limit(p: float, dof: float) -> float:
    """Give the number that chi-square with `dof` degrees of freedom exceeds with probability `p`."""
    from scipy.special import chdtri  # noqa: PLC0415

    return float(chdtri(dof, p))


def squares_tail(x: float, weights: Floats) -> float:
    """Probability that a weighted sum of squares of standard normal variables exceeds `x`.

    That of a chi-square with the same first three moments: exact for equal weights. Source: E. S. Pearson, in
    J. P. Imhof, "Computing the distribution of quadratic forms in normal variables", Biometrika 48 (1961), section 4.

    Parameters
    ----------
    x : float
        In the unit of the weights.
    weights : ndarray, shape (n,)
        Eigenvalues of the covariance, where the variables are correlated.
    """
    first, second, third = (float((weights**k).sum()) for k in (1, 2, 3))
    dof = second**3 / third**2
    return chi2_tail(dof + (x - first) * math.sqrt(dof / second), dof)


def student_tail(t: float, dof: float) -> float:
    """Probability that Student's t with `dof` degrees of freedom exceeds `t`."""
    from scipy.special import stdtr  # noqa: PLC0415

    return float(stdtr(dof, -t))


def student_limit(p: float, dof: float) -> float:
    """Give the number that Student's t with `dof` degrees of freedom exceeds with probability `p`."""
    from scipy.special import stdtrit  # noqa: PLC0415

    return -float(stdtrit(dof, p))
