"""`sdimu effects`: the catalogue of what can be wrong with a sensor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from sdimu_calibration.cli.console import answer, plain, say
from sdimu_calibration.cli.options import JsonOption

if TYPE_CHECKING:
    from rich.console import Console

    from sdimu_calibration.core.effects.effect import Effect


def effects(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Effect to show in full.")] = None,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print the page of the documentation.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Show the catalogue: equation, unit, typical size, what an effect is confused with."""
    from sdimu_calibration.report.catalogue import grouped, page
    from sdimu_calibration.storage.files.effect_file import register_plugins

    if markdown:
        typer.echo(page(), nl=False)
        return
    register_plugins()
    console = plain()
    answer(_content(name), as_json)
    if as_json:
        return
    if name is None:
        for title, found in grouped():
            _print_group(console, title, found)
    else:
        for line in _page(name):
            say(console, line)


def _print_group(console: Console, title: str, found: list[Effect]) -> None:
    """Print effects of a group: name, coefficients and unit, and the equation below."""
    from sdimu_calibration.core.plain_text import counted

    say(console, f"\n{title}".strip())
    for effect in found:
        units = ", ".join(dict.fromkeys(parameter.display_unit for parameter in effect.parameters))
        many = counted(len(effect.parameters), "coefficient")
        say(console, f"  {effect.name}: {many} in {units}")
        say(console, f"    {effect.equation}")


def _page(name: str) -> list[str]:
    from sdimu_calibration.report.catalogue import facts, sizes
    from sdimu_calibration.storage.files.effect_file import find_effects

    effect = find_effects(name)[0]
    lines = [f"{effect.name}: {effect.title}", "", effect.equation, "", effect.description, ""]
    lines += [f"  {p.name}  ({p.display_unit}; in files {p.unit})" for p in effect.parameters]
    if effect.options:
        lines += ["", f"options: {effect.key}"]
    if effect.typical:
        lines += ["", f"typical: {effect.typical}"]
    return [*lines, f"prior, one sigma: {sizes(effect)}", *facts(effect)]


def _content(name: str | None) -> dict[str, Any]:
    """Give the catalogue, or one effect of it, as plain data (SI)."""
    from sdimu_calibration.report.catalogue import grouped
    from sdimu_calibration.storage.files.effect_file import find_effects
    from sdimu_calibration.storage.files.json_file import entry

    chosen = find_effects(name) if name else [effect for _, found in grouped() for effect in found]
    listed = [
        entry(
            effect,
            "name title equation description typical scope",
            prior=dict(effect.prior),
            coefficients=[entry(p, "name unit display_unit") for p in effect.parameters],
        )
        for effect in chosen
    ]
    return {"format": "sdimu-catalogue/1", "effects": listed}
