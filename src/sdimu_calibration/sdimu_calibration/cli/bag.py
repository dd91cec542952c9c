"""`sdimu bag`: look into recordings, and mend them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from sdimu_calibration.cli.console import answer, command, plain, say
from sdimu_calibration.cli.opened import tell
from sdimu_calibration.cli.options import BagArgument, JsonOption
from sdimu_calibration.cli.verb_group import VerbGroup
from sdimu_calibration.cli.wide_table import print_table
from sdimu_calibration.core.plain_text import one_line
from sdimu_calibration.shell_words import joined

app = typer.Typer(
    cls=VerbGroup,
    help="Look into a recording, take a part of it, or mend one that was cut short.",
    no_args_is_help=True,
)


@app.command()
def info(bag: BagArgument, as_json: JsonOption = False) -> None:
    """Show topics, types and counts."""
    from sdimu_calibration.storage.bags.bag_info import read_info

    content = read_info(bag)
    rows = [(str(content.counts[topic]), one_line(topic), one_line(name)) for topic, name in content.types.items()]
    console = plain(stderr=as_json)
    print_table(console, ("messages", "topic", "type"), sorted(rows, key=lambda row: row[1]), left=3)
    console.print(f"{(content.last_ns - content.first_ns) * 1e-9:.1f} s from {content.first_ns * 1e-9:.3f} s")
    for part in content.damaged:
        say(console, f"{part} is cut short or damaged; to mend it:")
        command(console, joined(["sdimu", "bag", "recover", str(bag)]))
    topics = {topic: {"type": name, "messages": content.counts[topic]} for topic, name in content.types.items()}
    damaged = [str(part) for part in content.damaged]
    span = {"first_ns": content.first_ns, "last_ns": content.last_ns}
    answer({"format": "sdimu-bag-info/1", **span, "topics": topics, "damaged": damaged}, as_json)


@app.command()
def cut(
    bag: BagArgument,
    out: Annotated[Path, typer.Option(help="Bag to write.")],
    first: Annotated[float, typer.Option("--from", min=0.0, help="Seconds since the first sample.")] = 0.0,
    last: Annotated[float, typer.Option("--to", help="Seconds since the first sample; the end without it.")] = math.inf,
    replace: Annotated[bool, typer.Option(help="Delete what is there.")] = False,
) -> None:
    """Take a part of a recording: what comes before a power cycle, or after a push against the table."""
    from sdimu_calibration.storage.bags.cut_bag import cut_bag

    part = cut_bag(bag, out, first, last, replace=replace)
    kept = ", ".join(f"{one_line(topic)} {count}" for topic, count in sorted(part.counts.items()))
    end = "the end" if math.isinf(last) else f"{last:g} s"
    console = plain()
    console.print(f"{out}: {first:g} s to {end} of {part.whole_s:.1f} s", soft_wrap=True)
    console.print(f"  {kept}", soft_wrap=True)
    tell(console, part.notes)


@app.command()
def recover(bag: BagArgument) -> None:
    """Mend a bag that was cut while it was being written; the cut file stays as NAME.damaged."""
    from sdimu_calibration.storage.bags.recover import recover as mend

    console = plain()
    for salvage in mend(bag):
        seconds = (salvage.last_ns - salvage.first_ns) * 1e-9
        saved = ", ".join(f"{one_line(topic)} {count}" for topic, count in sorted(salvage.counts.items()))
        state = f"mended, was cut ({salvage.damage})" if salvage.damage else "whole, left as it is"
        console.print(f"{salvage.path}: {state}", soft_wrap=True)
        console.print(f"  {seconds:.1f} s: {saved}", soft_wrap=True)
        if salvage.kept is not None:
            console.print(f"  the cut file is now {salvage.kept.name}", soft_wrap=True)
