"""What a live test leaves beside result.json: diagnosis.json and report.html, by the fit of `sdimu diagnose`."""

from __future__ import annotations

from pathlib import Path

from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.diagnosis.summary import summarise
from sdimu_calibration.core.estimation.outcome import outcome
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.specification import Model
from sdimu_calibration.report.cost import held_to_use
from sdimu_calibration.report.page import write_report
from sdimu_calibration.report.report_extras import report_extras
from sdimu_calibration.storage.files.diagnosis_file import write_diagnosis
from sdimu_calibration.storage.files.whole_file import written_together
from sdimu_calibration.storage.trace import traced

DIAGNOSIS, REPORT = "diagnosis.json", "report.html"
"""Names of the files."""


def leave_report(folder: Path, test: PreparedTest, model: Model, name: str) -> None:
    """Write diagnosis.json and report.html of a test that has ended.

    They come beside the result.json of the node, which stays as it is: write it first.

    `model`: with what was added to it; `name`: of the model, for the page. Raises DataError where the test cannot be
    diagnosed.
    """
    found = climb(solve(test, model))
    more = report_extras(found)
    summary = summarise(held_to_use(found, more))
    result = outcome(found.fit, refuse=False)
    with written_together(folder) as part:
        write_diagnosis(part / DIAGNOSIS, summary)
        title = f"Live test, model {name}"
        write_report(part / REPORT, result, title=title, summary=summary, more=more, trace=traced(model=name))
