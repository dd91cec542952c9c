"""One sample is told as one, and several as several."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.data.arrival import arrange
from sdimu_calibration.core.plain_text import counted


@pytest.mark.parametrize(
    ("rows", "note"),
    [([50], "1 sample was not finite and dropped"), ([50, 51, 70], "3 samples were not finite and dropped")],
)
def test_samples_that_are_no_numbers_are_counted_in_words(rows, note):
    ns, rate, force = np.arange(100) * 10_000_000, np.zeros((100, 3)), np.ones((100, 3))
    rate[rows] = np.nan
    assert arrange(ns, rate, force, "/imu").notes == (note,)


def test_a_word_follows_its_number():
    assert [counted(n, "gap") for n in (0, 1, 2)] == ["0 gaps", "1 gap", "2 gaps"]
    assert [counted(n, "sample is", "samples are") for n in (1, 2)] == ["1 sample is", "2 samples are"]
