"""The catalogue of effects as a page: made from the registry, so that it cannot fall behind."""

from __future__ import annotations

from sdimu_calibration.core.effects import registry
from sdimu_calibration.core.effects.effect import Effect
from sdimu_calibration.core.units import from_si

_BASELINE = (
    "gyro_bias", "gyro_scale", "gyro_misalignment", "gyro_mass_unbalance", "accel_bias", "accel_scale",
    "accel_misalignment",
)  # fmt: skip
_GROUPS = (
    ("The baseline", lambda e: e.name in _BASELINE),
    ("Accelerometer", lambda e: e.name.startswith("accel_")),
    ("Gyro", lambda e: e.name.startswith("gyro_")),
    ("References and geometry", lambda e: e.name.startswith(("reference_", "lever_"))),
    ("Other", lambda _e: True),
)

_HEAD = """# Catalogue of effects

Made by `sdimu effects --markdown` from the registry (`core/effects/`, one file per physical cause); do not edit.
dw, df: measured minus true body rate and specific force; a = f/g; w: body rate against inertial space. Axis i is the
sensor's own, j and k the others. Any name here, or one of its coefficients, can be given to `--add`; an effect of one's
own is a file, see [diagnosis.md](diagnosis.md).
"""


def grouped() -> list[tuple[str, list[Effect]]]:
    """All registered effects under headings; no heading without effects."""
    rest = [registry.get(name) for name in registry.names()]
    out = []
    for title, belongs in _GROUPS:
        chosen = [effect for effect in rest if belongs(effect)]
        rest = [effect for effect in rest if not belongs(effect)]
        if chosen:
            out.append((title, chosen))
    return out


def sizes(effect: Effect) -> str:
    """Prior of an effect in its display unit, by grade."""
    unit = effect.parameters[0].display_unit
    return ", ".join(f"{grade} {from_si(value, unit):.3g} {unit}" for grade, value in effect.prior.items())


def page() -> str:
    """Make doc/effects.md."""
    parts = [_HEAD]
    for title, effects in grouped():
        parts.append(f"\n## {title}\n")
        parts += [_entry(effect) for effect in effects]
    return "".join(parts)


def _entry(effect: Effect) -> str:
    lines = [f"\n### {effect.name}\n", f"\n{effect.title}. `{effect.equation}`"]
    if effect.description:
        lines.append(f"\n{effect.description}")
    facts = [f"Coefficients: {_names(effect)}", f"prior: {sizes(effect)}"]
    if effect.typical:
        facts.append(f"typical: {effect.typical}")
    if effect.options:
        facts.append("options, scanned by a diagnosis: " + ", ".join(effect.options))
    if effect.needs:
        facts.append(f"needs: {effect.needs}")
    if effect.run_local:
        facts.append("a fault of one recording")
    if effect.confused_with:
        facts.append("confused with: " + ", ".join(effect.confused_with))
    return "\n".join(lines) + "\n\n" + "\n".join(f"- {fact}" for fact in facts) + "\n"


def _names(effect: Effect) -> str:
    names = [p.name.removeprefix(effect.name).lstrip("_") or p.name for p in effect.parameters]
    unit = effect.parameters[0].display_unit
    return f"{', '.join(names)} ({unit}; in files {effect.parameters[0].unit})"
