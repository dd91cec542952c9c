"""The catalogue of effects as a page: made from the registry, so that it cannot fall behind."""

from __future__ import annotations

from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.effect import ACCEL, BASELINE, GYRO, REFERENCES, Effect
from sdimu_calibration.core.plain_text import three
from sdimu_calibration.core.units import from_si
from sdimu_calibration.report.formula import mathml

_ORDER = (BASELINE, "Accelerometer", "Gyro", REFERENCES, "Other")

_HEAD = """# Catalogue of effects

Made by `sdimu effects --markdown` from the registry (`core/effects/`, one file per physical cause); do not edit.
dw, df: measured minus true body rate and specific force; a = f/g; w: body rate against inertial space. Axis i is the
sensor's own, j and k the others. Any name here, or one of its coefficients, can be given to `--add`; with a size behind
it, a coefficient can be given to `simulate --effect`. How effects are written, those of one's own too, is in
[diagnosis.md](../diagnosis.md).
"""


def grouped() -> list[tuple[str, list[Effect]]]:
    """All registered effects under headings; no heading without effects."""
    found: dict[str, list[Effect]] = {title: [] for title in _ORDER}
    for effect in map(registry.get, registry.names()):
        found.setdefault(_heading(effect), []).append(effect)
    return [(title, effects) for title, effects in found.items() if effects]


def _heading(effect: Effect) -> str:
    channels = {term.channel for term in effect.terms}
    triad = "Gyro" if channels <= set(GYRO) else "Accelerometer" if channels <= set(ACCEL) else "Other"
    return effect.group or triad


_SCOPES = {
    "unit": "the unit",
    "power-on": "the time from switch-on to switch-off",
    "setup": "site and mount of the test",
    "recording": "one recording: a fault of its data",
}


def facts(effect: Effect) -> list[str]:
    """Say what an effect needs to be seen, what its value holds for, and what it is confused with."""
    out = [f"holds for: {_SCOPES[effect.scope]}"]
    if effect.excitation:
        out.append("shown by: " + ", ".join(sorted(e.value for e in effect.excitation)))
    if effect.never_seen:
        out.append(f"shown by no plan: {effect.never_seen}")
    if effect.gauge:
        out.append("part of the turn of the body frame, which no measurement shows")
    if effect.needs or effect.needs_table:
        out.append("needs: " + ", ".join(n for n in (effect.needs, "a table" if effect.needs_table else "") if n))
    if effect.tried_in == "set":
        out.append("tried unasked only where several recordings are diagnosed together")
    if effect.tried_in == "request":
        out.append("not tried unasked")
    if effect.confused_with:
        out.append(f"confused with: {', '.join(effect.confused_with)}")
    return out


def sizes(effect: Effect) -> str:
    """Prior of an effect in its display unit, by grade."""
    unit = effect.parameters[0].display_unit
    return ", ".join(f"{grade} {three(from_si(value, unit))} {unit}" for grade, value in effect.prior.items())


def page(typeset: bool = False) -> str:
    """Make the page of the catalogue, which the book holds as generated/effects.md.

    `typeset`: equations as browsers typeset them, for the book; else as plain text, for any reader of Markdown.
    """
    parts = [_HEAD]
    for title, effects in grouped():
        parts.append(f"\n## {title}\n")
        parts += [_entry(effect, typeset) for effect in effects]
    return "".join(parts)


def equations(effect: Effect) -> str:
    """Equations of an effect as a directive of MyST, one line each."""
    lines = "\n".join(f"<div>{mathml(text)}</div>" for text in effect.equation.split("; "))
    return f'```{{raw}} html\n<div class="equation">\n{lines}\n</div>\n```\n'


def _entry(effect: Effect, typeset: bool) -> str:
    written = f".\n\n{equations(effect)}" if typeset else f". `{effect.equation}`"
    lines = [f"\n### {effect.name}\n", f"\n{effect.title}{written}"]
    if effect.description:
        lines.append(f"\n{effect.description}")
    lines.append(f"\n- Coefficients: {_names(effect)}\n- prior: {sizes(effect)}")
    if effect.typical:
        lines.append(f"- typical: {effect.typical}")
    if effect.options:
        stated = ", ".join(f"{name} ({value} where none is stated)" for name, value in effect.options.items())
        scanned = ", ".join(effect.options)
        lines.append(f"- options, scanned by a diagnosis: {scanned}" if effect.scan else f"- options: {stated}")
    return "\n".join([*lines, *(f"- {fact}" for fact in facts(effect))]) + "\n"


def _names(effect: Effect) -> str:
    names = [p.name.removeprefix(effect.name).lstrip("_") or p.name for p in effect.parameters]
    unit = effect.parameters[0].display_unit
    return f"{', '.join(names)} ({unit}; in files {effect.parameters[0].unit})"
