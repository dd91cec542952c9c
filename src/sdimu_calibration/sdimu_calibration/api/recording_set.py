"""Several recordings of one unit as scripts and notebooks see them: the set, its fit, its diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from sdimu_calibration.api.advice_in_python import IN_PYTHON_OF_A_SET
from sdimu_calibration.api.diagnosed import Diagnosed
from sdimu_calibration.api.fitted import Fitted
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.joint.member import Member
from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis, diagnose_set
from sdimu_calibration.core.joint.set_fit import SetFit, SetOptions, fit_set
from sdimu_calibration.core.joint.set_found import FunctionShare
from sdimu_calibration.core.joint.set_verdict import SetFinding
from sdimu_calibration.core.plain_text import counted
from sdimu_calibration.core.posterior.unknown import UnknownFunction
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.results import Calibration, SetSummary, of_recordings
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.report.cost import in_use_entry
from sdimu_calibration.report.page import write_report
from sdimu_calibration.report.report_extras import of_navigations
from sdimu_calibration.report.set_sections import stop_maps
from sdimu_calibration.storage.bags.file_room import results_folder
from sdimu_calibration.storage.files.advice_words import sentence
from sdimu_calibration.storage.files.diagnosis_file import write_set_diagnosis
from sdimu_calibration.storage.files.result_file import write_result
from sdimu_calibration.storage.files.whole_file import written_together
from sdimu_calibration.storage.recording_set import RecordingSet
from sdimu_calibration.storage.set_work import judged_outcome, set_runner

if TYPE_CHECKING:
    from plotly.graph_objects import Figure as Live

    from sdimu_calibration.core.evidence.known import Standing


@dataclass(frozen=True, repr=False)
class OpenedSet:
    """Recordings of one unit, ready to be fitted together; each is read when it is needed."""

    core: RecordingSet
    workers: int = 1
    """Processes that read them."""
    kept: Path | None = None
    """Folder in which what they say is kept from one call to the next."""

    @property
    def members(self) -> tuple[Member, ...]:
        """The recordings: `name`, `serial`, `power_on`, and `open()` for the test of each."""
        return self.core.members

    def __len__(self) -> int:
        """Return the number of recordings."""
        return len(self.members)

    def __repr__(self) -> str:
        """List the recordings, one a line."""
        lines = [f"{counted(len(self), 'recording')} of {self.serial or 'a unit without a serial number'}"]
        return "\n".join([*lines, *(f"  {m.name}: power-on {m.power_on or 'of its own'}" for m in self.members)])

    def _repr_html_(self) -> str:
        """List the recordings as HTML."""
        first, *lines = repr(self).splitlines()
        return f"<p>{escape(first)}</p><ul>{''.join(f'<li>{escape(line.strip())}</li>' for line in lines)}</ul>"

    @property
    def serial(self) -> str:
        """Serial number of the unit; empty where no recording says it."""
        return next((m.serial for m in self.members if m.serial), "")

    def fit(self, options: SetOptions, progress: Progress) -> JointFit:
        """Fit all recordings together."""
        with set_runner(len(self), self.workers, self.kept) as run:
            return JointFit(self, options, fit_set(self.members, options, run, progress=progress))

    def diagnose(self, fit: JointFit, extra: Sequence[Effect], progress: Progress) -> JointDiagnosis:
        """Find what the model of a fit of this set misses."""
        if len(self) < 2:
            raise DataError("diagnose(fit=...): a set of one recording: open it with open(bag, ...) instead")
        with set_runner(len(self), self.workers, self.kept) as run:
            return JointDiagnosis(self, diagnose_set(self.members, fit.options, run, extra, progress, fitted=fit.core))


class JointFit(Fitted):
    """A model fitted to several recordings of one unit.

    Indexed by the name of a coefficient; its ``repr`` is the table of coefficients, in a notebook as HTML.

    Attributes
    ----------
    core : SetFit
        With the reduced rows of every recording.
    """

    def __init__(self, of: OpenedSet, options: SetOptions, core: SetFit) -> None:
        self.of = of
        self.options = options
        self.core = core

    @cached_property
    def result(self) -> Calibration:
        """Coefficients of the unit, covariance, fit figures, notes; what differs between recordings in `of_set`."""
        return _of_unit(judged_outcome(self.core), self.of)

    @property
    def of_set(self) -> SetSummary:
        """Recordings, what differs from power-on to power-on, and what the coefficients follow."""
        return of_recordings(self.result)

    @property
    def _heading(self) -> str:
        return f"{self.of_set.together}, body frame: {self.result.body_frame}"

    def save(self, folder: str | Path) -> Path:
        """Write result.json and report.html into a folder, as `sdimu calibrate` does."""
        folder = results_folder(folder)
        with written_together(folder) as part:
            write_result(part / "result.json", self.result)
            write_report(part / "report.html", self.result, title=f"Calibration of {self.of_set.counted}")
        return folder


class JointDiagnosis(Diagnosed):
    """What the model of a set misses."""

    core: SetDiagnosis

    def __init__(self, of: OpenedSet, core: SetDiagnosis) -> None:
        self.of = of
        self.core = core

    @property
    def adequate(self) -> bool:
        """Whether the model explains all recordings."""
        return self.core.verdict == Verdict.CONSISTENT

    @property
    def found(self) -> tuple[SetFinding, ...]:
        """Effects that were found: `label`, `recording` (empty where all show it), `value`, `sigma` (SI), `alike`."""
        return self.core.findings

    @property
    def best(self) -> SetFinding:
        """The effect that explains most; its `label` is what ``calibrate(..., add=[...])`` takes."""
        if not self.found:
            raise DataError(f"nothing was found: {self.sentence}")
        return self.found[0]

    @property
    def function(self) -> float | None:
        """Probability that all recordings share an unknown function of the attitude; None where none was looked for."""
        return self.core.function

    @property
    def functions(self) -> tuple[FunctionShare, ...]:
        """The same with its sensors, then that of each recording alone; empty where none was looked for."""
        return self.core.functions

    @property
    def unknown(self) -> tuple[UnknownFunction, ...]:
        """Function of the attitude that all recordings share and no effect explains: mean and sigma at all stops."""
        return self.core.unknown

    @property
    def ladder(self) -> tuple[tuple[str, float], ...]:
        """Name and held-out error (sigma) of the model as given, then with one effect of all recordings more each."""
        return self.core.ladder.errors

    @property
    def advice(self) -> tuple[str, ...]:
        """What to do next, one sentence each, with the calls that do it; `set` is what was opened."""
        return tuple(sentence(one, IN_PYTHON_OF_A_SET) for one in self.core.advice)

    @property
    def known(self) -> Standing:
        """What all recordings know of the unit: what a plan for the next one begins with."""
        return self.core.standing

    @cached_property
    def result(self) -> Calibration:
        """The result with everything that was found."""
        return _of_unit(self.core.after, self.of)

    def plot_heat_map(self) -> Live:
        """Error of every sensor in every stop of the recordings over its sigma, with the model as given (plotly)."""
        if not self.core.where:
            raise DataError(f"no stop was looked at: {self.sentence}")
        return stop_maps(self.core)[0].as_plotly()

    def save(self, folder: str | Path) -> Path:
        """Write diagnosis.json, result.json and report.html into a folder, as `sdimu diagnose` does."""
        folder = results_folder(folder)
        title = f"Diagnosis of {of_recordings(self.result).counted}"
        with written_together(folder) as part:
            in_use = in_use_entry(of_navigations(self.core.ladder))
            write_set_diagnosis(part / "diagnosis.json", self.core, in_use)
            write_result(part / "result.json", self.result, self.core.verdict)
            write_report(part / "report.html", self.result, title=title, of_set=self.core)
        return folder


def _of_unit(result: Calibration, of: OpenedSet) -> Calibration:
    return result.with_serial(of.serial)
