"""The page on the command line, from the program itself."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import click
from typer.main import get_command

from sdimu_calibration.cli.main import app

HEAD = """# Command line

Made from the program at each build; `sdimu VERB --help` says the same. Exit status: 0 done, 1 data or options are
unusable (one line on stderr), 2 usage, 3 done, but the estimate is not to be trusted (stderr says why): the data have a
fault, `calibrate` notes that the model does not fit, or the verdict of `diagnose` is `unexplained` or `data fault`;
or a limit of `datasheet` does not pass.
"""


def page() -> str:
    """Write the page: a section for each verb, in the order of work."""
    root = get_command(app)
    context = click.Context(root, info_name="sdimu")
    return HEAD + "\n".join(line for _, verb in _verbs(root, context, "sdimu") for line in verb)


def _verbs(group: Any, context: click.Context, prefix: str) -> Iterator[tuple[str, list[str]]]:
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if command is None or command.hidden:
            continue
        words = f"{prefix} {name}"
        if hasattr(command, "list_commands"):
            inner = click.Context(command, info_name=name, parent=context)
            yield words, ["", f"## {words}", "", _plain(command.help)]
            for inner_words, lines in _verbs(command, inner, words):
                yield inner_words, [line.replace("## ", "### ", 1) for line in lines]
        else:
            yield words, _section(words, command)


def _section(words: str, command: Any) -> list[str]:
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    options = [p for p in command.params if p.param_type_name == "option" and not getattr(p, "hidden", False)]
    shown = " ".join([words, *(_metavar(p) for p in arguments), "[OPTIONS]"])
    rows = [f"| `{_metavar(p)}` | {_plain(p.help)} |" for p in arguments]
    rows += [f"| {_names(p)} | {_plain(p.help)}{_default(p)} |" for p in options if p.name != "help"]
    table = ["", "| | |", "|---|---|", *rows] if rows else []
    return ["", f"## {words}", "", _plain(command.help), "", "```text", shown, "```", *table, ""]


def _metavar(parameter: Any) -> str:
    return str(parameter.metavar or parameter.name.upper())


def _names(option: Any) -> str:
    names = ", ".join(f"`{name}`" for name in (*option.opts, *option.secondary_opts))
    return names if option.is_flag or not option.metavar else f"{names} {option.metavar}"


def _default(option: Any) -> str:
    kept = option.default
    if kept in (None, "", (), []) or option.is_flag or callable(kept):
        return ""
    return f" [{kept}]"


def _plain(text: str | None) -> str:
    """Join the lines of a help text; signs that markdown would obey are kept as they are."""
    joined = re.sub(r"\s+", " ", text or "").strip()
    return re.sub(r"([\\|*_<>\[\]$])", r"\\\1", joined)
