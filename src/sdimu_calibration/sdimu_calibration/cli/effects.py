"""`sdimu effects`: the catalogue of what can be wrong with a sensor."""

from __future__ import annotations

from typing import Annotated

import typer


def effects(
    name: Annotated[str | None, typer.Argument(metavar="[NAME]", help="Effect to show in full.")] = None,
) -> None:
    """Show the catalogue: equation, unit, typical size, what an effect is confused with."""
    from rich.console import Console

    console = Console()
    if name is None:
        console.print(_catalogue())
    else:
        for line in _page(name):
            console.print(line, soft_wrap=True, markup=False, highlight=False)


def _catalogue() -> object:
    from rich.table import Table

    from sdimu_calibration.core.effects import registry

    table = Table("effect", "coefficients", "unit", "equation", pad_edge=False)
    for effect in map(registry.get, registry.names()):
        units = dict.fromkeys(parameter.display_unit for parameter in effect.parameters)
        table.add_row(effect.name, str(len(effect.parameters)), ", ".join(units), effect.equation.replace("[", r"\["))
    return table


def _page(name: str) -> list[str]:
    from sdimu_calibration.core.effects import registry

    effect = registry.get(name)
    lines = [f"{effect.name}: {effect.title}", "", effect.equation, "", effect.description, ""]
    lines += [f"  {p.name}  ({p.display_unit}; in files {p.unit})" for p in effect.parameters]
    if effect.typical:
        lines += ["", f"typical: {effect.typical}"]
    if effect.confused_with:
        lines += [f"confused with: {', '.join(effect.confused_with)}"]
    return lines
