"""The server of the live page: refused before anything runs, gone with the test, and the pages know how it ended."""

from __future__ import annotations

import socket
import sys
import urllib.request
from io import StringIO

import pytest
from rich.console import Console

from sdimu_calibration.cli.serving import PORT, LivePage, PageOptions, ended
from sdimu_calibration.core.data_error import DataError
from sdimu_calibration.extras import ExtraError
from sdimu_calibration.report.live_page.record import End, LiveRecord
from sdimu_calibration.report.live_seen import Outline

TEST = Outline(900.0, 4, (), {})


@pytest.fixture
def port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def page(record: LiveRecord, **options: object) -> LivePage:
    console = Console(file=StringIO(), width=200)
    return LivePage(PageOptions(live=True, no_browser=True, **options), record, console)


def fetched(address: str) -> int:
    with urllib.request.urlopen(address, timeout=20) as answer:
        return int(answer.status)


def test_the_page_is_there_while_the_test_runs_and_its_address_is_said(port):
    shown = page(LiveRecord(TEST), port=port)
    with shown:
        shown.begin()
        assert f"live page at http://127.0.0.1:{port}" in shown.console.file.getvalue()
        assert fetched(f"http://127.0.0.1:{port}/") == 200
        assert fetched(f"http://127.0.0.1:{port}/alive") == 204
    with pytest.raises(OSError):  # noqa: PT011 (refused or reset)
        fetched(f"http://127.0.0.1:{port}/")


def test_a_port_that_is_taken_is_refused_before_anything_runs(port):
    with socket.socket() as other:
        other.bind(("127.0.0.1", port))
        other.listen()
        with (
            pytest.raises(DataError, match=f"port {port} is taken .choose another with --port"),
            page(LiveRecord(TEST), port=port),
        ):
            pytest.fail("the test began")


def test_without_a_port_two_tests_have_two_pages():
    one, other = page(LiveRecord(TEST)), page(LiveRecord(TEST))
    with one, other:
        one.begin()
        other.begin()
        addresses = {shown.console.file.getvalue() for shown in (one, other)}
        assert len(addresses) == 2
        assert all(int(said.rsplit(":", 1)[1]) >= PORT for said in addresses)


@pytest.mark.parametrize("stated", [{"port": 8051}, {"host": "127.0.0.1"}, {"no_browser": True}])
def test_an_option_of_the_page_without_the_page_is_refused(stated):
    with pytest.raises(DataError, match=f"--{next(iter(stated)).replace('_', '-')}: only the live page takes it"):
        PageOptions(**stated).check()


def test_without_open_nothing_is_served():
    shown = LivePage(PageOptions(), LiveRecord(TEST), Console(file=StringIO()))
    with shown:
        shown.begin()
    assert shown.console.file.getvalue() == ""


def test_where_dash_is_missing_it_is_said_what_to_install(monkeypatch):
    from sdimu_calibration.extras import lacking

    for name in [name for name in sys.modules if name.split(".")[0] == "dash" or "live_page.app" in name]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "dash", None)
    with pytest.raises(ImportError) as raised, page(LiveRecord(TEST)):
        pytest.fail("the test began")
    told = lacking(raised.value)
    assert isinstance(told, ExtraError)
    assert 'pip install "sdimu_calibration[workbench]"' in str(told)


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (DataError("nothing has moved\nfor 180 s"), "The test was stopped: nothing has moved for 180 s."),
        (KeyboardInterrupt(), "The test was stopped by its user."),
    ],
)
def test_pages_are_told_why_a_test_was_stopped(port, error, words):
    record = LiveRecord(TEST)
    shown = page(record, port=port)

    def stopped() -> None:
        with shown:
            shown.begin()
            raise error

    with pytest.raises(type(error)):
        stopped()
    assert record.view().head.end == End(False, words)


def test_the_end_names_the_folder_and_a_command_that_can_be_pasted():
    assert ended("/out/my run") == End(
        True, "The test has ended; results in /out/my run.", "xdg-open '/out/my run/report.html'"
    )
    assert ended("") == End(True, "The test has ended.")
