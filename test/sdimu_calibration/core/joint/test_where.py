"""Where a set fails: what each sensor has left in each stop, with the model as given and with what was found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from sdimu_calibration.core.estimation.solve import with_effects
from sdimu_calibration.core.joint.leftovers import leftovers
from sdimu_calibration.core.joint.set_fit import SetOptions, fit_set
from sdimu_calibration.storage.files.config import load_model

from .conftest import here, short, unit_set

OPTIONS = SetOptions(load_model("baseline"))
PLANS = [short("recommended"), short("kim18_signed")]


def deviates(found):
    """Deviates by recording, stop and channel: with the model as given, and with what was found."""
    return np.array([(one.before, one.after) for one in found.where]).T


def test_deviates_of_a_right_model_are_standard_normal():
    fit = fit_set(unit_set(71, PLANS).members, OPTIONS, here)
    found = leftovers(fit, here, fit.names)
    before, after = deviates(found)
    np.testing.assert_allclose(before, after, rtol=1e-6, atol=1e-6)
    # The coefficients take some of their freedom: fewer squares than cells, never more than chance gives.
    seen = after[np.isfinite(after)]
    assert chi2.ppf(1e-3, len(seen) - len(fit.names)) < seen @ seen < chi2.ppf(1.0 - 1e-3, len(seen))
    stops = [(r.name, stop) for r in fit.reports for stop, _, _ in r.times.stops]
    assert [(one.recording, one.stop) for one in found.where[::6]] == stops


@pytest.fixture(scope="module")
def quadratic():
    return unit_set(72, PLANS, ("accel_quadratic_z=60 ug/g^2",)).members


def test_the_model_as_given_is_shown_beside_what_was_found(quadratic):
    """Without another fit: from the rows about that with the effect, its coefficient left out."""
    given = fit_set(quadratic, OPTIONS, here)
    model = with_effects(OPTIONS.model, ["accel_quadratic_z"])
    found = leftovers(fit_set(quadratic, replace(OPTIONS, model=model), here), here, given.names)
    before, after = deviates(found)
    worst = found.where[int(np.nanargmax(np.abs(before)))]
    assert worst.channel.startswith("accel")
    assert abs(worst.before) > 4.0
    assert np.nanmean(before**2) > 1.5 * np.nanmean(after**2)
    assert np.nanmean(after**2) < chi2.ppf(1.0 - 1e-3, len(after)) / len(after)


def test_a_coefficient_of_one_recording_is_that_of_all_in_the_model_as_given():
    members = unit_set(73, PLANS, shift={1: {"gyro_scale_x": 2e-5}}).members
    given = fit_set(members, OPTIONS, here)
    found = fit_set(members, replace(OPTIONS, local={"r1": ("gyro_scale_x",)}), here)
    before, after = deviates(leftovers(found, here, given.names))
    _, fitted = deviates(leftovers(given, here, given.names))
    # The fit as given weighs some turns in a noise of its own: less than the noise of a cell.
    assert np.nanmax(np.abs(before - fitted)) < 1.0
    assert np.nanmax(np.abs(before)) > 4.0
    assert np.nanmean(after**2) < chi2.ppf(1.0 - 1e-3, len(after)) / len(after)
    # Without a value of its own the recording has that of all; with none at all it would fail elsewhere.
    none, _ = deviates(leftovers(found, here, [n for n in given.names if n != "gyro_scale_x"]))
    assert np.nanmax(np.abs(none - fitted)) > 5.0
