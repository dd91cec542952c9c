"""`sdimu plan --backwards`: the plan whose recording tells attitude from time."""

from __future__ import annotations

from sdimu_calibration.cli.plan import plan
from sdimu_calibration.core.plan import backwards
from sdimu_calibration.storage.files.config import load_plan


def test_a_plan_is_written_backwards(tmp_path, capsys):
    plan(plan="recommended", backwards=True, out=tmp_path / "back.yaml")
    first, back = load_plan("recommended"), load_plan(str(tmp_path / "back.yaml"))
    assert [t.axis for t in back.turns] == [t.axis for t in reversed(first.turns)]
    assert back.turns[0].angle_rad == -first.turns[-1].angle_rad
    assert abs(back.duration_s - first.duration_s) < 1e-6
    assert "backwards" in capsys.readouterr().out


def test_backwards_twice_is_the_plan():
    first = load_plan("kim18_signed")
    twice = backwards(backwards(first))
    assert (twice.turns, twice.dwell_s) == (first.turns, first.dwell_s)
