"""`sdimu pictures`: a diagnosis as small PNG files, for a README or a talk."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import plain
from sdimu_calibration.cli.opened import default_folder
from sdimu_calibration.cli.options import BagArgument, ImuNameOption, results_in
from sdimu_calibration.cli.progress import bar


def pictures(
    bag: BagArgument,
    model: Annotated[str, typer.Option(help="Model to examine: name in config/model or path.")] = "baseline",
    site: Annotated[str, typer.Option(help="Where the test was: name in config/site or path.")] = "daejeon",
    imu: ImuNameOption = "dtg",
    out: Annotated[Path | None, results_in("pictures; BAG_pictures")] = None,
) -> None:
    """Draw a diagnosis as PNG files: heat map before and after, candidates, ladder, drift in use."""
    from sdimu_calibration.core.diagnosis.diagnose import climb
    from sdimu_calibration.core.estimation.solve import solve
    from sdimu_calibration.report.pictures import write_pictures
    from sdimu_calibration.report.report_extras import report_extras
    from sdimu_calibration.storage.files.config import load_imu
    from sdimu_calibration.storage.files.model_choice import named_model
    from sdimu_calibration.storage.opening import open_test

    console = plain()
    wanted = named_model(model, [])
    test = open_test(bag, site, load_imu(imu))
    with bar(console) as progress:
        found = climb(solve(test, wanted, progress=progress), progress=progress)
        progress("navigation without aid", 0.95)
        more = report_extras(found)
    for path in write_pictures(out or default_folder(bag, "pictures"), found, more.trials):
        console.print(f"{path}: {path.stat().st_size / 1000:.0f} kB", soft_wrap=True, highlight=False)
