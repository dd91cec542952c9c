"""What may be missing and how probable it is: each family of effects with its members, each noise, as HTML text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from sdimu_calibration.core.noise_term import NoiseTerm
from sdimu_calibration.core.posterior.family import BIAS_DRIFT
from sdimu_calibration.core.posterior.told import FamilyShare, MemberShare, NoiseShare, Probabilities
from sdimu_calibration.core.probability import in_percent
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.effect_words import title_of
from sdimu_calibration.report.markup import quiet, section
from sdimu_calibration.report.table import with_sigma

if TYPE_CHECKING:
    # A report of one recording needs none of the rooms of a set.
    from sdimu_calibration.core.joint.set_diagnosis import SetDiagnosis

_LEAST = 0.05
"""Probability (1) from which a family or a noise has a line of its own: less is one of many."""
_MOST = 12
"""Number of families at most, and of members of one: the file has them all."""
_MEANS = "Coefficients and sigmas of this page are means over these models."
_AS_GIVEN = "The table of coefficients is of one model; a diagnosis of the bag gives means over these models."
_HEAD = ("", "probability", "", "size if it is this")


def odds_section(
    told: Probabilities | None,
    where: str = "in this test",
    found: Mapping[str, str] | None = None,
    functions: Sequence[tuple[str, float]] = (),
    means: bool = True,
) -> str:
    """Return the section; empty where there are no probabilities.

    `where`: what the data are of, as it ends a sentence; `found`: sizes in words of what the page tells as found, by
    label: a size stands on a page once; `functions`: of unknown functions, in words, with their probability; `means`:
    the coefficients of the page are means over the models.
    """
    sizes = found or {}
    if told is None:
        return ""
    lines = [_line("No effect of the catalogue is missing", told.nothing)]
    families = [one for one in told.families if one.probability >= _LEAST][:_MOST]
    for family in families:
        lines.append(_line(family_in_words(family), family.probability, size=_only(family, sizes)))
        if len(family.members) > 1:
            lines += [
                _line(m.label, m.probability, True, sizes.get(m.label) or _size(m)) for m in family.members[:_MOST]
            ]
    lines += [_line(words, p) for words, p in functions if p >= _LEAST]
    lines += [_line(_noise(n), n.probability) for n in told.noise if n.probability >= _LEAST]
    head = "".join(f'<th scope="col"{" class=text" if k == 0 else ""}>{word}</th>' for k, word in enumerate(_HEAD))
    rest = (
        ""
        if families or told.nothing > 0.5
        else "No family of effects is more probable than 5 %: many explain about the same. "
    )
    return section(
        "How probable each cause is",
        f'<div class="wide"><table class="odds"><thead><tr>{head}</tr></thead><tbody>{"".join(lines)}</tbody></table>'
        "</div>",
        quiet(
            f"{rest}Summed over all models that the data leave probable {where}, weighed with how usual each is. "
            f"Of a family, each member is listed; several effects may be missing at once. "
            f"{_MEANS if means else _AS_GIVEN}"
        ),
    )


def odds_of_set(found: SetDiagnosis) -> str:
    """Return the section of a set, with the functions of the attitude that were looked for."""
    of_all = "An unknown function of the attitude, the same in all recordings"
    told = [
        (f"{of_all if one.is_common else f'One of {one.recording} alone'} ({', '.join(one.sensors)})", one.probability)
        for one in found.functions
    ]
    return odds_section(found.probabilities, "in these recordings", functions=told)


def family_in_words(family: FamilyShare) -> str:
    """Name a family and its sensor: ``slow change of the bias, gyro y``."""
    sensor = family.sensor.replace("_", " ")
    if family.family == "own":
        return f"An equation that the catalogue lacks, {sensor}"
    if family.family.endswith(BIAS_DRIFT):
        return f"Slow change of the bias, {sensor}"
    words = title_of(family.members[0].label.partition("(")[0]) if family.members else family.family
    return f"{words[:1].upper()}{words[1:]}{f', {sensor}' if sensor else ''}"


def _only(family: FamilyShare, sizes: Mapping[str, str]) -> str:
    if len(family.members) != 1:
        return ""
    return sizes.get(family.members[0].label) or _size(family.members[0])


def _size(member: MemberShare) -> str:
    if not np.isfinite(member.value):
        return ""
    unit = member.display_unit
    return with_sigma(from_si(member.value, unit), from_si(member.sigma, unit), unit)


def _noise(noise: NoiseShare) -> str:
    size = NoiseTerm(noise.triad, noise.kind, size=noise.size, axes=noise.axes)
    amount = f"{from_si(noise.size, size.display_unit):.3g} {size.display_unit}"
    return f"Noise: {size.words}, {amount}"


def _line(name: str, p: float, inner: bool = False, size: str = "") -> str:
    words = f'<td class="text{" inner" * inner}">{f"<code>{escape(name)}</code>" if inner else escape(name)}</td>'
    return (
        f'<tr>{words}<td><meter min="0" max="1" value="{p:.3f}">{in_percent(p)}</meter></td>'
        f"<td>{escape(in_percent(p))}</td><td>{escape(size)}</td></tr>"
    )
