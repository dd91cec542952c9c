"""Messages of the core name what a user can state and start; the shell's words for it are the shell's."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
import typer

from sdimu_calibration import core
from sdimu_calibration.cli.main import app
from sdimu_calibration.core.wording import Option, Work

SHELL = re.compile(r"\bsdimu [a-z]+|(?<![\w-])--[a-z]")
SOURCES = sorted(Path(core.__file__).parent.rglob("*.py"))


def strings(path):
    return [
        n.value
        for n in ast.walk(ast.parse(path.read_text()))
        if isinstance(n, ast.Constant) and isinstance(n.value, str)
    ]


def commands(command, name="sdimu"):
    """Every command of the command line by its name, subcommands too."""
    yield name, command
    if hasattr(command, "list_commands"):
        for word in command.list_commands(None):
            yield from commands(command.get_command(None, word), f"{name} {word}")


@pytest.fixture(scope="module")
def verbs():
    return dict(commands(typer.main.get_command(app)))


def test_no_text_of_the_core_holds_a_command_or_an_option_of_the_shell():
    found = {str(path): text for path in SOURCES for text in strings(path) if SHELL.search(text)}
    assert len(SOURCES) > 100
    assert not found


def test_the_core_names_a_work_and_not_the_way_to_it_in_the_shell():
    assert all(work.value.isalpha() for work in Work)
    assert str(Work.CUT) == "sdimu bag cut"


def test_every_work_that_a_message_names_is_a_command(verbs):
    assert {str(work) for work in Work} <= set(verbs)


def test_every_option_that_a_message_names_is_one_of_some_command(verbs):
    known = {name for verb in verbs.values() for parameter in verb.params for name in parameter.opts}
    assert {str(option) for option in Option} <= known
