"""The page on IMU files, doc/grades.md: what the diagnosis says of clean tests and of one hidden effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from sdimu_calibration.core.verdict import Verdict

Rows = Sequence[Mapping[str, Any]]

_HEAD = """# Every IMU file, clean and with one hidden effect

`sdimu study grades` simulates tests of every file of config/imu on the plans kim18, kim18_signed and recommended
(drawn) at latitudes of 50 S to 60 N (drawn); `mems_by_hand` in runs by hand of 24 attitudes without a site. Each is
diagnosed with nothing but the IMU file and the site. {runs} clean tests and {runs} with one effect of 10 to 30 sigma a
file, seeds from {first}. The noise is white.

"""


def page(clean: Mapping[str, Rows], hidden: Mapping[str, Rows], choices: Mapping[str, Rows], first: int) -> str:
    """Make the page.

    Parameters
    ----------
    clean, hidden : mapping of IMU file to rows of `GradeRun`
    choices : mapping of IMU file to rows of ``plan``, ``estimator``
    first : int
        Smallest seed.
    """
    names = list(clean)
    table = [
        ("estimator", [", ".join(sorted({r["estimator"] for r in _good(clean[n])})) for n in names]),
        ("clean: consistent", [_share(clean[n], lambda r: r["verdict"] == Verdict.CONSISTENT) for n in names]),
        ("clean: refused", [str(len(clean[n]) - len(_good(clean[n]))) for n in names]),
        ("clean: accuses site or recording", [str(sum(r["accuses"] for r in _good(clean[n]))) for n in names]),
        ("clean: RMS z of the coefficients", [_rms(clean[n]) for n in names]),
        ("hidden: in the class named", [_share(hidden[n], lambda r: r["in_class"]) for n in names]),
        ("hidden: named first", [_share(hidden[n], lambda r: r["first"]) for n in names]),
        ("hidden: RMS z of the coefficients", [_rms(hidden[n]) for n in names]),
        ("hidden: median of the largest z", [_median(hidden[n]) for n in names]),
        ("choices of estimator, by plan", [_choices(choices.get(n, ())) for n in names]),
    ]
    runs = max(len(rows) for rows in clean.values())
    lines = [f"| | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
    lines += [f"| {word} | {' | '.join(cells)} |" for word, cells in table]
    return _HEAD.format(runs=runs, first=first) + "\n".join(lines) + "\n"


def _good(rows: Rows) -> list[Mapping[str, Any]]:
    return [row for row in rows if "error" not in row]


def _share(rows: Rows, good: Any) -> str:
    return f"{sum(bool(good(row)) for row in _good(rows))} of {len(rows)}"


def _rms(rows: Rows) -> str:
    done = _good(rows)
    return f"{np.sqrt(sum(r['z2'] for r in done) / max(sum(r['count'] for r in done), 1)):.2f}"


def _median(rows: Rows) -> str:
    done = _good(rows)
    return f"{np.median([r['largest_z'] for r in done]):.1f}" if done else ""


def _choices(rows: Rows) -> str:
    by_plan: dict[str, set[str]] = {}
    for row in rows:
        by_plan.setdefault(row["plan"], set()).add(row["estimator"])
    if not by_plan:
        return ""
    most = max(len(found) for found in by_plan.values())
    return f"{most} a plan in {len(rows)} draws"
