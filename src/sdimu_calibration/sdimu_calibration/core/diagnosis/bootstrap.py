"""How often does the whole search err? Repeat it on draws of pure noise.

Under a right model the whitened innovations are standard normal, whatever the test: a draw of them in place of the
recorded ones goes through scan, search and free-input remainder as the recording did.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import looked_at
from sdimu_calibration.core.diagnosis.free_input_test import free_input_test
from sdimu_calibration.core.diagnosis.search import search
from sdimu_calibration.core.evidence.information import Information
from sdimu_calibration.core.progress import Progress


@dataclass(frozen=True)
class Null:
    """What pure noise does."""

    draws: int
    false_finds: int
    """Draws in which the search told an effect as found."""
    largest: Floats
    """Largest ``|z|`` of the first scan of each draw (1), shape (draws,)."""
    threshold: float
    """Of the search in the recording (1)."""
    rms_z: float
    """Of the first scans of all draws; 1 when the scores are calibrated."""
    free_input_p: Floats
    """Shape (draws,). p-value of the free-input test of each draw, with nothing added; spread evenly over 0 to 1 when
    calibrated."""

    @property
    def sentence(self) -> str:
        """The result in words."""
        high = float(np.quantile(self.largest, 0.95))
        return (
            f"of {self.draws} draws of pure noise {self.false_finds} gave a find; rms z {self.rms_z:.3f}; 95 % of the "
            f"largest scores are below {high:.2f} (threshold used {self.threshold:.2f})"
        )


def bootstrap(d: Diagnosis, draws: int, seed: int = 1, progress: Progress | None = None) -> Null:
    """Repeat the search of a diagnosis on noise.

    Parameters
    ----------
    d : Diagnosis
        Its evidence says how effects and noise show in the test; its residuals are not used.
    draws : int
        How many times the search is repeated.
    progress : callable, optional
        Called with a word and the fraction done.
    """
    columns = looked_at(d)
    evidence = d.evidence
    rng = np.random.default_rng(seed)
    finds, largest, squares, tails = 0, [], [], []
    J = evidence.information.J
    for k in range(draws):
        if progress:
            progress("bootstrap", k / draws)
        e = rng.standard_normal(len(evidence.e))
        if evidence.noise is not None:
            e = e + evidence.noise.times(rng.standard_normal((evidence.noise.parts.shape[1],)))
        known = Information(J, evidence.W.T @ evidence.weighed(e[:, None])[:, 0])
        part = replace(evidence, e=e, shift=np.zeros(len(evidence.weight)), worked_out=known)
        found = search(part, columns, limit=d.found.threshold)
        finds += int(len(found.chosen) > 0)
        z = found.first.z[np.isfinite(found.first.sigma)]
        largest.append(float(np.max(np.abs(z), initial=0.0)))
        squares.append(float(np.mean(z**2)))
        tails.append(free_input_test(part.information, evidence.model, evidence.weight, d.free).p_value)
    return Null(draws, finds, np.array(largest), d.found.threshold, float(np.sqrt(np.mean(squares))), np.array(tails))
