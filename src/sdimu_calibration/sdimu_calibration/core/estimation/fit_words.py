"""Sentences about a fit by navigation: the noise in which a figure is right, and the priors that its model states."""

from __future__ import annotations

from sdimu_calibration.core.fit_statistics import FitStatistics
from sdimu_calibration.core.specification import Model

MISFIT = 1.2
"""NIS per degree of freedom, and held-out error (sigma), from which a user is warned: 1 is right, and chance stays
within a few per cent of it."""
_FAST = 3.0
"""NIS per degree of freedom (1) in learned noise from which sigmas are too small: in flicker errors are 1.0 of them at
2, 1.2 at 4.5 and 3.8 at 12 (twelve tests of a FOG)."""


def in_noise_in_words(statistics: FitStatistics) -> str:
    """Say what the figures are in learned noise, where any was, with what is not in that noise; else nothing."""
    nis, held_out = statistics.nis_in_noise, statistics.held_out_in_noise
    if nis is None or held_out is None:
        return ""
    if max(nis, held_out) <= MISFIT:
        return (
            f"; noise that was learned in place of what is missing takes them to {nis:.3f} and {held_out:.3f}, and "
            "mends no coefficient"
        )
    fast = ": noise that moves within seconds is not in it" if nis > MISFIT else ""
    small = ", so the sigmas are too small" if nis > _FAST else ""
    return f"; noise that was learned takes them to {nis:.3f} and {held_out:.3f}, where 1 is right, too{fast}{small}"


def stated_priors(model: Model) -> tuple[str, ...]:
    """Say which coefficients are fixed, and which have a prior of their own."""
    fixed = ", ".join(one.name for one in model.priors if one.sigma == 0.0)
    other = ", ".join(one.name for one in model.priors if one.sigma > 0.0)
    return said(
        fixed and f"fixed by the model, not estimated: {fixed}",
        other and f"with a prior that the model states: {other}",
    )


def said(*texts: str | None) -> tuple[str, ...]:
    """Keep what says something."""
    return tuple(text for text in texts if text)
