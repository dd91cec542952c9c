"""An unknown function of the attitude that the recordings of a set share leaves the sigmas of the joint fit right."""

from __future__ import annotations

import numpy as np
import pytest

from sdimu_calibration.core.advice import Kind
from sdimu_calibration.core.effects import body_frame
from sdimu_calibration.core.joint.function_fit import with_function
from sdimu_calibration.core.joint.set_diagnosis import diagnose_set
from sdimu_calibration.core.joint.set_fit import SetFit, fit_set
from sdimu_calibration.core.joint.set_result import set_outcome
from sdimu_calibration.core.plan import backwards
from sdimu_calibration.core.results import Calibration
from sdimu_calibration.core.units import to_si
from sdimu_calibration.core.verdict import Verdict
from sdimu_sim.core.truth import in_body_frame

from .conftest import here, short, unit_set

FORTH = short("recommended", stops=28)
HIDDEN = "accel_x: sin(2.1 fx/g - 2.24 fy/g + 5.5 fz/g)=40 ug"
SEED = 6


@pytest.fixture(scope="module")
def unit():
    """A unit with a wave of the attitude in accelerometer x, recorded forth and back."""
    return unit_set(SEED, [FORTH, backwards(FORTH)], (HIDDEN,))


@pytest.fixture(scope="module")
def as_given(unit, options) -> SetFit:
    return fit_set(unit.members, options, here)


def z_of(fit: SetFit, unit) -> np.ndarray:
    """Errors over sigma of all coefficients but the biases, which differ from power-on to power-on."""
    return z_of_result(set_outcome(fit), unit)


def z_of_result(told: Calibration, unit) -> np.ndarray:
    truth = in_body_frame(unit.truth, told.body_frame)
    sigma = np.sqrt(np.diag(told.covariance))
    free = [
        k
        for k, name in enumerate(told.names)
        if name in truth and "bias" not in name and name not in body_frame.pinned_names(told.body_frame)
    ]
    return np.array([(told.values[k] - truth[told.names[k]]) / sigma[k] for k in free])


def test_coefficients_are_as_good_as_their_sigmas_say(unit, as_given):
    z = z_of(with_function(as_given, ("accel_x",), here), unit)
    assert np.sqrt(np.mean(z**2)) < 1.3
    assert np.abs(z).max() < 4.0
    # Without the function coefficients are off by many sigmas: what is tested is there.
    assert np.abs(z_of(as_given, unit)).max() > 4.0


def test_it_changes_next_to_nothing_where_nothing_is_left(options):
    clean = fit_set(unit_set(SEED, [FORTH, backwards(FORTH)]).members, options, here)
    beside = with_function(clean, ("accel_x",), here)
    sigma = np.sqrt(np.diag(clean.estimate.covariance))
    p = len(clean.names)
    assert beside.names[:p] == clean.names
    np.testing.assert_array_less(np.abs(beside.estimate.values[:p] - clean.estimate.values), sigma)
    # It may be as large as the noise hides: in the coefficients of that accelerometer, and in the misalignments about y
    # and z, as its axis says where these axes of the frame are.
    of_it = [name.startswith("accel") and "x" in name.rpartition("_")[2] for name in clean.names]
    about = ["misalignment" in name and name[-1] in "yz" for name in clean.names]
    others = ~(np.array(of_it) | np.array(about))
    grown = np.sqrt(np.diag(beside.estimate.covariance)[:p]) / sigma
    np.testing.assert_array_less(grown[others], 1.1)
    np.testing.assert_array_less(grown, 2.0)


def test_a_diagnosis_tells_nothing_that_imitates_it_where_two_plans_share_few_attitudes(options):
    """With noise that each recording learned by itself three false effects were certain, and scales 12 sigma off."""
    wave = unit_set(41, [short("kim18_signed"), short("recommended")], ("accel_x: sin(7 fx/g + 4 fy/g)=40 ug",))
    found = diagnose_set(wave.members, options, here)
    assert found.recurrence is not None
    assert found.verdict == Verdict.UNEXPLAINED
    assert found.findings == ()
    check_drawn(found)
    # The search knew the function: what it says of effects holds beside it.
    assert found.function > 0.95
    assert found.probabilities is not None
    assert found.probabilities.nothing > 0.5
    assert found.advice[0].kind == Kind.TRY_FORCE_EQUATION
    assert any(
        note.startswith("estimated beside an unknown function of the attitude in accel_x") for note in found.after.notes
    )
    z = z_of_result(found.after, wave)
    assert np.sqrt(np.mean(z**2)) < 1.3
    check_standing(found, "gyro_scale")


def check_standing(found, begin):
    """What a plan for the next recording begins with knows no more than the result of coefficients with this begin."""
    known = found.standing.known
    place = {name: k for k, name in enumerate(known.names)}
    alone = np.linalg.inv(known.J + np.diag(1.0 / known.prior**2))
    of_unit = [k for k, name in enumerate(found.after.names) if name.startswith(begin)]
    told = np.sqrt(np.diag(found.after.covariance))[of_unit]
    again = np.sqrt(np.diag(alone))[[place[found.after.names[k]] for k in of_unit]]
    np.testing.assert_allclose(again, told, rtol=0.05)


def check_drawn(found):
    """The function at the stops is the hidden wave without what is constant or linear, within its band."""
    one = next(one for one in found.unknown if one.triad == "accel")
    assert 0 in one.axes
    wave = to_si(40.0, "ug") * np.sin(one.variable @ [7.0, 4.0, 0.0])
    columns = np.column_stack([np.ones(len(wave)), one.variable])
    hidden = wave - columns @ np.linalg.lstsq(columns, wave, rcond=None)[0]
    assert np.corrcoef(one.mean[:, 0], hidden)[0, 1] > 0.9
    z = (one.mean[:, 0] - hidden) / one.sigma[:, 0]
    # Some twenty attitudes: the root scatters by .16 about one.
    assert np.sqrt(np.mean(z**2)) < 1.6
    assert one.sigma[:, 0].max() < 0.5 * to_si(40.0, "ug")


def test_recordings_with_functions_of_their_own_share_none(options):
    """Two waves in one sensor, one a recording, were told as one function, with steps and changes that were certain."""
    other = "accel_x: sin(-6 fx/g + 5 fz/g + 1)=40 ug"
    plans = [FORTH, backwards(FORTH)]
    first, second = (unit_set(311, plans, (hidden,)) for hidden in ("accel_x: sin(7 fx/g + 4 fy/g)=40 ug", other))
    found = diagnose_set((first.members[0], second.members[1]), options, here)
    assert found.verdict == Verdict.UNEXPLAINED
    assert found.findings == ()
    assert found.function is not None
    assert found.function < 0.5
    assert found.unknown == ()
    # Which of them has it is told, and what the coefficients are beside it.
    assert {one.recording for one in found.functions if one.probability > 0.9} == {"r0", "r1"}
    z = z_of_result(found.after, first)
    assert np.sqrt(np.mean(z**2)) < 1.3
    # The scale factor of that sensor is as open as a function of 40 ug leaves it: beside a common one that both must
    # share it had a sigma of 139 ppm.
    place = found.after.names.index("accel_scale_x")
    assert np.sqrt(found.after.covariance[place, place]) < 40e-6
    check_standing(found, "accel_scale_x")
