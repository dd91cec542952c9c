"""When a set is searched beside an unknown function of the attitude, and when without one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import pytest

from sdimu_calibration.core.joint import function_search, set_search
from sdimu_calibration.core.joint.leftovers import ATTITUDE, TIME
from sdimu_calibration.core.joint.recurrence import Kind, Recurrence
from sdimu_calibration.core.joint.set_found import FunctionShare
from sdimu_calibration.core.joint.set_search import SetRequest


@dataclass(frozen=True)
class Found:
    """What a search leaves, as far as it is asked here."""

    name: str
    function: str | None = None
    probability: float = 0.0
    stood: bool = True
    posterior: str = ""
    families: tuple[str, ...] = ()

    @property
    def chosen(self):
        return tuple(SimpleNamespace(family=family) for family in self.families)

    @property
    def alone(self):
        return f"fit of {self.name}"

    @property
    def before(self):
        return SimpleNamespace(names=("as given",))

    @property
    def after(self):
        return SimpleNamespace(function=self.function)

    @property
    def function_is_likely(self):
        return self.probability > 0.5

    @property
    def functions(self):
        return (FunctionShare("", self.probability, ("accel_x",)),)


@dataclass
class Stage:
    """Stands for the searches: what each gives, and which were asked."""

    first: Found
    follows: tuple[str, ...] = ()
    again: Recurrence | None = None
    beside: Found = field(default_factory=lambda: Found("beside", "function", 0.9))
    asked: list[str] = field(default_factory=list)
    near: tuple[str, ...] | None = None
    """Equations that come near; None where the search asks for none."""
    wider: Found = field(default_factory=lambda: Found("wider"))

    def put(self, monkeypatch):
        def without(*_):
            self.asked.append("without")
            return Found("without")

        def search_about(_, __, request, asks=False):
            self.asked += ["beside"] if asks else [f"with {one}" for one in request.extra]
            return self.beside if asks else self.wider

        def with_function(_, sensors, __):
            self.asked += [f"function of {one}" for one in sensors]
            return SimpleNamespace(function="function" if sensors else None)

        def leftovers(fit, _, given):
            assert given == ("as given",)
            self.asked.append(f"left by {fit}")
            return SimpleNamespace(where=(f"left by {fit}",))

        for name, what in (
            ("asks_for_equations", lambda _: self.near is not None),
            ("near_equations", lambda *_: self.near),
            ("search_set", lambda *_: self.first),
            ("search_without", without),
            ("search_about", search_about),
            ("with_function", with_function),
            ("following", lambda *_: self.follows),
            ("leftovers", leftovers),
            ("recurrence", lambda _: self.again),
        ):
            monkeypatch.setattr(function_search, name, what)
        return function_search.searched((), SetRequest(None, None))  # type: ignore[arg-type]


def returns(attitude):
    kinds = (Kind(ATTITUDE, 9, attitude), Kind(TIME, 9, 0.0))
    return Recurrence(kinds, attitude, ("accel_y",), 1e-9)


def test_one_that_the_search_asked_for_stays_where_it_is_likely(monkeypatch):
    stage = Stage(Found("asked", "function", 0.8), again=returns(0.3))
    done = stage.put(monkeypatch)
    # What comes back is that of the fit before the function, with the probability that all rows give it.
    assert stage.asked == ["left by fit of asked"]
    assert done.found is stage.first
    assert done.without is None
    assert done.beside_function
    assert done.where == ("left by fit of asked",)
    assert done.again.kinds[0].probability == 0.8
    assert done.again.sensors == ("accel_x",)
    assert [one.probability for one in done.functions] == [0.8]


def test_one_that_is_not_likely_is_left_out_and_not_asked_for_again(monkeypatch):
    stage = Stage(Found("asked", "function", 0.2), follows=("accel_x",), again=returns(0.9))
    done = stage.put(monkeypatch)
    assert stage.asked == ["without", "left by fit of without"]
    assert (done.found.name, done.without, done.beside_function) == ("without", None, False)
    assert [one.probability for one in done.functions] == [0.2]
    assert done.again.sensors == ("accel_y",)


@pytest.mark.parametrize(
    ("follows", "attitude", "asked"), [(("gyro_x",), 0.0, "gyro_x"), ((), 0.3, "accel_y"), ((), 0.1, None)]
)
def test_at_the_end_one_is_asked_for_where_it_is_possible(monkeypatch, follows, attitude, asked):
    stage = Stage(Found("first"), follows, returns(attitude))
    done = stage.put(monkeypatch)
    if asked is None:
        assert stage.asked == ["left by fit of first"]
        assert (done.found, done.without, done.functions) == (stage.first, None, ())
    else:
        assert stage.asked == ["left by fit of first", f"function of {asked}", "beside"]
        assert (done.found, done.without) == (stage.beside, stage.first)


def test_where_nothing_is_left_none_is_asked_for_at_the_end(monkeypatch):
    stage = Stage(Found("first"), ("accel_x",))
    assert stage.put(monkeypatch).found is stage.first
    assert stage.asked == ["left by fit of first"]


def test_a_search_that_has_no_end_tells_no_probabilities_of_functions(monkeypatch):
    stage = Stage(Found("asked", "function", 0.8, stood=False), again=returns(0.3))
    done = stage.put(monkeypatch)
    assert done.functions == ()
    assert done.again.kinds[0].probability == 0.3


def test_recordings_that_were_left_out_stay_named_after_a_refit(monkeypatch):
    @dataclass(frozen=True)
    class Fit:
        members: tuple[str, ...]
        left_out: tuple[tuple[str, str], ...] = ()

    before = Fit(("r0", "r1"), (("r2", "no status"),))
    monkeypatch.setattr(set_search, "fit_set", lambda members, *_: Fit(members[:1], (("r1", "clipped"),)))
    monkeypatch.setattr(set_search, "_with", lambda options, _: options)
    again = SetRequest(None, None).fit((), before)  # type: ignore[arg-type]
    assert again == replace(before, members=("r0",), left_out=(("r2", "no status"), ("r1", "clipped")))


def test_an_equation_that_is_chosen_replaces_what_was_told(monkeypatch):
    stage = Stage(Found("first", families=("a", "b", "c")), near=("ax^2 az",), wider=Found("wider", families=("own",)))
    done = stage.put(monkeypatch)
    assert stage.asked == ["left by fit of first", "with ax^2 az", "left by fit of wider"]
    assert (done.found, done.without, done.functions) == (stage.wider, None, ())
    assert done.where == ("left by fit of wider",)


def test_a_function_that_an_equation_explains_is_left_out(monkeypatch):
    stage = Stage(
        Found("asked", "function", 0.8), near=("ax^3",), wider=Found("wider", "function", 0.1, families=("own",))
    )
    assert stage.put(monkeypatch).found.name == "without"
    assert stage.asked == ["left by fit of asked", "with ax^3", "without", "left by fit of without"]


@pytest.mark.parametrize("near", [(), ("ax^3",)])
def test_where_no_equation_comes_near_or_is_chosen_all_stays(monkeypatch, near):
    stage = Stage(Found("asked", "function", 0.8), again=returns(0.3), near=near, wider=Found("wider", families=("a",)))
    done = stage.put(monkeypatch)
    assert done.found is stage.first
    assert [one.probability for one in done.functions] == [0.8]
