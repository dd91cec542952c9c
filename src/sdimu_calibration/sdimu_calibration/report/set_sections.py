"""What a joint fit of several recordings says beyond its coefficients, as HTML text."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np

from sdimu_calibration.core.effects.effect import CHANNELS
from sdimu_calibration.core.plain_text import three
from sdimu_calibration.core.probability import in_percent
from sdimu_calibration.core.results import Calibration, SetRecording, SetSummary, of_recordings
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.data import NOTABLE
from sdimu_calibration.report.drawing import Figure
from sdimu_calibration.report.evidence_figures import deviates, upon_each_other
from sdimu_calibration.report.groups import free
from sdimu_calibration.report.markup import Draw, grid, quiet, section, switched
from sdimu_calibration.report.table import with_sigma

if TYPE_CHECKING:  # a result of one recording has none: fifty modules less to load
    from sdimu_calibration.core.joint.recurrence import Recurrence
    from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis

_MAP = 300
"""Height of the map of all stops (px): six lines."""
_TRENDS = 8
"""Number of trends that are listed: the others are further inside chance."""


def set_sections(calibration: Calibration, of_set: SetSummary, draw: Draw) -> list[str]:
    """List the recordings, what differs between them, and what it follows."""
    return [
        _recordings(of_set),
        # Nothing deviates from the only one.
        *([_deviates(calibration, of_set, draw)] if len(of_set.recordings) > 1 else []),
        *_turn_on(calibration, of_set),
        *_trends(calibration, of_set),
    ]


def _recordings(of_set: SetSummary) -> str:
    columns = ("recording", "power-on", "start (UTC)", "length (min)", "temperature (degC)", "NIS", "largest deviate")
    left = [f"{name} is left out: {why}." for name, why in of_set.left_out]
    return section(
        "Recordings", grid(columns, [_line(r) for r in of_set.recordings], {0, 1, 2}), *(quiet(text) for text in left)
    )


def _line(r: SetRecording) -> list[str]:
    began = datetime.fromtimestamp(r.start_ns * 1e-9, UTC).strftime("%Y-%m-%d %H:%M") if r.start_ns else ""
    seen = r.deviate[np.isfinite(r.deviate)]
    return [
        r.name,
        r.power_on or "its own",
        began,
        f"{r.duration_s / 60.0:.1f}",
        "" if np.isnan(r.temperature_degc) else f"{r.temperature_degc:.1f}",
        f"{r.nis:.3f}",
        f"{np.abs(seen).max():.1f}" if len(seen) else "",
    ]


def _deviates(calibration: Calibration, of_set: SetSummary, draw: Draw) -> str:
    shown = np.flatnonzero(free(calibration)).tolist()
    value = np.array([r.deviate[shown] for r in of_set.recordings]).T
    figure = deviates(
        [r.name for r in of_set.recordings],
        [calibration.names[k] for k in shown],
        value,
        "recording",
        "coefficient",
        120 + 20 * len(shown),
    )
    return section(
        "Every coefficient in every recording",
        quiet(
            "How far the recording puts the coefficient from the joint estimate, over the sigma of that. What "
            "power-ons are allowed to differ by is part of the sigma. Empty: the recording says nothing of it."
        ),
        draw(figure),
    )


def _turn_on(calibration: Calibration, of_set: SetSummary) -> list[str]:
    if not of_set.turn_on:
        return []
    rows = [
        [
            t.effect,
            *(three(from_si(v, t.display_unit)) for v in (t.sigma, t.low, t.high)),
            t.display_unit,
            f"{t.power_ons:.0f}",
        ]
        for t in of_set.turn_on
    ]
    units = dict(zip(calibration.names, calibration.display_units, strict=True))
    own = [
        [d.power_on, d.name, with_sigma(from_si(d.value, unit), from_si(d.sigma, unit), unit)]
        for d in of_set.deviations
        if (unit := units.get(d.name))
    ]
    return [
        section(
            "From power-on to power-on",
            grid(("effect", "sigma", "low", "high", "unit", "power-ons"), rows, {0, 4}),
            quiet("Standard deviation by restricted likelihood, bounds of its 95 % interval."),
            grid(("power-on", "coefficient", "deviation"), own, {0, 1}),
        )
    ]


def _trends(calibration: Calibration, of_set: SetSummary) -> list[str]:
    units = dict(zip(calibration.names, calibration.display_units, strict=True))
    rows = [
        [t.name, t.covariate, with_sigma(from_si(t.slope, unit), from_si(t.sigma, unit), unit), f"{t.p_value:.2g}"]
        for t in of_set.trends[:_TRENDS]
        if (unit := units.get(t.name))
    ]
    if not rows:
        return []
    return [
        section(
            "What the coefficients follow",
            grid(("coefficient", "with", "change per unit", "p"), rows, {0, 1}),
            quiet("p: probability of such a slope by chance, all coefficients and covariates counted."),
        )
    ]


def where_it_fails(found: SetDiagnosis, draw: Draw) -> str:
    """Return a card with what is left in each stop of each recording; empty where nothing was looked at."""
    if not found.where:
        return ""
    maps = stop_maps(found)
    asked, every = len({one.recording for one in found.where}), len(of_recordings(found.after).recordings)
    some = f" Of {every} recordings, {asked} were asked." if asked < every else ""
    return section(
        "Where it fails: sensor by stop",
        switched(draw(upon_each_other(maps, _MAP)), ("model as given", "with what was found")[: len(maps)]),
        quiet(
            "A cell is the error that a sensor of a recording has in a stop beyond the joint estimate, over its sigma; "
            "both maps are in the noise beside what was found. It counts beyond "
            f"{NOTABLE:.0f}: of 200 cells, one is chance.{some}"
        ),
    )


def stop_maps(found: SetDiagnosis) -> list[Figure]:
    """Draw what is left in each stop with the model as given and, where something was found, with that."""
    stops = dict.fromkeys((one.recording, one.stop) for one in found.where)
    deviate = np.array([(one.before, one.after) for one in found.where]).reshape(len(stops), len(CHANNELS), 2)
    columns = [f"{recording} {stop}" for recording, stop in stops]
    values = [deviate[:, :, k].T for k in range(2 if found.findings else 1)]
    return [deviates(columns, CHANNELS, value, "recording and stop", "channel", _MAP) for value in values]


def recurrence_section(found: Recurrence) -> str:
    """Tell what comes back of that what the model leaves in the stops."""
    rows = [
        [f"same {one.kind}", str(one.pairs), in_percent(one.probability) if np.isfinite(one.probability) else ""]
        for one in found.kinds
    ]
    sensors = ", ".join(found.sensors)
    more = (
        f"That it comes back at all: {in_percent(found.probability)}. Empty: the recordings say nothing of it."
        if found.told
        else "The recordings share too few stops to say more."
    )
    return section(
        "What comes back",
        grid(("at the", "pairs of stops", "probability"), rows, {0}),
        quiet(f"What the model leaves in the stops ({sensors}), compared between recordings. {more}"),
    )
