"""The diagnosis of a hand-held run as diagnosis.json: the keys of every diagnosis, and the ladder of fits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sdimu_calibration.core.diagnosis.handheld_diagnosis import HandheldRung
from sdimu_calibration.core.diagnosis.handheld_summary import HandheldSummary
from sdimu_calibration.core.handheld.handheld_fit import FORCE, RATE, TURN
from sdimu_calibration.storage.diagnosis_file import FORMAT, candidate, fit_of, reach_of, step_of
from sdimu_calibration.storage.json_file import write_json


def write_handheld_diagnosis(path: Path, told: HandheldSummary) -> None:
    """Write diagnosis.json.

    Parameters
    ----------
    path : Path
        File to make or replace; its folder is made too.
    told : HandheldSummary
    """
    write_json(path, hand_content(told))


def hand_content(told: HandheldSummary) -> dict[str, Any]:
    """Give the diagnosis as plain data."""
    d = told.diagnosis
    unexplained = d.verdict == "unexplained"
    return {
        "format": FORMAT,
        "method": "by hand",
        "adequate": d.adequate,
        "p_value": d.p_value,
        "verdict": d.verdict,
        "sentence": told.sentence,
        "where": [{"channel": w.channel, "stop": w.stop, "normalised_mean": w.normalised} for w in told.where],
        "candidates": [candidate(f, d.own) for f in told.found],
        "partial": [],
        "unexplained": {
            "is": unexplained,
            "fraction": 1.0 if unexplained else 0.0,
            "best_variables": [s.label for s in d.steps] if unexplained else [],
        },
        "advice": list(told.advice),
        "findings": [{"text": f.text, "grave": f.grave} for f in d.after.faults],
        "consistency": {"threshold": d.threshold},
        "fit": {"before": fit_of(d.before), "after": fit_of(d.after)},
        "ladder": [step_of(s) for s in d.steps],
        "beyond_white_noise": [_rung(r) for r in d.rungs],
        "not_testable": [reach_of(r) for r in told.reached if not r.testable],
        "smallest_detectable": [reach_of(r) for r in told.reached if r.testable],
    }


def _rung(r: HandheldRung) -> dict[str, Any]:
    return {
        "added": r.added, "log_likelihood": r.log_likelihood, "held_out_rms": r.held_out,
        "force_m_s2": float(r.extra[FORCE]), "rate_rad_s": float(r.extra[RATE]), "turn_share": float(r.extra[TURN]),
    }  # fmt: skip
