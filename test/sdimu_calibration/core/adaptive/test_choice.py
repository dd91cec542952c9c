"""The next move is one that the table can make, brings most a minute, and says why; nothing is chosen for nothing."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.adaptive import Choice, End, Goals, Knowledge, Menu, aimed, choose, fitted, so_far
from sdimu_calibration.core.adaptive.choice import _times, most_gain
from sdimu_calibration.core.adaptive.knowledge import ratios
from sdimu_calibration.core.adaptive.open_class import OpenClass, separation
from sdimu_calibration.core.adaptive.worth import worth
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.estimation.navigation_fit import NavigationFit
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.plan import Plan, Turn
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.table import Step
from sdimu_calibration.storage.files.config import load_imu, load_model, load_site
from sdimu_calibration.storage.files.goal_file import load_goals
from sdimu_sim.core.scenario import Scenario, generate

from .conftest import ACCELERATION, part, perfect_fit

GOALS = load_goals("table33")
SHORT = Menu(longest_s=12.0)
BOTH_SENSES = Plan(
    "both senses",
    (30.0,) * 6,
    tuple(
        Turn(axis, math.radians(angle), math.radians(10.0))
        for axis, angle in (("Y", 90.0), ("Y", -90.0), ("X", 90.0), ("Z", -90.0), ("Y", 90.0))
    ),
    ACCELERATION,
)
PAIR = ("gyro_scale_asymmetry_y", "gyro_scale_quadratic_y")


@pytest.fixture(scope="module")
def known(first_stop):
    return fitted(first_stop, GOALS)


def test_a_choice_brings_more_a_minute_than_any_other_move(known):
    choice = choose(known, GOALS, Menu(), 30.0)
    assert isinstance(choice, Choice)
    now = worth(known, GOALS, known.at.covariance[None], known.at.covariance).lacking[0]
    after = worth(known, GOALS, choice.after.covariance[None], known.at.covariance).lacking[0]
    assert now - after == pytest.approx(choice.gain)
    stay = choose(known, GOALS, Menu(), 30.0, lambda _: False)
    assert isinstance(stay, Choice)
    assert stay.step.turn is None
    assert choice.gain / choice.minutes > stay.gain / stay.minutes


def test_only_what_the_table_can_do_is_chosen_and_the_reason_names_a_coefficient(known):
    choice = choose(
        known, GOALS, Menu(), 30.0, lambda *steps: steps[-1].turn.axis == "Z" and steps[-1].turn.angle_rad < 0.0
    )
    assert isinstance(choice, Choice)
    assert choice.step.turn is None or choice.step.turn.axis == "Z"
    assert any(name in choice.text for name in known.limited)
    assert choice.text.endswith("min")


def test_a_test_ends_when_all_limits_hold_and_says_what_lacks_when_time_is_up(known):
    wide = Goals("wide", dict.fromkeys(GOALS.limits, 1000.0), 30.0)
    end = choose(replace(known, noise=np.ones_like(known.noise)), wide, Menu(), 30.0)
    assert isinstance(end, End)
    assert end.reached
    assert end.reason == "all limits hold and nothing is to be told apart"
    found = replace(known, noise=np.ones_like(known.noise), named=("gyro_scale_asymmetry_y",))
    assert "all limits hold with gyro_scale_asymmetry_y in the model" in choose(found, wide, Menu(), 30.0).reason
    late = choose(known, GOALS, Menu(), 0.1)
    assert isinstance(late, End)
    assert not late.reached
    assert "time is up" in late.reason
    assert "of its limit" in late.reason


def test_what_the_time_left_can_bring_is_the_gain_of_information_that_grows_as_time():
    # A sigma that falls as one over the square root of time gains half a nat each time that the time is e-fold.
    rate = 0.5 * math.log(32.01 / 32.0) / 0.01
    assert most_gain(rate, 60.0, 28.0) == pytest.approx(0.5 * math.log(60.0 / 32.0), rel=1e-3)
    assert most_gain(rate, 60.0, 0.0) == 0.0
    assert most_gain(rate, 60.0, 60.0) == math.inf


def test_a_test_that_gains_little_ends_only_where_its_limits_are_out_of_reach(first_stop, monkeypatch):
    known = fitted(first_stop, replace(GOALS, both_senses=False))
    monkeypatch.setattr("sdimu_calibration.core.adaptive.choice._NOTHING_NAT", math.inf)
    begun = 20.0 / 60.0
    assert isinstance(choose(known, GOALS, Menu(), GOALS.minutes - begun), Choice)
    never = Goals("never", {name: 1e-4 * limit for name, limit in GOALS.limits.items()}, 10.0)
    end = choose(known, never, Menu(), 0.5)
    assert isinstance(end, End)
    assert "no move of this table brings more" in end.reason


def test_between_the_axes_a_test_only_goes_back_or_on():
    # From there the gimbals of a table can turn about one axis or two, and a test would stay with them.
    half = Turn("Y", math.pi / 4.0, math.radians(10.0))
    known = fitted(perfect_fit(Plan("oblique", (20.0, 20.0), (half,), ACCELERATION)), GOALS)
    assert not known.at.square
    tried = []
    choice = choose(known, GOALS, Menu(), 30.0, lambda step: tried.append(step.turn) or True)
    assert isinstance(choice, Choice)
    assert {round(math.degrees(abs(turn.angle_rad))) for turn in tried} == {45}


def test_no_move_is_longer_than_the_time_that_is_left(known):
    choice = choose(known, GOALS, Menu(), 0.5)
    assert isinstance(choice, Choice)
    assert choice.minutes <= 0.5


def with_open(fit: NavigationFit, goals: Goals, pair: tuple[str, str]) -> Knowledge:
    """What is known where the last effect of a model is found at three sigmas of its prior, and another looks alike."""
    at, count = so_far(fit, [resolve(pair[1])], 30.0), len(fit.names)
    size = 3.0 * at.setup.sensors.prior[[count - 1, count]] / np.array([1.0, 30.0])
    one = OpenClass(pair[0], pair[1:], (count - 1, count), size, np.array([3.0]))
    return replace(fitted(fit, goals), at=at, open=one)


def test_an_open_class_is_told_apart_by_a_turn_about_its_own_axis_once_the_limits_hold():
    fit = perfect_fit(BOTH_SENSES, PAIR[:1])
    wide = Goals("wide", dict.fromkeys(GOALS.limits, 1000.0), 30.0)
    known = with_open(fit, wide, PAIR)
    at, one = known.at, known.open
    choice = choose(known, wide, SHORT, 30.0, lambda *steps: len(steps) == 1)
    assert isinstance(choice, Choice)
    assert choice.step.turn.axis == "Y"
    assert re.search(
        rf"tells {PAIR[0]} from {PAIR[1]} \(expected evidence \+[\d.]+ nat, the log of the odds\)", choice.text
    )
    prior = at.setup.sensors.prior
    before, after = (separation(one, prior, where.covariance[None]) for where in (at, choice.after))
    assert after[0, 0] > before[0, 0]


def test_a_stop_that_adds_the_last_hundredth_of_a_nat_says_to_what():
    """It was told as a stop that brings nothing."""
    fit = perfect_fit(BOTH_SENSES, PAIR[:1])
    wide = Goals("wide", dict.fromkeys(GOALS.limits, 1000.0), 30.0)
    known = with_open(fit, wide, PAIR)
    nearly = replace(known, open=replace(known.open, needed=np.array([0.01])))
    choice = choose(nearly, wide, SHORT, 30.0, lambda *steps: len(steps) == 1)
    assert isinstance(choice, Choice)
    assert 0.0 < choice.told <= 0.01
    assert choice.reason == f"adds the rest that tells {PAIR[0]} from {PAIR[1]}"


def test_a_turn_that_shows_nothing_is_chosen_where_it_leads_to_one_that_tells_a_class_apart():
    # At the end x stands upright, and a slow turn about it changes the azimuth alone; level, it shows as a tilt.
    pair = ("gyro_scale_asymmetry_x", "gyro_scale_quadratic_x")
    degrees = (("X", 90.0), ("X", -90.0), ("Z", 90.0), ("Z", -90.0), ("Y", 90.0))
    turns = tuple(Turn(axis, math.radians(angle), math.radians(10.0)) for axis, angle in degrees)
    wide = Goals("wide", dict.fromkeys(GOALS.limits, 1000.0), 30.0)

    def few(*steps):
        return all(step.turn.axis in "XZ" and abs(step.turn.angle_rad) < 2.0 for step in steps)

    known = with_open(perfect_fit(Plan("upright", (30.0,) * 6, turns, ACCELERATION), pair[:1]), wide, pair)
    choice = choose(known, wide, SHORT, 30.0, few)
    assert isinstance(choice, Choice)
    assert choice.step.turn.axis != "X"
    assert "leads to X" in choice.reason
    assert f"tells {pair[0]} from {pair[1]}" in choice.reason
    after = choose(known, wide, SHORT, 30.0 - choice.minutes, few, choice.after)
    assert isinstance(after, Choice)
    assert after.step.turn.axis == "X"
    assert after.gain > choice.gain


def test_no_turn_leads_to_one_that_the_table_cannot_make_after_it():
    wide = Goals("wide", dict.fromkeys(GOALS.limits, 1000.0), 30.0)
    known = with_open(perfect_fit(BOTH_SENSES, PAIR[:1]), wide, PAIR)
    asked = []
    choice = choose(known, wide, SHORT, 30.0, lambda *steps: asked.append(steps) or len(steps) == 1)
    assert any(len(steps) == 2 for steps in asked)
    assert "leads to" not in choice.reason


def level_fit() -> NavigationFit:
    """Fit where y and z were upright both ways, and x never was."""
    turns = tuple(Turn("X", math.radians(90.0), math.radians(10.0)) for _ in range(4))
    return perfect_fit(Plan("x level", (30.0,) * 5, turns, ACCELERATION))


def level_known(minutes: float) -> tuple[Knowledge, Goals]:
    """What is known of `level_fit` where the accelerometers' scale factors alone have a limit."""
    fit = level_fit()
    sigma = dict(zip(fit.names, np.sqrt(np.diag(fit.covariance)), strict=True))
    limit = 1.1 * max(sigma["accel_scale_y"], sigma["accel_scale_z"])
    goals = Goals("accelerometers", {"accel_scale": limit}, minutes)
    return fitted(fit, goals), goals


def first_about_x(*steps: Step) -> bool:
    """Say what a table can do that turns about x alone from where it stands, and from there about any axis."""
    return steps[0].turn.axis == "X"


def test_a_limit_that_takes_two_turns_is_no_end_of_a_test():
    # About x alone the accelerometer x stays level; after a quarter turn about x a turn about z makes it upright.
    known, goals = level_known(30.0)
    assert [name for name, ratio in zip(known.limited, known.ratio, strict=True) if ratio > 1.0] == ["accel_scale_x"]
    choice = choose(known, goals, SHORT, 27.0, first_about_x)
    assert isinstance(choice, Choice)
    assert choice.step.turn.axis == "X"
    assert abs(math.degrees(choice.step.turn.angle_rad)) == pytest.approx(90.0)
    assert "leads to" in choice.reason
    assert "accel_scale_x" in choice.reason
    after = choose(known, goals, SHORT, 27.0 - choice.minutes, at=choice.after)
    assert isinstance(after, Choice)
    assert after.step.turn.axis in "YZ"
    assert after.gain > 1.0


def test_two_turns_are_looked_for_only_where_one_leaves_a_limit_out_of_reach():
    known, goals = level_known(30.0)
    asked = []
    choose(known, goals, SHORT, 27.0, lambda *steps: asked.append(len(steps)) or True)
    assert set(asked) == {1}


def test_what_the_goals_ask_is_told_apart_though_nothing_was_found():
    wide = Goals("wide", dict.fromkeys(GOALS.limits, 1000.0), 30.0)
    fit = perfect_fit(BOTH_SENSES)
    assert isinstance(choose(fitted(fit, wide), wide, SHORT, 30.0), End)
    goals = aimed(wide, PAIR)
    known = fitted(fit, goals)
    assert known.named == ()
    choice = choose(known, goals, SHORT, 30.0, lambda *steps: len(steps) == 1)
    assert isinstance(choice, Choice)
    assert choice.step.turn.axis == "Y"
    assert re.search(
        rf"tells {PAIR[0]} from {PAIR[1]} \(expected evidence \+[\d.]+ nat, the log of the odds\)", choice.text
    )


@pytest.mark.parametrize(("ratio", "left", "goes_on"), [(1.02, 20.0, True), (300.0, 0.5, False), (0.9, 20.0, False)])
def test_a_class_that_cannot_be_told_apart_ends_no_test_whose_limits_are_near(ratio, left, goes_on, monkeypatch):
    fit = perfect_fit(BOTH_SENSES, PAIR[:1])
    worst = float(with_open(fit, GOALS, PAIR).ratio.max())
    goals = replace(GOALS, limits={name: limit * worst / ratio for name, limit in GOALS.limits.items()})
    known = with_open(fit, goals, PAIR)
    # More than any turn brings: as of two effects with one equation.
    never = replace(known, open=replace(known.open, needed=np.array([1e9])))
    monkeypatch.setattr("sdimu_calibration.core.adaptive.choice._NOTHING_NAT", math.inf)
    chosen = choose(never, goals, SHORT, left, lambda *steps: len(steps) == 1)
    assert isinstance(chosen, Choice) == goes_on
    if goes_on:
        assert (chosen.ratio <= known.ratio + 1e-9).all()
        assert np.maximum(chosen.ratio, 1.0).prod() < np.maximum(known.ratio, 1.0).prod()
    else:
        assert f"{PAIR[0]} is not told from {PAIR[1]}" in chosen.reason


def test_beside_two_effects_with_one_equation_a_test_goes_on_to_a_limit_that_is_a_stop_away():
    pair = ("gyro_delay_y", "gyro_acceleration_sensitivity_yy")
    fit = perfect_fit(BOTH_SENSES, pair[:1])
    worst = float(with_open(fit, GOALS, pair).ratio.max())
    goals = replace(GOALS, limits={name: limit * worst / 1.0009 for name, limit in GOALS.limits.items()})
    choice = choose(with_open(fit, goals, pair), goals, SHORT, 20.0)
    assert isinstance(choice, Choice)
    assert choice.ratio.max() < 1.0
    told = re.fullmatch(r"brings \w+ from (\S+) to (\S+) of its limit", choice.reason)
    assert told is not None, choice.reason
    assert float(told[2]) < 1.0 < float(told[1])


@pytest.mark.parametrize(
    ("ratios", "written"),
    [
        ((50.2, 0.86), ["50 times", "0.86"]),
        ((1.61, 1.04), ["1.61", "1.04"]),
        ((1.0009, 0.998), ["1.001", "0.998"]),
        ((1.0001, 0.998), ["1.0001", "0.9980"]),
        ((1.0009, 1.0006), ["1.0009", "1.0006"]),
        ((50.2, 0.998), ["50.2 times", "0.998"]),
        ((50.2, 49.9), ["50.2 times", "49.9 times"]),
        ((1.0009,), ["1.001"]),
        ((1.0,), ["1.00"]),
    ],
)
def test_a_reason_writes_as_many_digits_as_show_what_a_move_changes_and_on_which_side_of_the_limit(ratios, written):
    assert _times(*ratios) == written


def test_what_two_rates_in_both_senses_tell_apart_is_lacking_no_longer():
    turns = tuple(Turn("Y", math.radians(angle), math.radians(rate)) for rate in (10.0, 2.0) for angle in (90.0, -90.0))
    fit = perfect_fit(Plan("two rates", (30.0,) * 5, turns, ACCELERATION))
    assert fitted(fit, aimed(GOALS, PAIR)).open is None
    # About x nothing was turned.
    other = ("gyro_scale_asymmetry_x", "gyro_scale_quadratic_x")
    assert fitted(fit, aimed(GOALS, other)).open.alike == other[1:]


def test_what_the_model_has_already_is_told_apart_with_its_own_column():
    fit = perfect_fit(BOTH_SENSES, PAIR[:1])
    known = fitted(fit, aimed(GOALS, PAIR))
    assert known.open.columns == (fit.names.index(PAIR[0]), len(fit.names))
    both = fitted(fit, aimed(GOALS, ("gyro_scale_asymmetry", PAIR[1])))
    assert sorted(both.at.names) == sorted(set(both.at.names))


@pytest.mark.parametrize(
    ("tell", "message"),
    [(PAIR[:1], "two coefficients or more"), ((*PAIR, PAIR[0]), "named twice"), ((PAIR[0], "gyro"), "unknown effect")],
)
def test_what_is_no_class_is_refused(tell, message):
    with pytest.raises(DataError, match=message):
        aimed(GOALS, tell)


def test_what_has_the_same_signature_is_never_apart():
    fit = perfect_fit(part(4), PAIR[:1])
    at = so_far(fit, [resolve(PAIR[1])], 30.0)
    count = len(fit.names)
    known = replace(fitted(fit, GOALS), at=at)
    size = at.setup.sensors.prior[[count - 1, count]]
    twin = OpenClass(PAIR[0], (PAIR[0],), (count - 1, count), size, np.array([3.0]))
    same = at.covariance.copy()
    # One parameter in two places: a sum is known, the difference is not.
    prior = at.setup.sensors.prior[count - 1]
    s2 = (1e-3 * prior) ** 2
    J = np.array([[1.0 / s2, 1.0 / s2], [1.0 / s2, 1.0 / s2]]) + np.eye(2) / prior**2
    same[np.ix_([count - 1, count], [count - 1, count])] = np.linalg.inv(J)
    known.at.setup.sensors.prior[count] = prior
    assert separation(twin, known.at.setup.sensors.prior, same[None])[0, 0] < 1e-6 * size[0] ** 2 / s2


def test_ratios_are_sigmas_in_the_reported_frame_over_their_limits(first_stop):
    known = fitted(first_stop, replace(GOALS, both_senses=False))
    limited, limit = GOALS.of(first_stop.names, first_stop.model.body_frame)
    expected = np.sqrt(np.diag(first_stop.covariance)[limited]) / limit
    np.testing.assert_allclose(ratios(known.at, GOALS, known.at.covariance), expected, rtol=1e-6)
    assert not any(name in known.limited for name in ("accel_misalignment_xy", "accel_misalignment_xz"))


def scale_known(*degrees: float, both_senses: bool = True) -> tuple[Knowledge, Goals]:
    """What is known after turns about y, where nothing but scale factors of gyros has a limit."""
    turns = tuple(Turn("Y", math.radians(angle), math.radians(10.0)) for angle in degrees)
    goals = Goals("scale", {"gyro_scale": GOALS.limits["gyro_scale"]}, 30.0, both_senses)
    return fitted(perfect_fit(Plan("turns about y", (30.0,) * (len(turns) + 1), turns, ACCELERATION)), goals), goals


def test_the_limit_of_a_scale_factor_does_not_hold_while_an_asymmetry_may_hide_in_it():
    one, goals = scale_known(180.0, 180.0)
    y = one.limited.index("gyro_scale_y")
    alone, _ = scale_known(180.0, 180.0, both_senses=False)
    assert alone.ratio[y] < 1.0
    # Turns in one sense say nothing of an asymmetry: all of its prior may be in the scale factor.
    sensors = one.at.setup.sensors
    prior = sensors.prior[sensors.names.index("gyro_scale_asymmetry_y")]
    assert one.ratio[y] == pytest.approx(math.hypot(alone.ratio[y], prior / goals.limits["gyro_scale"]), rel=0.02)


def test_turns_in_both_senses_make_the_limit_of_a_scale_factor_hold():
    both, _ = scale_known(90.0, 90.0, -90.0, -90.0)
    alone, _ = scale_known(90.0, 90.0, -90.0, -90.0, both_senses=False)
    y = both.limited.index("gyro_scale_y")
    assert both.ratio[y] < 1.0
    assert both.ratio[y] == pytest.approx(alone.ratio[y], rel=0.02)


def test_a_turn_in_the_other_sense_is_chosen_where_only_an_asymmetry_keeps_a_limit_from_holding():
    one, goals = scale_known(180.0, 180.0)
    choice = choose(one, goals, Menu(), 30.0, lambda *steps: steps[-1].turn.axis == "Y")
    assert isinstance(choice, Choice)
    assert choice.step.turn.angle_rad < 0.0


def test_an_asymmetry_that_is_estimated_hides_nothing():
    fit = perfect_fit(BOTH_SENSES, PAIR[:1])
    known = fitted(fit, GOALS, [resolve("gyro_scale_asymmetry_x")])
    assert known.at.names[len(fit.names) :] == ("gyro_scale_asymmetry_x", "gyro_scale_asymmetry_z")


def test_a_limit_of_what_is_estimated_along_but_not_in_the_model_counts_for_nothing(first_stop):
    also = replace(GOALS, limits={**GOALS.limits, "gyro_scale_asymmetry": 1e-6, "gyro_scale_quadratic": 1e-6})
    known = fitted(first_stop, also, [resolve(PAIR[1])])
    assert known.limited == fitted(first_stop, GOALS).limited
    assert isinstance(choose(known, also, Menu(), 30.0), Choice)


def test_limits_of_nothing_in_the_model_are_refused(first_stop):
    with pytest.raises(DataError, match="accel_cubic"):
        fitted(first_stop, Goals("other", {"accel_cubic": 1.0}, 30.0))


def test_gyros_that_do_not_see_the_earth_choose_no_turn():
    site, imu = load_site("daejeon"), load_imu("mems_consumer")
    plan = replace(BOTH_SENSES, dwell_s=(10.0,) * 6)
    recording, _ = generate(Scenario(plan, imu, site, rate_hz=20.0, seed=5))
    fit = solve(PreparedTest(recording, imu, site), load_model("hand"), learn=False)
    with pytest.raises(
        DataError, match=r"let the table run a plan instead \(the gyros' white noise .* hides the Earth"
    ):
        fitted(fit, GOALS)
