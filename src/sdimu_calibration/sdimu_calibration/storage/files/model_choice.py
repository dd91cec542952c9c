"""Words for estimators and models: the same in the shell and in Python."""

from __future__ import annotations

from collections.abc import Sequence

from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import AUTO, ESTIMATORS, OLDER_NAMES
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import Model
from sdimu_calibration.storage.files.effect_file import extended_model

TABLE_MODEL, HANDHELD_MODEL = "baseline", "hand"
"""Models that are taken where the user names none."""
HANDHELD = "handheld"
"""The estimator that navigates nothing."""
_ESTIMATOR_ALIASES = {"hand": HANDHELD, **OLDER_NAMES}
_MODEL_ALIASES = {HANDHELD: HANDHELD_MODEL}


def named_estimator(word: str, option: str = "estimator") -> str:
    """Return the estimator that `word` means, ``auto`` included; ``hand`` and ``second-order`` are other names."""
    name = _ESTIMATOR_ALIASES.get(word, word)
    if name not in (AUTO, *ESTIMATORS):
        raise DataError(f"{option} {word}: expected one of {', '.join((AUTO, *ESTIMATORS))}")
    return name


def by_hand(test: PreparedTest, estimator: str = AUTO) -> bool:
    """Whether a test is estimated as a run by hand: as asked for, or as its data say."""
    return estimator == HANDHELD or (estimator == AUTO and bool(test.why_handheld))


def model_word(word: str | None, handheld: bool) -> str:
    """Return the name or path of a model that `word` means; parameters as for `named_model`."""
    default = HANDHELD_MODEL if handheld else TABLE_MODEL
    return _MODEL_ALIASES.get(word, word) if word else default


def named_model(word: str | None, added: Sequence[str], handheld: bool = False) -> Model:
    """Read the model that `word` means, with effects added; ``handheld`` means ``hand``.

    `word`: name in config/model or path; None or empty takes the model for a table, or for a handheld run. `added`:
    effects to add. `handheld`: moved by hand.
    """
    return extended_model(model_word(word, handheld), added)
