"""Error against mount misalignment, for the filter and for the classical calibration: the paper's claim, measured.

Every seed draws one IMU and one noise; the same IMU is then tested at every mount.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.estimation.outcome import calibrate
from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.design.palette import SERIES
from sdimu_calibration.report.design.sheet import document
from sdimu_calibration.report.drawing import Figure, html, lay_out
from sdimu_calibration.report.groups import title
from sdimu_calibration.storage.files.whole_file import write_whole
from sdimu_sim.core.scenario import Scenario, generate
from sdimu_sim.core.truth import Truth, in_body_frame
from sdimu_study.classical import TABLE_FRAME, ClassicalResult, calibrate_classically
from sdimu_study.study import Study, Table

FORMAT = "sdimu-mount-study/1"
ESTIMATORS = ("filter", "classical", "classical, turned afterwards")
_DASHES = ("solid", "dash", "dot")
_COLUMNS = 2


@dataclass(frozen=True)
class Mounted:
    """Tests of a scenario; its mount is the same angle (deg) about all three axes."""

    scenario: Scenario
    model: Model
    mount_deg: float


@dataclass(frozen=True)
class MountWorld:
    """A recording at a mount, with its truth."""

    case: Mounted
    recording: Recording
    truth: Truth


def world(case: Mounted, seed: int) -> MountWorld:
    """Simulate a seed."""
    angle = float(np.radians(case.mount_deg))
    return MountWorld(case, *generate(replace(case.scenario, seed=seed, mount_rad=(angle, angle, angle))))


def run(world: MountWorld) -> dict[str, Calibration | ClassicalResult]:
    """Calibrate by each of `ESTIMATORS`."""
    scenario, model = world.case.scenario, world.case.model
    what = world.recording, scenario.site, scenario.imu, model
    found = calibrate(*what, held_out=False)
    classical = calibrate_classically(*what)
    return dict(zip(ESTIMATORS, (found, classical, classical.turned(model.body_frame)), strict=True))


def score(world: MountWorld, found: Mapping[str, Calibration | ClassicalResult]) -> dict[str, Any]:
    """Mean square errors (SI) by estimator and effect."""
    return {
        estimator: {effect: float(np.mean(e**2)) for effect, e in errors_by_effect(result, world.truth).items()}
        for estimator, result in found.items()
    }


STUDY = Study("mount", world, run, score)


def mount_study(
    scenario: Scenario,
    model: Model,
    mounts_deg: Sequence[float],
    seeds: Sequence[int],
    progress: Callable[[str, float], None],
) -> dict[str, Any]:
    """Calibrate simulated tests at several mounts.

    Parameters
    ----------
    scenario : Scenario
        Its seed and mount are replaced.
    model : Model
    mounts_deg : sequence of float
    seeds : sequence of int
    progress : callable
        Called with a word and the fraction done.

    Returns
    -------
    dict
        ``rms``: by estimator, by effect, RMS error (SI) over seeds and parameters at every mount; ``spread``: its
        standard error.
    """
    total, rows = len(mounts_deg) * len(seeds), []
    for number in range(total):
        mount, seed = mounts_deg[number % len(mounts_deg)], seeds[number // len(mounts_deg)]
        progress(f"mount {mount:g} deg, seed {seed}", number / total)
        rows.append(STUDY.of(Mounted(scenario, model, mount))(seed))

    def of_all(figure: Callable[[Floats], Floats]) -> dict[str, Any]:
        return {
            estimator: {effect: figure(_by_mount(rows, estimator, effect, len(mounts_deg))) for effect in model.effects}
            for estimator in ESTIMATORS
        }

    return {
        "format": FORMAT,
        "mount_deg": list(mounts_deg),
        "seeds": list(seeds),
        "rms": of_all(lambda squares: np.asarray(np.sqrt(squares.mean(axis=1)))),
        "spread": of_all(_standard_error),
    }


def _by_mount(rows: Sequence[Mapping[str, Any]], estimator: str, effect: str, mounts: int) -> Floats:
    """Mean squares of an effect, shape (mounts, seeds)."""
    return np.ascontiguousarray(np.array([row[estimator][effect] for row in rows]).reshape(-1, mounts).T)


def errors_by_effect(result: Calibration | ClassicalResult, truth: Truth) -> dict[str, Floats]:
    """Estimate minus truth (SI) by effect; coefficients that the frame makes zero are left out.

    The classical result in table axes is held against the sensor as built, in its own axes: that these are the
    table's is what the method assumes.
    """
    true = in_body_frame(truth.imu.coefficients, "prior" if result.body_frame == TABLE_FRAME else result.body_frame)
    out: dict[str, Floats] = {}
    for effect in result.model:
        own = [i for i, name in enumerate(result.names) if name.startswith(f"{effect}_")]
        error = np.array([result.values[i] - true[result.names[i]] for i in own])
        out[effect] = error[error != 0.0]
    return out


def _standard_error(squares: Floats) -> Floats:
    """Take the standard error of the RMS from the scatter of the seeds' mean squares (mounts, seeds)."""
    count = squares.shape[1]
    of_mean = squares.std(axis=1, ddof=min(1, count - 1)) / np.sqrt(count)
    return np.asarray(of_mean / (2.0 * np.sqrt(squares.mean(axis=1))))


def tables(content: Mapping[str, Any], units: Mapping[str, str]) -> dict[str, Table]:
    """Lay RMS errors out by estimator: a line an effect, a column a mount."""
    headings = ("RMS error", *(f"{m:g} deg" for m in content["mount_deg"]), "unit")
    return {
        estimator: Table(
            headings,
            [(e, *(f"{from_si(float(v), unit):.3g}" for v in by_effect[e]), unit) for e, unit in units.items()],
        )
        for estimator, by_effect in content["rms"].items()
    }


def figure(content: Mapping[str, Any], units: Mapping[str, str]) -> Figure:
    """Draw RMS error against mount, one panel an effect, logarithmic; `units` are the display units by effect."""
    effects = list(units)
    rows = -(-len(effects) // _COLUMNS)
    titles = [title(effect) for effect in effects]
    drawn = Figure(rows, _COLUMNS, titles=titles, gap_x=0.1, gap_y=0.09)
    mounts = np.asarray(content["mount_deg"], dtype=float)
    for panel, effect in enumerate(effects):
        place = {"row": panel // _COLUMNS + 1, "col": panel % _COLUMNS + 1}
        for order, (estimator, by_effect) in enumerate(content["rms"].items()):
            factor = from_si(1.0, units[effect])
            drawn.add(
                "scatter",
                x=mounts,
                y=np.asarray(by_effect[effect]) * factor,
                mode="lines+markers",
                name=estimator,
                legendgroup=estimator,
                showlegend=panel == 0,
                error_y={"type": "data", "array": np.asarray(content["spread"][estimator][effect]) * factor},
                line={"color": SERIES[order % 3], "dash": _DASHES[order % 3]},
                **place,
            )
        drawn.y_axes(type="log", dtick=1, exponentformat="power", title=f"RMS ({units[effect]})", **place)
        drawn.x_axes(title="mount (deg)" if panel >= len(effects) - _COLUMNS else None, **place)
    return lay_out(
        drawn,
        260 * rows + 80,
        font={"size": 12},
        showlegend=True,
        legend={"orientation": "h", "y": 1.06},
        margin={"l": 70, "r": 30, "t": 60, "b": 50},
    )


def write_page(path: Path, content: Mapping[str, Any], units: Mapping[str, str]) -> None:
    """Write the page: one file that needs no network."""
    drawn = html(figure(content, units), 1)
    text = (
        f"{len(content['seeds'])} IMUs, each tested at every mount (the same angle about all axes). RMS over IMUs "
        "and axes; bars: its standard error. The classical calibration takes table axes for IMU axes. Turned into the "
        "accelerometers' own frame afterwards it loses most of the mount again: on a table whose angles are perfect."
    )
    heading = "Error against mount misalignment"
    write_whole(path, document(heading, f'<section class="card"><p>{escape(text)}</p>{drawn}</section>'))
