"""A diagnosis as scripts and notebooks see it."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal, overload

from sdimu_calibration.api.advice_in_python import in_python
from sdimu_calibration.api.diagnosed import Diagnosed
from sdimu_calibration.api.figure_library import Either, Library, drawn
from sdimu_calibration.api.fit import CalibrationFit
from sdimu_calibration.api.given import plan_given
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import Found
from sdimu_calibration.core.diagnosis.plan_seen import as_plan
from sdimu_calibration.core.diagnosis.problem import Problem
from sdimu_calibration.core.diagnosis.standing import standing
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary, summarise
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.estimation.fit import Fit
from sdimu_calibration.core.evidence.candidate import Candidate
from sdimu_calibration.core.evidence.known import Standing
from sdimu_calibration.core.evidence.navigation_evidence import NavigationEvidence
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.plan_search import NextTurn, Question, next_turn, untold
from sdimu_calibration.core.posterior.unknown import UnknownFunction
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.report import data, evidence_figures
from sdimu_calibration.report.cost import held_to_use, in_use_entry
from sdimu_calibration.report.drawing import Figure
from sdimu_calibration.report.may_be import MayBe, classes_of
from sdimu_calibration.report.page import write_report
from sdimu_calibration.report.report_extras import report_extras
from sdimu_calibration.report.unknown_section import unknown_of
from sdimu_calibration.storage.bags.file_room import results_folder
from sdimu_calibration.storage.files.advice_words import sentence
from sdimu_calibration.storage.files.diagnosis_file import write_diagnosis
from sdimu_calibration.storage.files.result_file import write_result
from sdimu_calibration.storage.files.whole_file import written_together
from sdimu_calibration.storage.trace import traced

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Printed
    from plotly.graph_objects import Figure as Live


class FitDiagnosis(Diagnosed):
    """What the model of a fit is missing.

    Attributes
    ----------
    core : Diagnosis
        With the evidence and both fits.
    """

    core: Diagnosis

    def __init__(self, core: Diagnosis, delivered: Fit | None = None) -> None:
        self.core, self._delivered = core, delivered

    @cached_property
    def summary(self) -> DiagnosisSummary:
        """What was found, what could have been seen, advice."""
        return summarise(self.core)

    @property
    def adequate(self) -> bool:
        """Whether the model explains the recording."""
        return self.core.adequate

    @property
    def found(self) -> tuple[Found, ...]:
        """Effects that were found, best first."""
        return self.summary.candidates

    @property
    def best(self) -> Candidate:
        """The effect that explains most, for `CalibrationFit.add`."""
        if not self.found:
            raise DataError(f"nothing was found: {self.sentence}")
        return self.found[0].candidate

    @cached_property
    def extended(self) -> CalibrationFit:
        """The fit with everything that was found."""
        return CalibrationFit(self.core.extended)

    @property
    def advice(self) -> tuple[str, ...]:
        """What to do next, one sentence each, with the calls that do it; `fit` is what was diagnosed, `found` this."""
        speech = in_python(self._seen is not None, self.core.fit.test.excluded)
        return tuple(sentence(one, speech) for one in self.summary.advice)

    @cached_property
    def _seen(self) -> Plan | None:
        """The plan as the motion showed it; None where it showed none."""
        return as_plan(self.summary.plan)

    @property
    def plan(self) -> Plan:
        """The plan as the motion showed it.

        Raises
        ------
        DataError
            Where the motion showed none: by hand, without a turn, with one about several axes, or with one whose angle
            or rate is rounded to zero.
        """
        if self._seen is None:
            raise DataError(
                "found.plan: the motion shows no plan (a run by hand, no turn, a turn about several axes, or one whose "
                'angle or rate is rounded to zero); name that which the table ran: found.turns(..., plan="PLAN"), '
                'sdimu.plan("PLAN"), or in a shell, sdimu plan --plan PLAN --backwards'
            )
        return self._seen

    def turns(self, *effects: str | Effect, plan: str | Path | Plan | None = None) -> tuple[NextTurn, ...]:
        """Rank turns after those of the test by what they tell effects apart, the most a minute first.

        Parameters
        ----------
        *effects : str or Effect
            Two coefficients or more, as `--tell` of `sdimu plan` takes them.
        plan : str, Path or Plan, optional
            The plan that the table ran: name in config/plan, path, or the plan itself; that which the motion showed
            where it is left out.

        Raises
        ------
        DataError
            Where no turn tells them apart, where no plan is stated or seen, and where an argument is none of these.
        """
        for one in effects:
            if not isinstance(one, str | Effect):
                raise DataError(f'turns(...): expected names of effects, such as turns("A", "B"), not {one!r:.60}')
        start = self.plan if plan is None else plan_given("turns(plan=...)", plan)
        given = self.core.fit
        if given.test.site is None:
            raise DataError("turns(...): the test has no site, at which turns could be foreseen")
        ranked = next_turn(start, Question(given.test.site, given.test.imu, given.model), effects)
        none = untold(ranked, effects)
        if none:
            raise DataError(f"turns(...): {none}")
        return ranked

    @property
    def known(self) -> Standing:
        """What the recording knows of the unit: what a plan for the next one begins with."""
        return standing(self.core, self.summary.found)

    @property
    def unknown(self) -> tuple[UnknownFunction, ...]:
        """Errors that no effect explains and that follow attitude, rate or temperature: mean and sigma by stretch."""
        return unknown_of(self.core)

    @overload
    def plot_ranking(self, library: Literal["plotly"] = ...) -> Live: ...
    @overload
    def plot_ranking(self, library: Literal["matplotlib"]) -> Printed: ...
    def plot_ranking(self, library: Library = "plotly") -> Either:
        """Scores of the candidates against what noise reaches (a figure of plotly or matplotlib)."""
        self._drawable(library)
        return drawn(library, self._ranking, "candidates", self.core)

    def _drawable(self, library: Library) -> None:
        """Refuse matplotlib for a run by hand, of which there are no such pictures."""
        if library != "plotly" and not isinstance(self.core.evidence, NavigationEvidence):
            raise DataError("of a run by hand there are figures of plotly alone: library='plotly'")

    def _ranking(self) -> Figure:
        if not isinstance(self.core.evidence, NavigationEvidence):
            return self._ranking_of_a_run()
        return evidence_figures.ranking(data.scored(self.core), self.core.found.threshold, self._classes())

    def _classes(self) -> dict[str, MayBe]:
        return classes_of(self.core.found_effects, self.core.probabilities)

    def _ranking_of_a_run(self) -> Figure:
        problem, found = Problem(self.core.evidence), self.core.found
        first, last = problem.scan([]), problem.scan([int(c) for c in found.chosen])
        free = set(self.core.free.tolist())
        columns = [k for k in range(problem.p, len(self.core.evidence.names)) if k not in free]
        return evidence_figures.ranking(
            data.scores(self.core.evidence, first, last, columns, found.chosen), found.threshold, self._classes()
        )

    @overload
    def plot_heat_map(self, library: Literal["plotly"] = ...) -> Live: ...
    @overload
    def plot_heat_map(self, library: Literal["matplotlib"]) -> Printed: ...
    def plot_heat_map(self, library: Library = "plotly") -> Either:
        """Mean residual of every channel at every stop over its sigma (a figure of plotly or matplotlib).

        Of the model as given; matplotlib draws that with what was found below it.
        """
        self._drawable(library)
        return drawn(library, self._heat_map, "heat_maps", self.core)

    def _heat_map(self) -> Figure:
        return evidence_figures.heat_map(*data.places(self.core.consistency.where))

    def save(self, folder: str | Path) -> Path:
        """Write diagnosis.json, result.json and report.html into a folder, as `sdimu diagnose` does."""
        folder = results_folder(folder)
        more = report_extras(self.core, self._delivered)
        told = held_to_use(self.core, more)
        with written_together(folder) as part:
            write_diagnosis(part / "diagnosis.json", summarise(told), in_use=in_use_entry(more))
            write_result(part / "result.json", told.after, told.verdict)
            write_report(
                part / "report.html", told.after, title="Diagnosis", summary=summarise(told), more=more, trace=traced()
            )
        return folder

    def _told(self) -> list[str]:
        """Coefficients that are one in this test, and advice, one line each."""
        return [*self.core.after.inseparable, *super()._told()]
