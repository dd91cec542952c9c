"""A command that is printed is one that a shell takes, whatever the names in it."""

from __future__ import annotations

import os
import subprocess

import pytest

from sdimu_calibration.cli.console import command, plain
from sdimu_calibration.shell_words import joined

NAMES = (b"plain", b"two  blanks", b"it's", b"\xff\xfe.bag", b"\xc3\xa9t\xc3\xa9", b"line\n\t'", b"back\\slash\x01")


@pytest.mark.parametrize("name", NAMES)
def test_a_printed_command_names_the_file_that_there_is(name, capsys):
    command(plain(), joined(["printf", "%s", os.fsdecode(name)]))
    printed = capsys.readouterr().out
    assert printed.count("\n") == 1
    assert printed.strip().isprintable()
    assert subprocess.run(["bash", "-c", printed], capture_output=True, check=True).stdout == name


def test_what_a_shell_takes_as_it_is_has_no_quotes():
    assert joined(["sdimu", "calibrate", "out/bag"]) == "sdimu calibrate out/bag"
