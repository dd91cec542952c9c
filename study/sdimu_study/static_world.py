"""Static recordings of every grade in noise with a memory: a test of several rests, cut to its stops."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.front_door import OpeningOptions, open_test
from sdimu_calibration.core.joint.member import Member
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import PhaseLog, Recording
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.core.units import STANDARD_GRAVITY
from sdimu_calibration.storage.files.config import load_imu
from sdimu_sim.core.mean_bias import mean_bias
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.truth import in_body_frame
from sdimu_study.worlds import simulate

GRADES = ("dtg", "fog_tactical", "mems_by_hand", "mems_consumer", "mems_industrial", "rlg_navigation")
SITE = Site(math.radians(36.4), 80.0)
_DWELL_S = dict.fromkeys(GRADES, 24.0) | {"mems_by_hand": 40.0}
"""Length of a rest (s): in a shorter one the gyros of the last do not see the Earth's rate, and a hand is taken to hold
them."""
_EDGE_S, _RATE_HZ = 2.0, 10.0
"""What is cut off at both ends of a rest (s), sample rate (Hz)."""
_WANDER = 10.0
"""Walk in a rest over the white noise in its mean (1): nothing can take it for white noise."""


def _turn(axis: str, quarters: int) -> Turn:
    return Turn(axis, quarters * 0.5 * math.pi, math.radians(10.0))


CUBE = (_turn("X", 2), _turn("X", 1), _turn("X", 2), _turn("Z", 1), _turn("X", 2))
"""Turns between the six rests of a cube: up, down, and its four sides."""
PAIR = CUBE[:1]
"""The turn between up and down."""


@dataclass(frozen=True)
class Opened:
    """Opens a test that is in memory."""

    test: PreparedTest

    def __call__(self) -> PreparedTest:
        """Open it."""
        return self.test


def wander(imu: ImuSpecification, dwell_s: float) -> tuple[str, str]:
    """Random walks of both triads that move on in a rest by a multiple of the white noise in its mean."""
    walk = _WANDER / (dwell_s / math.sqrt(3600.0))
    gyro = walk * np.degrees(imu.gyro_white_noise) * 3600.0
    accel = walk * imu.accel_white_noise / STANDARD_GRAVITY * 1e6
    return f"gyro_noise_random_walk={gyro:.4g} deg/h/sqrt(h)", f"accel_noise_random_walk={accel:.4g} ug/sqrt(h)"


def cut(recording: Recording, start_s: float, end_s: float, stop: int) -> Recording:
    """Return the part of a recording that lies in one of its stops."""
    rows = (recording.t > start_s) & (recording.t <= end_s)
    return replace(
        recording,
        start_ns=recording.start_ns + round(start_s * 1e9),
        t=recording.t[rows] - start_s,
        omega_ib_b=recording.omega_ib_b[rows],
        f_ib_b=recording.f_ib_b[rows],
        phase=PhaseLog(np.zeros(1), np.ones(1, dtype=bool), np.array([stop])),
    )


def beyond_prior(grade: str) -> tuple[str, ...]:
    """Coefficients whose noise walks in a rest by more than their prior: no file foresees it, and no rest shows it.

    The gyros of the finest grades: 4 and 43 of their priors.
    """
    imu, dwell_s = load_imu(grade), _DWELL_S[grade]
    walk = _WANDER * imu.gyro_white_noise / math.sqrt(dwell_s)
    return tuple(f"gyro_bias_{axis}" for axis in "xyz") if walk > imu.prior["gyro_bias"] else ()


def _scenario(grade: str, seed: int, turns: Sequence[Turn], noise: Sequence[str] | None) -> Scenario:
    imu, dwell_s = load_imu(grade), _DWELL_S[grade]
    plan = Plan("cube", (dwell_s,) * (len(turns) + 1), tuple(turns), math.radians(20.0))
    told = wander(imu, dwell_s) if noise is None else tuple(noise)
    return Scenario(plan, imu, SITE, rate_hz=_RATE_HZ, seed=seed, noise=told)


def _kept(grade: str, turns: Sequence[Turn]) -> list[tuple[float, float]]:
    """Begin and end (s) of what is kept of each rest."""
    dwell_s = _DWELL_S[grade]
    begin = np.cumsum([0.0, *(dwell_s + turn.duration_s for turn in turns)]).tolist()
    return [(t + _EDGE_S, t + dwell_s - _EDGE_S) for t in begin]


def truth(
    grade: str, seed: int, turns: Sequence[Turn], frame: str, noise: Sequence[str] | None = None
) -> dict[str, float]:
    """Coefficients of the unit (SI) in a body frame, biases in the mean over what is kept of the rests."""
    scenario = _scenario(grade, seed, turns, noise)
    unit, interval = imu_truth(scenario), 1.0 / _RATE_HZ
    ends = np.ravel(_kept(grade, turns))
    spans = PhaseLog(ends, np.arange(len(ends)) % 2 == 0, np.arange(len(ends)) // 2)
    t = interval * np.arange(1, round(ends[-1] / interval) + 1)
    return in_body_frame({**unit.coefficients, **mean_bias(unit, t, spans, interval, seed)}, frame)


def rests(
    grade: str, seed: int, turns: Sequence[Turn] = CUBE, noise: Sequence[str] | None = None
) -> tuple[Member, ...]:
    """Give static recordings of a unit: the rests between some turns; without `noise` in that of `wander`."""
    scenario = _scenario(grade, seed, turns, noise)
    imu, whole = scenario.imu, simulate(scenario, imu_truth(scenario))
    parts = [cut(whole, begin, end, k) for k, (begin, end) in enumerate(_kept(grade, turns))]
    return tuple(
        Member(f"r{k}", Opened(PreparedTest(*open_test(part, OpeningOptions(imu, SITE, "")))))
        for k, part in enumerate(parts)
    )
