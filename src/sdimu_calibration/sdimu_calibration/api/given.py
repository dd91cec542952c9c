"""What users give as plan, IMU or site: a name, a path, or the object itself."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from sdimu_calibration.core.plan import Plan
from sdimu_calibration.core.recording import DataError
from sdimu_calibration.core.specification import ImuSpecification, Site
from sdimu_calibration.storage.files.config import load_imu, load_plan, load_site

_T = TypeVar("_T")


def plan_given(where: str, plan: str | Path | Plan) -> Plan:
    """Return the plan that is meant.

    Parameters
    ----------
    where : str
        Function and argument, for the message: ``turns(plan=...)``.
    plan : str, Path or Plan
        Name in config/plan, path, or the plan itself.

    Raises
    ------
    DataError
        Where it is none of them, or no such file is there.
    """
    return _given(where, plan, Plan, load_plan, "a name in config/plan, a path, or a plan")


def imu_given(where: str, imu: str | Path | ImuSpecification) -> ImuSpecification:
    """Return the specification that is meant; `where` and errors as of `plan_given`.

    Parameters
    ----------
    imu : str, Path or ImuSpecification
        Name in config/imu, path, or the specification itself.
    """
    return _given(where, imu, ImuSpecification, load_imu, "a name in config/imu, a path, or a specification")


def site_given(where: str, site: str | Path | Site) -> Site:
    """Return the site that is meant; `where` and errors as of `plan_given`.

    Parameters
    ----------
    site : str, Path or Site
        Name in config/site, path, or the site itself.
    """
    return _given(where, site, Site, load_site, "a name in config/site, a path, or a site")


def _given(where: str, given: object, kind: type[_T], load: Callable[[str | Path], _T], meant: str) -> _T:
    if isinstance(given, str | Path):
        return load(given)
    if not isinstance(given, kind):
        raise DataError(f"{where}: expected {meant}, not {given!r:.60}")
    return given
