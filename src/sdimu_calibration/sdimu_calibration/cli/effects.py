"""`sdimu effects`: the catalogue of what can be wrong with a sensor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from sdimu_calibration.cli.console import plain

if TYPE_CHECKING:
    from rich.table import Table

    from sdimu_calibration.core.effects.effect import Effect


def effects(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Effect to show in full.")] = None,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print the page of the documentation.")] = False,
) -> None:
    """Show the catalogue: equation, unit, typical size, what an effect is confused with."""
    from sdimu_calibration.report.catalogue import grouped, page
    from sdimu_calibration.storage.effect_file import register_plugins

    if markdown:
        typer.echo(page(), nl=False)
        return
    register_plugins()
    console = plain()
    if name is None:
        for title, found in grouped():
            console.print(_table(title, found))
    else:
        for line in _page(name):
            console.print(line, soft_wrap=True, markup=False, highlight=False)


def _table(title: str, found: list[Effect]) -> Table:
    from rich.table import Table

    table = Table("effect", "coefficients", "unit", "equation", title=title, title_justify="left", pad_edge=False)
    for effect in found:
        units = dict.fromkeys(parameter.display_unit for parameter in effect.parameters)
        table.add_row(effect.name, str(len(effect.parameters)), ", ".join(units), effect.equation.replace("[", r"\["))
    return table


def _page(name: str) -> list[str]:
    from sdimu_calibration.report.catalogue import facts, sizes
    from sdimu_calibration.storage.effect_file import find_effects

    effect = find_effects(name)[0]
    lines = [f"{effect.name}: {effect.title}", "", effect.equation, "", effect.description, ""]
    lines += [f"  {p.name}  ({p.display_unit}; in files {p.unit})" for p in effect.parameters]
    if effect.options:
        lines += ["", f"options: {effect.key}"]
    if effect.typical:
        lines += ["", f"typical: {effect.typical}"]
    return [*lines, f"prior, one sigma: {sizes(effect)}", *facts(effect)]
