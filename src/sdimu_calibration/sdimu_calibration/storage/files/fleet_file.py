"""A study of a fleet as fleet.json (format ``sdimu-fleet/1``, SI), and its priors as an IMU file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from sdimu_calibration.core.effect_key import effect_of
from sdimu_calibration.core.fleet.population import Coefficient
from sdimu_calibration.core.fleet.priors import population_priors
from sdimu_calibration.core.fleet.reml import RandomEffect
from sdimu_calibration.core.fleet.study import Study
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.units import from_si
from sdimu_calibration.storage.files.config import find_config
from sdimu_calibration.storage.files.fleet_folder import Gathered
from sdimu_calibration.storage.files.imu_text import imu_text
from sdimu_calibration.storage.files.json_file import entry, write_json
from sdimu_calibration.storage.files.result_file import ORIGIN
from sdimu_calibration.storage.files.whole_file import same_file, write_whole

FORMAT = "sdimu-fleet/1"


def write_fleet(path: Path, gathered: Gathered, done: Study) -> None:
    """Write fleet.json. `done`: what they say together."""
    first = gathered.entries[0].result
    shown = dict(zip(first.names, zip(first.units, first.display_units, strict=True), strict=True))
    both = zip(done.people.coefficients, done.inside.coefficients, strict=True)
    content = {
        "format": FORMAT,
        "imu": first.origin.imu,
        **entry(first, "model body_frame"),
        "results": [entry(e, "name unit", origin=ORIGIN.plain(e.result.origin)) for e in gathered.entries],
        "apart": gathered.apart,
        "units": done.people.units,
        "coefficients": [_coefficient(one, inside.control_limits, *shown[one.name]) for one, inside in both],
        "out": list(map(asdict, done.people.out)),
        "trends": [asdict(one) | {"per": "year", "unit": shown[one.coefficient][0]} for one in done.slopes],
        "common_effects": list(map(asdict, done.common)),
    }
    write_json(path, content)


def _coefficient(one: Coefficient, limits: tuple[float, float], unit: str, display_unit: str) -> dict[str, Any]:
    """Give a coefficient over units as plain data (SI), with intervals at 95 %; `within` if a unit has two results."""
    low, high = one.between.mean_interval
    return {
        **entry(one, "name", unit=unit, display_unit=display_unit),
        **entry(one.between, "mean", mean_low=low, mean_high=high),
        **_spread("spread", one.between),
        **({} if one.within is None else _spread("within", one.within)),
        **entry(one.between, "q dof p_value", control_low=limits[0], control_high=limits[1]),
        **entry(one, "values sigmas deviates"),
    }


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
    remarks = (
        f"Priors of {len(done.inside.units)} units (sdimu fleet): root mean square of mean, spread and error of the",
        f"mean, over the coefficients of an effect. Grade, noise and all others are those of '{base}'.",
    )
    write_whole(path, imu_text(source, path.stem, remarks, priors=priors))
    return priors
