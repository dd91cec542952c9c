"""A live diagnosis as messages: tables for people, exact numbers for programs."""

from __future__ import annotations

import json
import math
from array import array
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import CompressedImage, JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

from sdimu_calibration.core.diagnosis.live_diagnosis import LiveDiagnosis, Ranked
from sdimu_calibration.core.posterior.told import Probabilities
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.nodes.credits import header
from sdimu_calibration.report.data import places
from sdimu_calibration.report.live_text import SeenDiagnosis, SeenFamily, best_ranked, ladder_rows, model_name, size
from sdimu_calibration.report.odds_section import family_in_words

NOTHING = "nothing_missing"
"""Key of the probability that no effect is missing."""
RANKED_ABOVE = "ranked_above"
"""Key of the number of rows of the ranking, from its begin, that stand out of the noise."""
_MOST_RANKED = 12
"""Number of candidates in the table for people."""


def diagnosis(stamp_ns: int, found: LiveDiagnosis) -> DiagnosticArray:
    """Return verdict, where the last stop fails, ranking, ladder, probabilities; all but the first are tables."""
    level = DiagnosticStatus.OK if found.verdict == Verdict.CONSISTENT else DiagnosticStatus.WARN
    parts = [_status("verdict", found.sentence, _verdict(found), level)]
    if found.verdict != Verdict.WAITING:
        reaches = f"noise reaches {found.threshold:.2f}"
        parts += [
            _status("where", f"stop {found.stop}: mean innovation over its sigma", _last_stop(found)),
            _status("ranking", reaches, ((r.label, f"{r.z:+.1f} sigma, {size(r)}") for r in _first(found))),
            _status("ladder", "error with one stop left out, 1 is right", ladder_rows(found.ladder)),
        ]
    if found.probabilities is not None:
        parts.append(_status("probabilities", "of what the model misses, all data", _odds(found.probabilities)))
        parts.append(
            _status("families", "the same, each family with its members as JSON", _folded(found.probabilities))
        )
    return DiagnosticArray(header=header(stamp_ns), status=parts)


def ranking(stamp_ns: int, found: LiveDiagnosis) -> JointState:
    """Return every candidate: estimate (SI) as position, score (sigma) as velocity, sigma (SI) as effort."""
    message = JointState(header=header(stamp_ns), name=[r.label for r in found.ranking])
    message.position = array("d", [r.estimate for r in found.ranking])
    message.velocity = array("d", [r.z for r in found.ranking])
    message.effort = array("d", [r.sigma for r in found.ranking])
    return message


def heat_map(stamp_ns: int, found: LiveDiagnosis) -> Float64MultiArray:
    """Return mean innovations over their sigma, channel by stop; labels name both, the last one is the stamp."""
    grid, channels = places(found.where)
    rows, columns = grid.value.shape
    dims = [
        MultiArrayDimension(label="channel:" + ",".join(channels), size=rows, stride=rows * columns),
        MultiArrayDimension(label="stop:" + ",".join(map(str, grid.stops)), size=columns, stride=columns),
        MultiArrayDimension(label=f"stamp_ns={stamp_ns}", size=1, stride=1),
    ]
    data = array("d", np.ascontiguousarray(grid.value).tobytes())
    return Float64MultiArray(layout=MultiArrayLayout(dim=dims), data=data)


def picture(stamp_ns: int, png: bytes) -> CompressedImage:
    """Return a drawn diagnosis."""
    return CompressedImage(header=header(stamp_ns, "diagnosis"), format="png", data=array("B", png))


def seen_diagnosis(message: DiagnosticArray, before: SeenDiagnosis) -> SeenDiagnosis:
    """Read what `diagnosis` made; the heat map is that of before."""
    parts = {status.name: status for status in message.status}
    tables = {name: tuple((v.key, v.value) for v in status.values) for name, status in parts.items()}
    about = dict(tables["verdict"])
    odds, ranked = dict(tables.get("probabilities", ())), tables.get("ranking", ())
    return replace(
        before,
        stop=int(about["stop"]),
        verdict=about["verdict"],
        sentence=parts["verdict"].message,
        reaches=parts["ranking"].message if "ranking" in parts else "",
        ranking=ranked,
        ladder=tables.get("ladder", ()),
        nothing=float(odds.get(NOTHING, math.nan)),
        families=tuple(_family(name, told) for name, told in tables.get("families", ())),
        # A node of an earlier version does not say it: then none is left out.
        standing=int(about.get(RANKED_ABOVE, len(ranked))),
    )


def seen_heat_map(message: Float64MultiArray, before: SeenDiagnosis) -> SeenDiagnosis:
    """Read what `heat_map` made; all else is that of before."""
    channels, stops = (tuple(dim.label.partition(":")[2].split(",")) for dim in message.layout.dim[:2])
    heat = np.array(message.data).reshape(len(channels), len(stops))
    return replace(before, channels=channels, stops=stops, heat=heat)


def _verdict(found: LiveDiagnosis) -> Iterable[tuple[str, str]]:
    yield "verdict", found.verdict
    yield "stop", str(found.stop)
    yield "until_s", f"{found.until_s:.6g}"
    yield "model", model_name(found.added)
    if found.verdict == Verdict.WAITING:
        return
    yield "threshold", f"{found.threshold:.6g}"
    yield "candidates_above", str(len(found.standing))
    yield RANKED_ABOVE, str(len(best_ranked(found.standing)))
    yield "largest_score", f"{max((abs(r.z) for r in found.ranking), default=0.0):.6g}"
    yield "best", found.ranking[0].label if found.standing else "none"
    yield "p_unexplained", f"{found.p_value:.3g}"
    yield "held_out", f"{found.ladder[-1].held_out:.6g}"
    yield "nis", f"{found.ladder[-1].nis:.6g}"
    for number, text in enumerate(found.noise, start=1):
        yield f"noise_{number}", text


def _odds(told: Probabilities) -> Iterable[tuple[str, str]]:
    """Probabilities with all their digits: of nothing, of families on a sensor, of their members."""
    yield NOTHING, repr(told.nothing)
    for family in told.families:
        yield f"{family.family} {family.sensor}".strip(), repr(family.probability)
        for member in family.members:
            yield member.label, repr(member.probability)
    for noise in told.noise:
        yield f"noise {noise.where} {noise.kind}", repr(noise.probability)


def _folded(told: Probabilities) -> Iterable[tuple[str, str]]:
    """Families in words, each with its probability and those of its members."""
    for family in told.families:
        members = [[member.label, member.probability] for member in family.members]
        yield family_in_words(family), json.dumps({"probability": family.probability, "members": members})


def _family(name: str, told: str) -> SeenFamily:
    read = json.loads(told)
    members = tuple((str(label), float(p)) for label, p in read["members"])
    return SeenFamily(name, float(read["probability"]), members)


def _last_stop(found: LiveDiagnosis) -> list[tuple[str, str]]:
    grid, channels = places(found.where)
    column = grid.value[:, -1] if grid.value.size else np.empty(0)
    return [(name, f"{value:.4g}") for name, value in zip(channels, column, strict=True) if np.isfinite(value)]


def _first(found: LiveDiagnosis) -> list[Ranked]:
    return best_ranked(found.ranking)[:_MOST_RANKED]


def _status(
    name: str, message: str, values: Iterable[tuple[str, str]], level: bytes = DiagnosticStatus.OK
) -> DiagnosticStatus:
    status = DiagnosticStatus(level=level, name=name, message=message, hardware_id="imu")
    status.values = [KeyValue(key=key, value=value) for key, value in values]
    return status
