"""The ladder of a set: models from that as given to that with everything found, and how wrong each is.

The noise, and the point about which the rows are linear, are those of the last model, so that models compare. A
prediction is made for each power-on from the others: of its rows, and of a navigation without aid in it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sdimu_calibration.core.diagnosis.ladder import rung_name
from sdimu_calibration.core.estimation.free_inertial import FOUND, FreeInertialRun, OfOthers
from sdimu_calibration.core.estimation.handheld_fit import HandheldFit
from sdimu_calibration.core.joint.combine import Combination
from sdimu_calibration.core.joint.member import Report
from sdimu_calibration.core.joint.set_evidence import held_out
from sdimu_calibration.core.joint.set_fit import Run, SetFit, SetOptions, columns_of, grouped_rows, job_of, power_on
from sdimu_calibration.core.joint.set_found import SetSearch
from sdimu_calibration.core.joint.set_search import places_of_chosen
from sdimu_calibration.core.recording import DataError

_MOST_NAVIGATED = 4
"""Number of recordings that are navigated at most: four say how far a unit drifts, and each takes a second."""


@dataclass(frozen=True)
class SetLadder:
    """Models of a set, the simplest first."""

    rungs: tuple[tuple[str, float], ...] = ()
    """What each has beyond the one before, empty for the first, and its held-out error (sigma); NaN where nothing can
    be held out."""
    in_use: tuple[FreeInertialRun, ...] = ()
    """Navigations without aid with each model, one a recording."""
    not_tried: str = ""
    """Why there are none; empty where there are."""

    @property
    def errors(self) -> tuple[tuple[str, float], ...]:
        """Name and held-out error (sigma) of each model."""
        return tuple((rung_name(added), error) for added, error in self.rungs)

    @property
    def error_without(self) -> float:
        """Held-out error (sigma) without what was found; NaN where nothing can be held out."""
        return self.rungs[0][1] if self.rungs else float("nan")


def set_ladder(found: SetSearch, run: Run) -> SetLadder:
    """Say how wrong a set is with the first, the first two, ... of what was found in all recordings.

    Parameters
    ----------
    found : SetSearch
        Of a search that has ended.
    run : callable
        Does the jobs.
    """
    fit, added = found.after, ("", *(c.label for c in found.chosen))
    columns = [fit.names[place] for place in places_of_chosen(found)]
    lacks = [frozenset(columns[k:]) for k in range(len(added))]
    rungs = tuple((label, _error(fit, without)) for label, without in zip(added, lacks, strict=True))
    # As on the ladder of one recording: the last model, where it is navigated, is what was found.
    names = [*map(rung_name, added[:-1]), FOUND if len(added) > 1 else rung_name("")]
    places = _navigated(fit)
    if not places:
        return SetLadder(rungs, (), "runs by hand are not navigated without aid")
    options = SetOptions(fit.model, local=fit.local)
    jobs = [
        replace(
            job_of(fit.members[k], options, fit, learn=False),
            others=tuple(
                _of_others(fit, fit.reports[k], name, without) for name, without in zip(names, lacks, strict=True)
            ),
        )
        for k in places
    ]
    done = [one for one in run(jobs) if not isinstance(one, DataError)]
    runs = tuple(report.in_use for report in done if report.in_use is not None)
    return SetLadder(rungs, runs, "" if runs else "the recordings are too short")


def _error(fit: SetFit, lacks: Collection[str]) -> float:
    told = held_out(fit, sorted(lacks))
    return float("nan") if told is None else told.rms


def _navigated(fit: SetFit) -> list[int]:
    """Places of the recordings that are navigated: on a table, without faults of their own where there are such."""
    on_table = [k for k, r in enumerate(fit.reports) if r.estimator != HandheldFit.estimator]
    sound = [k for k in on_table if not fit.local.get(fit.reports[k].name)] or on_table
    if len(sound) <= _MOST_NAVIGATED:
        return sound
    spread = np.linspace(0, len(sound) - 1, _MOST_NAVIGATED).round().astype(int)
    return [sound[k] for k in spread.tolist()]


def _of_others(fit: SetFit, report: Report, name: str, lacks: Collection[str]) -> OfOthers:
    """Say what all other power-ons tell of the unit (where there is one, all other recordings), with a model.

    `lacks` are coefficients of the fit that the model of this name has not. In a power-on that the others have not seen
    a coefficient may differ from their mean by its scatter.
    """
    one = len(fit.power_ons) == 1
    others = [r for r in fit.reports if r is not report and (one or power_on(r) != power_on(report))]
    kept = [name for name in fit.names if name not in lacks]
    weight = fit.weight[[fit.names.index(name) for name in kept]]
    varying = {} if one else _without(fit.varying, lacks)
    components = columns_of(varying, kept)
    tau = {t.effect: t.sigma for t in fit.turn_on}
    sizes = np.array([tau[c.effect] for c in components])
    estimate = Combination(grouped_rows(others, kept), weight, components).estimate(sizes)
    covariance = estimate.covariance
    for component, size in zip(components, sizes.tolist(), strict=True):
        covariance[component.columns, component.columns] += size**2
    every, total = (*kept, *sorted(lacks)), np.zeros((len(fit.names), len(fit.names)))
    total[: len(kept), : len(kept)] = covariance
    return OfOthers(name, every, np.concatenate([estimate.values, np.zeros(len(lacks))]), total)


def _without(varying: Mapping[str, Sequence[str]], lacks: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Effects that differ from power-on to power-on, with their coefficients that a model has."""
    left = {effect: tuple(name for name in names if name not in lacks) for effect, names in varying.items()}
    return {effect: names for effect, names in left.items() if names}
