"""Where a result is from, as HTML text: recording with its hashes, IMU, site, model, program and command."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from html import escape

from sdimu_calibration.core.results import Calibration
from sdimu_calibration.report.markup import section
from sdimu_calibration.storage.trace import Trace

_DATED_NS = 315_532_800 * 10**9
"""Stamp from which it is a date (ns since 1970): that of 1980; a smaller one counts from the start of a driver."""


def traceability(calibration: Calibration, trace: Trace | None) -> str:
    """Return the section that lets a reader make the result again."""
    origin, counts = calibration.origin, calibration.data
    made = (
        []
        if trace is None
        else [
            ("command", f"<code>{escape(trace.command)}</code>" if trace.command else "from Python"),
            ("program", escape(trace.program)),
            ("made", escape(trace.made)),
            # A name that the result itself holds stands above: only files are said again, with their path.
            *(
                (key, f"<code>{escape(value)}</code>")
                for key, value in trace.stated
                if value not in {origin.site, origin.imu}
            ),
        ]
    )
    length = f"{counts['duration_s'] / 60.0:.1f} min" if "duration_s" in counts else ""
    numbers = [f"{counts[key]:.0f} {key}" for key in ("stops", "samples", "lost", "rejected") if key in counts]
    heat = f"{origin.temperature_degc:.1f} deg C" if origin.temperature_degc == origin.temperature_degc else ""
    rows = [
        ("recording", escape(origin.recording)),
        ("recorded", escape(recorded(origin.start_ns))),
        ("content", escape(", ".join(word for word in (length, *numbers, heat) if word))),
        *(
            ("SHA-256", f"<code>{escape(digest)}</code><br><code>{escape(path)}</code>")
            for path, digest in (trace.files if trace else ())
        ),
        ("IMU", escape(origin.imu)),
        ("serial", escape(origin.serial)),
        ("power-on", escape(origin.power_on)),
        ("site", escape(origin.site)),
        ("estimator", escape(", ".join(w for w in (calibration.estimator, calibration.estimator_reason) if w))),
        ("model", escape(", ".join(calibration.model))),
        ("own effects", "<br>".join(f"<code>{escape(file)}</code>" for file in origin.effect_files)),
        ("body frame", escape(calibration.body_frame)),
        *made,
    ]
    return section("Traceability", _facts(rows))


def _facts(rows: Sequence[tuple[str, str]]) -> str:
    lines = "".join(f"<dt>{escape(key)}</dt><dd>{value}</dd>" for key, value in rows if value)
    return f'<dl class="facts">{lines}</dl>'


def recorded(start_ns: int) -> str:
    """Say when a recording began; empty where its stamps do not tell."""
    return (
        datetime.fromtimestamp(1e-9 * start_ns, UTC).strftime("%Y-%m-%d %H:%M:%S UTC") if start_ns >= _DATED_NS else ""
    )
