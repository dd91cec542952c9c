"""Effects as a person reads them: title, coefficients, equation; grouped by family, the largest first."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from html import escape

from sdimu_calibration.core.diagnosis.found import Found
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.report.formula import mathml
from sdimu_calibration.report.groups import title as in_words


@cache
def effect_of_key(key: str) -> Effect | None:
    """Return the effect of a canonical key, None for one that only a file of its user knows."""
    try:
        return resolve(key)
    except DataError:
        return None


def title_of(key: str) -> str:
    """Title of an effect; of one that the registry does not know, its key in words."""
    effect = effect_of_key(key)
    return in_words(key) if effect is None else _with_variant(effect.title, effect)


def tip(words: str, effect: Effect | None, names: Sequence[str] = ()) -> str:
    """Words that show equation, cause and names of an effect on hover, touch or focus."""
    if effect is None:
        return escape(words)
    lines = [mathml(effect.equation), f"<br>{escape(effect.description)}" if effect.description else ""]
    called = ", ".join(names) or effect.family or effect.name
    lines.append(f"<br><code>{escape(called)}</code>")
    shown = f'<span class="tip" role="tooltip">{"".join(lines)}</span>'
    return f'<span class="effect" tabindex="0">{escape(words)}{shown}</span>'


def families(found: Sequence[Found]) -> list[list[Found]]:
    """Group what was found by effect, the largest score first."""
    groups: dict[str, list[Found]] = {}
    for one in sorted(found, key=lambda f: -abs(f.z)):
        key = one.candidate.label if one.candidate.family == "own" else one.candidate.effect.title
        groups.setdefault(key, []).append(one)
    return list(groups.values())


def family_words(group: Sequence[Found]) -> str:
    """Name a family with the coefficients that were found, as HTML: ``gyro scale-factor asymmetry, y``."""
    first = group[0].candidate
    labels = [one.candidate.label for one in group]
    if first.family == "own":
        return f"<code>{escape(first.label)}</code>"
    stem = first.family
    axes = [label.partition("(")[0].removeprefix(stem).strip("_") for label in labels]
    words = f"{first.effect.title}{', ' + ', '.join(axes) if any(axes) else ''}"
    return tip(_with_variant(words, first.effect), first.effect, labels)


def _with_variant(words: str, effect: Effect) -> str:
    """Put a time constant behind the words that it belongs to: ``bias warm-up, y (tau=1200 s)``."""
    return f"{words} {effect.variant}".rstrip()
