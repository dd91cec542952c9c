"""The overlapping Allan deviation is that of an independent package."""

from __future__ import annotations

import allantools
import numpy as np
import pytest

from sdimu_calibration.core.noise.allan import allan, factors, overlapping


@pytest.mark.parametrize("length", [3, 4, 10, 1_001, 12_345])
def test_the_deviation_of_a_stretch_is_that_of_allantools(length):
    rng = np.random.default_rng(length)
    samples = 9.8 + 1e-3 * rng.standard_normal(length) + 1e-5 * np.cumsum(rng.standard_normal(length))
    m = factors(length)[2 * factors(length) < length]
    tau, expected, _, _ = allantools.oadev(samples, rate=1.0, data_type="freq", taus=m.astype(np.float64))
    assert tau.tolist() == m.tolist()
    np.testing.assert_allclose(overlapping(samples, m), expected, rtol=1e-12)


def test_stretches_are_pooled_by_their_number_of_differences():
    rng = np.random.default_rng(6)
    stretches = [rng.standard_normal(n) for n in (2, 400, 3_000, 7_001)]
    found = allan(stretches, 0.05)
    for tau, deviation in zip(found.tau, found.deviation, strict=True):
        m = round(tau / 0.05)
        squares = differences = 0.0
        for samples in stretches:
            if 2 * m < len(samples):
                _, (own,), _, (count,) = allantools.oadev(samples, rate=1.0, data_type="freq", taus=[float(m)])
                squares, differences = squares + count * own**2, differences + count
        assert deviation == pytest.approx(np.sqrt(squares / differences), rel=1e-12)
