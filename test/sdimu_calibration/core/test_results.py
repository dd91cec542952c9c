"""What results say of themselves."""

import pytest

from sdimu_calibration.core.note import without_advice
from sdimu_calibration.storage.files.result_file import as_note


@pytest.mark.parametrize(
    ("note", "left"),
    [
        ("the model does not fit (NIS 1.2); run: sdimu diagnose", "the model does not fit (NIS 1.2)"),
        ("look at the data there, or run: sdimu diagnose", "look at the data there"),
        ("A missing effect can look the same: run sdimu diagnose", "A missing effect can look the same"),
        ("a handheld run: use sdimu diagnose x.mcap", "a handheld run: use sdimu diagnose x.mcap"),
    ],
)
def test_a_diagnosed_fit_is_not_told_to_be_diagnosed(note, left):
    assert without_advice([as_note(note)]) == (left,)
