"""The functions of the Python interface."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, overload

from sdimu_calibration.api.comparison import Comparison
from sdimu_calibration.api.diagnosis import FitDiagnosis
from sdimu_calibration.api.fit import CalibrationFit
from sdimu_calibration.api.given import imu_given, plan_given, site_given
from sdimu_calibration.api.recording_set import JointDiagnosis, JointFit, OpenedSet
from sdimu_calibration.core.batch.batch import bound_covariance
from sdimu_calibration.core.diagnosis.diagnose import climb
from sdimu_calibration.core.estimation.prepared_test import PreparedTest
from sdimu_calibration.core.estimation.solve import AUTO, solve
from sdimu_calibration.core.evidence.known import Standing
from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.plan_search import Found, Goal, Question, search
from sdimu_calibration.core.plan_search.bound import bounds
from sdimu_calibration.core.plan_search.moves import Abilities
from sdimu_calibration.core.planning.predict import Prediction
from sdimu_calibration.core.planning.predict import predict as predict_test
from sdimu_calibration.core.progress import Progress, silent
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.core.units import parse_quantity
from sdimu_calibration.storage.arrays import raw_test
from sdimu_calibration.storage.files.config import load_imu
from sdimu_calibration.storage.files.effect_file import find_effects
from sdimu_calibration.storage.files.model_choice import by_hand, named_estimator, named_model
from sdimu_calibration.storage.opening import Opening, Source
from sdimu_calibration.storage.recording_set import BagSource, load_set, set_of, set_options

if TYPE_CHECKING:
    import pandas as pd

_ABLE = Abilities((math.radians(2.0), math.radians(10.0)), math.radians(20.0), (20.0, 40.0, 60.0, 80.0, 100.0, 130.0))
"""What the table may be asked for: mean rates (rad/s), acceleration (rad/s^2) and dwells (s), as of `sdimu plan`."""


def open(  # noqa: A001 (as every library of files has it)
    bag: str | Path | Mapping[str, Any] | pd.DataFrame,
    site: str | None = None,
    imu: str | ImuSpecification | None = None,
    source: Source | None = None,
    handheld: bool | None = None,
    measured_noise: bool = False,
    whole_turns: str | None = None,
    exclude_stops: Sequence[int] = (),
    exclude_times: Sequence[tuple[float, float]] = (),
    rests: Sequence[tuple[float, float]] = (),
) -> PreparedTest:
    """Open a recording: read, brought to SI and one clock, with its site and the IMU's file.

    Parameters
    ----------
    bag : str, Path, mapping of str to array, or DataFrame
        rosbag2 folder, .mcap or .db3 file, ROS 1 .bag; or the samples: ``t`` (s) or ``ns`` (integers), shape (n,), end
        of the interval of each; ``gyro`` (rad/s) and ``accel`` (m/s^2), shape (n, 3), or their columns ``gyro_x`` ...
        ``accel_z``, means over the interval; optional ``temperature`` (deg C), ``dwell`` (true at rest) and ``stop``
        (integers), shape (n,). Other units: `source`.
    site : str, optional
        Name in config/site or path; left out it is assumed, and a note says so; refused where the latitude in the
        data excludes it. A handheld run needs none.
    imu : str or ImuSpecification, optional
        Name in config/imu, path, or the specification itself; left out a class is proposed from the rests, and a note
        says which.
    source : Source, optional
        Topics, units and senses, where they are not to be recognised.
    handheld : bool, optional
        Moved by hand; None decides by the turns and the noise of the gyros.
    measured_noise : bool
        White noise from the rests of the recording, not from `imu`.
    whole_turns : str, optional
        By hand: turns of about 360 deg about the vertical are whole ones to this, such as ``1 deg``.
    exclude_stops : sequence of int
        Stops that no fit sees.
    exclude_times : sequence of (float, float)
        Spans of time (s) in which no fit takes a measurement.
    rests : sequence of (float, float)
        By hand: begin and end (s after the first sample) of every rest; without any they are found.
    """
    if imu is not None and not isinstance(imu, str):
        _expect("open", "imu", imu, ImuSpecification, "a name in config/imu, a path, or a specification")
    opening = Opening(
        site=site,
        imu=load_imu(imu) if isinstance(imu, str) else imu,
        source=source or Source(),
        handheld=handheld,
        measured_noise=measured_noise,
        whole_turns=0.0 if whole_turns is None else parse_quantity(whole_turns, "deg"),
        exclude_stops=tuple(exclude_stops),
        exclude_times=tuple(exclude_times),
        rests=tuple(rests),
        imu_file=imu if isinstance(imu, str) else None,
    )
    if isinstance(bag, str | Path):
        return opening.test(Path(bag))
    # A data frame is no mapping, but has its columns by name as one has.
    return opening.test_of(raw_test(cast("Mapping[str, Any]", bag)))


def open_set(
    bags: str | Path | Sequence[str | Path],
    site: str | None = None,
    imu: str | None = None,
    source: Source | None = None,
    serial: str | None = None,
    reference_temperature: str | None = None,
    workers: int = 1,
    keep: str | Path | None = None,
) -> OpenedSet:
    """Open several recordings of one unit, to be calibrated and diagnosed together.

    Parameters
    ----------
    bags : sequence of str or Path, or str or Path
        Bags; or one set file (`sdimu set init`).
    site, imu : str, optional
        As for `open`, for all recordings; what a set file says of one comes first.
    source : Source, optional
        Topics, units and senses of all recordings.
    serial : str, optional
        Of the unit, in place of what the bags say.
    reference_temperature : str, optional
        From which temperature effects count, such as ``25 degC``.
    workers : int
        Processes that read recordings: a script that asks for more than one needs ``if __name__ == "__main__"``.
    keep : str or Path, optional
        Folder in which what each recording says is kept: a tenth recording then costs one.
    """
    reference = None if reference_temperature is None else parse_quantity(reference_temperature, "degC")
    like = BagSource(Path(), site, imu, source or Source(), reference_degc=reference)
    wanted = load_set(Path(bags), like) if isinstance(bags, str | Path) else set_of([Path(bag) for bag in bags], like)
    if not wanted.members:
        raise DataError("open_set(bags=...): no bag is named; name the recordings of one unit")
    if serial is not None:
        wanted = replace(wanted, members=tuple(replace(m, serial=serial) for m in wanted.members))
    return OpenedSet(wanted, workers, None if keep is None else Path(keep))


def _expect(function: str, argument: str, value: object, kind: type, meant: str) -> None:
    if not isinstance(value, kind):
        raise DataError(f"{function}({argument}=...): expected {meant}, not {value!r:.60}")


def _listed(texts: str | Sequence[str]) -> list[str]:
    """Take one text for a list of it."""
    return [texts] if isinstance(texts, str) else list(texts)


@overload
def calibrate(
    test: PreparedTest,
    model: str | None = ...,
    add: Sequence[str] = ...,
    estimator: str = ...,
    progress: Progress = ...,
) -> CalibrationFit: ...
@overload
def calibrate(
    test: OpenedSet, model: str | None = ..., add: Sequence[str] = ..., estimator: str = ..., progress: Progress = ...
) -> JointFit: ...
def calibrate(
    test: PreparedTest | OpenedSet,
    model: str | None = None,
    add: Sequence[str] = (),
    estimator: str = AUTO,
    progress: Progress = silent,
) -> CalibrationFit | JointFit:
    """Fit a model to a test, or to a set of recordings together.

    Parameters
    ----------
    test : PreparedTest or OpenedSet
        What `open` or `open_set` returns.
    model : str, optional
        Name in config/model or path; ``baseline``, or ``hand`` (also ``handheld``) for a handheld run.
    add : sequence of str
        Effects to add, as for `sdimu calibrate --add`.
    estimator : str
        ``auto``, ``filter``, ``handheld`` (or ``hand``) or ``batch``.
    progress : callable
        Called with a word and the fraction done.
    """
    wanted = named_estimator(estimator)
    if isinstance(test, OpenedSet):
        return test.fit(set_options(test.core, model, _listed(add), wanted), progress)
    _expect("calibrate", "test", test, PreparedTest, "what open(...) or open_set(...) returns")
    chosen = named_model(model, _listed(add), by_hand(test, wanted))
    return CalibrationFit(solve(test, chosen, wanted, progress=progress))


@overload
def diagnose(
    fit: CalibrationFit, attempt: Sequence[str] = ..., refits: bool = ..., progress: Progress = ...
) -> FitDiagnosis: ...
@overload
def diagnose(
    fit: JointFit, attempt: Sequence[str] = ..., refits: bool = ..., progress: Progress = ...
) -> JointDiagnosis: ...
def diagnose(
    fit: CalibrationFit | JointFit, attempt: Sequence[str] = (), refits: bool = False, progress: Progress = silent
) -> FitDiagnosis | JointDiagnosis:
    """Find what the model of a fit is missing.

    Parameters
    ----------
    attempt : sequence of str
        Effects of your own that are tried with the catalogue, as for `sdimu diagnose --try`.
    refits : bool
        Also fit with one found effect more at a time.
    progress : callable
        Called with a word and the fraction done.
    """
    extra = [effect for text in _listed(attempt) for effect in find_effects(text)]
    if isinstance(fit, JointFit):
        if refits:
            raise DataError("diagnose(refits=True): is of one recording: leave it out for a set")
        return fit.of.diagnose(fit, extra, progress)
    _expect("diagnose", "fit", fit, CalibrationFit, "what calibrate(...) returns")
    return FitDiagnosis(climb(fit.core, extra, progress, refits=refits), fit.core)


def compare(*fits: CalibrationFit) -> Comparison:
    """Compare models fitted to one recording, the simplest first."""
    for fit in fits:
        _expect("compare", "fit", fit, CalibrationFit, "what calibrate(...) returns")
    return Comparison(fits)


def predict(
    plan: str | Path | Plan = "kim18",
    imu: str | Path | ImuSpecification = "dtg",
    site: str | Path | Site = "daejeon",
    model: str = "baseline",
) -> Prediction:
    """Simulate the covariance of a test before it is run.

    Parameters
    ----------
    plan, imu, site
        Name in config, path, or the object itself.
    model : str
        As for `sdimu predict`.
    """
    driven = plan_given("predict(plan=...)", plan)
    at, sensors = site_given("predict(site=...)", site), imu_given("predict(imu=...)", imu)
    return predict_test(driven, at, sensors, named_model(model, []), bound=bound_covariance)


def plan(
    start: str | Path | Plan = "kim18",
    imu: str | Path | ImuSpecification | None = None,
    site: str | Path | Site | None = None,
    model: str = "baseline",
    add: Sequence[str] = (),
    minutes: float | None = None,
    slack: float = 1.2,
    tries: int = 150,
    progress: Progress = silent,
    after: Standing | None = None,
) -> Found:
    """Search for a shorter or more telling plan with the bound of the data.

    Parameters
    ----------
    start : str, Path or Plan
        Plan to begin with: name in config/plan, path, or the plan itself.
    imu, site : optional
        Name in config, path, or the object itself; left out: those of `after`, else ``dtg`` and ``daejeon``. An IMU
        that was opened as a specification of your own has no file that `after` could name: give it again.
    model, add
        As for `sdimu plan`.
    minutes : float, optional
        Time there is: the best sigmas in it. Without: the shortest plan.
    slack : float
        Factor on the sigmas of `start` that are the limits.
    tries : int
        Plans that are evaluated at most.
    progress : callable
        Called with a word and the fraction done.
    after : Standing, optional
        What is known already (`known` of a diagnosis): the plan that tells most beyond it, in the time of `start`
        where `minutes` are left out.
    """
    first = plan_given("plan(start=...)", start)
    if after is not None:
        _expect("plan", "after", after, Standing, "what `known` of a diagnosis is")
    stated = (imu or (after and after.imu) or "dtg", site or (after and after.site) or "daejeon")
    sensors, at = imu_given("plan(imu=...)", stated[0]), site_given("plan(site=...)", stated[1])
    if after is not None:
        wanted = named_model(model, [*after.added, *_listed(add)])
        asked = Question(at, sensors, wanted, after.known)
        goal = Goal({}, first.duration_s / 60.0 if minutes is None else minutes)
        return search(first, asked, _ABLE, goal, tries, progress)
    asked = Question(at, sensors, named_model(model, _listed(add)))
    limits = {effect: slack * sigma for effect, sigma in bounds(first, asked).largest().items()}
    return search(first, asked, _ABLE, Goal(limits, minutes), tries, progress)


def simulate(out: str | Path, **options: Any) -> Path:
    """Simulate a test into a bag; options as of `sdimu simulate` (plan, imu, site, seed, effect, ...).

    Returns
    -------
    Path
        The bag; the truth lies beside it.
    """
    points = {point.name: point for point in entry_points(group="sdimu_calibration.verbs")}
    if "simulate" not in points:
        raise DataError("simulate: the package sdimu_sim is not installed")
    several = {key: _listed(options[key]) for key in ("effect", "noise") if options.get(key) is not None}
    points["simulate"].load()(out=Path(out), **options | several)
    return Path(out)
