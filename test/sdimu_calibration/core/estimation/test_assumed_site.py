"""A filter that diverges at a site that nobody stated says so in its own line."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sdimu_calibration.core.estimation import solve as room
from sdimu_calibration.core.recording import DivergedError
from sdimu_calibration.core.specification import StatedPrior


def diverge(*_):
    raise DivergedError("the filter diverged")


@pytest.mark.parametrize(
    ("assumed", "said"), [("daejeon", r"\(no site was stated: daejeon was assumed\)$"), ("", "d$")]
)
def test_a_filter_that_diverges_names_the_site_that_was_assumed(bench, monkeypatch, assumed, said):
    fit = bench.fit()
    monkeypatch.setattr(room, "ESTIMATORS", {"filter": diverge})
    with pytest.raises(DivergedError, match=said):
        room.solve(replace(fit.test, assumed_site=assumed), fit.model, "filter")


def test_a_filter_that_diverges_names_the_priors_of_the_model(bench, monkeypatch):
    fit = bench.fit()
    monkeypatch.setattr(room, "ESTIMATORS", {"filter": diverge})
    model = replace(fit.model, priors=(StatedPrior("gyro_bias_x", 5e-4, 5e-9, "deg/h"),))
    with pytest.raises(DivergedError, match=r"check the priors that the model states: gyro_bias_x$"):
        room.solve(fit.test, model, "filter")
