"""How well a fit describes its data, as its estimator knows it: what it does not know is missing, not zero."""

from __future__ import annotations

from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class FitStatistics:
    """Statistics of a fit."""

    log_likelihood: float
    """In the noise that was learned, where any was."""
    nis_mean: float
    nis_dof: float
    """`nis_mean`, `nis_dof`: mean of the squared normalised innovations in white noise (1), and their number."""
    passes: float
    """Number of passes or steps."""
    nis_in_noise: float | None = None
    held_out_in_noise: float | None = None
    """`nis_in_noise`, `held_out_in_noise`: mean of the squared residuals (1), and RMS of the normalised prediction
    errors at stops left out one by one (1), in noise with a memory; None where none was learned."""
    held_out_rms: float | None = None
    """RMS of the normalised prediction errors where the fit has not seen the data (1); None where nobody asked, or
    nothing can be held out."""

    def judged(self, may_be_an_effect: bool) -> tuple[float, float | None]:
        """Return the NIS and the held-out error (1) that judge the fit.

        They are those in the noise that was learned. Those in white noise judge where this noise may be a missing
        effect.

        `may_be_an_effect`: as `noise_term.may_be_an_effect` says of the noise that was learned.
        """
        if self.nis_in_noise is None or may_be_an_effect:
            return self.nis_mean, self.held_out_rms
        return self.nis_in_noise, self.held_out_in_noise

    def entries(self) -> dict[str, float | None]:
        """Give them as a result holds them; figures in noise that was not learned are left out."""
        return {k: v for k, v in asdict(self).items() if v is not None or not k.endswith("_in_noise")}
