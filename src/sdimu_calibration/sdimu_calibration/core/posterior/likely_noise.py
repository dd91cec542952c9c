"""The noise of a fit: the likeliest one beside no effect, by the posterior that a diagnosis weighs noise with."""

from __future__ import annotations

from dataclasses import replace

from sdimu_calibration.core.evidence.joint_information import Joint
from sdimu_calibration.core.evidence.learned_noise import NoiseInformation, kinds
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.evidence.noise_kernels import Stretches
from sdimu_calibration.core.evidence.stretch_length import MOVES, halved
from sdimu_calibration.core.evidence.wander import Wander
from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.noise_models import usual_sizes
from sdimu_calibration.core.posterior.noise_search import likeliest
from sdimu_calibration.core.specification import ImuSpecification


def likely_noise(information: NoiseInformation, cut: Stretches, imu: ImuSpecification) -> tuple[NoiseTerm, ...]:
    """Find the likeliest noise of a model with its sizes; none where white noise is likeliest.

    Parameters
    ----------
    information : NoiseInformation
        The coefficients are estimated along.
    imu : ImuSpecification
        Its grade and data sheet say what sizes are usual.
    """
    return likeliest(information, cut, usual_sizes(imu), kinds(cut)).terms


def wander_of(evidence: LinearEvidence) -> Wander:
    """Work out how wandering biases show in a test, in stretches short enough for the noise that it has.

    Parameters
    ----------
    evidence : LinearEvidence
        In white noise, with the model's columns first.
    """
    wander = Wander.of(evidence)
    if wander.moved.reshape(2, 3).mean(axis=1).max() < 1.0 + MOVES:
        return wander
    information = Joint.of(evidence, wander).on_wander(evidence.model, evidence.weight)
    terms = likely_noise(information, wander.cut, evidence.imu)
    return halved(evidence, replace(wander, learned=terms), terms)
