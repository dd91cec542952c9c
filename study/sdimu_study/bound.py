"""The least sigma that any unbiased estimator could reach on the tests of a campaign."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from sdimu_calibration.core.batch.batch import bound_covariance
from sdimu_calibration.core.planning.predict import predict
from sdimu_sim.core.scenario import imu_truth
from sdimu_study.run import CalibrationRun

MOUNTS = 8
"""Mounts that stand for all: the bound moves by a few per cent between 0 and 3 deg."""


def plan_bound(work: CalibrationRun, seeds: Iterable[int]) -> dict[str, float]:
    """Bound of the plan by covariance of the batch estimator, without data.

    Parameters
    ----------
    work : CalibrationRun
    seeds : iterable of int
        Of the campaign; the first `MOUNTS` of them give mounts, over which the variance is averaged.

    Returns
    -------
    dict of str to float
        Sigma (SI) by coefficient name, in the reported body frame.

    Raises
    ------
    DataError
        When plan, IMU and model do not fit together.
    """
    scenario = work.scenario
    variances = []
    names: tuple[str, ...] = ()
    for _, seed in zip(range(1 if scenario.mount_rad is not None else MOUNTS), seeds, strict=False):
        mount = np.asarray(imu_truth(replace(scenario, seed=seed)).mount_rad)
        found = predict(scenario.plan, scenario.site, scenario.imu, work.model, mount_rad=mount, bound=bound_covariance)
        names = found.names
        variances.append(found.bound**2)
    return dict(zip(names, np.sqrt(np.mean(variances, axis=0)).tolist(), strict=True))
