"""Text from elsewhere made fit to be shown: one line, no control characters, not endless."""

from __future__ import annotations

from collections.abc import Sequence

LONGEST_LINE = 500
"""Number of characters of a line shown to a user: six lines of a terminal; more hides what it says."""
_TAIL = 160
"""Number of characters kept of the end of a line that is too long: what to do stands there."""

_LONG = 1e6
"""Number (1) from which people read a power of ten: its digits are no longer counted at a glance."""


def printable(text: str) -> str:
    """Write every character that a terminal would obey, not show, as ``ascii`` does."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def one_line(text: str, longest: int | None = LONGEST_LINE) -> str:
    """Write a text on one line of printable characters.

    `longest`: characters beyond which the middle is left out; None keeps all.
    """
    # A text of megabytes is cut before its characters are looked at.
    if longest is not None and len(text) > 8 * longest:
        text = text[: 4 * longest] + text[-4 * longest :]
    line = printable(" ".join(text.split()))
    if longest is None or len(line) <= longest:
        return line
    return f"{line[: longest - _TAIL - 5]} ... {line[-_TAIL:]}"


def counted(number: int, one: str, many: str = "") -> str:
    """Write a number with its word: ``1 gap``, ``2 gaps``.

    `one`, `many`: what stands behind one, and behind any other number; `one` with an s by default.
    """
    return f"{number} {one if number == 1 else many or one + 's'}"


def three(value: float) -> str:
    """Write a number with three digits, a larger one whole: people read 1027, not 1.03e+03."""
    return f"{value:.0f}" if 999.5 <= abs(value) < _LONG else f"{value:.3g}"


def first_of(names: Sequence[str], most: int) -> str:
    """Write names one after the other, of more than `most` the first ones."""
    return ", ".join(names[:most]) + (" and others" if len(names) > most else "")


def listing(names: Sequence[str], between: str = "and") -> str:
    """Write names one after the other, with a word between the last two."""
    return f" {between} ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def capital(text: str) -> str:
    """Begin a text with a capital letter, and leave the rest as it is: units keep their spelling."""
    return text[:1].upper() + text[1:]
