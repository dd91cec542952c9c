"""What is drawn: reproducible, of the size asked for, readable by the simulator, testable, on the sensors it says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.diagnosis.candidates import catalogue
from sdimu_calibration.core.effects.effect import CHANNELS, Timetable
from sdimu_calibration.core.effects.motion import Motion
from sdimu_calibration.core.evidence.candidate import split
from sdimu_calibration.core.recording import DataError, Recording
from sdimu_calibration.storage.files.config import load_imu
from sdimu_sim.core.equation import CONSTANTS
from sdimu_sim.core.expression import parse_expression
from sdimu_sim.core.hidden import VARIABLES, parse_effects
from sdimu_study.hidden import with_fault
from sdimu_study.hidden_draw import KINDS, LATITUDES_DEG, Draw, Sizes, between, draw
from sdimu_study.hidden_outside import OUTSIDE, shapes
from sdimu_study.plans import FILED as PLANS
from sdimu_study.worlds import TESTABLE, Truth, hideable_names

STOPS = tuple((k, 150.0 * k, 150.0 * k + 100.0) for k in range(8))
TURNS = tuple((k, 150.0 * k + 100.0, 150.0 * k + 150.0) for k in range(7))
TIMES = Timetable(1150.0, STOPS, TURNS)
SEEDS = range(60)


def _tables(sigma: float = 1e-3, retention: float = 0.5) -> tuple[Sizes, ...]:
    """Tables in which every candidate's sigma is the same share of its prior."""
    candidates = [c for e in catalogue(TIMES, set(), True) for c in split(e)]
    known = [(c.family, c.label, c.effect.prior["navigation"]) for c in candidates]
    known += [(OUTSIDE, s.label, np.inf) for s in shapes(TIMES)]
    family, label, prior = (tuple(column) for column in zip(*known, strict=True))
    size = tuple(sigma * (p if np.isfinite(p) else 1.0) for p in prior)
    return tuple(
        Sizes(plan, latitude, family, label, size, (retention,) * len(label), prior, STOPS)
        for plan in PLANS
        for latitude in LATITUDES_DEG
    )


TABLES = _tables()


def _draws(kind: str, tables: tuple[Sizes, ...] = TABLES) -> list[Draw]:
    return [draw(kind, seed, tables, hideable_names()) for seed in SEEDS]


@pytest.mark.parametrize("kind", KINDS)
def test_a_seed_draws_the_same_test_twice_and_another_seed_another(kind: str) -> None:
    assert _draws(kind) == _draws(kind)
    assert len({d.latitude_deg for d in _draws(kind)}) == len(SEEDS)


@pytest.mark.parametrize("kind", ["weak", "strong", "pair"])
def test_the_simulator_reads_every_effect_with_the_size_that_the_score_will_look_for(kind: str) -> None:
    for one in _draws(kind):
        hidden = parse_effects(t.text for t in one.truths)
        for truth in one.truths:
            assert hidden.sizes[truth.name] == pytest.approx(truth.value, rel=1e-12)


SPANS = [("weak", 5, 5), ("strong", 8, 30), ("pair", 10, 30), ("outside", 15, 40)]


@pytest.mark.parametrize(("kind", "low", "high"), SPANS)
def test_sizes_are_what_the_kind_says(kind: str, low: float, high: float) -> None:
    for one in _draws(kind):
        table = between(TABLES, one.plan, one.latitude_deg)
        for truth in one.truths:
            at = [k for k, x in enumerate(table.label) if x == truth.name or x.startswith(f"{truth.name}(")]
            assert abs(truth.value) / table.sigma[at[0]] == pytest.approx(truth.sigmas, rel=1e-9)
            assert low * (1 - 1e-9) <= truth.sigmas <= high


def test_two_effects_act_on_two_sensor_axes() -> None:
    for one in _draws("pair"):
        a, b = one.truths
        assert (a.name.split("_")[0], a.name.split("_")[-1][0]) != (b.name.split("_")[0], b.name.split("_")[-1][0])


def test_both_signs_all_plans_and_most_families_are_drawn() -> None:
    draws = _draws("strong")
    assert {d.plan for d in draws} == set(PLANS)
    assert {np.sign(d.truths[0].value) for d in draws} == {-1.0, 1.0}
    # 60 draws of some 40 equally likely families miss a given one with probability 0.22.
    assert len({d.truths[0].family for d in draws}) > 20


def test_an_effect_that_the_plan_cannot_test_is_never_drawn() -> None:
    only = "accel_quadratic_x"
    tables = tuple(replace(t, retention=tuple(0.5 if x == only else 0.99 * TESTABLE for x in t.label)) for t in TABLES)
    assert {d.truths[0].name for d in _draws("strong", tables)} == {only}


def test_an_effect_whose_sigma_hangs_on_the_mount_has_no_size() -> None:
    first, second, third = TABLES[:3]
    uneven = replace(second, sigma=(10.0 * second.sigma[0], *second.sigma[1:]))
    found = between((first, uneven, third), PLANS[0], 45.0)
    assert found.sigma[0] == np.inf
    assert found.sigma[1] == pytest.approx(first.sigma[1])


def test_a_plan_without_sizes_is_named() -> None:
    with pytest.raises(DataError, match="plan 'other'"):
        between(TABLES, "other", 45.0)


def test_what_is_outside_the_catalogue_is_the_same_for_simulator_and_size() -> None:
    motion = _motion()
    names: dict[str, np.ndarray | float] = dict.fromkeys(VARIABLES, np.zeros(len(motion.t)))
    names |= CONSTANTS
    names |= {f"w{a}": motion.w[:, i] for i, a in enumerate("xyz")}
    names |= {f"a{a}": motion.a[:, i] for i, a in enumerate("xyz")}
    names["t"] = motion.t - 0.5 * motion.dt
    for shape in shapes(TIMES):
        formula = parse_expression(shape.formula, (*VARIABLES, *CONSTANTS))
        ours = shape.effect().regressors(motion)[:, 0]
        np.testing.assert_allclose(ours, formula.evaluate(names), rtol=1e-12, atol=1e-12, err_msg=shape.label)


def _motion() -> Motion:
    rng = np.random.default_rng(5)
    n = 400
    dt = np.full(n, 2.87)
    three = rng.standard_normal((3, n, 3))
    zeros = np.zeros((n, 3))
    return Motion(
        np.cumsum(dt),
        dt,
        three[0],
        9.8 * three[1],
        np.broadcast_to(np.eye(3), (n, 3, 3)),
        three[2],
        zeros,
        np.ones(n, dtype=bool),
        np.zeros(n),
        np.zeros(n),
        zeros,
        zeros,
        np.full(n, np.inf),
        np.zeros(3),
        zeros,
        np.zeros((0, 4)),
    )


def test_outliers_hit_the_share_of_samples_that_the_fault_says_by_twenty_sample_sigmas() -> None:
    imu = load_imu("dtg")
    n = 50_000
    still = Recording(0, np.arange(1, n + 1) * 0.05, np.zeros((n, 3)), np.zeros((n, 3)))
    hit = with_fault(still, Draw("noise", "kim18", 45.0, fault="outliers 1 %"), imu, 7)
    where = hit.f_ib_b[:, 0] != 0.0
    # Binomial: 500 +- 22.
    assert abs(where.sum() - 500) < 5 * 22
    np.testing.assert_allclose(np.abs(hit.f_ib_b[where]), 20.0 * imu.accel_white_noise / 0.05**0.5)
    np.testing.assert_allclose(np.abs(hit.omega_ib_b[where]), 20.0 * imu.gyro_white_noise / 0.05**0.5)
    assert abs(np.sign(hit.f_ib_b[where]).sum(axis=0)).max() < 5 * 500**0.5


def test_other_draws_leave_the_samples_alone() -> None:
    still = Recording(0, np.arange(1, 11) * 0.05, np.ones((10, 3)), np.ones((10, 3)))
    truth = Truth("accel_quadratic_x", "accel_quadratic", None, 1e-4, 10.0, "accel_quadratic_x=10 ug/g^2")
    assert with_fault(still, Draw("strong", "kim18", 45.0, (truth,)), load_imu("dtg"), 1) is still
    assert {s.sensor for s in shapes(TIMES)} == set(CHANNELS)
