"""The page of the catalogue: equations typeset in the book, plain text for any other reader."""

from __future__ import annotations

import re
from html import unescape

import pytest

from sdimu_calibration.report.catalogue import grouped, page
from sdimu_calibration.report.formula import mathml

EQUATIONS = [text for _, effects in grouped() for effect in effects for text in effect.equation.split("; ")]


def test_the_book_has_every_equation_typeset_and_none_as_text():
    book = page(typeset=True)
    assert [unescape(text) for text in re.findall(r'<math alttext="([^"]*)">', book)] == EQUATIONS
    assert len(EQUATIONS) > 80
    entries = re.findall(r"^### .*?(?=^- )", book, flags=re.MULTILINE | re.DOTALL)
    assert not [entry for entry in entries if re.search(r"`d[wf]\w* = ", entry)]


def test_the_page_for_other_readers_has_them_as_text():
    text = page()
    assert "<math" not in text
    assert text.count("`dw_i = T_i w_i`") == 1


@pytest.mark.parametrize(
    ("text", "typeset"),
    [
        ("K2_i a_i^2", "<msub><mi>K</mi><mi>2,i</mi></msub><msup><msub><mi>a</mi><mi>i</mi></msub><mn>2</mn></msup>"),
        ("T0", "<msub><mi>T</mi><mi>0</mi></msub>"),
        ("K1'_i", "<msub><mi>K\u2032</mi><mi>1,i</mi></msub>"),
        ("sum_k c_k", "<msub><mi>\u2211</mi><mi>k</mi></msub><msub><mi>c</mi><mi>k</mi></msub>"),
        ("(a)_i", "<msub><mrow><mo>(</mo><mi>a</mi><mo>)</mo></mrow><mi>i</mi></msub>"),
        ("sqrt(a)", "<mo>\u221a</mo><mrow><mo>(</mo><mi>a</mi><mo>)</mo></mrow>"),
    ],
)
def test_numbers_and_axes_stand_below_and_a_root_is_seen_without_a_font_for_mathematics(text, typeset):
    assert mathml(text) == f'<math alttext="{text.replace(chr(39), "&#x27;")}"><mrow>{typeset}</mrow></math>'
