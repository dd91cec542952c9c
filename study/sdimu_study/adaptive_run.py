"""One run of the study of adaptive tests: draw, let the test choose its turns, score by name; fixed plans beside it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any
from zlib import crc32

import numpy as np

from sdimu_calibration.core.adaptive import Goals, Menu
from sdimu_calibration.core.diagnosis.diagnose import Diagnosis, climb
from sdimu_calibration.core.effects.selection import resolve
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import solve
from sdimu_calibration.core.joint.scope import is_shared
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.specification import ImuSpecification, Model, Site
from sdimu_calibration.storage.files.config import load_plan
from sdimu_calibration.storage.files.table_file import load_rate_table
from sdimu_sim.core.scenario import Scenario, imu_truth
from sdimu_sim.core.truth import ImuTruth
from sdimu_study.adaptive_test import adaptive_test
from sdimu_study.hidden_draw import Truth, drawn_effect, hideable_names
from sdimu_study.hidden_score import baseline_z, same_effect
from sdimu_study.hidden_sizes import RATE_HZ, WARM_UP, Sizes
from sdimu_study.run import in_the_mean, simulate, true_values

KINDS = ("table33", "clean", "hidden")
"""Clean tests to the accuracy of Table 3.3; clean tests, and tests with a hidden effect, to that of kim18."""
FIXED = ("kim18", "recommended")
"""Plans that are run with the same hidden effect."""
SPAN = (10.0, 30.0)
"""Sizes of hidden effects: sigmas of a test with kim18."""
LOOK_S = {"table33": 60.0, "clean": 600.0, "hidden": 600.0}
"""Length of test after which the data are looked at anew (s), by kind: a look costs seconds of computing."""


@dataclass(frozen=True)
class AdaptiveRun:
    """Simulate and score one adaptive test.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    imu : ImuSpecification
    site : Site
    model : Model
    goals : Goals
    sizes : Sizes
        How small an effect kim18 sees at the site.
    """

    kind: str
    imu: ImuSpecification
    site: Site
    model: Model
    goals: Goals
    sizes: Sizes

    def __call__(self, seed: int) -> dict[str, Any]:
        """Run a seed.

        Returns
        -------
        dict
            ``minutes``, ``stops``, ``worst`` (sigma over limit at the end), ``looks`` (minutes, worst, named), ``z`` of
            the baseline coefficients, ``errors`` (over their limits), and that of `_scored`; with a hidden effect
            ``truth`` and, by fixed plan, ``fixed``.

        Raises
        ------
        DataError
            When the drawn test cannot be simulated or calibrated.
        """
        truth = hidden(self.sizes, seed) if self.kind == "hidden" else None
        scenario = Scenario(
            plan=load_plan("kim18"), imu=self.imu, site=self.site, rate_hz=RATE_HZ, seed=seed,
            effects=() if truth is None else (truth.text,), temperature=WARM_UP,
        )  # fmt: skip
        sensor = imu_truth(scenario)
        done = adaptive_test(
            scenario, sensor, load_rate_table("ideal"), self.model, self.goals, Menu(), LOOK_S[self.kind]
        )
        found = done.last.found
        true = in_the_mean(sensor, found.fit.test.recording, seed)
        row: dict[str, Any] = {
            "minutes": done.plan.duration_s / 60.0, "stops": len(done.plan.dwell_s),
            "worst": float(done.last.known.ratio.max()),
            "looks": [[x.minutes, float(x.known.ratio.max()), list(x.known.named)] for x in done.looks],
            "z": baseline_z(found.after, true).tolist(), "errors": limit_errors(found.after, true, self.goals),
            "truth": None if truth is None else truth.text, **_scored(found, truth),
        }  # fmt: skip
        if truth is not None:
            row["fixed"] = {}
            for name in FIXED:
                test = replace(scenario, plan=load_plan(name))
                fit = solve(PreparedTest(simulate(test, sensor), self.imu, self.site), self.model)
                row["fixed"][name] = _scored(climb(fit), truth)
        return row


def limit_errors(result: Calibration, true: ImuTruth, goals: Goals) -> list[float]:
    """Errors of the coefficients that have a limit, over that limit."""
    limited, limit = goals.of(result.names, result.body_frame)
    truth = true_values(true, result.names, result.body_frame)
    return list(map(float, (result.values - truth)[limited] / limit))


def hidden(sizes: Sizes, seed: int) -> Truth:
    """Draw an effect that any test of a sensor can show: no fault of one recording, nothing at one time of it."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, crc32(b"adaptive")]))
    low, high = SPAN
    size = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    return drawn_effect(rng, sizes, size, hideable_names() - _of_one_recording())


def _of_one_recording() -> frozenset[str]:
    return frozenset(name for name in hideable_names() if not is_shared(resolve(name)))


def _scored(found: Diagnosis, truth: Truth | None) -> dict[str, Any]:
    """Score a diagnosis.

    ``one``: ends with one effect, no other one beside it or alike (other time constants of the same one are no other
    effect); ``right``: the first one named is the hidden one.
    """
    named = [c.label for c in found.chosen]
    names = {_bare(label) for label in (*named, *found.alike)}
    right = truth is not None and bool(named) and same_effect(named[0], truth, found.evidence.times.stops)
    in_class = truth is not None and any(
        same_effect(label, truth, found.evidence.times.stops) for label in (*named, *found.alike)
    )
    return {
        "verdict": found.verdict, "named": named, "alike": list(found.alike), "one": len(names) == 1,
        "right": right, "in_class": in_class,
    }  # fmt: skip


def _bare(label: str) -> str:
    return label.partition("(")[0]
