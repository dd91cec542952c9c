"""Words of a page are explained where they stand first, and a page is printed or one line says why not."""

from __future__ import annotations

import pytest

from sdimu_calibration.core.recording import DataError
from sdimu_calibration.report import pdf
from sdimu_calibration.report.glossary import WORDS, explained, in_parts


def test_a_word_is_explained_once_and_tags_stay_as_they_are():
    told = explained('<p title="NIS">Held-out error and NIS; the held-out error again</p>')
    assert told.count("<abbr") == 2
    assert told.startswith('<p title="NIS"><abbr title="RMS of measurement')
    assert ">Held-out error</abbr>" in told
    assert told.endswith("the held-out error again</p>")


def test_the_two_errors_of_a_workbench_have_names_of_their_own_and_each_says_what_it_is():
    told = list(in_parts("one stop left out 1.05; a third of the stops left out 1.23"))
    assert [words for words, why in told if why] == ["one stop left out", "a third of the stops left out"]
    assert len({why for _, why in told if why}) == 2
    assert "".join(words for words, _ in told) == "one stop left out 1.05; a third of the stops left out 1.23"


def test_a_part_of_a_word_is_no_word():
    assert explained("UNIST, sigmas-like, sixsigmas") == "UNIST, sigmas-like, sixsigmas"


def test_explanations_break_no_attribute():
    assert not any(mark in text for text in WORDS.values() for mark in '"<>')


def test_without_a_browser_the_page_is_left_and_one_line_says_what_to_do(monkeypatch):
    monkeypatch.setattr(pdf.shutil, "which", lambda _: None)
    with pytest.raises(DataError, match="open the page and print it"):
        pdf.browser()


def test_a_browser_that_prints_nothing_is_told(tmp_path):
    page = tmp_path / "report.html"
    page.write_text("<p>x")
    (tmp_path / "report.pdf").write_text("old")
    with pytest.raises(DataError, match="did not print"):
        pdf.print_pdf(page, "true")
    assert not (tmp_path / "report.pdf").exists()
