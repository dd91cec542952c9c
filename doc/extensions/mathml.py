"""Typeset equations as MathML, which browsers draw themselves: no script, no network, light and dark alike."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import ziamath
from docutils import nodes
from fontTools import subset, ttLib
from math_core import LatexError, LatexToMathML
from sphinx.errors import ExtensionError
from sphinx.util.math import get_node_equation_number

FONT = Path(ziamath.__file__).parent / "fonts" / "STIXTwoMath-Regular.ttf"
"""STIX Two Math (SIL Open Font License): has the table that MathML needs, which the fonts of many systems lack."""
_RANGES = ((0x20, 0x17F), (0x300, 0x3FF), (0x2000, 0x23FF), (0x25A0, 0x25FF), (0x27C0, 0x2AFF), (0x1D400, 0x1D7FF))
"""Letters and signs that are kept: Latin, Greek, operators, the mathematical alphabets."""

_CONVERTER = LatexToMathML()


def typeset(latex: str, block: bool) -> str:
    """Convert LaTeX to MathML.

    Raises
    ------
    ExtensionError
        When the equation is not understood; names the equation.
    """
    try:
        return str(_CONVERTER.convert_with_local_state(latex, displaystyle=block))
    except LatexError as error:
        raise ExtensionError(f"equation not understood: {latex!r}: {error}") from error


def inline(self: Any, node: nodes.math) -> None:
    """Write an equation in a line."""
    self.body.append(typeset(node.astext(), block=False))
    raise nodes.SkipNode


def display(self: Any, node: nodes.math_block) -> None:
    """Write an equation that stands alone, with its number where it has one."""
    text = node.astext()
    if r"\\" in text and r"\begin" not in text:
        text = rf"\begin{{aligned}}{text}\end{{aligned}}"
    self.body.append(self.starttag(node, "div", CLASS="equation"))
    self.body.append(typeset(text, block=True))
    if node.get("number"):
        self.body.append(f'<span class="number">({get_node_equation_number(self, node)})</span>')
    self.body.append("</div>")
    raise nodes.SkipNode


def write_font(app: Any, error: Exception | None) -> None:
    """Put the part of the font that equations use beside the pages."""
    if error is not None or app.builder.format != "html":
        return
    logging.getLogger("fontTools").setLevel(logging.WARNING)
    font = ttLib.TTFont(FONT)
    chosen = subset.Subsetter(subset.Options(layout_features=["*"], notdef_outline=True))
    chosen.populate(unicodes=[code for first, last in _RANGES for code in range(first, last + 1)])
    chosen.subset(font)
    font.flavor = "woff"
    font.save(Path(app.outdir) / "_static" / "math.woff")


def setup(app: Any) -> dict[str, bool]:
    """Register the renderer and the font."""
    app.add_html_math_renderer("mathml", (inline, None), (display, None))
    app.connect("build-finished", write_font)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
