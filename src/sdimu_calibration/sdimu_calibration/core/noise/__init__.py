"""Noise of an IMU at rest: static stretches, Allan deviation, noise terms. SI units.

A package of its own so that a change here compiles none of the loops of the estimator again.
"""

from sdimu_calibration.core.noise.allan import Allan, allan
from sdimu_calibration.core.noise.rests import rests
from sdimu_calibration.core.noise.terms import TERMS, Terms, fit_terms
from sdimu_calibration.core.noise.white import WhiteNoise, white_noise, with_measured_noise

__all__ = ["TERMS", "Allan", "Terms", "WhiteNoise", "allan", "fit_terms", "rests", "white_noise", "with_measured_noise"]
