"""What the study of probabilities counts as there: what can be seen; and what it counts at all."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.verdict import Verdict
from sdimu_study.reliability import score
from sdimu_study.worlds import Truth

from .conftest import TWO

STRONG, WEAK = TWO


def truth(text: str, sigmas: float) -> Truth:
    label, _, size = text.partition("=")
    name = label.partition("(")[0]
    return Truth(name, name.rpartition("_")[0], None, float(size.split()[0]), sigmas, text)


def right(row, what):
    return sum(true for p, true in row[what] if p > 0.9)


def test_an_effect_counts_as_there_from_two_sigma_on(two, two_found):
    rows = [
        score(replace(two, truths=(truth(STRONG, 25.0), truth(WEAK, sigmas))), (two_found, 1.0))
        for sigmas in (1.99, 2.0)
    ]
    assert [right(row, "families") for row in rows] == [1, 2]
    assert [right(row, "effects") for row in rows] == [1, 2]
    assert [len(row["hidden"]) for row in rows] == [2, 2]
    alone = [score(replace(two, truths=(truth(WEAK, sigmas),)), (two_found, 1.0)) for sigmas in (1.99, 2.0)]
    assert [row["nothing"][0][1] for row in alone] == [True, False]


def test_data_at_fault_make_no_statement(two, two_found):
    with pytest.raises(DataError, match="no statement on physics"):
        score(two, (replace(two_found, verdict=Verdict.DATA_FAULT), 1.0))
