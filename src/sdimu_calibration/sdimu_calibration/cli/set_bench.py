"""The recordings of a set for the workbench: each by itself, and what judges them together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from sdimu_calibration.cli.options import Recorded
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis, diagnose_set
from sdimu_calibration.core.joint.set_fit import SetOptions
from sdimu_calibration.core.progress import Progress
from sdimu_calibration.core.specification import Model
from sdimu_calibration.storage.files.model_choice import named_model
from sdimu_calibration.storage.recording_set import BagSource, load_set, set_of
from sdimu_calibration.storage.set_work import set_runner

Judge = Callable[[Sequence[str], Progress], SetDiagnosis]


def bench_of_set(
    bags: Sequence[Path], file: Path | None, model: str | None, opening: Recorded
) -> tuple[Mapping[str, Callable[[], PreparedTest]], Model, Judge]:
    """Read a set for the workbench.

    Parameters
    ----------
    file : Path or None
        Set file, in the place of bags.
    model : str or None
        As the option of the same name.

    Returns
    -------
    openers : mapping of str to callable
        What opens each recording, by its name.
    model : Model
        To start from.
    judge : callable
        Diagnoses the set with effects added; it gets their names and a progress function.
    """
    like = BagSource(Path(), opening.site, opening.imu, opening.source)
    wanted = set_of(bags, like) if file is None else load_set(file, like)
    named = model or wanted.model

    def judge(added: Sequence[str], progress: Progress) -> SetDiagnosis:
        options = SetOptions(named_model(named, added), wanted.estimator, scopes=wanted.scopes)
        # In this process: the recordings of a person at a page are few, and the cores are those of the page, too.
        with set_runner(len(wanted.members), 1, None) as run:
            return diagnose_set(wanted.members, options, run, (), progress)

    return {member.name: member.open for member in wanted.members}, named_model(named, []), judge
