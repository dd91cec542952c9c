"""What the workbench calls its numbers: two errors are not taken for one another, and each is explained."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from sdimu_calibration.core.origin import Origin
from sdimu_calibration.report.beside_title import beside_title
from sdimu_calibration.report.glossary import WORDS
from sdimu_calibration.report.workbench import parts
from sdimu_calibration.report.workbench.elements import card, explained, table


def abbreviations(made: Any) -> dict[str, str]:
    """Words of a component that are explained, with what is said of them."""
    out: dict[str, str] = {}
    for child in made if isinstance(made, list) else [made]:
        if type(child).__name__ == "Abbr":
            out[child.children] = child.title
        elif hasattr(child, "children"):
            out |= abbreviations(child.children)
    return out


def test_the_error_of_a_report_is_not_called_as_the_one_beside_the_title():
    left = SimpleNamespace(chi2=10.0, dof=9)
    missing: Any = SimpleNamespace(probabilities=None, left=left, held_out=1.226)
    fitted: Any = SimpleNamespace(held_out=1.046, at_held=None, calibration=SimpleNamespace(inseparable=()))
    (told,) = parts.odds(missing)
    bar = explained(parts.numbers(fitted, fitted))
    assert abbreviations(told)["a third of the stops left out"] == WORDS["a third of the stops left out"]
    assert abbreviations(bar)["one stop left out"] == WORDS["one stop left out"]
    assert set(abbreviations(told)) & set(abbreviations(bar)) == {"sigma"}


def test_titles_and_headings_explain_their_words():
    assert abbreviations(card("Is the noise as promised? NIS")) == {"NIS": WORDS["NIS"]}
    assert abbreviations(table(("model", "NIS"), [])) == {"NIS": WORDS["NIS"]}
    assert explained("no such word") == "no such word"


def test_a_title_says_what_is_known_and_nothing_else():
    origin = Origin("A7", start_ns=1_700_000_000 * 10**9, imu="dtg", site="daejeon", recording="two")
    words = ["two", "2023-11-14 22:13:20 UTC", "14.6 min", "IMU dtg", "serial A7", "daejeon"]
    assert beside_title(origin, duration_s=876.0).split(" \N{MIDDLE DOT} ") == words
    assert beside_title(Origin(), of="out/run", course="plan kim18") == "out/run \N{MIDDLE DOT} plan kim18"
    assert beside_title(Origin()) == ""
