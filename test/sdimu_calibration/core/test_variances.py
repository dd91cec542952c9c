"""A crossing of zero is found on falling functions of any shape."""

import math

import pytest

from sdimu_calibration.core.variances import crossing


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(
    ("excess", "at"),
    [
        (lambda x: 3.0 - x, 3.0),
        (lambda x: math.exp(-x) - 1e-9, math.log(1e9)),
        (lambda x: 5.0 / (1e-12 + x**2) - 20.0, 0.5),
        (lambda x: 1.0 if x < 7.0 else -1e-9, 7.0),
    ],
)
def test_a_falling_function_crosses_zero_where_it_does(excess, at, scale):
    found = crossing(excess, scale)
    assert found == pytest.approx(at, rel=1e-11)
    assert excess(found) <= 0.0


def test_what_begins_below_zero_crosses_at_zero():
    assert crossing(lambda x: -1.0 - x, 1.0) == 0.0


def test_a_crossing_is_as_near_as_was_asked():
    def excess(x):
        return 1.0 / (1.0 + x) - 0.1

    assert 0.0 <= crossing(excess, 1.0, 0.1) / 9.0 - 1.0 <= 0.12


@pytest.mark.parametrize("value", [1.0, math.nan])
def test_a_function_that_does_not_fall_is_refused(value):
    with pytest.raises(ArithmeticError, match="should be below zero"):
        crossing(lambda _: value if math.isnan(value) or _ == 0.0 else 1.0, 1.0)
