"""Plans of studies: those of config/plan, and others that users run, from six positions to turns at random."""

from __future__ import annotations

import math
from dataclasses import replace
from zlib import crc32

import numpy as np

from rate_table_sim.core import TableSpecification
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.storage.files.config import load_plan

FILED = ("kim18", "kim18_signed", "recommended")
"""Plans of config/plan."""
OTHERS = ("six_positions", "random_attitudes", "kim18_10_min", "kim18_3_h")
"""Plans that are made here: each accelerometer axis up and down; 24 attitudes at random; the turns of kim18 in ten
minutes and in three hours."""
PLANS = (*FILED, *OTHERS)
"""All plans that a study knows."""
_SIX_DWELL_S = 300.0
"""Stop of the six positions (s): half an hour in all, as a plain six-position test takes."""
_SIX_TURNS_DEG = (("Y", 90), ("Y", 90), ("Y", 90), ("Y", 90), ("X", 90), ("X", 180), ("X", 90))
"""Turns of the six positions (axis, deg): X down, Z down, X up, level; Y up, Y down, level."""
_RANDOM_TURNS, _RANDOM_DWELL_S = 23, 75.0
"""Turns of random attitudes; stop (s) between them: about as long as kim18."""
_RANDOM_ANGLE_DEG, _RANDOM_RATE_DEG_S = (30.0, 180.0), (2.0, 6.0)
"""Range of the angle (deg) and of the rate (deg/s) of a random turn."""
_TEN_MINUTES = (20.0, 10.0)
"""Kim18 in ten minutes: stop (s) and rate (deg/s)."""
_ACCELERATION_DEG_S2 = 5.0
"""Angular acceleration (deg/s^2) of turns that are faster than those of kim18."""
_THREE_HOURS_DWELL_S = 510.0
"""Stop of kim18 in three hours (s)."""


def study_plan(name: str, seed: int) -> Plan:
    """Make the plan of a name; only random attitudes depend on the seed.

    Parameters
    ----------
    name : str
        One of `PLANS`, or what `load_plan` takes.
    seed : int
    """
    if name == "six_positions":
        return _six_positions()
    if name == "random_attitudes":
        return _random_attitudes(seed)
    if name == "kim18_10_min":
        return _in_ten_minutes(load_plan("kim18"))
    if name == "kim18_3_h":
        return _with_stops(load_plan("kim18"), name, _THREE_HOURS_DWELL_S)
    return load_plan(name)


def study_table(plan: str) -> TableSpecification:
    """Table for the plan of a name: three gimbals make no turns at random, a table without gimbals does."""
    return TableSpecification(axes=None) if plan == "random_attitudes" else TableSpecification()


def _six_positions() -> Plan:
    of = load_plan("kim18")
    turns = tuple(Turn(axis, math.radians(angle), of.turns[0].rate_rad_s) for axis, angle in _SIX_TURNS_DEG)
    return _with_stops(replace(of, turns=turns), "six_positions", _SIX_DWELL_S)


def _random_attitudes(seed: int) -> Plan:
    rng = np.random.default_rng(np.random.SeedSequence([seed, crc32(b"random attitudes")]))
    turns = tuple(
        Turn(
            str(rng.choice(("X", "Y", "Z"))),
            math.radians(float(rng.uniform(*_RANDOM_ANGLE_DEG) * rng.choice((-1.0, 1.0)))),
            math.radians(float(rng.uniform(*_RANDOM_RATE_DEG_S))),
        )
        for _ in range(_RANDOM_TURNS)
    )
    return _with_stops(_faster(load_plan("kim18"), turns), "random_attitudes", _RANDOM_DWELL_S)


def _in_ten_minutes(of: Plan) -> Plan:
    dwell_s, rate = _TEN_MINUTES
    turns = tuple(replace(turn, rate_rad_s=math.radians(rate)) for turn in of.turns)
    return _with_stops(_faster(of, turns), "kim18_10_min", dwell_s)


def _faster(plan: Plan, turns: tuple[Turn, ...]) -> Plan:
    return replace(plan, turns=turns, acceleration_rad_s2=math.radians(_ACCELERATION_DEG_S2))


def _with_stops(plan: Plan, name: str, dwell_s: float) -> Plan:
    return replace(plan, name=name, dwell_s=(dwell_s,) * (len(plan.turns) + 1))
