"""What every served page does stands in one script, which each page has once."""

from __future__ import annotations

from difflib import SequenceMatcher

from sdimu_calibration.report.live_page import app as live
from sdimu_calibration.report.live_page import view as live_view
from sdimu_calibration.report.live_page.record import LiveRecord
from sdimu_calibration.report.live_seen import Outline
from sdimu_calibration.report.workbench import view as bench_view

MOST = 3
"""Lines (1) in a row that two scripts may share by chance: the begin of each."""


def test_two_pages_share_no_part_of_their_own_scripts():
    own = [[line.strip() for line in view.SCRIPT.splitlines() if line.strip()] for view in (live_view, bench_view)]
    longest = SequenceMatcher(None, *own, autojunk=False).find_longest_match()
    assert longest.size <= MOST, own[0][longest.a : longest.a + longest.size]


def test_a_page_watches_its_command_once():
    page = live.build(LiveRecord(Outline(0.0, 0, (), {}), "")).index_string
    assert page.count("fetch('alive'") == 1
    assert page.count("window.benchLook = ") == 1
