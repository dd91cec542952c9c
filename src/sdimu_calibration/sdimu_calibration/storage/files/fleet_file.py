"""A study of a fleet as fleet.json (format ``sdimu-fleet/1``, SI), and its priors as an IMU file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
import yaml

from sdimu_calibration.core.effect_key import effect_of
from sdimu_calibration.core.fleet.common import CommonEffect
from sdimu_calibration.core.fleet.population import Coefficient, Out
from sdimu_calibration.core.fleet.priors import population_priors
from sdimu_calibration.core.fleet.reml import RandomEffect
from sdimu_calibration.core.fleet.study import Study
from sdimu_calibration.core.origin import Origin
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import from_si
from sdimu_calibration.storage.files.config import find_config, imu_mapping
from sdimu_calibration.storage.files.fleet_folder import Gathered
from sdimu_calibration.storage.files.json_file import entry
from sdimu_calibration.storage.files.result_file import PATHS
from sdimu_calibration.storage.files.result_model import Array, Entry, Line, Number, ResultModel, Said
from sdimu_calibration.storage.files.whole_file import same_file, write_whole

FORMAT: Final = "sdimu-fleet/1"


class FleetResult(ResultModel):
    """A result that the fleet is made of."""

    name: Line
    unit: Line
    origin: Annotated[Origin, Entry(seldom=PATHS)]


class FleetCoefficient(ResultModel):
    """A coefficient over units (SI), each number with its interval at 95 %; `within` where a unit has two results."""

    name: Line
    unit: Line
    display_unit: Line
    mean: Number
    mean_low: Number
    mean_high: Number
    spread: Number
    spread_low: Number
    spread_high: Number
    within: Number = np.nan
    within_low: Number = np.nan
    within_high: Number = np.nan
    q: Number
    dof: int
    p_value: Number
    control_low: Number
    control_high: Number
    values: Array
    sigmas: Array
    deviates: Array


class FleetTrend(ResultModel):
    """A `Trend`: its slope is in `unit` per `per`."""

    coefficient: Line
    kind: Line
    slope: Number
    slope_sigma: Number
    p_value: Number
    q_value: Number
    named: bool
    per: Literal["year"] = "year"
    unit: Line


class FleetFile(ResultModel):
    """fleet.json, in the order of its keys."""

    format: Literal["sdimu-fleet/1"] = FORMAT
    imu: Line
    model: tuple[Line, ...]
    body_frame: Line
    results: tuple[FleetResult, ...]
    apart: tuple[Said, ...]
    units: tuple[Line, ...]
    coefficients: tuple[FleetCoefficient, ...]
    out: tuple[Annotated[Out, Entry()], ...]
    trends: tuple[FleetTrend, ...]
    common_effects: tuple[Annotated[CommonEffect, Entry()], ...]


def write_fleet(path: Path, gathered: Gathered, done: Study) -> None:
    """Write fleet.json. `done`: what they say together."""
    first = gathered.entries[0].result
    shown = dict(zip(first.names, zip(first.units, first.display_units, strict=True), strict=True))
    FleetFile.model_construct(
        format=FORMAT,
        imu=first.origin.imu,
        **entry(first, "model body_frame"),
        results=tuple(
            FleetResult.model_construct(**entry(e, "name unit origin=result.origin")) for e in gathered.entries
        ),
        apart=gathered.apart,
        units=done.people.units,
        coefficients=tuple(
            _coefficient(one, inside.control_limits, *shown[one.name])
            for one, inside in zip(done.people.coefficients, done.inside.coefficients, strict=True)
        ),
        out=done.people.out,
        trends=tuple(
            FleetTrend.model_construct(**asdict(one), per="year", unit=shown[one.coefficient][0]) for one in done.slopes
        ),
        common_effects=done.common,
    ).write(path)


def _coefficient(one: Coefficient, limits: tuple[float, float], unit: str, display_unit: str) -> FleetCoefficient:
    low, high = one.between.mean_interval
    return FleetCoefficient.model_construct(
        unit=unit,
        display_unit=display_unit,
        mean_low=low,
        mean_high=high,
        **_spread("spread", one.between),
        **({} if one.within is None else _spread("within", one.within)),
        **entry(one.between, "mean q dof p_value", control_low=limits[0], control_high=limits[1]),
        **entry(one, "name values sigmas deviates"),
    )


def _spread(name: str, found: RandomEffect) -> dict[str, Any]:
    return {name: found.spread, f"{name}_low": found.low, f"{name}_high": found.high}


def write_priors(path: Path, base: str, gathered: Gathered, done: Study) -> Mapping[str, str]:
    """Write an IMU file with the priors of the population, without units that are out.

    `base`: IMU by name or path: grade, noise, and priors of effects that the population does not know. Gives the priors
    written, as in the file, by effect.
    """
    source = find_config("imu", base)
    if same_file(path, source):
        raise DataError(f"{path}: this is the IMU file that the priors are added to; name another file to write")
    first = gathered.entries[0].result
    of = {name: effect_of(name, first.model) for name in first.names}
    units = {of[name]: unit for name, unit in zip(first.names, first.display_units, strict=True)}
    sizes = population_priors(done.inside, of)
    priors = {effect: f"{from_si(size, units[effect]):.3g} {units[effect]}" for effect, size in sizes.items()}
    content = imu_mapping(source)
    content["name"] = path.stem
    content["prior"] = {**content.get("prior", {}), **priors}
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
    remark = (
        f"# Priors of {len(done.inside.units)} units (sdimu fleet): root mean square of mean, spread and error of the\n"
        f"# mean, over the coefficients of an effect. Grade, noise and all others are those of '{base}'.\n"
    )
    write_whole(path, remark + text)
    return priors
