"""Equations of effects, plain text in the registry, as MathML: a browser typesets them without a library or a network.

``dw_i = k_i exp(-t/tau)`` is read from left to right: a name with its subscript, powers, roots, fractions of two names,
``x`` between two vectors as their product. What is no symbol stays a word.
"""

from __future__ import annotations

import re
from html import escape

_SYMBOLS = {
    "alpha": "\u03b1",
    "tau": "\u03c4",
    "eta": "\u03b7",
    "pi": "\u03c0",
    "sigma": "\u03c3",
    "theta": "\u03b8",
    "w": "\u03c9",
    "wt": "\u03c9\u209c",
    "dw": "\u03b4\u03c9",
    "df": "\u03b4f",
    "dg": "\u03b4g",
    "dlat": "\u03b4\u03c6",
    "dT": "dT",
    "dt": "dt",
    "dy": "dy",
    "sum": "\u2211",
    "own": "own",
    "cross": "cross",
    "nb": "nb",
    "bn": "bn",
    "ie": "ie",
}
_FUNCTIONS = {"exp", "sin", "cos", "tan", "tanh", "log", "sgn", "sqrt", "max", "min", "abs", "dx"}
_TOKEN = re.compile(r"[A-Za-z]+\d*'?(?:_[A-Za-z0-9]+)*|\d+(?:\.\d+)?(?:e[-+]?\d+)?|\.\.|\*\*|\s+|.")
_NAME = re.compile(r"[A-Za-z]+\d*'?(?:_[A-Za-z0-9]+)*")
_LONGEST_SYMBOL = 1
"""Number of letters of a name that is a symbol by itself: longer ones are words unless they are listed or have a
subscript."""


def mathml(text: str) -> str:
    """Return an equation as one ``math`` element; its text stays in it as ``alttext``."""
    tokens = [token for token in _TOKEN.findall(text) if not token.isspace()]
    rows, at = [], 0
    while at < len(tokens):
        piece, at = _atom(tokens, at)
        rows.append(piece)
    return f'<math alttext="{escape(text)}"><mrow>{"".join(rows)}</mrow></math>'


def _atom(tokens: list[str], at: int) -> tuple[str, int]:
    """Read what stands at a place with the power or the denominator behind it."""
    piece, at = _single(tokens, at)
    # A subscript of what stands in brackets: that of a name is a part of it.
    if at + 1 < len(tokens) and tokens[at] == "_":
        below, at = _single(tokens, at + 1)
        piece = f"<msub>{piece}{below}</msub>"
    if at + 1 < len(tokens) and tokens[at] in {"^", "**"}:
        power, at = _single(tokens, at + 1)
        piece = f"<msup>{piece}{power}</msup>"
    if at + 1 < len(tokens) and tokens[at] == "/" and _is_plain(tokens[at - 1]) and _is_plain(tokens[at + 1]):
        below, at = _atom(tokens, at + 1)
        piece = f"<mfrac>{piece}{below}</mfrac>"
    return piece, at


def _single(tokens: list[str], at: int) -> tuple[str, int]:
    token = tokens[at]
    if token == "sqrt" and tokens[at + 1 : at + 2] == ["("]:
        inside, end = _group(tokens, at + 1)
        # Not msqrt: where no font for mathematics is installed its sign is not drawn.
        return f"<mo>\u221a</mo><mrow><mo>(</mo>{inside}<mo>)</mo></mrow>", end
    if token in "([":
        inside, end = _group(tokens, at)
        close = {"(": ")", "[": "]"}[token]
        return f"<mrow><mo>{token}</mo>{inside}<mo>{close}</mo></mrow>", end
    if token == "x" and 0 < at < len(tokens) - 1:
        return "<mo>\u00d7</mo>", at + 1
    if _NAME.fullmatch(token):
        return _name(token), at + 1
    if token[0].isdigit():
        return f"<mn>{token}</mn>", at + 1
    return f"<mo>{escape({'-': chr(0x2212), '*': chr(0xB7), '..': chr(0x2026)}.get(token, token))}</mo>", at + 1


def _group(tokens: list[str], at: int) -> tuple[str, int]:
    """Read from a bracket to the one that closes it; a bracket that stays open ends with the text."""
    close = {"(": ")", "[": "]"}[tokens[at]]
    pieces, at = [], at + 1
    while at < len(tokens) and tokens[at] != close:
        piece, at = _atom(tokens, at)
        pieces.append(piece)
    return "".join(pieces), at + 1


def _is_plain(token: str) -> bool:
    return bool(_NAME.fullmatch(token)) or token[0].isdigit()


def _name(token: str) -> str:
    base, _, below = token.partition("_")
    stem, prime = base.rstrip("'"), "\u2032" if base.endswith("'") else ""
    letters = stem.rstrip("0123456789")
    # The number of a coefficient stands below, as its axis does: K2_i, T0.
    below = ",".join(part for part in (stem[len(letters) :], below) if part)
    stem = letters
    if stem in _FUNCTIONS:
        return f"<mi>{stem}</mi><mo>\u2061</mo>" if not below else _below(stem, prime, below)
    known = stem in _SYMBOLS or below or len(stem) <= _LONGEST_SYMBOL
    if not known:
        return f"<mtext>\u2009{escape(stem)}\u2009</mtext>"
    return _below(_SYMBOLS.get(stem, stem), prime, below)


def _below(symbol: str, prime: str, below: str) -> str:
    body = f"<mi>{escape(symbol)}{prime}</mi>"
    return f"<msub>{body}<mi>{escape(_SYMBOLS.get(below, below))}</mi></msub>" if below else body
