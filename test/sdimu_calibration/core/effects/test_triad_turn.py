"""A turn of the accelerometer triad has the sign of the misalignments that it makes."""

from __future__ import annotations

import numpy as np

from sdimu_calibration.core.effects import registry


def columns(effect, seen):
    """Change of the three accelerometers by each parameter, shape (parameters, n, 3)."""
    out = np.zeros((len(effect.parameters), len(seen.t), 3))
    for values, term in zip(effect.regressors(seen).T, effect.terms, strict=True):
        out[term.parameter, :, term.channel - 3] += values
    return out


def test_a_turn_about_an_axis_is_two_misalignments_of_one_sign(bench):
    seen = bench.fit().known.seen
    turn, single = registry.get("accel_triad_ramp"), registry.get("accel_misalignment")
    names = [p.name[-2:] for p in single.parameters]
    by_pair = dict(zip(names, columns(single, seen), strict=True))
    middle = (seen.t - 0.5 * seen.dt)[:, None]
    for got, axis, (first, second) in zip(columns(turn, seen), "xyz", ("yz", "zx", "xy"), strict=True):
        expected = by_pair[first + axis] + by_pair[second + axis]
        np.testing.assert_allclose(got, middle * expected, atol=1e-9)
