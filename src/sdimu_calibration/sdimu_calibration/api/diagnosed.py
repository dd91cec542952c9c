"""What a diagnosis of one recording and of several have in common for scripts and notebooks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from html import escape
from typing import Any

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis
from sdimu_calibration.core.posterior.told import Probabilities
from sdimu_calibration.core.posterior.unknown import UnknownFunction
from sdimu_calibration.report.unknown_section import followed


class Diagnosed(ABC):
    """A diagnosis: verdict, sentence, probabilities, advice; ``repr`` is sentence and advice, as HTML in a notebook."""

    core: Diagnosis | SetDiagnosis
    """What it shows, in the words of the core."""

    @property
    def verdict(self) -> str:
        """The verdict in a word or two."""
        return self.core.verdict.value

    @property
    def sentence(self) -> str:
        """The verdict in one sentence: what is certain, what is likely, what is open."""
        return self.core.sentence

    @property
    def probabilities(self) -> Probabilities | None:
        """Probability of nothing missing, of each family of effects, of each kind of noise."""
        return self.core.probabilities

    @property
    @abstractmethod
    def advice(self) -> tuple[str, ...]:
        """What to do next, one sentence each."""

    @property
    @abstractmethod
    def unknown(self) -> tuple[UnknownFunction, ...]:
        """Errors that no effect explains and that follow something: mean and sigma by stretch, or at all stops."""

    def plot_unknown(self) -> tuple[Any, ...]:
        """Each error of `unknown` against what it follows, with its 95 % band (plotly figures)."""
        return tuple(followed(one).as_plotly() for one in self.unknown)

    def _told(self) -> list[str]:
        """Advice, one line each."""
        return [f"advice: {text}" for text in self.advice]

    def __repr__(self) -> str:
        """Sentence and advice."""
        return "\n".join([f"{self.verdict}: {self.sentence}", *self._told()])

    def _repr_html_(self) -> str:
        """Sentence and advice as HTML."""
        listed = "".join(f"<li>{escape(text)}</li>" for text in self._told())
        return f"<p><b>{escape(self.verdict)}.</b> {escape(self.sentence)}</p><ul>{listed}</ul>"
