"""The result of a diagnosis, of one recording or of a set, as diagnosis.json: SI numbers, names as everywhere."""

from __future__ import annotations

import zlib
from base64 import b64decode, b64encode
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np

from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.bootstrap import Null
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis
from sdimu_calibration.core.diagnosis.found import DetectableSize, Found
from sdimu_calibration.core.diagnosis.ladder import Rung
from sdimu_calibration.core.diagnosis.plan_seen import PlanSeen
from sdimu_calibration.core.diagnosis.scan import scan
from sdimu_calibration.core.diagnosis.standing import standing
from sdimu_calibration.core.diagnosis.step import Step
from sdimu_calibration.core.diagnosis.summary import DiagnosisSummary
from sdimu_calibration.core.evidence.consistency import Noise
from sdimu_calibration.core.evidence.linear import LinearEvidence
from sdimu_calibration.core.fleet.common import STEPS, Bytes
from sdimu_calibration.core.handheld.run_scatter import FORCE, RATE, TURN
from sdimu_calibration.core.posterior.told import Probabilities, Share
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.verdict import Verdict
from sdimu_calibration.storage.files.advice_words import sentence
from sdimu_calibration.storage.files.json_file import entry
from sdimu_calibration.storage.files.result_model import Array, Line, Number, ResultModel, Said, read_model
from sdimu_calibration.storage.files.standing_file import KnownEntry

if TYPE_CHECKING:
    from sdimu_calibration.core.joint.recurrence import Recurrence

    # A diagnosis of one recording does not load what joins several.
    from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis
    from sdimu_calibration.core.joint.set_verdict import SetFinding

FORMAT: Final = "sdimu-diagnosis/1"
_MOST = 5000
"""Number of estimates at most: a catalogue has hundreds, and what is unpacked must be bounded."""
_TEST = "chi2 dof p=p_value"
"""Keys of a test of free inputs, as for `entry`."""


Row = dict[str, Any] | None
Rows = tuple[dict[str, Any], ...]


class Alone(ResultModel):
    """Entry ``alone``: every candidate of the catalogue alone beside the given model (SI), however small."""

    labels: tuple[Line, ...]
    units: tuple[Line, ...]
    display_units: tuple[Line, ...]
    estimates: Array
    sigmas: Array
    correlations: str


class DiagnosisFile(ResultModel):
    """diagnosis.json, in the order of its keys; what stands in them only for people is not looked into.

    The last ones are of a set, which has no keys that only one recording fills.
    """

    format: Literal["sdimu-diagnosis/1"] = FORMAT
    estimator: Line = ""
    adequate: bool = False
    p_value: Number = np.nan
    verdict: Line = ""
    sentence: Said = ""
    where: Rows = ()
    probabilities: Row = None
    candidates: Rows = ()
    partial: Rows = ()
    unexplained: Row = None
    advice: tuple[Said, ...] = ()
    findings: Rows = ()
    noise: Row = None
    consistency: Row = None
    free_inputs: Row = None
    alone: Any = None
    known: Any = None
    fit: Any = None
    ladder: Rows = ()
    grown: Rows = ()
    in_use: Row = None
    plan: Row = None
    not_testable: Rows = ()
    smallest_detectable: Rows = ()
    assumed_absent: Rows = ()
    bootstrap: Row = None
    function: Number | None = None
    functions: Rows = ()
    refused: tuple[Line, ...] = ()
    recurrence: Row = None


def write_diagnosis(path: Path, summary: DiagnosisSummary, null: Null | None = None, in_use: Row = None) -> None:
    """Write diagnosis.json. `null` is that of a bootstrap, `in_use` as `report.cost.in_use_entry` has it."""
    _file(summary, in_use=in_use, **({"bootstrap": _null(null)} if null else {})).write(path)


def read_diagnosis(path: Path) -> DiagnosisFile:
    """Read diagnosis.json, or the diagnosis.json in a folder."""
    path = Path(path)
    return read_model(path / "diagnosis.json" if path.is_dir() else path, DiagnosisFile)


def content(summary: DiagnosisSummary) -> dict[str, Any]:
    """Give the diagnosis as plain data."""
    return _file(summary).plain()


def _file(summary: DiagnosisSummary, **more: Any) -> DiagnosisFile:
    d = summary.diagnosis
    is_unexplained = d.verdict == Verdict.UNEXPLAINED
    return DiagnosisFile.model_construct(
        format=FORMAT,
        estimator=d.fit.estimator,
        adequate=d.adequate,
        p_value=d.p_value,
        verdict=d.verdict,
        sentence=summary.diagnosis.sentence,
        where=[entry(w, "channel stop normalised_mean") for w in d.consistency.where],
        probabilities=odds(d.probabilities),
        candidates=[candidate(f, d.own) for f in summary.candidates],
        partial=[candidate(f, d.own) for f in summary.found] if is_unexplained else [],
        unexplained={
            "is": is_unexplained,
            "fraction": _unexplained_fraction(d),
            "best_variables": [f.candidate.label for f in summary.found] if is_unexplained or d.own else [],
        },
        advice=tuple(map(sentence, summary.advice)),
        findings=[entry(f, "text grave") for f in d.findings],
        noise={
            "wrong": list(d.noise),
            "terms": [asdict(term) | {"unit": term.unit, "words": term.words} for term in d.found.noise],
            "gyro": _noise(d.consistency.gyro),
            "accel": _noise(d.consistency.accel),
        },
        consistency=entry(d.consistency, "nis_mean nis_p_value first_nis ljung_box_p", threshold=d.found.threshold),
        free_inputs={"before": entry(d.free_inputs_before, _TEST), "after": entry(d.free_inputs_after, _TEST)},
        alone=alone(d.evidence, d.free.tolist()),
        known=KnownEntry.of(standing(d, summary.found)),
        fit={"before": fit_of(d.before), "after": fit_of(d.after)},
        ladder=list(map(step_of, d.found.steps)),
        grown=list(map(_rung, d.rungs)),
        plan=_plan(summary.plan),
        not_testable=[reach_of(r) | {"reason": _reason(summary, r)} for r in summary.reached if not r.testable],
        smallest_detectable=[reach_of(r) for r in summary.reached if r.testable],
        assumed_absent=[
            entry(a, "coefficient label effect=family size unit display_unit sigmas") for a in summary.assumed
        ],
        **more,
    )


def packed(J: Floats) -> str:
    """Pack the correlations of estimates ``d_i / J_ii`` whose information is `J`, shape (k, k)."""
    unit = 1.0 / np.sqrt(np.diag(J))
    whole = np.rint(np.clip(J * np.outer(unit, unit), -1.0, 1.0) * STEPS).astype(np.int8)
    return b64encode(zlib.compress(whole[np.tril_indices(len(J), -1)].tobytes(), 9)).decode("ascii")


def unpacked(text: str, k: int) -> Bytes | None:
    """Unpack correlations of `k` estimates, times `STEPS`, shape (k, k); None for what is no such text."""
    if not 0 < k <= _MOST:
        return None
    count = k * (k - 1) // 2
    try:
        raw = zlib.decompressobj().decompress(b64decode(text), count + 1)
    except (ValueError, zlib.error):
        return None
    if len(raw) != count:
        return None
    out = np.zeros((k, k), np.int8)
    out[np.tril_indices(k, -1)] = np.frombuffer(raw, np.int8)
    out += out.T
    np.fill_diagonal(out, round(STEPS))
    return out


def alone(evidence: LinearEvidence, free: Sequence[int] = ()) -> Alone:
    """Give every candidate of the catalogue alone beside the given model, however small: many units make it large.

    `evidence`: of a recording, or of a set; `free`: columns of the evidence that are no candidates.
    """
    first = scan(evidence.information, evidence.model, evidence.weight)
    J = evidence.information.given(evidence.model, evidence.weight).J
    p = len(evidence.weight)
    columns = [
        k
        for k in range(p, len(evidence.names))
        if k not in free and np.isfinite(first.sigma[k]) and evidence.candidates[k - p].family != "own"
    ]
    candidates = [evidence.candidates[k - p] for k in columns]
    return Alone.model_construct(
        labels=[one.label for one in candidates],
        units=[one.parameter.unit for one in candidates],
        display_units=[one.parameter.display_unit for one in candidates],
        estimates=first.estimate[columns].tolist(),
        sigmas=first.sigma[columns].tolist(),
        correlations=packed(J[np.ix_(columns, columns)]),
    )


def _plan(plan: PlanSeen | None) -> dict[str, Any] | None:
    """Give the turns of a table as plain data; None where there is no table."""
    if plan is None:
        return None
    turns = [entry(t, "after_stop axis angle rate") for t in plan.turns]
    named = [turn | {"axis": None if turn["axis"] is None else "xyz"[turn["axis"]]} for turn in turns]
    return {"turns": named, "oblique_stops": plan.oblique}


def odds(told: Probabilities | None) -> Row:
    """Give the probabilities of a diagnosis as plain data (SI); None where there are none."""
    if told is None:
        return None
    member = "label p=probability value sigma unit display_unit"
    return {
        "nothing_missing": told.nothing,
        "families": [
            entry(family, "family sensor p=probability", members=[entry(one, member) for one in family.members])
            for family in told.families
        ],
        "noise": [entry(noise, "triad kind axes p=probability size low high unit") for noise in told.noise],
    }


def candidate(f: Found, own: bool) -> dict[str, Any]:
    """Give an effect that was found as plain data."""
    of = "candidate.parameter"
    return {
        "effect": f.candidate.label if own else f.candidate.family,
        "label": f.candidate.label,
        "parameters": [entry(f, f"name={of}.name value sigma unit={of}.unit display_unit={of}.display_unit")],
        "probability": f.probability,
        "may_be": _shares(f.may_be),
        "same_together": [{"labels": [one, other], "p": p} for one, other, p in f.together],
        **entry(f, "z delta_log_likelihood=log_likelihood_gain log_bayes_factor p_value_adjusted explained"),
        **entry(f, "held_out_rms_before=held_out_before held_out_rms_after=held_out_after"),
        "indistinguishable_from": list(f.alike),
        "depends_on_choice": [entry(s, "instead=other coefficient sigmas") for s in f.coefficient_shifts],
        "wider": [{"coefficient": name, "factor": factor} for name, factor in f.widened],
    }


def _unexplained_fraction(d: Diagnosis) -> float:
    """Share of the misfit that is left: none without a misfit; all or none where no free inputs measure it."""
    if d.verdict != Verdict.UNEXPLAINED and not len(d.found.chosen):
        return 0.0
    if np.isnan(d.explained):
        return float(d.verdict == Verdict.UNEXPLAINED)
    return float(np.clip(1.0 - d.explained, 0.0, 1.0))


def _noise(noise: Noise) -> dict[str, Any]:
    return entry(noise, "ratio sigma kurtosis", outliers=len(noise.outliers))


def fit_of(calibration: Calibration) -> dict[str, Any]:
    """Give model and fit of a calibration as plain data."""
    return {"model": list(calibration.model), **dict(calibration.fit)}


def step_of(s: Step) -> dict[str, Any]:
    """Give a step of the search as plain data."""
    return entry(
        s,
        "label effect=family z threshold estimate sigma unit log_likelihood_gain log_bayes_factor"
        " one_stop_out_before=held_out_before.rms one_stop_out_after=held_out_after.rms held_out_gain held_out_error",
        indistinguishable_from=list(s.alike),
        moved=_moved(s),
    )


def _moved(s: Step | Rung) -> list[dict[str, Any]]:
    return [{"name": name, "sigmas": size} for name, size in s.moved]


def _shares(shares: Sequence[Share]) -> list[dict[str, Any]]:
    return [entry(share, "name p=probability") for share in shares]


def _null(null: Null) -> dict[str, Any]:
    return entry(null, "draws false_finds threshold rms_z largest remainder_p=free_input_p")


def _rung(r: Rung) -> dict[str, Any]:
    scatter = r.scatter and {
        "force_m_s2": r.scatter[FORCE],
        "rate_rad_s": r.scatter[RATE],
        "turn_share": r.scatter[TURN],
    }
    names = "added accepted reason log_likelihood log_bayes_factor nis_mean held_out_rms jump jump_velocity"
    return entry(r, names, moved=_moved(r), beyond_white_noise=scatter)


def reach_of(r: DetectableSize) -> dict[str, Any]:
    """Give what could have been seen of one effect as plain data."""
    return entry(r, "label effect=family retention smallest unit display_unit", taken_by=list(r.partners))


def _reason(summary: DiagnosisSummary, r: DetectableSize) -> str:
    return next((b.reason for b in summary.untestable if r.label in b.labels), "")


def _recurrence(found: Recurrence) -> dict[str, Any]:
    return {"answer": list(found.answer), "apart": found.apart, **asdict(found)}


def write_set_diagnosis(path: Path, found: SetDiagnosis, in_use: Row = None) -> None:
    """Write diagnosis.json of a set. `in_use`: as `report.cost.in_use_entry` has it."""
    is_unexplained = found.verdict == Verdict.UNEXPLAINED
    DiagnosisFile.model_construct(
        format=FORMAT,
        estimator=found.after.estimator,
        adequate=found.verdict == Verdict.CONSISTENT,
        p_value=found.first.p_value,
        verdict=found.verdict,
        sentence=found.sentence,
        where=[
            entry(w, "recording channel stop normalised_mean=before normalised_mean_after=after")
            for w in sorted(found.where, key=lambda w: -abs(np.nan_to_num(w.before)))
        ],
        probabilities=odds(found.probabilities),
        candidates=[_of_set(f, found) for f in found.findings],
        unexplained={"is": is_unexplained, "fraction": float(is_unexplained), "best_variables": []},
        advice=tuple(map(sentence, found.advice)),
        consistency={"threshold": found.first.threshold},
        alone=alone(found.first.evidence),
        known=KnownEntry.of(found.standing),
        fit={"before": fit_of(found.before), "after": fit_of(found.after)},
        grown=[{"added": label, "held_out_rms": error} for label, error in found.ladder.rungs],
        in_use=in_use,
        function=found.function,
        functions=[asdict(one) | {"sensors": list(one.sensors)} for one in found.functions],
        refused=[f.label for f in found.refused],
        # None where the model leaves nothing in the stops.
        recurrence=None if found.recurrence is None else _recurrence(found.recurrence),
    ).write(Path(path))


def _of_set(f: SetFinding, found: SetDiagnosis) -> dict[str, Any]:
    """Give an effect that was found in a set as plain data; held-out errors are those without and with all of them."""
    return {
        **entry(f, "effect=family label"),
        "parameters": [entry(f, "name=label value sigma unit display_unit")],
        "probability": f.probability,
        "may_be": _shares(f.may_be),
        "z": f.z,
        "delta_log_likelihood": 0.5 * f.z**2,
        "p_value_adjusted": found.first.p_value_of(f.z),
        "explained": float("nan"),
        "held_out_rms_before": found.ladder.error_without,
        "held_out_rms_after": found.after.fit["held_out_rms"],
        "indistinguishable_from": list(f.alike),
        **entry(f, "recording against"),
    }
