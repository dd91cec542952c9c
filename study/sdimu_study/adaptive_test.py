"""A test that chooses its next turn, simulated stop by stop without DDS: one sensor, one noise, one clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from rate_table_sim.core import phase_changes, table_motion
from sdimu_calibration.core.adaptive import (
    FIRST_STOP_S,
    Choice,
    End,
    Goals,
    Knowledge,
    Menu,
    choose,
    knowledge,
    nearest_other,
)
from sdimu_calibration.core.arrays import Floats
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, climb
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import PhaseLog, Recording
from sdimu_calibration.core.specification import Model
from sdimu_calibration.core.table import RateTable, Step, is_possible, plan_move
from sdimu_sim.core.generator import ImuGenerator, ImuSamples
from sdimu_sim.core.platform import PlatformMotion
from sdimu_sim.core.scenario import Scenario, temperature_log
from sdimu_sim.core.truth import ImuTruth


@dataclass(frozen=True)
class Look:
    """What a look at the data found."""

    minutes: float
    """Length of the test then."""
    found: Diagnosis
    known: Knowledge

    @property
    def nearest(self) -> float | None:
        """Difference of log Bayes factors between the first effect found and the nearest other one; None for none."""
        return nearest_other(self.found)


@dataclass(frozen=True)
class AdaptiveTest:
    """A finished test."""

    plan: Plan
    """What was chosen, in the order in which it was done."""
    choices: tuple[tuple[float, Choice], ...]
    """Minutes at which each was made."""
    looks: tuple[Look, ...]
    end: End

    @property
    def last(self) -> Look:
        """The look at the whole test."""
        return self.looks[-1]


@dataclass
class _Bench:
    """The simulated IMU on its table: what it has recorded grows with the plan."""

    scenario: Scenario
    sensor: ImuTruth
    table: RateTable
    plan: Plan
    angles: Floats = field(default_factory=lambda: np.zeros(3))
    generator: ImuGenerator = field(init=False)
    parts: list[ImuSamples] = field(default_factory=list)
    moved: int = 0

    def __post_init__(self) -> None:
        s = self.scenario
        self.generator = ImuGenerator(self.sensor, s.site, s.rate_hz, s.seed, s.temperature)

    def recording(self) -> Recording:
        """Do what is planned and not yet done, and give all that was recorded."""
        motion = table_motion(self.plan, self.scenario.table, 0)
        new = slice(self.moved, len(motion.t))
        self.parts.append(
            self.generator.advance(PlatformMotion(motion.t[new], motion.q_nt[new], motion.omega_nt_t[new]))
        )
        self.moved = len(motion.t)
        t, omega, force = (np.concatenate([getattr(p, name) for p in self.parts]) for name in _ARRAYS)
        log = temperature_log(self.scenario, float(motion.t[-1]))
        return Recording(self.scenario.start_ns, t, omega, force, PhaseLog(*phase_changes(motion)), log)

    def possible(self, *steps: Step) -> bool:
        """Whether the table can make steps next."""
        return is_possible(self.table, self.angles, *steps)

    def do(self, step: Step) -> None:
        """Make a step the next one of the plan."""
        self.angles = np.asarray(plan_move(self.table, self.angles, step).target)
        dwell, turn, plan = step.dwell_s, step.turn, self.plan
        if turn is None:
            self.plan = replace(plan, dwell_s=(*plan.dwell_s[:-1], plan.dwell_s[-1] + dwell))
        else:
            self.plan = replace(plan, dwell_s=(*plan.dwell_s, dwell), turns=(*plan.turns, turn))


_ARRAYS = ("t", "omega_ib_b", "f_ib_b")


def adaptive_test(
    scenario: Scenario,
    sensor: ImuTruth,
    table: RateTable,
    model: Model,
    goals: Goals,
    menu: Menu,
    look_s: float,
    told: Callable[[str], None] = lambda _: None,
) -> AdaptiveTest:
    """Simulate a test that chooses its turns.

    Parameters
    ----------
    scenario : Scenario
        Its plan is not read.
    sensor : ImuTruth
    table : RateTable
        Of the scenario, as its driver sees it.
    model : Model
        What is estimated.
    goals : Goals
    menu : Menu
    look_s : float
        Length of test (s) after which the data are looked at anew; between, the covariance alone says what is known.
    told : callable
        Is told every choice in words.
    """
    bench = _Bench(scenario, sensor, table, Plan("adaptive", (FIRST_STOP_S,), (), menu.acceleration_rad_s2))
    looks: list[Look] = []
    choices: list[tuple[float, Choice]] = []
    while True:
        minutes = bench.plan.duration_s / 60.0
        found = climb(solve(PreparedTest(bench.recording(), scenario.imu, scenario.site), model))
        looks.append(Look(minutes, found, knowledge(found, goals)))
        here, due = looks[-1].known.at, bench.plan.duration_s + look_s
        while bench.plan.duration_s < due:
            done = bench.plan.duration_s / 60.0
            choice = choose(looks[-1].known, goals, menu, goals.minutes - done, bench.possible, here)
            if isinstance(choice, End):
                end = choice
                break
            choices.append((done, choice))
            told(f"{done:5.1f} min  {choice.text}")
            bench.do(choice.step)
            here = choice.after
        if bench.plan.duration_s / 60.0 == minutes:
            return AdaptiveTest(bench.plan, tuple(choices), tuple(looks), end)
