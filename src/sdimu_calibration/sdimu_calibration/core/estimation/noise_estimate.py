"""What noise with a memory does to an estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.noise_term import WORDS, NoiseTerm
from sdimu_calibration.core.note import Note, Topic
from sdimu_calibration.core.units import from_si
from sdimu_calibration.core.wording import Work


@dataclass(frozen=True)
class NoiseEstimate:
    """Noise that was learned with the coefficients, and the coefficients in it."""

    terms: tuple[NoiseTerm, ...]
    deviation: Floats
    """Coefficients of the estimator less those in white noise (SI), shape (q,)."""
    covariance: Floats
    """Of the coefficients in this noise, shape (q, q)."""
    gain: float
    """Log-likelihood over that of white noise."""
    nis: float
    """Mean of the squared residuals, whitened with all noise; 1 is right."""
    held_out_rms: float
    """RMS of the normalised prediction errors at stops left out one at a time."""

    @property
    def note(self) -> Note:
        """What a user should know, with the terms and their sizes."""
        terms = "; ".join(term_in_words(term) for term in self.terms)
        told = (
            f"the noise is not white: {terms}; values and sigmas are those in this noise. A missing effect can look "
            "the same, and the sigmas are then too small"
        )
        return Note(told, end=f": run {Work.DIAGNOSE}")


def term_in_words(term: NoiseTerm) -> str:
    """Name a term with its size and the 95 % interval of it."""
    size, low, high = (f"{from_si(v, term.display_unit):.3g}" for v in (term.size, term.low, term.high))
    others = f" (or what looks the same: {', '.join(WORDS[kind] for kind in term.alike)})" if term.alike else ""
    return f"{term.words} {size} ({low} to {high}) {term.display_unit}{others}"


def not_of_sensors(terms: Sequence[NoiseTerm], recording: str = "") -> Note:
    """Say that the noise of a model is none of a sensor.

    Parameters
    ----------
    terms : sequence of NoiseTerm
        As `noise_term.unexplained` returns them.
    recording : str
        Whose noise it is, where there are several.
    """
    where = f" of {recording}" if recording else ""
    told = (
        f"the model does not fit{where}: it leaves {' and '.join(term.words for term in terms)}, which is no noise "
        "of a sensor: a cause that depends on attitude or rate is missing, or a bias does so"
    )
    return Note(told, Topic.MISFIT, f"; run: {Work.DIAGNOSE}")
