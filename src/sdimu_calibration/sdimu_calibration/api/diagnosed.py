"""What a diagnosis of one recording and of several have in common for scripts and notebooks."""

from __future__ import annotations

from abc import ABC, abstractmethod
from html import escape
from typing import TYPE_CHECKING

from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis
from sdimu_calibration.core.posterior.told import MemberShare, Probabilities
from sdimu_calibration.core.posterior.unknown import UnknownFunction
from sdimu_calibration.core.units import from_si
from sdimu_calibration.extras import needed
from sdimu_calibration.report.unknown_section import followed

if TYPE_CHECKING:
    import pandas as pd
    from plotly.graph_objects import Figure as Live


def _size(member: MemberShare) -> tuple[float, float]:
    """Size and sigma in the customary unit."""
    return from_si(member.value, member.display_unit), from_si(member.sigma, member.display_unit)


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

    def to_dataframe(self) -> pd.DataFrame:
        """Effects that may be missing as a table, the likeliest first: family, probability, size if it is this one.

        Columns: effect (the index), family, probability, value, sigma, unit (customary). As in `probabilities`.
        """
        families = self.probabilities.families if self.probabilities else ()
        rows = [
            (m.label, f"{family.family}, {family.sensor}", m.probability, *_size(m), m.display_unit)
            for family in families
            for m in family.members
        ]
        columns = ["effect", "family", "probability", "value", "sigma", "unit"]
        made: pd.DataFrame = needed("pandas").DataFrame(rows, columns=columns)
        return made.sort_values("probability", ascending=False, kind="stable").set_index("effect")

    def plot_unknown(self) -> tuple[Live, ...]:
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
