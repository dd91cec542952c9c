"""The study of benches that are not ideal: what is disturbed is what its name says."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.recording import Recording
from sdimu_calibration.core.specification import Site
from sdimu_calibration.core.units import to_si
from sdimu_study.disturbed import STUDY, shaken, told_wrong

SITE = Site(np.radians(40.0), 0.0)


def test_a_site_is_told_wrong_by_its_sigma():
    north = told_wrong(SITE, -0.5, 0.0)
    assert np.degrees(north.latitude_rad) == pytest.approx(39.5)
    assert np.degrees(north.latitude_sigma_rad) == pytest.approx(0.5)
    heavy = told_wrong(SITE, 0.0, 100.0)
    assert heavy.gravity_m_s2 == pytest.approx(9.80169 + 1e-3, abs=1e-4)
    assert heavy.gravity_sigma_m_s2 == pytest.approx(to_si(100.0, "mgal"))
    assert heavy.latitude_rad == SITE.latitude_rad


def test_a_table_that_vibrates_swings_by_its_amplitude_and_tilts_gravity():
    t = np.arange(1, 1001) * 0.01
    still = Recording(0, t, np.zeros((1000, 3)), np.tile([0.0, 0.0, -9.8], (1000, 1)))
    moved = shaken(still, 2.0, 17.0, np.array([1.0, 0.0, 0.0]))
    angle = np.cumsum(moved.omega_ib_b[:, 0]) * 0.01
    assert np.abs(angle).max() == pytest.approx(to_si(2.0, "arcsec"), rel=0.01)
    np.testing.assert_array_equal(moved.omega_ib_b[:, 1:], 0.0)
    # The mean over a sample of 10 ms holds .95 of a swing at 17 Hz.
    assert np.abs(moved.f_ib_b[:, 1]).max() == pytest.approx(9.8 * 0.95 * to_si(2.0, "arcsec"), rel=0.02)


def test_an_effect_beside_a_wrong_latitude_is_named_with_honest_coefficients():
    row = STUDY.of(("latitude .5 deg, an effect",))(114_001)
    assert row["in_class"]
    # Some thirty errors over sigma: their root scatters by an eighth about one.
    assert (row["z2"] / row["count"]) ** 0.5 < 1.6
