"""A process from which the commands of the pages are forked, one for each worker."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from .pages import FORKED, Fork


@pytest.fixture(scope="session")
def fork(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fork]:
    where = tmp_path_factory.mktemp("fork") / "door"
    with subprocess.Popen([sys.executable, FORKED, "serve", where], stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        try:
            assert server.stdout.readline() == "ready\n"
            yield Fork(Path(where))
        finally:
            server.kill()
