"""README and the page on sets are read once: no sentence of theirs is longer than a breath."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from .pages import ROOT

MOST_WORDS = 26
NO_PROSE = ("    ", "|", "#", "!")


def sentences(text: str, ends: str) -> Iterator[str]:
    """Sentences of the prose of a page, parted behind each of `ends`; links by their words."""
    for part in re.split(r"\n\s*\n|\n(?=\s*- )|(?<=\|)\n", re.sub(r"```.*?```", "", text, flags=re.DOTALL)):
        lines = [line for line in part.strip("\n").split("\n") if not line.startswith(NO_PROSE)]
        prose = re.sub(r"\]\([^)]*\)", "]", " ".join(lines))
        yield from re.split(rf"(?<=[{ends}])\*?\s+", prose)


@pytest.mark.parametrize(("page", "ends"), [("README.md", ".!?"), ("doc/sets.md", ".!?:;")])
def test_no_sentence_has_to_be_read_twice(page, ends):
    counted = {one: len(re.findall(r"\S*\w\S*", one)) for one in sentences((ROOT / page).read_text(), ends)}
    assert len(counted) > 50
    assert {one: words for one, words in counted.items() if words > MOST_WORDS} == {}


def test_the_words_of_a_sentence_are_counted_to_its_end():
    page = "One two\nthree: four.\n\n    code, no prose\n\n- *Five* [six](link.md).\n- *Seven.* Eight.\n"
    assert [one.split() for one in sentences(page, ".:")] == [
        ["One", "two", "three:"],
        ["four."],
        [],
        ["-", "*Five*", "[six]."],
        ["-", "*Seven."],
        ["Eight."],
    ]
