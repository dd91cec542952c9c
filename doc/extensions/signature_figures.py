"""Draw the signature of every effect of the registry over the stops of the default plan; run as a program.

    python doc/extensions/signature_figures.py FOLDER

Leaves NAME.svg and signatures.json, with the share of each signature that the model's coefficients leave. It is a
program of its own because the book itself switches the compiler off.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.evidence.consistency import CHANNEL_NAMES
from sdimu_calibration.core.evidence.navigation_evidence import NavigationEvidence
from sdimu_calibration.core.planning.nominal import nominal_recording
from sdimu_calibration.core.recording import TemperatureLog
from sdimu_calibration.report.catalogue import grouped
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site

PLAN, IMU, SITE, MODEL = "kim18", "dtg", "daejeon", "baseline"
"""What `sdimu predict` takes by default."""
CELL, LINE, LABEL = 26, 13, 84
"""Width and height of a cell, and width of the names of the channels (px)."""
WARMING_K = 10.0
"""Rise of the temperature over the test (K), even in time: without one nothing is seen of the temperature."""
WARM, COLD = "#b2182b", "#2166ac"


def main(folder: Path) -> None:
    """Draw all effects."""
    folder.mkdir(parents=True, exist_ok=True)
    effects = [effect for _, found in grouped() for effect in found]
    site, imu, model = load_site(SITE), load_imu(IMU), load_model(MODEL)
    recording = nominal_recording(load_plan(PLAN), site)
    warming = TemperatureLog(recording.t[[0, -1]], np.array([20.0, 20.0 + WARMING_K]))
    test = PreparedTest(replace(recording, temperature=warming), imu, site)
    fit = solve(test, model, "filter", learn=False)
    missing = [effect for effect in effects if effect.name not in model.effects]
    evidence = fit.evidence(missing)
    if not isinstance(evidence, NavigationEvidence):
        raise SystemExit("the default plan is not navigated")
    left = _left(evidence)
    told = {}
    # A candidate's label says its time constant too; its parameter has the name of the catalogue.
    names = [*evidence.names[: len(evidence.weight)], *(c.parameter.name for c in evidence.candidates)]
    for effect in effects:
        columns = [k for k, name in enumerate(names) if name in {p.name for p in effect.parameters}]
        if not columns:
            continue
        column = max(columns, key=lambda k: float(np.abs(evidence.W[:, k]).max()))
        means = _by_stop(evidence, column)
        if not means.any():
            continue
        (folder / f"{effect.name}.svg").write_text(_drawing(means, effect), encoding="utf-8")
        told[effect.name] = {"coefficient": names[column], "left": float(left[column])}
    (folder / "signatures.json").write_text(json.dumps(told), encoding="utf-8")


def _left(evidence: NavigationEvidence) -> np.ndarray:
    """Share of each signature that the coefficients of the model leave; NaN for those themselves."""
    J = evidence.information.J
    given = evidence.information.given(evidence.model, evidence.weight).J
    with np.errstate(divide="ignore", invalid="ignore"):
        left = np.sqrt(np.maximum(np.diag(given), 0.0) / np.diag(J))
    left[evidence.model] = np.nan
    return left


def _by_stop(evidence: NavigationEvidence, column: int) -> np.ndarray:
    """Sum of a signature over each stop and channel over the root of its rows, as in the heat map, largest 1."""
    stops = np.unique(evidence.stop)
    total = np.zeros((len(CHANNEL_NAMES), len(stops)))
    count = np.zeros_like(total)
    place = np.searchsorted(stops, evidence.stop)
    np.add.at(total, (evidence.channel, place), evidence.W[:, column])
    np.add.at(count, (evidence.channel, place), 1.0)
    means = total / np.sqrt(np.maximum(count, 1.0))
    largest = np.abs(means).max()
    return means / largest if largest > 0.0 else means


def _drawing(means: np.ndarray, effect: Effect) -> str:
    """Draw a signature: channels by stops, in colours that carry on light and dark ground."""
    lines, stops = means.shape
    width, height = LABEL + CELL * stops + 2, LINE * lines + 22
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        f'font-family="sans-serif" font-size="10" fill="#888"><title>Signature of {effect.name}</title>'
    ]
    for row, name in enumerate(CHANNEL_NAMES):
        y = LINE * row
        parts.append(f'<text x="{LABEL - 6}" y="{y + 10}" text-anchor="end">{name.replace("_", " ")}</text>')
        for k, value in enumerate(means[row]):
            colour, depth = (WARM if value > 0.0 else COLD), abs(float(value)) ** 0.7
            shown = f'fill="{colour}" fill-opacity="{depth:.2f}"' if depth > 0.01 else 'fill="#888" fill-opacity="0.08"'
            parts.append(f'<rect x="{LABEL + CELL * k}" y="{y}" width="{CELL - 2}" height="{LINE - 2}" {shown}/>')
    y = LINE * lines + 10
    parts += [f'<text x="{LABEL + CELL * k + CELL / 2}" y="{y}" text-anchor="middle">{k}</text>' for k in range(stops)]
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
