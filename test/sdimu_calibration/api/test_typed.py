"""A user's script in the strict checks of mypy: results say what they are, and nothing has to be ignored."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[3] / "src"
SCRIPT = """
import sdimu_calibration as sdimu

test = sdimu.open("bag", site="daejeon", imu="dtg")
fit = sdimu.calibrate(test)
value, sigma = fit["gyro_bias_x"].to("deg/h")
found = sdimu.diagnose(fit)
print(found.verdict, *found.advice, value / sigma)
found.plot_heat_map().write_html("map.html")
found.plot_ranking(library="matplotlib").savefig("ranking.png")
better = fit.add(found.best)
print(better.to_dataframe(), *(turn.minutes for turn in found.turns("a", "b")), found.plan.backwards())
together = sdimu.diagnose(sdimu.calibrate(sdimu.open_set(["one", "two"])))
"""
TOLD = {
    "found": "sdimu_calibration.api.diagnosis.FitDiagnosis",
    "together": "sdimu_calibration.api.recording_set.JointDiagnosis",
    'found.plot_heat_map(library="matplotlib")': "matplotlib.figure.Figure",
    'found.plot_ranking(library="matplotlib")': "matplotlib.figure.Figure",
    "found.plan": "sdimu_calibration.core.plan.Plan",
    "sdimu.compare(fit, better)": "sdimu_calibration.api.comparison.Comparison",
}
"""Expressions and what mypy says they are. Figures of plotly are of no type to it: plotly has none."""


def strict(folder: Path, script: str) -> list[str]:
    """Lines that mypy says of a script."""
    (folder / "script.py").write_text(script)
    command = [sys.executable, "-m", "mypy", "--strict", "--config-file=", "--cache-dir", folder / "cache"]
    # As mypy treats an installed package: what its functions do inside is the package's own affair (make check-types).
    command += ["--follow-imports=silent", "script.py"]
    paths = os.pathsep.join(str(SOURCES / name) for name in ("sdimu_calibration", "sdimu_sim", "rate_table_sim"))
    done = subprocess.run(
        command, cwd=folder, env={**os.environ, "MYPYPATH": paths}, capture_output=True, text=True, check=False
    )
    return [line for line in done.stdout.splitlines() if line.startswith("script.py")] + done.stderr.splitlines()


def test_a_script_passes_the_strict_checks_of_mypy_and_is_told_its_types(tmp_path):
    for module in ("mypy", "matplotlib"):
        pytest.importorskip(module)
    asked = "".join(f"reveal_type({one})\n" for one in TOLD)
    said = strict(tmp_path, f"{SCRIPT}{asked}fit.add(3)\n")
    *told, wrong = said
    assert [line.partition('Revealed type is "')[2].rstrip('"') for line in told] == list(TOLD.values())
    # What is wrong in a script is found: an effect is no number.
    assert "error:" in wrong
    assert "[arg-type]" in wrong
