"""The table of constants in the theory of the posterior is that of the code."""

from __future__ import annotations

import re
from collections.abc import Mapping

import pytest

from .pages import ROOT
from .test_sources import found

PAGE = ROOT / "doc" / "theory" / "priors.md"
ROWS = re.findall(r"^\| `([\w.]+)` \| ([\d., ]+) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)


def test_the_table_has_all_groups_of_constants():
    assert {name.rpartition(".")[0] for name, _ in ROWS} >= {
        "posterior.prior",
        "posterior.noise_models",
        "posterior.noise_search",
        "posterior.search",
        "posterior.posterior",
        "effects.usual",
    }


@pytest.mark.parametrize(("name", "stated"), ROWS, ids=[name for name, _ in ROWS])
def test_a_constant_of_the_page_is_that_of_the_code(name, stated):
    value = found(f"sdimu_calibration.core.{name}")
    if callable(value):
        value = value("an effect that no list holds")
    numbers = value.values() if isinstance(value, Mapping) else value if isinstance(value, tuple) else (value,)
    assert [float(text) for text in stated.split(",")] == list(numbers)
