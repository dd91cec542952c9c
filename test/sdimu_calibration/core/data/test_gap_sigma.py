"""What a missing sample leaves uncertain covers what it really changes, in the corners of a turn as in its middle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sdimu_calibration.core.alignment.prepared import reduce, set_up
from sdimu_calibration.storage.files.config import load_imu, load_model, load_plan, load_site
from sdimu_sim.core.scenario import Scenario, generate

EVERY = 60
"""Samples between two gaps: at most one in an epoch of a second at 20 Hz."""


@pytest.fixture(scope="module", params=["recommended", "kim18"])
def whole(request):
    imu, site = load_imu("dtg"), load_site("daejeon")
    quiet = replace(imu, gyro_white_noise=0.01 * imu.gyro_white_noise, accel_white_noise=0.01 * imu.accel_white_noise)
    recording = generate(Scenario(load_plan(request.param), quiet, site, seed=3, rate_hz=20.0))[0]
    setup = set_up(site, imu, load_model("baseline"))
    return recording, setup, reduce(recording, setup)


@pytest.mark.parametrize("lost", [1, 2])
def test_the_angle_lost_in_a_gap_is_within_its_sigma(whole, lost):
    recording, setup, reference = whole
    true = np.cumsum(reference.cycles.alpha, axis=0)
    z = []
    for first in range(100, 100 + EVERY, 7):
        keep = np.ones(len(recording.t), dtype=bool)
        for j in range(lost):
            keep[np.arange(first + j, len(keep) - 100, EVERY)] = False
        torn = replace(
            recording, t=recording.t[keep], omega_ib_b=recording.omega_ib_b[keep], f_ib_b=recording.f_ib_b[keep]
        )
        found = reduce(torn, setup)
        angle = np.cumsum(found.cycles.alpha, axis=0)
        ends = np.intersect1d(np.round(reference.cycles.t, 6), np.round(found.cycles.t, 6), return_indices=True)
        wrong = np.diff(true[ends[1]] - angle[ends[2]], axis=0)
        epoch = np.searchsorted(found.epochs.end, ends[0][1:] - 1e-6)
        inside = epoch < len(found.epochs)
        total = np.zeros((len(found.epochs), 3))
        np.add.at(total, epoch[inside], wrong[inside])
        sigma = found.bridges.angle
        z.append(np.sqrt(np.sum(total[sigma > 0.0] ** 2, axis=1)) / sigma[sigma > 0.0])
    z = np.concatenate(z)
    assert len(z) > 500
    # A bound over the root of three: nothing beyond it but by the noise, and most is far inside.
    assert z.max() < 3.0
    assert np.sqrt(np.mean(z**2)) < 1.0
